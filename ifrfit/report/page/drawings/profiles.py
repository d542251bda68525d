"""The profile likelihood of one quantity."""

from __future__ import annotations

import math

import numpy as np

from ifrfit.inference.profile.types import ProfileLikelihood
from ifrfit.report.page.charts.chart import Axis, Box, Chart, Line, Mark, Points, Words
from ifrfit.report.page.drawings.canvas import one_panel, symbol
from ifrfit.report.style import COLOURS, GREY, RESIDUAL_DASHES

WIDTH_MM, HEIGHT_MM = 62.0, 48.0
LONGEST = 14  # characters of a series' name


def draw_profile(profile: ProfileLikelihood) -> Chart:
    """Rise of the objective against the quantity, with the cuts of 68 and 95 %."""
    cuts = {level: profile.cut(level) for level in (0.68, 0.95)}
    top = 2.1 * cuts[0.95]
    finite = np.isfinite(profile.x)
    known = profile.x[finite]
    low, high = _window(known, known[profile.rise[finite] <= top])
    marks: list[Mark] = []
    for level, pieces, opacity in ((0.95, profile.pieces, 0.14), (0.68, profile.pieces68, 0.22)):
        for piece in pieces:  # one without end is shaded as far as the profile is known
            left, right = np.clip(piece, known.min(), known.max()).tolist()
            marks.append(Box((left, right), (-math.inf, math.inf), COLOURS[0], opacity))
        cut = cuts[level]
        marks += [
            Line(np.array([low, high]), np.full(2, cut), GREY, 0.7, RESIDUAL_DASHES),
            Words(0.5 * (low + high), cut + 0.02 * top, f"{100 * level:.0f} %", colour=GREY, height="bottom"),
        ]
    shown = finite & (profile.rise <= 1.5 * top)
    optimum = np.array([profile.value]), np.zeros(1)
    marks += [
        Line(profile.x[shown], profile.rise[shown], COLOURS[0], 1.3),
        Points(*optimum, "o", 4.5, COLOURS[0], COLOURS[0], is_clipped=False),
    ]
    x = Axis(low, high, symbol(profile.name, LONGEST), most=5)
    return one_panel(x, Axis(0.0, top, "rise"), marks, WIDTH_MM, HEIGHT_MM, left=11.0)


def _window(known: np.ndarray, below: np.ndarray) -> tuple[float, float]:
    """What is in sight: where the profile stays low, or all that is known of it."""
    for x in (below, known):
        if x.size > 1 and x.max() > x.min():
            return float(x.min()), float(x.max())
    room = 0.1 * max(abs(float(known[0])), 1e-3)
    return float(known[0]) - room, float(known[0]) + room
