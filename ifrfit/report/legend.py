"""The legend under the panels: series with their provenance, and what marks and shades mean."""

from __future__ import annotations

import math
import textwrap
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ifrfit.inference.result import FitResult
from ifrfit.report.panels import outlier_limit
from ifrfit.report.provenance import provenance_words
from ifrfit.report.shading import regime_key
from ifrfit.report.style import GREY, Look

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FONT_SIZE = 6.6
# inches: a character of that size, a line, and a handle with its gaps
CHARACTER, LINE, HANDLE = 0.049, 0.145, 0.4
LONGEST = 48


@dataclass(frozen=True)
class Legend:
    """Entries of a legend and the room they take.

    Attributes
    ----------
    entries : tuple
        Handle (or several side by side) and label.
    columns : int
    height : float
        Inches.
    """

    entries: tuple[tuple[Any, str], ...]
    columns: int
    height: float

    @classmethod
    def of(cls, result: FitResult, look: dict[str, Look], width: float) -> Legend:
        """Legend of a result in a figure `width` inches wide."""
        entries = (*_series(result, look), *_marks(result))
        longest = max(len(line) for _, label in entries for line in label.split("\n"))
        columns = max(1, min(len(entries), int(width / (CHARACTER * longest + HANDLE))))
        # the entries fill one column after the other; the tallest counts
        per_column = math.ceil(len(entries) / columns)
        tall = [label.count("\n") + 1 for _, label in entries]
        lines = max(sum(tall[i : i + per_column]) for i in range(0, len(tall), per_column))
        return cls(entries, columns, LINE * lines + 0.1)

    def draw(self, figure: Figure) -> None:
        """Draw it under everything else."""
        from matplotlib.legend_handler import HandlerTuple

        figure.legend(
            handles=[handle for handle, _ in self.entries],
            labels=[label for _, label in self.entries],
            handler_map={tuple: HandlerTuple(ndivide=None, pad=0)},
            loc="outside lower center",
            ncols=self.columns,
            fontsize=FONT_SIZE,
            handlelength=2.2,
            handletextpad=0.6,
            columnspacing=1.0,
            labelspacing=0.35,
            borderaxespad=0.2,
        )


def _series(result: FitResult, look: dict[str, Look]) -> list[tuple[Any, str]]:
    from matplotlib.lines import Line2D

    entries = []
    for name, own in look.items():
        kinds = result.points["provenance"][result.points["series"] == name].unique()
        provenance = provenance_words(tuple(str(kind) for kind in kinds))
        label = textwrap.fill(f"{name} ({provenance})", LONGEST)
        # a leading underscore would hide the entry, dollars would be read as mathematics
        label = (f" {label}" if label.startswith("_") else label).replace("$", r"\$")
        entries.append((Line2D([], [], color=own.colour, ls=own.line, marker=own.marker, ms=4.2), label))
    return entries


def _marks(result: FitResult) -> list[tuple[Any, str]]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    def mark(marker: str, size: float, face: str, edge: str = GREY) -> Line2D:
        return Line2D([], [], ls="none", marker=marker, ms=size, mfc=face, mec=edge)

    points = result.points
    angled = points["gamma_deg"].notna()
    sticking = points["sticking"].map(bool).astype(bool) & angled
    entries: list[tuple[Any, str]] = []
    if sticking.any():
        entries.append((mark("o", 4.2, "white"), "open: sticking"))
    if (~sticking & angled).any():
        entries.append((mark("o", 4.2, GREY), "filled: sliding"))
    light, dark = (Patch(fc=GREY, alpha=alpha, lw=0) for alpha in (0.16, 0.35))
    entries.append(((light, dark, light), "68, 95 % credible bands"))
    if any(isinstance(regime_key(result, str(name)), tuple) for name in points["series"][angled].unique()):
        shade = Patch(fc="0.5", alpha=0.3, lw=0)
        entries.append(((shade, mark("|", 8.0, GREY), shade), "transition, 95 % interval"))
    if (points["standardised"].abs() > outlier_limit(result)).any():
        entries.append((mark("o", 8.0, "none", "black"), "ringed: outlier"))
    return entries
