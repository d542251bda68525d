"""The cells of a piecewise problem: their quadratics, their bounds, their constrained minima."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.optimize.active_sets import FLAT, size_of, stationary_points
from ifrfit.inference.optimize.piecewise import Array, PiecewiseProblem

_DOUBTFUL = 1e-9  # below this share the sums have too few digits left to solve the cell from them
_FEASIBLE = 1e-11  # slack of a constraint, relative to its terms
_STEP = 1e-10  # slack of a constraint in standard deviations
_FIRST = 8  # cells solved to get a first value
_BLOCK = 32768  # cells bounded at once
_CHUNK = 4096  # cells solved at once
_MOST = 512  # cells solved beyond need, to count local minima


@dataclass(frozen=True)
class Cells:
    """Quadratics t'Gt - 2 g't + s of all m cells; the cells run along the last axis."""

    gram: Array  # (q, q, m)
    slope: Array  # (q, m)
    square: Array  # (m,)
    count: NDArray[np.intp]  # rows that stick
    low: Array  # tau of the last sticking row (0 for none)
    high: Array  # tau of the first sliding row (inf for none)
    rounding: float  # relative error of a sum


@dataclass(frozen=True)
class Solved:
    """Constrained minima of some cells.

    Attributes
    ----------
    values, errors : ndarray
        Minima, and their rounding errors.
    points : ndarray
        Where they are, (m, q).
    """

    values: Array
    errors: Array
    points: Array


@dataclass(frozen=True)
class Branched:
    """Cells solved, and a lower bound of every cell."""

    values: Array
    errors: Array
    points: Array
    solved: NDArray[np.intp]
    bounds: Array
    counted: bool  # whether every cell within 4 of the least value is among the solved

    @property
    def best(self) -> int:
        """Place of the best among the solved."""
        return int(np.argmin(self.values))

    @property
    def value(self) -> float:
        """Least value."""
        return float(self.values[self.best])

    @property
    def point(self) -> Array:
        """Where it is."""
        return np.asarray(self.points[self.best])

    @property
    def cell(self) -> int:
        """In which cell."""
        return int(self.solved[self.best])

    def lowest_bound_elsewhere(self) -> float:
        """Least bound over all cells but those that hold the least value."""
        rest = np.ones(self.bounds.size, dtype=bool)
        same = self.values <= self.value + self.errors + self.errors[self.best]
        rest[self.solved[same]] = False
        return float(self.bounds[rest].min(initial=np.inf))


def build(problem: PiecewiseProblem) -> Cells:
    """Sum up the quadratics of all cells; rows of equal tau change together."""
    tau, q = problem.tau, problem.kappa.size
    change = changes(tau)
    count = np.flatnonzero(change)
    stick, slide = ([*rows.columns, rows.target] for rows in (problem.stick, problem.slide))
    always = np.column_stack((problem.always.design, problem.always.target))
    constant = always.T @ always
    # one buffer serves all products: fresh memory for each would cost more than the sums
    product, running = np.empty(tau.size), np.empty(tau.size)
    distinct = count.size == change.size

    def total(i: int, j: int) -> Array:
        found = np.full(tau.size + 1, constant[i, j])
        first, second = stick[i], stick[j]
        if first is not None and second is not None:
            np.cumsum(np.multiply(first, second, out=product), out=running)
            found[1:] += running
        first, second = slide[i], slide[j]
        if first is not None and second is not None:
            np.cumsum(np.multiply(first, second, out=product)[::-1], out=running)
            found[-2::-1] += running
        return found if distinct else found[change]

    gram = np.empty((q, q, count.size))
    for i, j in itertools.combinations_with_replacement(range(q), 2):
        gram[i, j] = gram[j, i] = total(i, j)
    slope = np.array([total(i, q) for i in range(q)]).reshape(q, count.size)
    square = total(q, q)
    return Cells(
        gram,
        slope - problem.slope0[:, None],
        square,
        count,
        np.concatenate(([0.0], tau))[change],
        np.concatenate((tau, [np.inf]))[change],
        rounding_of(tau.size),
    )


def changes(tau: Array) -> NDArray[np.bool_]:
    """Which of the n + 1 numbers of sticking rows begin a cell, for tau in ascending order."""
    change = np.empty(tau.size + 1, dtype=bool)
    change[0] = change[-1] = True
    np.greater(tau[1:], tau[:-1], out=change[1:-1])
    return change


def rounding_of(n: int) -> float:
    """Relative error of a sum over n rows."""
    return 4.0 * np.finfo(float).eps * max(16.0, math.sqrt(n))


def unconstrained(cells: Cells) -> tuple[Array, NDArray[np.bool_]]:
    """Lower bound of every cell from its unconstrained minimum, and which cells the sums leave in doubt."""
    bounds, doubtful = np.empty(cells.square.size), np.empty(cells.square.size, dtype=bool)
    for start in range(0, bounds.size, _BLOCK):  # in blocks that stay in the cache
        at = slice(start, start + _BLOCK)
        bounds[at], doubtful[at] = _eliminate(
            cells.gram[:, :, at], cells.slope[:, at], cells.square[at], cells.rounding
        )
    return bounds, doubtful


def _eliminate(gram: Array, slope: Array, square: Array, rounding: float) -> tuple[Array, NDArray[np.bool_]]:
    """Elimination on the Jacobi-scaled matrices of many cells at once.

    A vanishing pivot means that the minimum lies along a line, which is no harm; a small one that its part
    has lost its digits.
    """
    q = slope.shape[0]
    size = [size_of(gram[i, i]) for i in range(q)]
    a = [[gram[i, j] / (size[i] * size[j]) for j in range(q)] for i in range(q)]
    z = [slope[i] / size[i] for i in range(q)]
    doubtful = np.zeros(square.size, dtype=bool)
    minimum, error = square.copy(), square.copy()
    for k in range(q):
        empty = gram[k, k] == 0.0
        doubtful |= ~empty & (a[k][k] < _DOUBTFUL)
        pivot = np.where(empty | ~(a[k][k] > FLAT), np.inf, a[k][k])
        part = z[k] * z[k] / pivot
        minimum -= part
        error += part / np.minimum(pivot, 1.0)
        for i in range(k + 1, q):
            factor = a[i][k] / pivot
            z[i] = z[i] - factor * z[k]
            for j in range(k + 1, q):
                a[i][j] = a[i][j] - factor * a[k][j]
    return minimum - rounding * error, doubtful


def constraints(problem: PiecewiseProblem, cells: Cells, which: NDArray[np.intp]) -> tuple[Array, Array]:
    """Walls (m, walls, q) and limits (m, walls) of the chosen cells: the domain, then the two kinks."""
    m = which.size
    walls = np.broadcast_to(problem.walls, (m, *problem.walls.shape))
    limits = np.broadcast_to(problem.limits, (m, problem.limits.size))
    low = cells.low[which, None]
    high = cells.high[which, None]
    # no kink below the first cell and above the last one: such walls are void
    open_start, open_end = low == 0.0, np.isinf(high)
    high = np.where(open_end, 0.0, high)
    low_wall = np.where(open_start, 0.0, low * problem.bound - problem.kappa)
    high_wall = np.where(open_end, 0.0, problem.kappa - high * problem.bound)
    low_limit = np.where(open_start, 1.0, problem.kappa0 - low * problem.bound0)
    high_limit = np.where(open_end, 1.0, high * problem.bound0 - problem.kappa0)
    walls = np.concatenate((walls, low_wall[:, None], high_wall[:, None]), axis=1)
    return walls, np.concatenate((limits, low_limit, high_limit), axis=1)


def _inside(
    t: Array, walls: Array, limits: Array, slack: Array, active: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Whether points t (m, faces, q) obey all constraints; the active ones hold by construction."""
    with np.errstate(invalid="ignore", over="ignore"):
        terms = walls[:, None] * t[:, :, None, :]
        size = np.abs(terms).sum(axis=3) + np.abs(limits)[:, None]
        obeyed = terms.sum(axis=3) - limits[:, None] <= _FEASIBLE * size + slack[:, None]
    return np.asarray((obeyed | active).all(axis=2))


