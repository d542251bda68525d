"""The global minimum of piecewise problems, and its proof: branch and bound over the cells.

Sort the rows by tau. Between two neighbouring values of tau the sum of squares is one convex quadratic, a
cell; sums over the rows give the quadratics of all cells in O(n). A cell's unconstrained minimum bounds it
from below; only cells whose bound lies under the best value found are solved exactly. What remains is
proven: no cell holds a lower value. Bounds and values are taken less their rounding error, and a cell that
rounding leaves in doubt is solved again from its own rows. Derived in docs/theory/certificate.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.diagnostics.thresholds import GAP, RANK
from ifrfit.inference.optimize.piecewise import (
    CHI2_95,
    NEAR,
    Array,
    PiecewiseBatch,
    PiecewiseOptimum,
    PiecewiseProblem,
)
from ifrfit.inference.optimize.piecewise_quadratic import PiecewiseQuadratic, quadratic_of
from ifrfit.inference.optimize.solved_cells import DOUBT, SolvedCells, TransitionAt, local_minima, refine
from ifrfit.inference.optimize.transition_cells import TransitionCells

Index = NDArray[np.intp]
Bool = NDArray[np.bool_]

_MANY = 20_000  # rows beyond which the sums are taken about a point near the optimum
_SAMPLE = 1000  # rows that find that point
_FIRST, _FIRST_IN_BATCH = 8, 3  # cells of a problem that are solved to get a first value
_CHUNK = 4096  # cells solved at once
MOST_NEAR = 512  # cells solved beyond need, to count local minima
_TIED = 1e-9  # relative; cells this near to the least value hold it as well


def minimise(problem: PiecewiseProblem) -> PiecewiseOptimum:
    """Find the global minimum and prove it.

    Parameters
    ----------
    problem : PiecewiseProblem
        In at most three unknowns.
    """
    centred, center, shift = _centred(problem)
    return _minimise(centred).moved(center, shift) if center.any() else _minimise(centred)


def least_value(problem: PiecewiseProblem) -> tuple[float, float]:
    """The least value, from the rows, and how far below it a lower one is not excluded.

    As `minimise`, but cells that cannot hold it are left alone: other local minima are not looked for.
    """
    centred, _, shift = _centred(problem)
    quadratic = quadratic_of(PiecewiseBatch(centred))
    found = refine(centred, quadratic, branch(centred, quadratic, _FIRST).member(0))
    value = centred.value(found.point)
    return value + shift, max(0.0, value - found.lowest_bound_elsewhere())


def _centred(problem: PiecewiseProblem) -> tuple[PiecewiseProblem, Array, float]:
    """The problem with its rows sorted, in t less a center, that center, and what the value lacks there.

    Sums over many rows keep their digits when they are taken about a point near the optimum.
    """
    problem = problem.sorted_by_tau()
    if problem.tau.size <= _MANY:
        return problem, np.zeros(problem.kappa.size), 0.0
    center = _minimise(problem.take(slice(None, None, problem.tau.size // _SAMPLE))).t
    shift = 0.0 if problem.linear is None else float(problem.linear @ center)
    return problem.about(center), center, shift


def _minimise(problem: PiecewiseProblem) -> PiecewiseOptimum:
    """Minimise a problem whose rows are sorted."""
    quadratic = quadratic_of(PiecewiseBatch(problem))
    found = refine(problem, quadratic, branch(problem, quadratic, _FIRST, count_minima=True).member(0))
    return optimum_of(
        problem.transition.at,
        quadratic,
        found,
        problem.value(found.point),
        problem.tau.size,
    )


def optimum_of(
    transition: TransitionAt,
    cells: PiecewiseQuadratic | TransitionCells,
    found: SolvedCells,
    chi2: float,
    n_rows: int,
) -> PiecewiseOptimum:
    """What the solved cells say, with the value at the best point from the rows themselves.

    `transition` gives kappa and the bound of the impulse at points, as `Transition.at`.
    """
    gap = max(0.0, chi2 - found.lowest_bound_elsewhere())
    point = found.point
    optima = [(chi2, point), *local_minima(transition, cells.high, found)[1:]]
    near = (found.values <= found.value + CHI2_95).nonzero()[0]
    points, n_stick = found.points[near], cells.n_stick[found.cells[near]].tolist()
    return PiecewiseOptimum(
        point,
        chi2,
        gap,
        tuple(optima),
        points[np.concatenate((points.argmin(axis=0), points.argmax(axis=0)))],
        0 in n_stick,
        n_rows in n_stick,
    )


@dataclass(frozen=True)
class Branched:
    """Minima of the cells that were solved, and a lower bound of every cell, of b problems with m cells.

    Attributes
    ----------
    values, errors : ndarray, (b, m)
        Minima and their rounding errors; infinite and 0 where a cell was not solved.
    points : ndarray, (b, m, q)
    first : ndarray of int, (b, k)
        Cells that were solved first: those of the lowest bounds.
    solved : ndarray of bool, (b, m)
        All that were solved.
    bounds : ndarray, (b, m)
    all_near_solved : bool
        Whether every cell within `NEAR` of the least value is among the solved.
    """

    values: Array
    errors: Array
    points: Array
    first: Index
    solved: Bool
    bounds: Array
    all_near_solved: bool

    def member(self, number: int) -> SolvedCells:
        """The solved cells of one problem, in the order in which they were solved."""
        later = self.solved[number].copy()
        later[self.first[number]] = False
        cells = np.concatenate((self.first[number], np.flatnonzero(later)))
        return SolvedCells(
            self.values[number, cells],
            self.errors[number, cells],
            self.points[number, cells],
            cells,
            self.bounds[number],
            self.all_near_solved,
        )


def branch(
    problem: PiecewiseProblem, quadratic: PiecewiseQuadratic, n_first: int, *, count_minima: bool = False
) -> Branched:
    """Solve every cell whose bound does not lie above the best value of its problem.

    The cells with the lowest bounds give a first value; all that its bound admits follow. The value only
    falls, so nothing that could hold the minimum is left out. A cell that the sums leave in doubt keeps the
    bound that needs no sums. With `count_minima` cells within `NEAR` of the best value are solved as well.
    """
    is_sum_of_squares = problem.linear is None
    bounds, doubtful = quadratic.lower_bounds(linear=not is_sum_of_squares)
    least = 0.0 if is_sum_of_squares else -np.inf  # what needs no sums
    b, m = bounds.shape
    np.maximum(bounds, least, out=bounds)
    bounds[doubtful] = least
    values, errors = np.full(b * m, np.inf), np.zeros(b * m)
    n_unknowns = problem.kappa.size
    points = np.zeros((b * m, n_unknowns))

    def solve(which: Index) -> None:
        for start in range(0, which.size, _CHUNK):
            at = which[start : start + _CHUNK]
            found = quadratic.minima(problem, at)
            values[at], errors[at], points[at] = found.values, found.errors, found.points

    n_first = min(n_first, m)
    lowest = np.argpartition(bounds, n_first - 1, axis=1)[:, :n_first]
    first = (lowest + m * np.arange(b)[:, None]).reshape(-1)
    solve(first)
    best = (values[first] + errors[first]).reshape(b, n_first).min(axis=1, keepdims=True)
    admitted = bounds <= best
    all_near_solved = False
    if count_minima:
        near = bounds <= best + NEAR
        all_near_solved = int(near.sum()) <= MOST_NEAR
        if all_near_solved:
            admitted = near
        else:
            # all sliding and all sticking: whether they describe the data is asked for
            admitted[:, [0, -1]] |= near[:, [0, -1]]
    admitted.reshape(-1)[first] = False
    if n_first < m:
        solve(np.flatnonzero(admitted))
    solved = admitted
    solved.reshape(-1)[first] = True
    sure = np.flatnonzero(solved & ~doubtful)
    bounds.reshape(-1)[sure] = values[sure] - errors[sure]
    shape = (b, m)
    return Branched(
        values.reshape(shape),
        errors.reshape(shape),
        points.reshape(b, m, n_unknowns),
        lowest,
        solved,
        bounds,
        all_near_solved,
    )


@dataclass(frozen=True)
class BatchOptima:
    """The minimum of each member of a batch.

    Attributes
    ----------
    points : ndarray, (b, q)
    values : ndarray, (b,)
        Sums of squares.
    certified : ndarray of bool, (b,)
        Whether nothing lower than the value is possible, to 1e-9 relative.
    rank : ndarray of int, (b,)
        Unknowns, or combinations of them, that the rows determine at the minimum; where several cells hold
        the minimum, in the one that determines least.
    n_stick : ndarray of int, (b,)
        How many rows, as sorted, stick in that cell.
    """

    points: Array
    values: Array
    certified: Bool
    rank: Index
    n_stick: Index


def minimise_batch(batch: PiecewiseBatch) -> BatchOptima:
    """Global minimum of every member, with its proof; those in doubt for rounding go to `minimise`."""
    quadratic = quadratic_of(batch)
    found = branch(batch.problem, quadratic, _FIRST_IN_BATCH)
    every = np.arange(batch.size)
    best = found.values.argmin(axis=1)
    value, point = found.values[every, best], found.points[every, best]
    scale = np.maximum(1.0, value)
    elsewhere = np.where(np.arange(quadratic.n_cells) == best[:, None], np.inf, found.bounds)
    certified = value - elsewhere.min(axis=1, initial=np.inf) <= GAP * scale
    doubtful = ~(found.errors[every, best] <= DOUBT * scale)
    doubtful |= found.bounds.min(axis=1) < value - DOUBT * scale
    rank, n_stick = _least_rank(quadratic, found.values <= (value + _TIED * scale)[:, None])
    for number in np.flatnonzero(doubtful):
        alone = batch.member(int(number))
        optimum = minimise(alone)
        point[number], value[number] = optimum.t, optimum.chi2
        certified[number] = optimum.gap <= GAP * max(1.0, optimum.chi2)
        rank[number], n_stick[number] = _rank_at(alone, optimum.t)
    return BatchOptima(point, value, certified, rank, n_stick)


def _least_rank(quadratic: PiecewiseQuadratic, tied: Bool) -> tuple[Index, Index]:
    """Least rank over the cells (b, m) that hold the minimum, and how many rows stick there, (b,)."""
    flat = np.flatnonzero(tied)
    member, cell = np.divmod(flat, quadratic.n_cells)
    ranks = _rank_of(quadratic.grams(flat))
    order = np.lexsort((ranks, member))
    number, first = np.unique(member[order], return_index=True)
    rank, n_stick = np.zeros(len(tied), dtype=np.intp), np.zeros(len(tied), dtype=np.intp)
    rank[number] = ranks[order][first]
    n_stick[number] = quadratic.n_stick[cell[order][first]]
    return rank, n_stick


def _rank_of(gram: Array) -> Index:
    """Rank of stacked Gram matrices, (k, q, q), each unknown in units of its own size."""
    q = gram.shape[-1]
    diagonal = gram[:, range(q), range(q)]
    size = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    curvature = np.linalg.eigvalsh(gram / (size[:, :, None] * size[:, None, :])) if q else diagonal
    return np.asarray((curvature > RANK * RANK * q).sum(axis=1))


def _rank_at(problem: PiecewiseProblem, t: Array) -> tuple[int, int]:
    """Rank at one point of one problem, and how many rows stick there."""
    sticks = problem.sticks(t)
    parts = (problem.stick.take(sticks), problem.slide.take(~sticks), problem.always)
    gram = sum((part.gram() for part in parts), start=np.zeros((t.size, t.size)))
    return int(_rank_of(gram[None])[0]), int(sticks.sum())
