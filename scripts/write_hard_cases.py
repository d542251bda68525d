"""Write docs/hard-cases.md from the table that the tests run; --check only compares."""

from __future__ import annotations

import argparse
import sys

from studies import DOCS, markdown, render

PAGE = DOCS / "hard-cases.md"
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


def main() -> int:
    """Write or compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="exit with 1 if the page is not up to date")
    check = parser.parse_args().check
    text = page()
    if not check:
        PAGE.write_text(text, encoding="utf-8")
        return 0
    if PAGE.is_file() and PAGE.read_text(encoding="utf-8") == text:
        return 0
    print(f"{PAGE} is not up to date: run python scripts/write_hard_cases.py", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())
