"""Intervals of one constant side by side: by several methods, or in several results."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ifrfit.inference.result.types import Estimate, Interval
from ifrfit.report.page.charts.chart import Axis, Chart, Line, Mark, Points
from ifrfit.report.page.drawings.canvas import lines_panel, shortened, symbol
from ifrfit.report.style import COLOURS, GREY, RESIDUAL_DASHES

LONGEST = 34  # characters of a result's name
_CHARACTER, _GAP = 1.6, 4.0  # mm: a character of such a name, and what is left of a line beside it


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


def draw_intervals(name: str, spans: tuple[Span, ...], domain: Interval) -> Chart:
    """What several methods say of one constant as bars over one axis.

    Parameters
    ----------
    name : str
        The constant.
    spans : tuple of Span
        From top to bottom.
    domain : tuple of float
        Its bounds, drawn where they are in sight.
    """
    ends = [end for span in spans for end in (*span.outer, span.value)]
    window = _window(ends, domain, 0.12)
    marks: list[Mark] = [
        Line(np.full(2, bound), np.array([-0.6, len(spans) - 0.4]), GREY, 0.8, RESIDUAL_DASHES)
        for bound in domain
        if window[0] < bound < window[1]
    ]
    for place, span in enumerate(spans):
        marks += _bar(span, place, window, COLOURS[place % len(COLOURS)])
    x = Axis(*window, symbol(name), most=5, mirrored=True)
    return lines_panel([span.label for span in spans], x, marks, 85.0, 25.0)


def draw_forest(name: str, lines: Sequence[tuple[str, Estimate]]) -> Chart:
    """One constant in several results: value with 68 and 95 % intervals; a cross where it was fixed.

    Parameters
    ----------
    name : str
        The constant.
    lines : sequence of (str, Estimate)
        Label and estimate, from top to bottom.
    """
    known = [end for _, e in lines if e.value is not None for end in (e.value, *e.interval95)]
    window = _window(known or [end for _, e in lines for end in e.interval95], (0.0, 1.0), 0.08)
    marks: list[Mark] = []
    for place, (label, estimate) in enumerate(lines):
        marks.append(Line(np.array(window), np.full(2, float(place)), "0.9", 0.6))
        if estimate.status == "fixed" and estimate.value is not None:
            marks.append(
                Points(np.array([estimate.value]), np.array([float(place)]), "x", 5.0, "none", GREY, 1.0)
            )
        else:
            span = Span(label, estimate.value, estimate.interval68, estimate.interval95)
            loose = estimate.value is None
            marks += _bar(span, place, window, GREY if loose else COLOURS[0], ":" if loose else "-")
    labels = [shortened(label, LONGEST) for label, _ in lines]
    names = _GAP + _CHARACTER * max(map(len, labels), default=0)
    x = Axis(*window, symbol(name), mirrored=True)
    return lines_panel(labels, x, marks, names + 80.0, names, line=5.0)


def _bar(span: Span, place: int, window: Interval, colour: str, line: str = "-") -> list[Mark]:
    """Thin for 95 %, thick for 68 %, a circle at the value; an arrow where an end is out of sight."""
    at = np.array([float(place)])
    ends = np.clip(span.outer, *window)
    found: list[Mark] = [Line(ends, np.repeat(at, 2), colour, 1.4, line)]
    for end, shown, marker in zip(span.outer, ends.tolist(), "<>", strict=True):
        if end != shown:
            found.append(Points(np.array([shown]), at, marker, 5.0, colour, colour, is_clipped=False))
        else:
            found.append(Line(np.full(2, end), place + np.array([-0.14, 0.14]), colour, 1.1))
    if span.inner is not None:
        found.append(Line(np.clip(span.inner, *window), np.repeat(at, 2), colour, 4.5, opacity=0.55))
    if span.value is not None:
        found.append(Points(np.array([span.value]), at, "o", 4.5, "#fff", colour, 1.2))
    return found


def _window(numbers: Iterable[float | None], otherwise: Interval, share: float) -> Interval:
    """What is in sight: every finite number, with some room; what stands for them where there is none."""
    finite = [x for x in numbers if x is not None and math.isfinite(x)]
    finite = finite or [end for end in otherwise if math.isfinite(end)] or [0.0, 1.0]
    low, high = min(finite), max(finite)
    room = share * (high - low) or 0.1 * max(abs(low), 1e-3)
    return low - room, high + room
