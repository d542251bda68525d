"""Redraw the paper's figures: the same as ``ifrfit reproduce``, with its options."""

from __future__ import annotations

import sys

from ifrfit.cli.main import app

if __name__ == "__main__":
    app(["reproduce", *sys.argv[1:]], prog_name="reproduce_paper.py")
