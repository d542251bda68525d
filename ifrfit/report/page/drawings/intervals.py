"""Intervals of one constant side by side: by several methods, or in several results."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ifrfit.inference.result.types import Estimate, Interval
from ifrfit.report.page.drawings.canvas import lines_panel, shortened, symbol
from ifrfit.report.style import COLOURS, GREY, drawing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LONGEST = 34  # characters of a result's name


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
    """Draw what several methods say of one constant as bars over one axis.

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
        figure, axes = lines_panel([span.label for span in spans], 85.0, 25.0)
        ends = [end for span in spans for end in (*span.outer, span.value)]
        window = _window(ends, domain, 0.12)
        for place, span in enumerate(spans):
            _bar(axes, span, place, window, COLOURS[place % len(COLOURS)])
        for bound in domain:
            if window[0] < bound < window[1]:
                axes.axvline(bound, color=GREY, lw=0.8, ls=(0, (4, 3)))
        axes.set_xlim(*window)
        axes.set_xlabel(symbol(name))
        axes.locator_params(axis="x", nbins=5)
    return figure


def draw_forest(name: str, lines: Sequence[tuple[str, Estimate]]) -> Figure:
    """Draw one constant in several results: value with 68 and 95 % intervals; a cross where it was fixed.

    Parameters
    ----------
    name : str
        The constant.
    lines : sequence of (str, Estimate)
        Label and estimate, from top to bottom.
    """
    with drawing():
        figure, axes = lines_panel([shortened(label, LONGEST) for label, _ in lines], 130.0, 50.0, 5.0)
        known = [end for _, e in lines if e.value is not None for end in (e.value, *e.interval95)]
        window = _window(known or [end for _, e in lines for end in e.interval95], (0.0, 1.0), 0.08)
        for place, (label, estimate) in enumerate(lines):
            if estimate.status == "fixed" and estimate.value is not None:
                axes.plot([estimate.value], [place], marker="x", ms=5, color=GREY, ls="none")
            else:
                span = Span(label, estimate.value, estimate.interval68, estimate.interval95)
                loose = estimate.value is None
                _bar(axes, span, place, window, GREY if loose else COLOURS[0], ":" if loose else "-")
        axes.set_xlim(*window)
        axes.grid(axis="y", color="0.9", lw=0.6)
        axes.set_axisbelow(True)
        axes.locator_params(axis="x", nbins=6)
        axes.set_xlabel(symbol(name))
    return figure


def _bar(axes: Axes, span: Span, place: int, window: Interval, colour: str, line: str = "-") -> None:
    """Thin for 95 %, thick for 68 %, a circle at the value; an arrow where an end is out of sight."""
    ends = [min(max(end, window[0]), window[1]) for end in span.outer]
    axes.plot(ends, [place, place], color=colour, lw=1.4, ls=line, solid_capstyle="butt")
    for end, shown, marker in zip(span.outer, ends, "<>", strict=True):
        if end != shown:
            axes.plot([shown], [place], marker=marker, ms=5, color=colour, clip_on=False)
        else:
            axes.plot([end, end], [place - 0.14, place + 0.14], color=colour, lw=1.1)
    if span.inner is not None:
        inner = [min(max(end, window[0]), window[1]) for end in span.inner]
        axes.plot(inner, [place, place], color=colour, lw=4.5, alpha=0.55, solid_capstyle="butt")
    if span.value is not None:
        axes.plot([span.value], [place], marker="o", ms=4.5, mfc="white", mec=colour, mew=1.2)


def _window(numbers: Iterable[float | None], otherwise: Interval, share: float) -> Interval:
    """What is in sight: every finite number, with some room; what stands for them where there is none."""
    finite = [x for x in numbers if x is not None and math.isfinite(x)]
    finite = finite or [end for end in otherwise if math.isfinite(end)] or [0.0, 1.0]
    low, high = min(finite), max(finite)
    room = share * (high - low) or 0.1 * max(abs(low), 1e-3)
    return low - room, high + room
