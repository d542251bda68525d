"""One piecewise problem many times over, with other weights and other targets: all certified minima at once.

What `ifrfit.inference.optimize.piecewise.minimise` does for one problem is done here for all replicates along
an axis: prefix sums of the sticking rows and suffix sums of the sliding rows give the quadratics of all cells
of all replicates, unconstrained minima bound the cells, and whatever a bound admits is solved exactly. A
replicate that rounding leaves in doubt is handed to `minimise` itself.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.diagnostics.thresholds import GAP, RANK
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.piecewise import Array, PiecewiseProblem, Rows, minimise
from ifrfit.inference.optimize.regime_sums import Cells, changes, rounding_of, solve_cells, unconstrained

_FIRST = 3  # cells of each replicate that are solved to get a first value
_CHUNK = 4096  # cells solved at once
_DOUBT = 5e-10  # relative; a bound that lies lower than this below the value leaves doubt
_TIED = 1e-9  # relative; cells this near to the least value hold it as well


@dataclass(frozen=True)
class Replicated:
    """Replicates of one problem.

    Attributes
    ----------
    problem : PiecewiseProblem
        With rows of weight 1, sorted by tau.
    weight, rest : ndarray, (m, n) and (m, k)
        Weight of each row in the sum of squares of each replicate: of those with two forms, and of `always`.
    shift, rest_shift : ndarray or None
        What is added to the targets of these rows; None for nothing.
    """

    problem: PiecewiseProblem
    weight: Array
    rest: Array
    shift: Array | None = None
    rest_shift: Array | None = None

    def alone(self, number: int) -> PiecewiseProblem:
        """One replicate as a problem of its own."""

        def rows(rows: Rows, weight: Array, shift: Array | None) -> Rows:
            root = np.sqrt(weight[number])
            target = rows.target if shift is None else rows.target + shift[number]
            return Rows(tuple(None if c is None else root * c for c in rows.columns), root * target)

        p = self.problem
        return replace(
            p,
            stick=rows(p.stick, self.weight, self.shift),
            slide=rows(p.slide, self.weight, self.shift),
            always=rows(p.always, self.rest, self.rest_shift),
        )


@dataclass(frozen=True)
class Minima:
    """The minimum of each replicate.

    Attributes
    ----------
    points : ndarray, (m, q)
    values : ndarray, (m,)
        Sums of squares.
    certified : ndarray of bool, (m,)
        Whether nothing lower than the value is possible, to 1e-9 relative.
    rank : ndarray of int, (m,)
        Unknowns, or combinations of them, that the rows know at the minimum; where several cells hold the
        minimum, in the one that knows least.
    n_stick : ndarray of int, (m,)
        How many rows, as sorted, stick in that cell.
    """

    points: Array
    values: Array
    certified: NDArray[np.bool_]
    rank: Index
    n_stick: Index


def minimise_all(many: Replicated) -> Minima:
    """Global minimum of every replicate, with its proof."""
    m = many.weight.shape[0]
    cells = _build(many)
    k = cells.square.size // m
    values, errors, points, bounds = _branch(many.problem, cells, m)
    every = np.arange(m)
    best = values.argmin(axis=1)
    value, point = values[every, best], points[every, best]
    slack = _DOUBT * np.maximum(1.0, value)
    lower = value - np.where(np.arange(k) == best[:, None], np.inf, bounds).min(axis=1, initial=np.inf)
    doubtful = ~(errors[every, best] <= slack) | (bounds.min(axis=1) < value - slack)
    certified = lower <= GAP * np.maximum(1.0, value)
    rank, n_stick = _rank(cells, values <= (value + _TIED * np.maximum(1.0, value))[:, None])
    for number in np.flatnonzero(doubtful):
        alone = many.alone(int(number))
        found = minimise(alone)
        point[number], value[number] = found.t, found.chi2
        certified[number] = found.gap <= GAP * max(1.0, found.chi2)
        rank[number], n_stick[number] = _rank_at(alone, found.t)
    return Minima(point, value, certified, rank, n_stick)


def _build(many: Replicated) -> Cells:
    """Quadratics of all cells of all replicates, replicate by replicate along the last axis."""
    problem, weight = many.problem, many.weight
    (m, n), q = weight.shape, problem.kappa.size
    count = np.flatnonzero(changes(problem.tau))
    stick = [*problem.stick.columns, _moved(problem.stick.target, many.shift)]
    slide = [*problem.slide.columns, _moved(problem.slide.target, many.shift)]
    rest = [*problem.always.design.T, _moved(problem.always.target, many.rest_shift)]
    running = np.zeros((m, n + 1))

    def total(i: int, j: int) -> Array:
        constant = (many.rest * (rest[i] * rest[j])).sum(axis=1, keepdims=True)
        found = np.repeat(constant, count.size, axis=1)
        first, second = stick[i], stick[j]
        if first is not None and second is not None:
            running[:, 0] = 0.0
            np.cumsum(weight * (first * second), axis=1, out=running[:, 1:])
            found += running[:, count]
        first, second = slide[i], slide[j]
        if first is not None and second is not None:
            running[:, -1] = 0.0
            np.cumsum((weight * (first * second))[:, ::-1], axis=1, out=running[:, -2::-1])
            found += running[:, count]
        return found.reshape(-1)

    gram = np.empty((q, q, m * count.size))
    for i, j in itertools.combinations_with_replacement(range(q), 2):
        gram[i, j] = gram[j, i] = total(i, j)
    slope = np.array([total(i, q) for i in range(q)]).reshape(q, m * count.size)
    square = total(q, q)
    low = np.concatenate(([0.0], problem.tau))[count]
    high = np.concatenate((problem.tau, [np.inf]))[count]
    count, low, high = np.tile(count, m), np.tile(low, m), np.tile(high, m)
    return Cells(gram, slope, square, count, low, high, rounding_of(n))


def _moved(target: Array, shift: Array | None) -> Array:
    return target if shift is None else target + shift


def _branch(problem: PiecewiseProblem, cells: Cells, m: int) -> tuple[Array, Array, Array, Array]:
    """Solve what the bounds admit: values, errors (m, k), points (m, k, q), and a lower bound of every cell.

    A cell that was not solved has an infinite value.
    """
    k, q = cells.square.size // m, cells.slope.shape[0]
    free, doubtful = unconstrained(cells)
    bounds = np.where(doubtful, 0.0, np.maximum(free, 0.0)).reshape(m, k)
    values, errors = np.full(m * k, np.inf), np.zeros(m * k)
    points = np.zeros((m * k, q))

    def solve(which: Index) -> None:
        for start in range(0, which.size, _CHUNK):
            at = which[start : start + _CHUNK]
            solved = solve_cells(problem, cells, at)
            values[at], errors[at], points[at] = solved.values, solved.errors, solved.points

    n_first = min(_FIRST, k)
    first = np.argpartition(bounds, n_first - 1, axis=1)[:, :n_first] + k * np.arange(m)[:, None]
    solve(np.sort(first, axis=None))
    best = (values + errors).reshape(m, k).min(axis=1, keepdims=True)
    admitted = (bounds <= best) & np.isinf(values).reshape(m, k)
    admitted.reshape(-1)[first] = False
    solve(np.flatnonzero(admitted))
    solved = np.zeros(m * k, dtype=bool)
    solved[first] = True
    solved |= admitted.reshape(-1)
    bounds = np.where(solved & ~doubtful, values - errors, bounds.reshape(-1)).reshape(m, k)
    return values.reshape(m, k), errors.reshape(m, k), points.reshape(m, k, q), bounds


def _rank(cells: Cells, tied: NDArray[np.bool_]) -> tuple[Index, Index]:
    """Least rank over the cells that hold the minimum, and how many rows stick there."""
    m, k = tied.shape
    flat = np.flatnonzero(tied)
    ranks = _rank_of(np.moveaxis(cells.gram[:, :, flat], -1, 0))
    order = np.lexsort((ranks, flat // k))
    number, first = np.unique(flat[order] // k, return_index=True)
    rank, n_stick = np.zeros(m, dtype=np.intp), np.zeros(m, dtype=np.intp)
    rank[number] = ranks[order][first]
    n_stick[number] = cells.count[flat[order][first]]
    return rank, n_stick


def _rank_of(gram: Array) -> Index:
    """Rank of stacked Gram matrices, (m, q, q), each unknown in units of its own size."""
    q = gram.shape[-1]
    diagonal = gram[:, range(q), range(q)]
    size = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    curvature = np.linalg.eigvalsh(gram / (size[:, :, None] * size[:, None, :])) if q else diagonal
    return np.asarray((curvature > RANK * RANK * q).sum(axis=1))


def _rank_at(problem: PiecewiseProblem, t: Array) -> tuple[int, int]:
    """The same at one point of one problem."""
    sticks = problem.sticks(t)
    parts = (problem.stick.take(sticks), problem.slide.take(~sticks), problem.always)
    gram = sum((part.gram() for part in parts), start=np.zeros((t.size, t.size)))
    return int(_rank_of(gram[None])[0]), int(sticks.sum())
