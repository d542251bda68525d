"""Write docs/hard-cases.md from the table that the tests run."""

from __future__ import annotations

import sys

from studies import DOCS, markdown, render

sys.path.insert(0, str(DOCS.parent / "tests"))

TITLES = {
    "rebound": "Rebound",
    "scenes": "Simulated scenes",
    "data refused": "Data refused or skipped",
    "identifiability": "What the data can say",
    "strangers": "Tables that contradict themselves or mislead",
    "slips": "Slips of the hand",
    "ordinary": "Ordinary tables that were too much",
    "numerics": "Numerics",
}


def page() -> str:
    """Return the page as text."""
    from hard_cases.case import GROUPS
    from hard_cases.cases import CASES

    groups = {
        TITLES[group]: markdown(
            ("case", "what is fed", "what comes out"),
            [(c.name, _cell(c.what), _cell(c.answer)) for c in CASES if c.group == group],
        )
        for group in GROUPS
    }
    return render("hard_cases.md", groups=groups)


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


if __name__ == "__main__":
    (DOCS / "hard-cases.md").write_text(page(), encoding="utf-8")
