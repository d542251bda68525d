"""Regions that hold 68 and 95 % of the draws of two quantities, and the lines around them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.result.types import Interval

Array = NDArray[np.float64]

GRID = 40  # cells a side behind the contours
SMOOTH = 1.6  # cells
CORRELATED = 0.6  # from here on draws are smoothed along their own axes
ONE_LINE = 0.9999


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
