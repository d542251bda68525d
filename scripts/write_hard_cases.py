"""Write docs/hard-cases.md from the table that the tests run; --check only compares."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "hard-cases.md"
sys.path.insert(0, str(ROOT / "tests"))

HEAD = """# Hard cases

What ifrfit must answer where programs usually stumble. The tests run every row, with warnings as errors;
whatever is fitted is fitted by least squares, by profiles, by the exact posterior and by Markov chains, with
the same answers (tables that contradict themselves: by least squares and by the exact posterior).
This page is written by `python scripts/write_hard_cases.py` from the table in `tests/hard_cases/`.
"""
TITLES = {
    "rebound": "Rebound",
    "scenes": "Simulated scenes",
    "data refused": "Data refused or skipped",
    "identifiability": "What the data can say",
    "strangers": "Tables that contradict themselves or mislead",
    "numerics": "Numerics",
}


def page() -> str:
    """Return the page as text."""
    from hard_cases.case import GROUPS
    from hard_cases.cases import CASES

    parts = [HEAD]
    for group in GROUPS:
        parts.append(f"\n## {TITLES[group]}\n\n| case | what is fed | what comes out |\n|---|---|---|\n")
        parts += [f"| {c.name} | {_cell(c.what)} | {_cell(c.answer)} |\n" for c in CASES if c.group == group]
    return "".join(parts)


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def main() -> int:
    """Write or compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="exit with 1 if the page is not up to date")
    check = parser.parse_args().check
    text = page()
    if not check:
        PAGE.parent.mkdir(exist_ok=True)
        PAGE.write_text(text, encoding="utf-8")
        return 0
    if PAGE.is_file() and PAGE.read_text(encoding="utf-8") == text:
        return 0
    print(f"{PAGE} is not up to date: run python scripts/write_hard_cases.py", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())
