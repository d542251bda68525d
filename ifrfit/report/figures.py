"""The figure of a fit: one panel an observable, residuals under it, a legend under all."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, Any

from ifrfit.errors import UsageError
from ifrfit.inference.estimators import LeastSquares, title_of
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Estimate
from ifrfit.report import panels, style
from ifrfit.report.modes import at_shown_mode, modes_of, other_modes
from ifrfit.report.panels import handle, is_outlier
from ifrfit.report.provenance import amount_words, is_stand_in, provenance_words
from ifrfit.report.regimes import (
    Regimes,
    at_true_angles,
    does,
    draw_strip,
    has_angle,
    note_open_transition,
    regime_key,
    regime_name,
    regimes_of,
    shade,
)
from ifrfit.report.style import GREY, RESIDUAL_DASHES, SeriesStyle

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec

FONT_SIZE = 6.6
# inches: a character of that size, a line, and a handle with its gaps
CHARACTER, LINE, HANDLE = 0.049, 0.145, 0.4
LONGEST = 48
MOST_COLUMNS = 3
SPEEDS = 1.0  # inches more for residuals against speed
NON_BREAKING = "\u00a0"


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
        words = "transition of the mode shown" if modes_of(result) else "transition, 95 % interval"
        entries.append(((shade, handle("|", 8.0, GREY), shade), words))
    entries.append((Line2D([], [], color=GREY, lw=0.7, ls=RESIDUAL_DASHES), "residuals of ±2 σ"))
    for weight, _ in other_modes(result) if angled.any() else ():
        entries.append((Line2D([], [], **panels.OTHER_MODE), f"another mode, weight {weight:.2g}"))
    if is_outlier(result, points).any():
        entries.append((handle("o", 8.0, "none", "black"), "ringed: outlier"))
    if result.is_sampled:
        entries.append((handle("", 0.0, "none"), f"points: {amount_words(result)}"))
    return entries


def _bands(result: FitResult) -> str:
    """Only a posterior has credible bands; without draws they are of the Gaussian around the optimum."""
    if result.state.sample is None:
        return f"bands ({LeastSquares.title})"
    return "credible bands" if result.is_posterior else f"bands ({title_of(result.method)})"


def plot(result: FitResult) -> Figure:
    """Figure of data, curves with bands and standardised residuals; one panel an observable.

    Parameters
    ----------
    result : FitResult
        With its points.

    Returns
    -------
    matplotlib.figure.Figure
        85 mm wide a panel, not known to pyplot; at most three panels side by side. Angles in degrees,
        everything else dimensionless. Curves are at the median spin of each series.

    Raises
    ------
    UsageError
        If the result holds no points.
    """
    if not len(result.points):
        raise UsageError("This result holds no points, so there is nothing to draw. Fit the data again.")
    result = at_shown_mode(at_true_angles(result))
    observables = [str(name) for name in result.points["observable"].unique()]
    styles = style.series_styles([str(name) for name in result.points["series"].unique()])
    columns = min(len(observables), MOST_COLUMNS)
    lines = math.ceil(len(observables) / columns)
    width_mm = columns * style.PANEL_WIDTH_MM
    width = width_mm / style.MM_PER_INCH
    with style.drawing():
        legend = Legend.of(result, styles, width)
        title = _title(result, width)
        # a bar for each series above a panel whose series differ in their regimes
        bars = (len(_regimes(result, name, styles)) for name in observables)
        strip = max(count if count > 1 else 0 for count in bars)
        by_speed = {name for name in observables if panels.has_speeds(_rows_of(result, name), name)}
        panel = 3.1 + 0.16 * strip + (SPEEDS if by_speed else 0.0)
        height = lines * panel + legend.height + 0.17 * (title.count("\n") + 1 if title else 0)
        figure = style.new_figure(width_mm, height, "constrained")
        figure.get_layout_engine().set(w_pad=0.04, h_pad=0.03, hspace=0.02, wspace=0.03)  # type: ignore[union-attr, call-arg]
        grid = figure.add_gridspec(lines, columns)
        for number, observable in enumerate(observables):
            cell = grid[divmod(number, columns)]
            rooms = _rooms(figure, cell, strip, speeds=bool(by_speed))
            if observable not in by_speed and rooms.speeds is not None:
                rooms.speeds.remove()
                rooms = replace(rooms, speeds=None)
            _draw_panel(figure, rooms, result, observable, styles)
        if title:
            figure.suptitle(title, fontsize=8.5, weight="bold")
        legend.draw(figure)
        style.fix_layout(figure)
    return figure


@dataclass(frozen=True)
class Rooms:
    """The axes of one observable, from top to bottom; `speeds` where a panel of the figure has some."""

    strip: SubplotSpec
    data: Axes
    residuals: Axes
    speeds: Axes | None


def _rooms(figure: Figure, cell: SubplotSpec, strip: int, *, speeds: bool) -> Rooms:
    heights = [max(0.16 * strip, 1e-3), 2.0, 0.75, *([0.75] if speeds else [])]
    inner = cell.subgridspec(len(heights), 1, height_ratios=heights, hspace=0.03)
    data = figure.add_subplot(inner[1])
    residuals = figure.add_subplot(inner[2], sharex=data)
    return Rooms(inner[0], data, residuals, figure.add_subplot(inner[3]) if speeds else None)


def _draw_panel(
    figure: Figure, rooms: Rooms, result: FitResult, observable: str, styles: dict[str, style.SeriesStyle]
) -> None:
    data, residuals = rooms.data, rooms.residuals
    panels.draw_panel(data, residuals, result, observable, styles, rooms.speeds)
    data.tick_params(labelbottom=False)
    data.set_xlabel("")
    figure.align_ylabels([data, residuals, *(() if rooms.speeds is None else (rooms.speeds,))])
    regimes, name = _regimes(result, observable, styles), partial(regime_name, result)
    if len(regimes) > 1:
        draw_strip(figure.add_subplot(rooms.strip, sharex=data), regimes, name)
    elif regimes and regimes[0].spans:
        shade(data, regimes[0], words=True, name=name)
        shade(residuals, regimes[0], words=False)
    elif regimes:
        note_open_transition(data, result, _series_of(result, observable)[0])


def _rows_of(result: FitResult, observable: str) -> pd.DataFrame:
    return result.points[result.points["observable"] == observable]


def _series_of(result: FitResult, observable: str) -> list[str]:
    rows = _rows_of(result, observable)
    return [str(name) for name in rows["series"].unique()]


def _regimes(result: FitResult, observable: str, styles: dict[str, style.SeriesStyle]) -> tuple[Regimes, ...]:
    """Regimes of the series of a panel; none where the angle does not matter."""
    if not has_angle(observable):
        return ()
    return regimes_of(result, {name: styles[name] for name in _series_of(result, observable)})


def _title(result: FitResult, width: float) -> str:
    """What nobody may overlook, wrapped to the width (inches); empty where there is nothing of the kind."""
    stand_in = "STAND-IN DATA, generated from the constants a paper prints: not an experiment"
    sentences = (stand_in if is_stand_in(result) else "", contradiction(result))
    # about 13 bold characters an inch at this size
    lines = [textwrap.fill(sentence, int(13.0 * width)) for sentence in sentences if sentence]
    return "\n".join(lines).replace(NON_BREAKING, " ")


def contradiction(result: FitResult) -> str:
    """Say that the data refute the closure, with the p value in one piece; empty where they do not."""
    lack = result.facts.get("lack_of_fit")
    if lack is None or lack.ok:
        return ""
    separate = any(not isinstance(entry, Estimate) for entry in result.constants.values())
    words = f"The data contradict one set of constants{' a series' if separate else ''}"
    p = lack.figures.get("p")
    if p is None:
        return words
    # the number stays in one piece when lines are broken
    number = "(p < 1e-99)" if p < 1e-99 else f"(p = {p:.0e})"
    return f"{words} {number.replace(' ', NON_BREAKING)}"
