"""Distinct local minima of a piecewise problem, from its cells' own minima."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.optimize.piecewise import NEAR, Array, PiecewiseProblem
from ifrfit.inference.optimize.piecewise_quadratic import PiecewiseQuadratic
from ifrfit.inference.optimize.solved_cells import SolvedCells


def local_minima(
    problem: PiecewiseProblem, quadratic: PiecewiseQuadratic, found: SolvedCells
) -> list[tuple[float, Array]]:
    """Distinct local minima within `NEAR` of the least, best first.

    A cell's minimum on a kink is one of the whole only if the cell beyond the kink goes no lower; equal
    neighbours are one minimum. Where there are too many cells for that, each unbroken run of cells whose
    bounds lie within `NEAR` counts as one.
    """
    if not found.all_near_solved:
        return _runs(found)
    near = found.values <= found.value + NEAR
    order = np.argsort(found.cells[near])
    number, value, point = found.cells[near][order], found.values[near][order], found.points[near][order]
    tolerance = max(1e-9 * abs(found.value), float(found.errors[found.best]), 1e-12)
    kappa, bound = point @ problem.kappa + problem.kappa0, point @ problem.bound + problem.bound0
    neighbours = np.diff(number) == 1
    kink = quadratic.high[number[:-1]]
    linked = neighbours & (_touches(kappa[:-1], bound[:-1], kink) | _touches(kappa[1:], bound[1:], kink))
    minima: list[tuple[float, Array]] = []
    for chain in np.split(np.arange(number.size), np.flatnonzero(~linked) + 1):
        minima += _valleys(value[chain], point[chain], tolerance)
    return sorted(minima, key=lambda item: item[0])


def _runs(found: SolvedCells) -> list[tuple[float, Array]]:
    """Best solved cell of each unbroken run of cells with bounds within `NEAR`, where it has one."""
    near = found.bounds <= found.value + NEAR
    run = np.cumsum(near[1:] & ~near[:-1]) if near.size > 1 else np.zeros(0, dtype=np.intp)
    run = np.concatenate(([0], run))[found.cells]
    minima = []
    for number in np.unique(run):
        at = np.flatnonzero((run == number) & (found.values <= found.value + NEAR))
        if at.size:
            best = at[np.argmin(found.values[at])]
            minima.append((float(found.values[best]), found.points[best]))
    return sorted(minima, key=lambda item: item[0])


def _touches(kappa: Array, bound: Array, tau: Array) -> NDArray[np.bool_]:
    """Whether a point lies on the kink at tau."""
    finite = np.where(np.isinf(tau), 0.0, tau)
    near = np.abs(kappa - finite * bound) <= 1e-9 * (np.abs(kappa) + np.abs(finite * bound))
    return np.asarray(near & ~np.isinf(tau))


def _valleys(values: Array, points: Array, tolerance: float) -> list[tuple[float, Array]]:
    """Local minima of a chain of cells that touch: those with no lower neighbour, plateaus counted once."""
    found = []
    i = 0
    while i < values.size:
        end = i
        while end + 1 < values.size and abs(values[end + 1] - values[i]) <= tolerance:
            end += 1
        left = i > 0 and values[i - 1] < values[i] - tolerance
        right = end + 1 < values.size and values[end + 1] < values[i] - tolerance
        if not left and not right:
            found.append((float(values[i]), points[i]))
        i = end + 1
    return found
