"""Fig. 2 as our own drawing: restitution and friction as separate elements of the contact."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ifrfit.report import style
from ifrfit.report.style import COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Point = tuple[float, float]

_NORMAL, _TANGENTIAL, _FRICTION = COLOURS[0], COLOURS[1], COLOURS[2]


def draw() -> Figure:
    """The figure, 85 mm wide. It holds no numbers."""
    from matplotlib.patches import Circle, Rectangle

    with style.drawing():
        figure = style.new_figure(style.PANEL_WIDTH_MM, 0.86 * style.PANEL_WIDTH_MM / style.MM_PER_INCH)
        axes = figure.add_axes((0.01, 0.09, 0.98, 0.82))
        axes.set_aspect("equal")
        axes.set_axis_off()
        axes.set_xlim(-2.6, 4.6)
        axes.set_ylim(-0.6, 5.4)
        axes.add_patch(Circle((0.0, 3.6), 1.5, fc="#F2F2F2", ec="0.25", lw=0.9))
        axes.add_patch(Rectangle((-2.5, -0.35), 7.0, 0.35, fc="white", ec="0.5", hatch="/////", lw=0.0))
        axes.axhline(0.0, color="0.25", lw=1.0)
        _pair(axes, (0.0, 2.1), (0.0, 0.0), _NORMAL)
        axes.text(-1.05, 1.05, "normal\n$e_n$", color=_NORMAL, ha="center", va="center")
        axes.plot([1.5, 1.75], [3.6, 3.6], color="0.25", lw=0.9)
        _pair(axes, (1.75, 3.6), (4.1, 3.6), _TANGENTIAL)
        axes.plot([4.1, 4.1], [0.0, 4.05], color="0.25", lw=1.0)
        axes.text(2.9, 4.5, "tangential $e_t$", color=_TANGENTIAL, ha="center", va="center")
        _slider(axes)
        figure.suptitle("Fig. 2  Restitution and friction apart", fontsize=8.0, weight="bold", y=0.985)
        words = "FR: restitution or friction, by regime. IFR: both at once."
        figure.text(0.5, 0.03, words, ha="center", fontsize=7.2)
    return figure


def _pair(axes: Axes, start: Point, end: Point, colour: str) -> None:
    """A spring and a dashpot side by side between two points."""
    a, b = np.array(start), np.array(end)
    axis = (b - a) / np.linalg.norm(b - a)
    across = 0.32 * np.array([-axis[1], axis[0]])
    for point in (a, b):
        bar = np.array([point - across, point + across])
        axes.plot(*bar.T, color=colour, lw=1.0)
    _spring(axes, a + across, b + across, colour)
    _dashpot(axes, a - across, b - across, colour)


def _spring(axes: Axes, a: np.ndarray, b: np.ndarray, colour: str) -> None:
    share = np.array([0.0, 0.15, *np.linspace(0.2, 0.8, 9), 0.85, 1.0])
    swing = np.array([0.0, 0.0, *np.resize([1.0, -1.0], 9), 0.0, 0.0])
    axis = b - a
    across = np.array([-axis[1], axis[0]]) / np.linalg.norm(axis)
    line = a + share[:, None] * axis + 0.15 * swing[:, None] * across
    axes.plot(*line.T, color=colour, lw=1.0)


def _dashpot(axes: Axes, a: np.ndarray, b: np.ndarray, colour: str) -> None:
    axis = b - a
    across = 0.17 * np.array([-axis[1], axis[0]]) / np.linalg.norm(axis)
    rod = np.array([a, a + 0.52 * axis])
    cup = np.array([0.72, 0.36, 0.36, 0.72])
    side = np.array([1.0, 1.0, -1.0, -1.0])
    # the cup is open towards the rod
    walls = a + (1.08 - cup)[:, None] * axis + side[:, None] * across
    axes.plot(*rod.T, color=colour, lw=1.0)
    plate = np.array([rod[1] - 0.8 * across, rod[1] + 0.8 * across])
    axes.plot(*plate.T, color=colour, lw=1.6)
    axes.plot(*walls.T, color=colour, lw=1.0)
    axes.plot(*np.array([a + 0.72 * axis, b]).T, color=colour, lw=1.0)


def _slider(axes: Axes) -> None:
    """Friction: a block that rubs on the wall."""
    from matplotlib.patches import Rectangle

    axes.add_patch(Rectangle((1.9, 0.0), 1.0, 0.5, fc="white", ec=_FRICTION, lw=1.2, zorder=3))
    axes.plot([1.1, 1.1, 1.9], [2.55, 0.25, 0.25], color=_FRICTION, lw=1.0)
    axes.text(2.4, 0.85, "friction μ", color=_FRICTION, ha="center", va="center")
