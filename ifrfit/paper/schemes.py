"""Figs 1 and 2 as our own drawings: an impact from three sides, and the elements of the contact."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ifrfit.paper.scene import Row
from ifrfit.physics import Rebound, rebound
from ifrfit.report import style
from ifrfit.report.style import COLOURS, GREY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_MM = 174.0
GAMMA = 40.0
SPIN = (0.50, 0.35)
CONSTANTS = {"e_n": 0.90, "e_t": -0.90, "mu": 0.15}
_SCALE = 1.7  # radii that stand for the incoming speed u
_CENTRE, _NORMAL_END = (0.0, 1.0), 2.9
_IN, _OUT = COLOURS[0], COLOURS[1]
Point = tuple[float, float]

_NORMAL, _TANGENTIAL, _FRICTION = COLOURS[0], COLOURS[1], COLOURS[2]


@dataclass(frozen=True)
class Arrow:
    """An arrow in one of the views: from `tail` to `head` in sphere radii, with its label beside the head."""

    view: str
    label: str
    tail: tuple[float, float]
    head: tuple[float, float]
    colour: str
    beside: tuple[float, float]


def impact() -> Rebound:
    """The impact that is drawn."""
    return rebound(GAMMA, *SPIN, degrees=True, **CONSTANTS)  # type: ignore[arg-type]


def arrows() -> tuple[Arrow, ...]:
    """Velocities in the three views. Up is away from the wall in the first two; y is down in the third."""
    r = impact()
    i = r.incidence
    in_x, in_n = _SCALE * float(i.sine), _SCALE * float(i.cosine)
    v_x, v_y, v_n = (_SCALE * float(v) for v in (r.v_x, r.v_y, r.v_n))
    slip = _SCALE * float(i.slip_x), -_SCALE * float(i.slip_y)
    after = _SCALE * float(r.contact_x), -_SCALE * float(r.contact_y)
    centre_x, centre_n = _CENTRE
    lateral, front, above = "a: along y", "b: along x", "c: along z"
    return (
        Arrow(lateral, "u", (-in_x, centre_n + in_n), _CENTRE, _IN, (-in_x - 0.16, centre_n + in_n + 0.05)),
        Arrow(lateral, "v", _CENTRE, (v_x, centre_n + v_n), _OUT, (v_x + 0.16, centre_n + v_n + 0.05)),
        Arrow(front, "u", (centre_x, centre_n + in_n), _CENTRE, _IN, (0.2, centre_n + in_n - 0.2)),
        Arrow(front, "v", _CENTRE, (v_y, centre_n + v_n), _OUT, (v_y - 0.22, centre_n + v_n)),
        Arrow(above, "u", (-in_x, 0.0), (0.0, 0.0), _IN, (-in_x + 0.05, 0.2)),
        Arrow(above, "v", (0.0, 0.0), (v_x, -v_y), _OUT, (v_x - 0.12, -v_y + 0.2)),
        Arrow(above, "$U_t$", (0.0, 0.0), slip, style.COLOURS[2], (slip[0] + 0.22, slip[1] - 0.12)),
        Arrow(above, "$V_t$", (0.0, 0.0), after, style.COLOURS[3], (after[0] - 0.12, after[1] - 0.22)),
    )


def rows() -> Iterator[Row]:
    """Ends of every arrow, in sphere radii."""
    for arrow in arrows():
        label = arrow.label.replace("$", "")
        yield Row(arrow.view, "other", f"{label} tail", *arrow.tail)
        yield Row(arrow.view, "other", f"{label} head", *arrow.head)


def draw_impact() -> Figure:
    """Fig. 1, 174 mm wide."""
    r = impact()
    with style.drawing():
        figure = style.new_figure(WIDTH_MM, 0.38 * WIDTH_MM / style.MM_PER_INCH)
        views = figure.subplots(1, 3)
        for axes, name in zip(views, ("a: along y", "b: along x", "c: along z"), strict=True):
            axes.set_aspect("equal")
            axes.set_axis_off()
            axes.set_xlim(-2.1, 2.1)
            axes.set_ylim(*((-1.9, 1.9) if name[0] == "c" else (-0.95, 2.85)))
            axes.set_title(f"{name[0]})  view {name[3:]}", fontsize=8.5, y=0.99)
        _side(views[0], r)
        _front(views[1])
        _above(views[2], r)
        for arrow in arrows():
            _arrow(views["abc".index(arrow.view[0])], arrow)
        figure.suptitle("Fig. 1  Oblique impact with arbitrary spin", fontsize=8.5, weight="bold", y=0.985)
        spins = f"$R\\omega_x/u$ = {SPIN[0]:.2f}, $R\\omega_y/u$ = {SPIN[1]:.2f}"
        constants = "$e_n$ 0.90, $e_t$ −0.90, μ 0.15"
        words = f"Arrows to scale: γ = {GAMMA:.0f}°, {spins}; {constants}. z points into the wall."
        figure.text(0.5, 0.025, words, ha="center", fontsize=7.2)
        figure.subplots_adjust(0.01, 0.06, 0.99, 0.86, wspace=0.03)
    return figure


def _side(axes: Axes, r: Rebound) -> None:
    _wall(axes)
    _sphere(axes, _CENTRE)
    axes.plot([0.0, 0.0], [1.0, _NORMAL_END], color=GREY, lw=0.7, ls=(0, (4, 3)))
    _angle(axes, 90.0, 90.0 + GAMMA, "γ", 1.0)
    _angle(axes, 90.0 - math.degrees(float(r.delta)), 90.0, "δ", 1.25)
    _turn(axes, _CENTRE, 0.55, "$\\omega_y$", (0.0, 0.3))
    _triad(axes, "x", "z")


def _front(axes: Axes) -> None:
    _wall(axes)
    _sphere(axes, _CENTRE)
    _turn(axes, _CENTRE, 0.55, "$\\omega_x$", (0.0, 0.3))
    _triad(axes, "y", "z")


def _above(axes: Axes, r: Rebound) -> None:
    _sphere(axes, (0.0, 0.0))
    axes.plot([-1.9, 1.9], [0.0, 0.0], color=GREY, lw=0.7, ls=(0, (4, 3)))
    deviation = -math.degrees(float(r.lambda_))  # y is down in this view
    _angle(axes, min(0.0, deviation), max(0.0, deviation), "λ", 1.45, (0.0, 0.0))
    direction = -math.degrees(math.atan2(float(r.incidence.slip_y), float(r.incidence.slip_x)))
    _angle(axes, min(0.0, direction), max(0.0, direction), "σ", 1.15, (0.0, 0.0))
    _turn(axes, (0.0, 0.0), 0.42, "$\\omega_z$", (-0.62, 0.25), start=100.0)
    _triad(axes, "x", "y", (-1.75, -1.25))


def _arrow(axes: Axes, arrow: Arrow) -> None:
    axes.annotate(
        "",
        arrow.head,
        arrow.tail,
        arrowprops={
            "arrowstyle": "-|>",
            "color": arrow.colour,
            "lw": 1.5,
            "shrinkA": 0,
            "shrinkB": 0,
            "mutation_scale": 9,
        },
        zorder=5,
    )
    axes.text(*arrow.beside, arrow.label, color=arrow.colour, ha="center", va="center", fontsize=9)


def _sphere(axes: Axes, centre: tuple[float, float]) -> None:
    from matplotlib.patches import Circle

    axes.add_patch(Circle(centre, 1.0, fc="#F2F2F2", ec="0.25", lw=0.9, zorder=1))
    axes.plot(*centre, marker="o", ms=2.5, color="0.25", zorder=6)


def _wall(axes: Axes) -> None:
    axes.axhspan(-0.22, 0.0, fc="white", ec="0.4", hatch="/////", lw=0.0, zorder=0.5)
    axes.axhline(0.0, color="0.25", lw=1.0, zorder=2)


def _angle(
    axes: Axes, low: float, high: float, word: str, radius: float, at: tuple[float, float] = _CENTRE
) -> None:
    from matplotlib.patches import Arc

    axes.add_patch(Arc(at, 2 * radius, 2 * radius, theta1=low, theta2=high, color=GREY, lw=0.8, zorder=4))
    middle = math.radians((low + high) / 2.0)
    place = at[0] + (radius + 0.17) * math.cos(middle), at[1] + (radius + 0.17) * math.sin(middle)
    axes.text(*place, word, ha="center", va="center", color=GREY)


def _turn(
    axes: Axes,
    centre: tuple[float, float],
    radius: float,
    word: str,
    place: tuple[float, float],
    start: float = 200.0,
) -> None:
    """A positive spin: counterclockwise in the views along y and x, clockwise seen along z."""
    from matplotlib.patches import FancyArrowPatch

    ends = [math.radians(start), math.radians(start + 140.0)]
    if word == "$\\omega_z$":
        ends.reverse()
    points = [(centre[0] + radius * math.cos(a), centre[1] + radius * math.sin(a)) for a in ends]
    bow = 0.75 if ends[0] < ends[1] else -0.75
    arrow = FancyArrowPatch(
        *points,
        connectionstyle=f"arc3,rad={bow}",
        arrowstyle="-|>",
        mutation_scale=7,
        color="0.25",
        lw=1.0,
        zorder=4,
    )
    axes.add_patch(arrow)
    axes.text(place[0], centre[1] - place[1], word, ha="center", va="center", zorder=6)


def _triad(axes: Axes, across: str, down: str, corner: tuple[float, float] = (-1.75, -0.4)) -> None:
    for word, step in ((across, (0.5, 0.0)), (down, (0.0, -0.4))):
        head = corner[0] + step[0], corner[1] + step[1]
        axes.annotate("", head, corner, arrowprops={"arrowstyle": "->", "color": GREY, "lw": 0.8})
        axes.text(head[0] + 0.2 * step[0] + 0.05, head[1] + 0.3 * step[1], word, color=GREY, fontsize=7)


def draw_springs() -> Figure:
    """Fig. 2, 85 mm wide. It holds no numbers."""
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