def solve_cells(
    problem: PiecewiseProblem, cells: Cells, which: NDArray[np.intp], sd: Array | None = None
) -> Solved:
    """Constrained minimum of each chosen cell, exactly: the best stationary point over all its faces.

    Faces on which the quadratic is flat are passed over: then a face of lower dimension has the same value.
    `sd` is the size of a standard deviation of each unknown, by default from the cell's own matrix.
    """
    walls, limits = constraints(problem, cells, which)
    gram = np.moveaxis(cells.gram[:, :, which], -1, 0)
    slope, square = cells.slope[:, which].T, cells.square[which]
    q = walls.shape[2]
    # so small a part of a standard deviation moves no sum of squares; it matters where several walls meet
    if sd is None:
        diagonal = gram[:, range(q), range(q)]
        sd = np.where(diagonal > 0.0, 1.0 / size_of(diagonal), 0.0)
    slack = _STEP * (np.abs(walls) * sd[:, None, :]).sum(axis=2)
    t, good, active = stationary_points(gram, slope, walls, limits)
    good &= _inside(t, walls, limits, slack, active)
    curved = (gram[:, None] @ t[..., None])[..., 0] * t
    linear = slope[:, None, :] * t
    value = np.where(good, (curved - 2.0 * linear).sum(axis=2) + square[:, None], np.inf)
    cell, face = np.arange(which.size), value.argmin(axis=1)
    size = (np.abs(curved) + 2.0 * np.abs(linear)).sum(axis=2)[cell, face] + square
    return Solved(value[cell, face], cells.rounding * size, t[cell, face])


def branch(problem: PiecewiseProblem, cells: Cells) -> Branched:
    """Solve every cell whose bound does not lie above the best value, and those within 4 of it.

    The cells with the lowest bounds give a first value; all that its bound admits follow. The value only
    falls, so nothing that could hold the minimum is left out. A cell that the sums leave in doubt keeps the
    bound that needs no sums.
    """
    bounds, doubtful = unconstrained(cells)
    nothing = 0.0 if problem.pull is None else -np.inf
    bounds = np.where(doubtful, nothing, bounds if problem.pull is not None else np.maximum(bounds, 0.0))
    first = np.argpartition(bounds, min(_FIRST, bounds.size) - 1)[:_FIRST]
    parts = [solve_cells(problem, cells, first)]
    best = float((parts[0].values + parts[0].errors).min())
    admitted = bounds <= best
    near = bounds <= best + 4.0
    counted = int(near.sum()) <= _MOST
    if counted:
        admitted |= near
    else:
        admitted[[0, -1]] |= near[[0, -1]]  # whether the ends describe the data is asked for
    admitted[first] = False
    more = np.flatnonzero(admitted)
    for start in range(0, more.size, _CHUNK):
        parts.append(solve_cells(problem, cells, more[start : start + _CHUNK]))
    solved = np.concatenate((first, more))
    values = np.concatenate([part.values for part in parts])
    errors = np.concatenate([part.errors for part in parts])
    bounds[solved] = np.where(doubtful[solved], nothing, values - errors)
    points = np.concatenate([part.points for part in parts])
    return Branched(values, errors, points, solved, bounds, counted)
