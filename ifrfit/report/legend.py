"""The legend under the panels: series with their provenance, and what marks and shades mean."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Any

from ifrfit.inference.estimators import LeastSquares, title_of
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.report.plot_elements import handle, is_outlier
from ifrfit.report.provenance import provenance_words
from ifrfit.report.regimes import does, regime_name
from ifrfit.report.shading import regime_key
from ifrfit.report.style import GREY, RESIDUAL_DASHES, SeriesStyle

if TYPE_CHECKING:
    import pandas as pd
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
    def of(cls, result: FitResult, styles: dict[str, SeriesStyle], width: float) -> Legend:
        """Legend of a result in a figure `width` inches wide."""
        entries = (*_series(result, styles), *_marks(result))
        columns = next(n for n in range(len(entries), 0, -1) if n == 1 or _wide(entries, n) <= width)
        lines = max(sum(label.count("\n") + 1 for label in part) for part in _columns(entries, columns))
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


def _columns(entries: Sequence[tuple[Any, str]], count: int) -> list[list[str]]:
    """Labels of each column: matplotlib fills one after the other, the first ones with one more."""
    least, extra = divmod(len(entries), count)
    labels = iter(label for _, label in entries)
    return [list(islice(labels, least + (i < extra))) for i in range(count)]


def _wide(entries: Sequence[tuple[Any, str]], count: int) -> float:
    """Inches that so many columns take."""
    longest = [
        max(len(line) for label in part for line in label.split("\n")) for part in _columns(entries, count)
    ]
    return sum(CHARACTER * characters + HANDLE for characters in longest)


def _series(result: FitResult, styles: dict[str, SeriesStyle]) -> list[tuple[Any, str]]:
    from matplotlib.lines import Line2D

    entries = []
    for name, own in styles.items():
        line = Line2D([], [], color=own.colour, ls=own.line, marker=own.marker, ms=4.2)
        entries.append((line, series_label(result.points, name, LONGEST)))
    return entries


def series_label(points: pd.DataFrame, name: str, longest: int) -> str:
    """A series with its provenance, wrapped."""
    kinds = points["provenance"][points["series"] == name].unique()
    label = textwrap.fill(f"{name} ({provenance_words(tuple(str(kind) for kind in kinds))})", longest)
    # a leading underscore would hide the entry, dollars would be read as mathematics
    return (f" {label}" if label.startswith("_") else label).replace("$", r"\$")


def _marks(result: FitResult) -> list[tuple[Any, str]]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    points = result.points
    angled = points["gamma_deg"].notna()
    keys = [regime_key(result, str(name)) for name in points["series"][angled].unique()]
    entries: list[tuple[Any, str]] = []
    sticking = points["sticking"][angled].map(bool).astype(bool)
    stick, slide = handle("o", 4.2, "white"), handle("o", 4.2, GREY)
    if sticking.any() and not sticking.all():
        entries += [
            (stick, f"open: {regime_name(result, 'sticking')}"),
            (slide, f"filled: {regime_name(result, 'sliding')}"),
        ]
    elif len(sticking) and None in keys:
        # of one kind, and no word in the panel names it
        chosen, regime = (stick, "sticking") if sticking.all() else (slide, "sliding")
        entries.append((chosen, f"all impacts {does(result, regime)}"))
    light, dark = (Patch(fc=GREY, alpha=alpha, lw=0) for alpha in (0.18, 0.4))
    entries.append(((light, dark, light), f"68, 95 % {_bands(result)}"))
    if any(isinstance(key, tuple) for key in keys):
        shade = Patch(fc="0.5", alpha=0.3, lw=0)
        entries.append(((shade, handle("|", 8.0, GREY), shade), "transition, 95 % interval"))
    entries.append((Line2D([], [], color=GREY, lw=0.7, ls=RESIDUAL_DASHES), "residuals of ±2 σ"))
    if is_outlier(result, points).any():
        entries.append((handle("o", 8.0, "none", "black"), "ringed: outlier"))
    return entries


def _bands(result: FitResult) -> str:
    """Only a posterior has credible bands; without draws they are of the Gaussian around the optimum."""
    if result.state.sample is None:
        return f"bands ({LeastSquares.title})"
    return "credible bands" if result.is_posterior else f"bands ({title_of(result.method)})"
