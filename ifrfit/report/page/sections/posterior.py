"""Marginals and pairs of the constants."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.estimators import title_of
from ifrfit.inference.model.entry_names import quantity_of
from ifrfit.inference.result.types import Interval
from ifrfit.report.page.blocks import Block, Paragraph, Picture, Pictures, Table
from ifrfit.report.page.charts.chart import Axis, Band, Chart, Line, Mark, Panel, Points, symbol
from ifrfit.report.page.charts.scales import Ticks
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.style import COLOURS, GREY, RESIDUAL_DASHES

MOST = 6
Array = NDArray[np.float64]

CELL_MM, LEFT_MM, BOTTOM_MM, GAP_MM, TOP_MM = 36.0, 15.0, 11.0, 3.2, 2.0  # the gap holds a note on ticks
BINS = 30
LONGEST = 10  # characters of a series' name
SHOWN = 400  # draws drawn as points
GRID = 40  # cells a side behind the contours
SMOOTH = 1.6  # cells
CORRELATED = 0.6  # from here on draws are smoothed along their own axes
ONE_LINE = 0.9999


def build(given: ReportInput) -> Sequence[Block] | None:
    """Corner plot of the draws, and the correlations; None where every constant is fixed."""
    result = given.result
    draws = given.appraisal.draws
    estimates = given.free | given.kappas
    names = [name for name in estimates if name in draws and draws[name].std() > 0.0]
    if not names:
        return None
    if not any(quantity_of(name) == "e_n" for name in given.free):
        # kappa is mu times a number then
        names = [name for name in names if not name.startswith("kappa")]
    shown = names[:MOST]
    columns = {name: draws[name].to_numpy(dtype=float) for name in shown}
    if result.state.sample is None:
        law = "Gaussian around the optimum, cut at the bounds"
    else:
        law = title_of(result.method)
    left_out = f" Not shown: {', '.join(names[MOST:])}." if len(names) > MOST else ""
    described = "; ".join(
        f"{name}: mean {column.mean():.4g}, sd {column.std():.2g}" for name, column in columns.items()
    )
    blocks: list[Block] = [
        Pictures(
            (
                Picture(
                    "corner",
                    "Marginals and pairs",
                    f"{described}.",
                    draw_corner(columns, {name: estimates[name].interval95 for name in shown}),
                ),
            ),
            f"{len(draws)} draws, {law}. Diagonal: marginal, with its median and the stated 95 % interval "
            f"(dashed). Below: pairs with the contours that hold 68 % (solid) and 95 % (dashed).{left_out}",
        )
    ]
    labels, matrix = result.correlation.names, result.correlation.matrix
    if len(labels) > 1:
        rows = tuple(
            (label, *(f"{matrix[i, j]:+.3f}" for j in range(len(labels)))) for i, label in enumerate(labels)
        )
        blocks.append(
            Table(
                "Correlation of the free constants.",
                ("", *labels),
                rows,
                frozenset(range(1, len(labels) + 1)),
            )
        )
    if result.state.sample is None:
        blocks.append(
            Paragraph("This method has no posterior: the draws show the curvature at the optimum.", "note")
        )
    return blocks


def draw_corner(columns: Mapping[str, Array], intervals: Mapping[str, Interval]) -> Chart:
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
    extent = n * CELL_MM + (n - 1) * GAP_MM
    windows = {name: _window(column, intervals.get(name, ())) for name, column in columns.items()}
    panels = []
    for row, below in enumerate(names):
        for column, across in enumerate(names[: row + 1]):
            x = _axis(across, windows[across], is_outer=row == n - 1)
            if row == column:
                marks, top = _marginal(columns[across], windows[across], intervals.get(across))
                y = Axis(0.0, top, ticks=Ticks((), ()))
            else:
                marks = _pair(columns[across], columns[below], windows[across], windows[below])
                y = _axis(below, windows[below], is_outer=column == 0)
            left, top = (
                edge + place * (CELL_MM + GAP_MM) for edge, place in ((LEFT_MM, column), (TOP_MM, row))
            )
            panels.append(Panel(left, top, CELL_MM, CELL_MM, x, y, tuple(marks)))
    return Chart(LEFT_MM + extent + TOP_MM, TOP_MM + extent + BOTTOM_MM, tuple(panels))


def _axis(name: str, window: Interval, *, is_outer: bool) -> Axis:
    label = symbol(name, LONGEST) if is_outer else ""
    return Axis(*window, label, most=4, labelled=is_outer, inside=True)


def _window(column: Array, interval: Sequence[float]) -> Interval:
    """The range that holds all but a few draws and the finite ends of an interval, with some room."""
    ends = [end for end in interval if math.isfinite(end)]
    low, high = (
        f([end, *ends]) for f, end in zip((min, max), np.quantile(column, (0.002, 0.998)), strict=True)
    )
    room = 0.04 * (high - low) or 1e-6 * max(1.0, abs(float(low)))
    return float(low - room), float(high + room)


def _marginal(column: Array, window: Interval, interval: Interval | None) -> tuple[list[Mark], float]:
    """A histogram, its median and interval; and the upper end of its axis."""
    counts, edges = np.histogram(column, bins=BINS, range=window)
    top = 1.12 * float(counts.max())
    x, heights = np.repeat(edges, 2), np.concatenate(([0.0], np.repeat(counts, 2), [0.0]))
    median = np.full(2, float(np.median(column)))
    marks: list[Mark] = [
        Band(x, np.zeros(x.size), heights, COLOURS[0], 0.3),
        Line(x, heights, COLOURS[0], 1.0),
        Line(median, np.array([0.0, top]), GREY, 1.0),
    ]
    for end in interval or ():
        if window[0] < end < window[1]:
            marks.append(Line(np.full(2, end), np.array([0.0, top]), GREY, 0.8, RESIDUAL_DASHES))
    return marks, top


def _pair(x: Array, y: Array, across: Interval, below: Interval) -> list[Mark]:
    """Some of the draws, and the contours around most of all of them."""
    step = max(1, x.size // SHOWN)
    marks: list[Mark] = [Points(x[::step], y[::step], "o", 0.9, COLOURS[0], "none", opacity=0.5)]
    found = regions(x, y, across, below)
    if found is not None:
        for level, colour, width, dashes in zip(
            found.levels, (COLOURS[1], COLOURS[0]), (0.9, 1.3), ("--", "-"), strict=True
        ):
            marks += [Line(line[:, 0], line[:, 1], colour, width, dashes) for line in contours(found, level)]
    return marks


def contours(found: Regions, level: float) -> list[Array]:
    """Lines where a density has a level, (k, 2) each."""
    from contourpy import contour_generator

    lines = contour_generator(found.x, found.y, found.density).lines(level)
    return [np.asarray(line) for line in lines]


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
    density: Array = smoothed(counts, SMOOTH)
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


def smoothed(counts: Array, sd: float) -> Array:
    """A table, (m, m), smoothed along both axes by a Gaussian of that many cells, mirrored at its edges."""
    m = len(counts)
    farthest = round(4.0 * sd)
    steps = np.arange(-farthest, farthest + 1)
    weights = np.exp(-0.5 * (steps / sd) ** 2)
    # cells beyond an edge are those before it, the last one first
    sources = (np.arange(m)[:, None] + steps) % (2 * m)
    sources = np.minimum(sources, 2 * m - 1 - sources)
    kernel = np.zeros((m, m))
    np.add.at(kernel, (np.arange(m)[:, None], sources), weights / weights.sum())
    return np.asarray(kernel @ counts @ kernel.T)


def _around(column: Array) -> Interval:
    room = 0.1 * float(np.ptp(column))
    return float(column.min()) - room, float(column.max()) + room


SECTION = ReportSection("posterior", "Posterior", build, frozenset({"table"}))
