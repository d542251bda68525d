"""Write docs/statuses.md from the package's own table of rules."""

from __future__ import annotations

from studies import DOCS, markdown

from ifrfit.inference.diagnostics.thresholds import FACTS, STATUSES


def page() -> str:
    """The page's text."""
    written = "Written by `scripts/write_statuses.py` from the rules in the code."
    lines = ["# Statuses and facts", "", written, ""]
    for title, rules in (("status of a constant", STATUSES), ("fact of a fit", FACTS)):
        lines += [markdown((title, "rule"), [(f"`{name}`", rule) for name, rule in rules.items()]), ""]
    return "\n".join(lines)


if __name__ == "__main__":
    (DOCS / "statuses.md").write_text(page(), encoding="utf-8")
