"""Fit the bundled datasets and draw them: ``python scripts/reproduce_paper.py [--out FOLDER]``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ifrfit.errors import IfrfitError
from ifrfit.report.reproduce import reproduce


def main() -> int:
    """Run `ifrfit reproduce`; returns the exit status."""
    parser = argparse.ArgumentParser(
        description="Fit the bundled datasets, draw them, print their constants."
    )
    parser.add_argument("--out", type=Path, default=Path("figures"), metavar="DIR", help="default: figures")
    out: Path = parser.parse_args().out
    try:
        print(reproduce(out, progress=sys.stderr.isatty()), end="")
    except IfrfitError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
