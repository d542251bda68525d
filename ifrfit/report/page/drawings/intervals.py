"""Intervals of one constant by several methods, side by side."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ifrfit.inference.result.types import Interval
from ifrfit.report.page.drawings.canvas import blank, symbol
from ifrfit.report.style import COLOURS, GREY, drawing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LINE_MM = 6.0
MARGIN_MM = 14.0
WIDTH_MM = 85.0
NAMES_MM = 25.0


@dataclass(frozen=True)
class Span:
    """One line: what gave the interval, and the interval; an infinite end runs out of the picture.

    Attributes
    ----------
    label : str
    value : float or None
    inner, outer : tuple of float or None
        68 and 95 %.
    """

    label: str
    value: float | None
    inner: Interval | None
    outer: Interval


def draw_intervals(name: str, spans: tuple[Span, ...], domain: Interval) -> Figure:
    """Draw intervals as bars over one axis.

    Parameters
    ----------
    name : str
        The constant.
    spans : tuple of Span
        From top to bottom.
    domain : tuple of float
        Its bounds, drawn where they are in sight.
    """
    with drawing():
        height = MARGIN_MM + LINE_MM * len(spans)
        figure = blank(WIDTH_MM, height)
        axes = figure.add_axes(
            (NAMES_MM / WIDTH_MM, 11.0 / height, (WIDTH_MM - NAMES_MM - 3.0) / WIDTH_MM, 1.0 - 13.0 / height)
        )
        low, high = _limits(spans, domain)
        axes.set_xlim(low, high)
        axes.set_ylim(len(spans) - 0.4, -0.6)
        for place, span in enumerate(spans):
            _bar(axes, span, place, (low, high), COLOURS[place % len(COLOURS)])
        for bound in domain:
            if low < bound < high:
                axes.axvline(bound, color=GREY, lw=0.8, ls=(0, (4, 3)))
        axes.set_yticks(range(len(spans)), [span.label for span in spans])
        axes.tick_params(axis="y", length=0)
        axes.set_xlabel(symbol(name))
        axes.locator_params(axis="x", nbins=5)
    return figure


def _bar(axes: Axes, span: Span, place: int, window: Interval, colour: str) -> None:
    ends = [min(max(end, window[0]), window[1]) for end in span.outer]
    axes.plot(ends, [place, place], color=colour, lw=1.4, solid_capstyle="butt")
    for end, marker in zip(span.outer, "<>", strict=True):
        if math.isinf(end):
            edge = window[0] if end < 0 else window[1]
            axes.plot([edge], [place], marker=marker, ms=5, color=colour, clip_on=False)
        else:
            axes.plot([end, end], [place - 0.14, place + 0.14], color=colour, lw=1.1)
    if span.inner is not None:
        inner = [min(max(end, window[0]), window[1]) for end in span.inner]
        axes.plot(inner, [place, place], color=colour, lw=4.5, alpha=0.55, solid_capstyle="butt")
    if span.value is not None:
        axes.plot([span.value], [place], marker="o", ms=4.5, mfc="white", mec=colour, mew=1.2)


def _limits(spans: tuple[Span, ...], domain: Interval) -> Interval:
    """What is in sight: every finite end, with some room; the domain only if it is near."""
    finite = [end for span in spans for end in span.outer if math.isfinite(end)]
    finite += [span.value for span in spans if span.value is not None]
    if not finite:
        finite = [end for end in domain if math.isfinite(end)] or [0.0, 1.0]
    low, high = min(finite), max(finite)
    room = 0.12 * (high - low) or 0.1 * max(abs(low), 1e-3)
    return low - room, high + room
