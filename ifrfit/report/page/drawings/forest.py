"""One constant in many results."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ifrfit.inference.result.types import Estimate
from ifrfit.report.page.drawings.canvas import blank, plain, shortened, symbol
from ifrfit.report.style import COLOURS, GREY, drawing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_MM, NAMES_MM, LINE_MM = 130.0, 50.0, 5.0
LONGEST = 34


def draw_forest(name: str, lines: Sequence[tuple[str, Estimate]]) -> Figure:
    """A line a result: value with 68 and 95 % intervals; a cross where it was fixed.

    Parameters
    ----------
    name : str
        The constant.
    lines : sequence of (str, Estimate)
        Label and estimate, from top to bottom.
    """
    height = 13.0 + LINE_MM * len(lines)
    with drawing():
        figure = blank(WIDTH_MM, height)
        axes = figure.add_axes(
            (NAMES_MM / WIDTH_MM, 10.0 / height, (WIDTH_MM - NAMES_MM - 4.0) / WIDTH_MM, 1.0 - 12.0 / height)
        )
        window = _window([estimate for _, estimate in lines])
        axes.set_xlim(*window)
        axes.set_ylim(len(lines) - 0.4, -0.6)
        for place, (_, estimate) in enumerate(lines):
            _line(axes, estimate, place, window)
        axes.set_yticks(range(len(lines)), [plain(shortened(label, LONGEST)) for label, _ in lines])
        axes.tick_params(axis="y", length=0)
        axes.grid(axis="y", color="0.9", lw=0.6)
        axes.set_axisbelow(True)
        axes.locator_params(axis="x", nbins=6)
        axes.set_xlabel(symbol(name))
    return figure


def _line(axes: Axes, estimate: Estimate, place: int, window: tuple[float, float]) -> None:
    if estimate.status == "fixed" and estimate.value is not None:
        axes.plot([estimate.value], [place], marker="x", ms=5, color=GREY, ls="none")
        return
    loose = estimate.value is None
    colour = GREY if loose else COLOURS[0]
    for interval, width in ((estimate.interval95, 1.3), (estimate.interval68, 4.0)):
        ends = [min(max(end, window[0]), window[1]) for end in interval]
        thick = width > 2.0
        axes.plot(
            ends,
            [place, place],
            color=colour,
            lw=width,
            alpha=0.5 if thick else 1.0,
            ls=":" if loose and not thick else "-",
            solid_capstyle="butt",
        )
    for end, edge, marker in zip(estimate.interval95, window, "<>", strict=True):
        if (end < edge) if marker == "<" else (end > edge):
            axes.plot([edge], [place], marker=marker, ms=4.5, color=colour, clip_on=False)
    if estimate.value is not None:
        axes.plot([estimate.value], [place], marker="o", ms=4.5, mfc="white", mec=colour, mew=1.2)


def _window(estimates: Sequence[Estimate]) -> tuple[float, float]:
    """What is known with room around it; an open interval is cut."""
    known = [
        end
        for estimate in estimates
        if estimate.value is not None
        for end in (estimate.value, *estimate.interval95)
        if math.isfinite(end)
    ]
    if not known:
        known = [end for estimate in estimates for end in estimate.interval95 if math.isfinite(end)] or [
            0.0,
            1.0,
        ]
    low, high = min(known), max(known)
    room = 0.08 * (high - low) or 0.1 * max(abs(low), 1e-3)
    return low - room, high + room
