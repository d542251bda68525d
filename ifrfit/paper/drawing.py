"""Draw a scene: data with curves and bands, residuals under them, a legend under both."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from ifrfit.paper.scene import Scene
from ifrfit.report import style
from ifrfit.report.figures import LINE, NON_BREAKING, Legend
from ifrfit.report.panels import Look, draw_curve, draw_points, draw_residuals, handle
from ifrfit.report.regimes import draw_strip, shade
from ifrfit.report.style import GREY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_TITLE_CHARACTERS = 52
_LEGEND_CHARACTERS = 60


def draw(scene: Scene) -> Figure:
    """Figure of a scene, 85 mm wide, not known to pyplot."""
    residuals = any(points.residual is not None for points in scene.points)
    strips = len(scene.regimes) if len(scene.regimes) > 1 else 0
    with style.drawing():
        entries = _legend_entries(scene)
        lines = sum(label.count("\n") + 1 for _, label in entries)
        legend = Legend(entries, 1, LINE * lines + 0.08)
        title = _title(scene)
        panel = 2.25 + (0.75 if residuals else 0.0) + 0.15 * strips
        height = panel + legend.height + 0.15 * (title.count("\n") + 1)
        figure = style.new_figure(style.PANEL_WIDTH_MM, height, "constrained")
        figure.get_layout_engine().set(w_pad=0.03, h_pad=0.025, hspace=0.02)  # type: ignore[union-attr, call-arg]
        figure.suptitle(title, fontsize=7.4, weight="bold", linespacing=1.25)
        ratios = [0.15 * strips, 2.0, 0.7 if residuals else 0.0]
        used = [i for i, ratio in enumerate(ratios) if ratio > 0.0]
        grid = figure.add_gridspec(len(used), 1, height_ratios=[ratios[i] for i in used], hspace=0.03)
        data = figure.add_subplot(grid[used.index(1)])
        _draw_data(data, scene)
        if residuals:
            below = figure.add_subplot(grid[used.index(2)], sharex=data)
            draw_residuals(below, scene.points, Look())
            below.set_xlabel(scene.x.label)
            if len(scene.regimes) == 1:
                shade(below, scene.regimes[0], words=False)
            data.tick_params(labelbottom=False)
            figure.align_ylabels([data, below])
        else:
            data.set_xlabel(scene.x.label)
        if strips:
            draw_strip(figure.add_subplot(grid[used.index(0)], sharex=data), scene.regimes)
        legend.draw(figure)
        style.fix_layout(figure)
    return figure


def _title(scene: Scene) -> str:
    lines = "\n".join((scene.title, *scene.warnings)).split("\n")
    title = "\n".join(textwrap.fill(line, _TITLE_CHARACTERS) for line in lines)
    return title.replace(NON_BREAKING, " ")


def _draw_data(axes: Axes, scene: Scene) -> None:
    for curve in scene.curves:
        draw_curve(axes, curve, front=3.0 if curve.kind == "recovered" else 3.5)
    for points in scene.points:
        draw_points(axes, points, Look())
    _set_x(axes, scene)
    axes.set_ylim(*limits(scene))
    if scene.y.in_degrees:
        low, high = limits(scene)
        step = 5.0 if high - low < 40.0 else 30.0
        axes.set_yticks(np.arange(np.ceil(low / step), np.floor(high / step) + 1.0) * step)
    axes.set_ylabel(scene.y.label)
    if len(scene.regimes) == 1:
        shade(axes, scene.regimes[0], words=True)
    if scene.stand_in:
        style.write_watermark(axes, size=30, height=0.42)


def limits(scene: Scene) -> tuple[float, float]:
    """Limits of the vertical axis: the range of the table, wider where points lie beyond it.

    An error bar may ask for room as far as a third of the range, no more.
    """
    low, high = scene.y.low, scene.y.high
    longest = (high - low) / 3.0
    for points in scene.points:
        low = min(low, float(np.min(points.y - np.minimum(points.sigma, longest))))
        high = max(high, float(np.max(points.y + np.minimum(points.sigma, longest))))
    room = high - low
    return low - 0.03 * room, high + 0.12 * room


def _set_x(axes: Axes, scene: Scene) -> None:
    x = scene.x
    if x.logarithmic:
        axes.set_xscale("log")
    axes.set_xlim(x.low, x.high)
    axes.set_xticks(x.ticks, [f"{tick:g}" for tick in x.ticks])
    axes.minorticks_off()


def _legend_entries(scene: Scene) -> tuple[tuple[Any, str], ...]:
    """Handles with their labels: series, lines, bands, marks, then transitions and notes."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    entries = [*_point_entries(scene), *_curve_entries(scene), *_mark_entries(scene)]
    nothing = Line2D([], [], ls="none")
    shade = Patch(fc="0.5", alpha=0.3, lw=0)
    mark = (shade, Line2D([], [], ls="none", marker="|", ms=8.0, color=GREY), shade)
    banded = any(mark.low is not None for part in scene.regimes for mark in part.marks)
    for note in scene.notes:
        entries.append((mark if banded and note.startswith("transition") else nothing, note))
    return tuple((handle, _wrapped(label)) for handle, label in entries)


def _wrapped(label: str) -> str:
    # signs of mathematics take no room of their own
    extra = sum(label.count(sign) for sign in ("$", "\\mathrm", "{", "}", "_"))
    return textwrap.fill(label, _LEGEND_CHARACTERS + extra).replace(NON_BREAKING, " ")


def _point_entries(scene: Scene) -> list[tuple[Any, str]]:
    entries: list[tuple[Any, str]] = []
    for points in scene.points:
        own, open_all = points.series_style, points.sticking is not None and points.sticking.all()
        mark = handle(own.marker, 3.8, "white" if open_all else own.colour, own.colour)
        entries.append((mark, points.label))
    return entries


def _curve_entries(scene: Scene) -> list[tuple[Any, str]]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles_by_label: dict[str, list[Any]] = {}
    for curve in scene.curves:
        line = Line2D([], [], color=curve.pen.colour, ls=curve.pen.dashes, lw=curve.pen.width)
        handles = handles_by_label.setdefault(curve.label, [])
        if not handles or curve.kind == "recovered":
            handles.append(line)
    entries = [(tuple(lines), label) for label, lines in handles_by_label.items()]
    banded = {curve.label for curve in scene.curves if curve.credible is not None}
    if banded:
        light, dark = (Patch(fc=GREY, alpha=alpha, lw=0) for alpha in (0.18, 0.4))
        dots = Line2D([], [], color=GREY, lw=0.6, ls=(0, (1, 1.5)))
        bands = "68, 95 % credible; dotted: 95 % of further measurements"
        place = max(i for i, (_, label) in enumerate(entries) if label in banded)
        entries.insert(place + 1, ((light, dark, dots), bands))
    return entries


def _mark_entries(scene: Scene) -> list[tuple[Any, str]]:
    entries: list[tuple[Any, str]] = []
    sticking = [bool(s) for p in scene.points if p.sticking is not None for s in p.sticking]
    if any(sticking) and not all(sticking):
        open_and_filled = handle("o", 3.8, "white"), handle("o", 3.8, GREY)
        entries.append((open_and_filled, "open: sticks; filled: slides"))
    if any(p.is_outlier is not None and p.is_outlier.any() for p in scene.points):
        entries.append((handle("o", 8.0, "none", "black"), "ringed: outlier"))
    return entries
