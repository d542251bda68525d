"""Marginals and pairs of the posterior."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.result.types import Interval
from ifrfit.report.page.drawings.canvas import symbol
from ifrfit.report.style import COLOURS, GREY, MM_PER_INCH, drawing, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

CELL_MM, LEFT_MM, BOTTOM_MM, GAP_MM = 36.0, 15.0, 13.0, 2.0
BINS = 30
LONGEST = 10  # characters of a series' name
SHOWN = 400  # draws drawn as points
GRID = 40  # cells a side behind the contours
SMOOTH = 1.6  # cells
CORRELATED = 0.6  # from here on draws are smoothed along their own axes
ONE_LINE = 0.9999


def draw_corner(columns: Mapping[str, Array], intervals: Mapping[str, Interval]) -> Figure:
    """Histograms on the diagonal; points with the contours of 68 and 95 % under it.

    Parameters
    ----------
    columns : mapping of str to ndarray, (m,)
        Draws by name of the constant.
    intervals : mapping of str to tuple of float
        95 % interval of each, shaded; infinite ends run out of the picture.
    """
    names = list(columns)
    n = len(names)
    width = LEFT_MM + n * CELL_MM + (n - 1) * GAP_MM + 2.0
    height = BOTTOM_MM + n * CELL_MM + (n - 1) * GAP_MM + 2.0
    windows = {name: _window(column) for name, column in columns.items()}
    with drawing():
        figure = new_figure(width, height / MM_PER_INCH)
        for row, below in enumerate(names):
            for column, across in enumerate(names[: row + 1]):
                left = LEFT_MM + column * (CELL_MM + GAP_MM)
                bottom = BOTTOM_MM + (n - 1 - row) * (CELL_MM + GAP_MM)
                axes = figure.add_axes((left / width, bottom / height, CELL_MM / width, CELL_MM / height))
                axes.set_xlim(windows[across])
                if row == column:
                    _marginal(axes, columns[across], windows[across], intervals.get(across))
                else:
                    _pair(axes, columns[across], columns[below], windows[across], windows[below])
                _label(axes, across if row == n - 1 else "", below if column == 0 and row else "")
                if row == column:
                    axes.set_yticks([])
    return figure


def _label(axes: Axes, across: str, below: str) -> None:
    axes.locator_params(nbins=4)
    axes.tick_params(labelbottom=bool(across), labelleft=bool(below), top=False, right=False)
    axes.tick_params(axis="x", labelrotation=35)
    if across:
        axes.set_xlabel(symbol(across, LONGEST), labelpad=1.0)
    if below:
        axes.set_ylabel(symbol(below, LONGEST), labelpad=1.0)


def _window(column: Array) -> Interval:
    """The range that holds all but a few draws, with some room."""
    low, high = np.quantile(column, (0.002, 0.998))
    room = 0.04 * (high - low) or 1e-6 * max(1.0, abs(float(low)))
    return float(low - room), float(high + room)


def _marginal(axes: Axes, column: Array, window: Interval, interval: Interval | None) -> None:
    counts, edges = np.histogram(column, bins=BINS, range=window)
    axes.stairs(counts, edges, fill=True, color=COLOURS[0], alpha=0.3)
    axes.stairs(counts, edges, color=COLOURS[0], lw=1.0)
    axes.axvline(float(np.median(column)), color=GREY, lw=1.0)
    if interval is not None:
        for end in interval:
            if window[0] < end < window[1]:
                axes.axvline(end, color=GREY, lw=0.8, ls=(0, (4, 3)))
    axes.set_ylim(0.0, 1.12 * float(counts.max()))


def _pair(axes: Axes, x: Array, y: Array, across: Interval, below: Interval) -> None:
    axes.set_ylim(below)
    step = max(1, x.size // SHOWN)
    axes.plot(x[::step], y[::step], ls="none", marker=".", ms=1.8, mew=0.0, color=COLOURS[0], alpha=0.5)
    found = regions(x, y, across, below)
    if found is not None:
        axes.contour(
            found.x,
            found.y,
            found.density,
            levels=found.levels,
            colors=[COLOURS[1], COLOURS[0]],
            linewidths=(0.9, 1.3),
            linestyles=("--", "-"),
        )


@dataclass(frozen=True)
class Regions:
    """A smoothed density on a mesh, (m, m) each, and its levels around 95 and 68 % of the draws."""

    x: Array
    y: Array
    density: Array
    levels: tuple[float, float]


def regions(x: Array, y: Array, across: Interval, below: Interval) -> Regions | None:
    """Where 68 and 95 % of the draws lie; None where they fill no area.

    Draws that are correlated are smoothed along their own axes, or a narrow ridge would grow fat. Others
    along the plot's, with edges that mirror: a density that ends at a bound is not smeared over it.
    """
    from scipy.ndimage import gaussian_filter

    correlation = float(np.corrcoef(x, y)[0, 1])
    if not abs(correlation) < ONE_LINE:
        return None
    centre, turn = np.zeros(2), np.eye(2)
    if abs(correlation) < CORRELATED:
        u, v, ranges = x, y, (across, below)
    else:
        centre = np.array([x.mean(), y.mean()])
        turn = np.asarray(np.linalg.cholesky(np.cov(x, y)))
        u, v = np.linalg.solve(turn, np.stack((x, y)) - centre[:, None])
        ranges = _around(u), _around(v)
    counts, edges_u, edges_v = np.histogram2d(u, v, bins=GRID, range=ranges)
    density: Array = gaussian_filter(counts, SMOOTH, mode="reflect")
    falling = np.sort(density.ravel())[::-1]
    share = np.cumsum(falling) / float(falling.sum())
    places = np.minimum(np.searchsorted(share, (0.95, 0.68)), share.size - 1)
    outer, inner = (float(level) for level in falling[places])
    if not 0.0 < outer < inner:
        return None
    middle_u, middle_v = (0.5 * (edges[1:] + edges[:-1]) for edges in (edges_u, edges_v))
    mesh = np.stack(np.meshgrid(middle_u, middle_v, indexing="ij"))
    placed = np.einsum("ij,jkl->ikl", turn, mesh) + centre[:, None, None]
    return Regions(placed[0], placed[1], density, (outer, inner))


def _around(column: Array) -> Interval:
    room = 0.1 * float(np.ptp(column))
    return float(column.min()) - room, float(column.max()) + room
