"""The folder that holds a comparison."""

from __future__ import annotations

from pathlib import Path

from ifrfit.inference.comparison import Comparison
from ifrfit.report.atomic_folder import Contents, deliver
from ifrfit.report.style import save_svg_and_png

COMPARISON = Contents("compare.json", ("compare.svg", "compare.png"), "comparison")


def write_comparison(comparison: Comparison, out: Path, *, force: bool) -> list[str]:
    """Write compare.json, compare.svg and compare.png into a folder, whole or not at all.

    Raises
    ------
    UsageError
        If the folder holds an earlier comparison and `force` is not given, or nothing can be written there.
    """

    def fill(folder: Path) -> list[str]:
        comparison.save(folder / COMPARISON.record)
        return [COMPARISON.record, *save_svg_and_png(comparison.plot(), folder, "compare")]

    return deliver(fill, Path(out), COMPARISON, force=force)
