"""The drawing of an impact: what the symbols of a report stand for."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ifrfit.report.page.charts.chart import Axis, Box, Chart, Line, Mark, Panel, Points, Words
from ifrfit.report.page.charts.scales import Ticks
from ifrfit.report.style import COLOURS, GREY

Array = NDArray[np.float64]

# radii of the sphere, whose contact point is the origin
LEFT, RIGHT, BOTTOM, TOP = -2.9, 2.9, -1.25, 3.55
RADIUS_MM = 17.0
LETTERS = 10.0
INCIDENCE, REBOUND = 48.0, 32.0  # degrees from the normal
CENTRE = np.array([0.0, 1.0])
HEAD = 0.13  # of an arrow, radii


def draw_impact() -> Chart:
    """A sphere on a wall: velocities before and after, angle of incidence, spin, and the contact point."""
    marks: list[Mark] = [
        Box((-math.inf, math.inf), (-0.28, 0.0), "0.9"),
        Line(np.array([LEFT, RIGHT]), np.zeros(2), "0", 1.2),
        Line(np.zeros(2), np.array([0.0, 3.3]), GREY, 0.8, "--"),
        Words(0.08, 3.38, "normal", 8.0, GREY, anchor="start"),
        *_arc(1.0, 0.0, 360.0),
    ]
    before = CENTRE + 2.45 * _direction(90.0 + INCIDENCE)
    between = CENTRE + 1.6 * _direction(90.0 + 0.5 * INCIDENCE)
    after = CENTRE + 2.0 * _direction(90.0 - REBOUND)
    marks += [
        *_arrow(before, CENTRE, COLOURS[0]),
        *_arrow(CENTRE, after, COLOURS[1]),
        Words(before[0], before[1] + 0.22, "$u$", LETTERS, COLOURS[0]),
        Words(after[0], after[1] + 0.22, "$v$", LETTERS, COLOURS[1]),
        *_arc(1.35, 90.0, 90.0 + INCIDENCE, GREY),
        Words(between[0], between[1], r"$\gamma$", LETTERS),
        # positive: the lowest point runs ahead, as back-spin has it
        *_arc(0.55, 205.0, 335.0, COLOURS[2], has_head=True),
        Words(0.22, 0.7, r"$\omega$", LETTERS, COLOURS[2]),
        *_arrow(np.array([0.0, -0.55]), np.array([1.3, -0.55]), COLOURS[0]),
        Words(1.42, -0.55, "$U_t$", LETTERS, COLOURS[0], anchor="start"),
        *_arrow(np.array([0.0, -0.9]), np.array([-0.8, -0.9]), COLOURS[1]),
        Words(-0.92, -0.9, "$V_t$", LETTERS, COLOURS[1], anchor="end"),
        Points(np.zeros(1), np.zeros(1), "o", 5.0, "#000", "#000"),
        Words(-0.15, -0.5, "contact point", 8.0, anchor="end"),
        Words(RIGHT - 0.05, -0.14, "wall", 8.0, anchor="end"),
    ]
    none = Ticks((), ())
    wide, tall = RADIUS_MM * (RIGHT - LEFT), RADIUS_MM * (TOP - BOTTOM)
    x, y = Axis(LEFT, RIGHT, ticks=none), Axis(BOTTOM, TOP, ticks=none)
    return Chart(wide, tall, (Panel(0.0, 0.0, wide, tall, x, y, tuple(marks), has_frame=False),))


def _direction(degrees: float) -> Array:
    """A unit vector at an angle from the wall, anticlockwise."""
    return np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])


def _arrow(start: Array, end: Array, colour: str) -> list[Mark]:
    """A line with a head at its end."""
    along = (end - start) / float(np.hypot(*(end - start)))
    x, y = np.stack((start, end), axis=1)
    return [Line(x, y, colour, 1.8), *_head(end, along, colour)]


def _head(tip: Array, along: Array, colour: str) -> list[Mark]:
    across = np.array([-along[1], along[0]])
    sides = [tip - HEAD * (1.6 * along + side * across) for side in (0.8, -0.8)]
    x, y = np.stack((sides[0], tip, sides[1]), axis=1)
    return [Line(x, y, colour, 1.8)]


def _arc(radius: float, start: float, end: float, colour: str = "0", *, has_head: bool = False) -> list[Mark]:
    """Part of a circle about the centre of the sphere, between angles in degrees."""
    angles = np.radians(np.linspace(start, end, 61))
    x, y = CENTRE[0] + radius * np.cos(angles), CENTRE[1] + radius * np.sin(angles)
    arc: list[Mark] = [Line(x, y, colour, 1.2)]
    if has_head:
        arc += _head(np.array([x[-1], y[-1]]), _direction(end + 90.0), colour)
    return arc
