"""Posterior predictive checks: their p-values on one axis."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ifrfit.inference.diagnostics.thresholds import REFUTED
from ifrfit.report.page.charts.chart import Axis, Box, Chart, Line, Mark, Points, Words
from ifrfit.report.page.charts.scales import Logarithmic
from ifrfit.report.page.drawings.canvas import lines_panel
from ifrfit.report.style import COLOURS, GREY

LEAST = 1e-6  # smaller ones are drawn at the edge


def draw_checks(p: Mapping[str, float]) -> Chart:
    """Each p-value over a logarithmic axis; what lies in the shade fails."""
    marks: list[Mark] = [
        Box((LEAST, REFUTED), (-math.inf, math.inf), COLOURS[1], 0.15),
        Words(0.8 * REFUTED, len(p) - 0.1, "fails", colour=GREY, anchor="end", height="bottom"),
    ]
    for place, value in enumerate(p.values()):
        fails = value < REFUTED
        colour = COLOURS[1] if fails else COLOURS[0]
        marker = "<" if value < LEAST else "X" if fails else "o"
        at = np.array([float(place)])
        marks += [
            Line(np.array([LEAST, 1.0]), np.repeat(at, 2), "0.85", 0.6),
            Points(np.array([max(value, LEAST)]), at, marker, 6.0, colour, colour, is_clipped=False),
        ]
    x = Axis(LEAST, 10.0**0.1, "p", Logarithmic(), most=7)
    return lines_panel(list(p), x, marks, 110.0, 42.0, below=0.5)
