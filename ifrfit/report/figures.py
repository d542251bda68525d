"""The figure of a fit: one panel an observable, residuals under it."""

from __future__ import annotations

import math
import textwrap
from functools import partial
from typing import TYPE_CHECKING

from ifrfit.errors import UsageError
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Estimate
from ifrfit.report import panels, shading, style
from ifrfit.report.legend import Legend
from ifrfit.report.provenance import is_stand_in
from ifrfit.report.regimes import at_true_angles, has_angle, regime_name

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec

MOST_COLUMNS = 3
NON_BREAKING = "\u00a0"


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
    result = at_true_angles(result)
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
        panel = 3.1 + 0.16 * strip
        height = lines * panel + legend.height + 0.17 * (title.count("\n") + 1 if title else 0)
        figure = style.new_figure(width_mm, height, "constrained")
        figure.get_layout_engine().set(w_pad=0.04, h_pad=0.03, hspace=0.02, wspace=0.03)  # type: ignore[union-attr, call-arg]
        grid = figure.add_gridspec(lines, columns)
        for number, observable in enumerate(observables):
            _draw_panel(figure, grid[divmod(number, columns)], result, observable, styles, strip)
        if title:
            figure.suptitle(title, fontsize=8.5, weight="bold")
        legend.draw(figure)
        style.fix_layout(figure)
    return figure


def _draw_panel(
    figure: Figure,
    cell: SubplotSpec,
    result: FitResult,
    observable: str,
    styles: dict[str, style.SeriesStyle],
    strip: int,
) -> None:
    inner = cell.subgridspec(3, 1, height_ratios=[max(0.16 * strip, 1e-3), 2.0, 0.75], hspace=0.03)
    data = figure.add_subplot(inner[1])
    residuals = figure.add_subplot(inner[2], sharex=data)
    panels.draw_panel(data, residuals, result, observable, styles)
    data.tick_params(labelbottom=False)
    figure.align_ylabels([data, residuals])
    regimes, name = _regimes(result, observable, styles), partial(regime_name, result)
    if len(regimes) > 1:
        shading.draw_strip(figure.add_subplot(inner[0], sharex=data), regimes, name)
    elif regimes and regimes[0].spans:
        shading.shade(data, regimes[0], words=True, name=name)
        shading.shade(residuals, regimes[0], words=False)
    elif regimes:
        shading.note_open_transition(data, result, _series_of(result, observable)[0])


def _series_of(result: FitResult, observable: str) -> list[str]:
    rows = result.points[result.points["observable"] == observable]
    return [str(name) for name in rows["series"].unique()]


def _regimes(
    result: FitResult, observable: str, styles: dict[str, style.SeriesStyle]
) -> tuple[shading.Regimes, ...]:
    """Regimes of the series of a panel; none where the angle does not matter."""
    if not has_angle(observable):
        return ()
    return shading.regimes_of(result, {name: styles[name] for name in _series_of(result, observable)})


def _title(result: FitResult, width: float) -> str:
    """What nobody may overlook, wrapped to the width (inches); empty where there is nothing of the kind."""
    sentences = []
    if is_stand_in(result):
        sentences.append("STAND-IN DATA, generated from the constants a paper prints: not an experiment")
    lack = result.facts.get("lack_of_fit")
    if lack is not None and not lack.ok:
        sentences.append(contradiction(result, lack.figures.get("p")))
    # about 13 bold characters an inch at this size
    lines = [textwrap.fill(sentence, int(13.0 * width)) for sentence in sentences]
    return "\n".join(lines).replace(NON_BREAKING, " ")


def contradiction(result: FitResult, p: float | None) -> str:
    """Say that the data refute the closure, with the p value in one piece."""
    separate = any(not isinstance(entry, Estimate) for entry in result.constants.values())
    words = f"The data contradict one set of constants{' a series' if separate else ''}"
    if p is None:
        return words
    # the number stays in one piece when lines are broken
    number = "(p < 1e-99)" if p < 1e-99 else f"(p = {p:.0e})"
    return f"{words} {number.replace(' ', NON_BREAKING)}"
