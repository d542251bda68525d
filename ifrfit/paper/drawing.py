"""Draw a scene: data with curves and bands, residuals under them, a legend under both."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

import numpy as np

from ifrfit.paper.legend_entries import entries_of
from ifrfit.paper.scene import Curve, Points, Scene
from ifrfit.report import style
from ifrfit.report.figures import NON_BREAKING
from ifrfit.report.legend import LINE, Legend
from ifrfit.report.markers import draw_markers, draw_residual_axis, ring_outliers
from ifrfit.report.shading import draw_strip, shade

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_TITLE_CHARACTERS = 52


def draw(scene: Scene) -> Figure:
    """Figure of a scene, 85 mm wide, not known to pyplot."""
    residuals = any(points.residual is not None for points in scene.points)
    strips = len(scene.regimes) if len(scene.regimes) > 1 else 0
    with style.drawing():
        entries = entries_of(scene)
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
            _draw_residuals(below, scene)
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
        _draw_curve(axes, curve)
    for points in scene.points:
        _draw_points(axes, points)
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
        style.write_watermark(axes, "STAND-IN", size=30, height=0.42)


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


def _draw_curve(axes: Axes, curve: Curve) -> None:
    pen = curve.pen
    if curve.predictive is not None:
        for end in (curve.predictive.lo95, curve.predictive.hi95):
            axes.plot(curve.x, end, color=pen.colour, lw=0.6, ls=(0, (1, 1.5)), alpha=0.8, zorder=2.5)
    if curve.credible is not None:
        band = curve.credible
        for low, high, alpha in ((band.lo95, band.hi95, 0.18), (band.lo68, band.hi68, 0.26)):
            axes.fill_between(curve.x, low, high, color=pen.colour, alpha=alpha, lw=0.0, zorder=2)
    front = 3.0 if curve.kind == "recovered" else 3.5
    axes.plot(curve.x, curve.y, color=pen.colour, ls=pen.dashes, lw=pen.width, zorder=front)


def _draw_points(axes: Axes, points: Points) -> None:
    axes.errorbar(
        points.x,
        points.y,
        yerr=points.sigma,
        fmt="none",
        ecolor=points.series_style.colour,
        elinewidth=0.7,
        alpha=0.8,
        zorder=4,
    )
    _markers(axes, points, points.y, 3.8)


def _markers(axes: Axes, points: Points, y: np.ndarray, size: float) -> None:
    sticking = np.zeros(points.x.size, dtype=bool) if points.sticking is None else points.sticking
    draw_markers(axes, points.x, y, sticking, points.series_style, size)
    if points.is_outlier is not None:
        ring_outliers(axes, points.x, y, points.is_outlier, size=8.5)


def _draw_residuals(axes: Axes, scene: Scene) -> None:
    fitted = [(points, points.residual) for points in scene.points if points.residual is not None]
    for points, residual in fitted:
        _markers(axes, points, residual, 3.2)
    draw_residual_axis(axes, np.concatenate([residual for _, residual in fitted]))
    axes.set_xlabel(scene.x.label)
    if len(scene.regimes) == 1:
        shade(axes, scene.regimes[0], words=False)


def _set_x(axes: Axes, scene: Scene) -> None:
    x = scene.x
    if x.logarithmic:
        axes.set_xscale("log")
    axes.set_xlim(x.low, x.high)
    axes.set_xticks(x.ticks, [f"{tick:g}" for tick in x.ticks])
    axes.minorticks_off()
