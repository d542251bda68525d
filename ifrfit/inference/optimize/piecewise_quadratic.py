"""The quadratics of all cells of a piecewise problem, or of a batch of them: sums, bounds, minima.

A cell is the part of the domain whose transition lies between two neighbouring values of tau: no row changes
its regime there, so the sum of squares is one convex quadratic. A single problem is a batch of one.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.optimize.piecewise import Array, PiecewiseBatch, PiecewiseProblem

DOUBTFUL = 1e-9  # below this share the sums have too few digits left to solve the cell from them
_FEASIBLE = 1e-11  # slack of a constraint, relative to its terms
_STEP = 1e-10  # slack of a constraint in standard deviations
_BLOCK = 32768  # cells bounded at once

Index = NDArray[np.intp]
Bool = NDArray[np.bool_]


FLAT = 1e-14  # below this share of its diagonal a pivot counts as zero
_PARALLEL = 1e-12  # below this determinant constraints do not meet in one point


@dataclass(frozen=True)
class PiecewiseQuadratic:
    """Quadratics t'Gt - 2 g't + s of the m cells of each of b problems: eq. (2) of certificate.md.

    Attributes
    ----------
    gram : ndarray, (q, q, b, m)
    slope : ndarray, (q, b, m)
    square : ndarray, (b, m)
    n_stick : ndarray of int, (m,)
        How many rows, in ascending order of tau, stick in a cell.
    low, high : ndarray, (m,)
        tau of the last row that sticks (0 for none), and of the first that slides (inf for none).
    rounding : float
        Relative error of a sum.
    """

    gram: Array
    slope: Array
    square: Array
    n_stick: Index
    low: Array
    high: Array
    rounding: float

    def __post_init__(self) -> None:
        for array in (self.gram, self.slope, self.square):
            array.setflags(write=False)

    @property
    def n_cells(self) -> int:
        """Cells of each problem."""
        return int(self.n_stick.size)

    def lower_bounds(self, *, linear: bool) -> tuple[Array, Bool]:
        """Lower bound of every cell from its unconstrained minimum, and which cells the sums leave in doubt.

        Both (b, m); eq. (4) of certificate.md. Where the problem has a linear term (`linear`) a quadratic
        that is flat in some direction has no such bound: it may fall along it without end.
        """
        gram, slope, square = self._flat()
        bounds, doubtful = np.empty(square.size), np.empty(square.size, dtype=bool)
        for start in range(0, square.size, _BLOCK):  # in blocks that stay in the cache
            at = slice(start, start + _BLOCK)
            bounds[at], doubtful[at], flat = _unconstrained_minima(
                gram[:, :, at], slope[:, at], square[at], self.rounding
            )
            if linear:
                bounds[at][flat] = -np.inf
        return bounds.reshape(self.square.shape), doubtful.reshape(self.square.shape)

    def minima(self, problem: PiecewiseProblem, which: Index) -> CellMinima:
        """Constrained minima of chosen cells; `which` counts through the cells of all problems, (k,)."""
        cell = which % self.n_cells
        _, slope, square = self._flat()
        return cell_minima(
            *cell_constraints(problem, self.low[cell], self.high[cell]),
            self.grams(which),
            slope[:, which].T,
            square[which],
            self.rounding,
        )

    def grams(self, which: Index) -> Array:
        """Gram matrices of chosen cells, counted through the cells of all problems, (k, q, q)."""
        return np.moveaxis(self._flat()[0][:, :, which], -1, 0)

    def _flat(self) -> tuple[Array, Array, Array]:
        """The quadratics with the cells of all problems along one axis: (q, q, b m), (q, b m) and (b m,)."""
        q, total = self.slope.shape[0], self.square.size
        return self.gram.reshape(q, q, total), self.slope.reshape(q, total), self.square.reshape(total)


class CellMinima(NamedTuple):
    """Constrained minima of k cells: values and their rounding errors (k,), and minimisers (k, q)."""

    values: Array
    errors: Array
    points: Array

    @classmethod
    def joined(cls, parts: Sequence[CellMinima]) -> CellMinima:
        """Those of several lots of cells, one after the other."""
        columns = zip(*((each.values, each.errors, each.points) for each in parts), strict=True)
        return cls(*map(np.concatenate, columns))


def quadratic_of(batch: PiecewiseBatch) -> PiecewiseQuadratic:
    """Sum up the quadratics of all cells, by eq. (3) of certificate.md; rows of equal tau change together.

    Prefix sums over the rows that stick and suffix sums over those that slide: O(n) for all cells.
    """
    problem = batch.problem
    tau, q, b = problem.tau, problem.kappa.size, batch.size
    change = _first_of_each_cell(tau)
    distinct = bool(change.all())
    constant = _sums_of_always(batch)
    stick, slide = (
        [*rows.columns, rows.target if batch.shift is None else rows.target + batch.shift]
        for rows in (problem.stick, problem.slide)
    )
    # one buffer serves all products: fresh memory for each would cost more than the sums
    product, running = np.empty((b, tau.size)), np.empty((b, tau.size))

    def weighted_product(first: Array, second: Array) -> Array:
        if batch.weight is None:
            return np.multiply(first, second, out=product)
        return np.multiply(batch.weight, first * second, out=product)

    def total(i: int, j: int) -> Array:
        sums = np.empty((b, tau.size + 1))
        sums[:] = constant[i, j, :, None]
        first, second = stick[i], stick[j]
        if first is not None and second is not None:
            sums[:, 1:] += weighted_product(first, second).cumsum(axis=1, out=running)
        first, second = slide[i], slide[j]
        if first is not None and second is not None:
            sums[:, -2::-1] += weighted_product(first, second)[:, ::-1].cumsum(axis=1, out=running)
        return sums if distinct else sums[:, change]

    m = int(change.sum())
    gram, slope = np.empty((q, q, b, m)), np.empty((q, b, m))
    for i, j in itertools.combinations_with_replacement(range(q), 2):
        gram[i, j] = gram[j, i] = total(i, j)
    for i in range(q):
        slope[i] = total(i, q)
    if problem.linear is not None:
        slope -= problem.half_linear[:, None, None]
    return PiecewiseQuadratic(
        gram,
        slope,
        total(q, q),
        np.flatnonzero(change),
        np.concatenate(([0.0], tau))[change],
        np.concatenate((tau, [np.inf]))[change],
        4.0 * np.finfo(float).eps * max(16.0, math.sqrt(tau.size)),
    )


def _first_of_each_cell(tau: Array) -> Bool:
    """Which of the n + 1 numbers of sticking rows begin a cell, for tau in ascending order."""
    change = np.empty(tau.size + 1, dtype=bool)
    change[0] = change[-1] = True
    np.greater(tau[1:], tau[:-1], out=change[1:-1])
    return change


def _sums_of_always(batch: PiecewiseBatch) -> Array:
    """Products of the rows without regimes, of design and target, (q + 1, q + 1, b)."""
    always = batch.problem.always
    rows = np.column_stack((always.design, always.target))
    if batch.always_weight is None:
        return (rows.T @ rows)[:, :, None]
    if batch.always_shift is not None:
        rows = np.repeat(rows[None], batch.size, axis=0)
        rows[:, :, -1] += batch.always_shift
    weighted = batch.always_weight[:, :, None] * rows
    return np.moveaxis(np.swapaxes(weighted, 1, 2) @ rows, 0, -1)


def _unconstrained_minima(
    gram: Array, slope: Array, square: Array, rounding: float
) -> tuple[Array, Bool, Bool]:
    """Least values of quadratics (q, q, k) less their rounding error, which are in doubt, and which are flat.

    By elimination on the Jacobi-scaled matrices. A vanishing pivot means that the quadratic is flat in some
    direction: without a linear term its minimum is a line. A small one means that its part of the minimum
    has lost its digits.
    """
    q = slope.shape[0]
    size = [size_of(gram[i, i]) for i in range(q)]
    a = [[gram[i, j] / (size[i] * size[j]) for j in range(q)] for i in range(q)]
    z = [slope[i] / size[i] for i in range(q)]
    doubtful, flat = np.zeros((2, square.size), dtype=bool)
    minimum, error = square.copy(), square.copy()
    for k in range(q):
        empty = gram[k, k] == 0.0
        doubtful |= ~empty & (a[k][k] < DOUBTFUL)
        vanishing = empty | ~(a[k][k] > FLAT)
        flat |= vanishing
        pivot = np.where(vanishing, np.inf, a[k][k])
        part = z[k] * z[k] / pivot
        minimum -= part
        error += part / np.minimum(pivot, 1.0)
        for i in range(k + 1, q):
            factor = a[i][k] / pivot
            z[i] = z[i] - factor * z[k]
            for j in range(k + 1, q):
                a[i][j] = a[i][j] - factor * a[k][j]
    return minimum - rounding * error, doubtful, flat


def cell_constraints(problem: PiecewiseProblem, low: Array, high: Array) -> tuple[Array, Array]:
    """Constraints (k, p, q) and limits (k, p) of cells between these tau: the domain, then both kinks."""
    k = low.size
    domain = np.broadcast_to(problem.constraints, (k, *problem.constraints.shape))
    limits = np.broadcast_to(problem.limits, (k, problem.limits.size))
    low, high = low[:, None], high[:, None]
    # no kink below the first cell and above the last one: such constraints are void
    open_start, open_end = low == 0.0, np.isinf(high)
    high = np.where(open_end, 0.0, high)
    at_low = np.where(open_start, 0.0, low * problem.bound - problem.kappa)
    at_high = np.where(open_end, 0.0, problem.kappa - high * problem.bound)
    low_limit = np.where(open_start, 1.0, problem.kappa0 - low * problem.bound0)
    high_limit = np.where(open_end, 1.0, high * problem.bound0 - problem.kappa0)
    constraints = np.concatenate((domain, at_low[:, None], at_high[:, None]), axis=1)
    return constraints, np.concatenate((limits, low_limit, high_limit), axis=1)


def cell_minima(
    constraints: Array,
    limits: Array,
    gram: Array,
    slope: Array,
    square: Array,
    rounding: float,
    sd: Array | None = None,
) -> CellMinima:
    """Minimum of each of k quadratics under its constraints: the best stationary point of all active sets.

    Active sets on which the quadratic is flat are passed over: then a larger set has the same value.

    Parameters
    ----------
    constraints, limits : ndarray, (k, p, q) and (k, p)
    gram, slope, square : ndarray, (k, q, q), (k, q) and (k,)
    rounding : float
        Relative error of the three.
    sd : ndarray, (k, q), optional
        A standard deviation of each unknown, by default from the cell's own matrix.
    """
    k, _, q = constraints.shape
    # so small a part of a standard deviation moves no sum of squares; it matters where constraints meet
    if sd is None:
        diagonal = gram[:, range(q), range(q)]
        sd = np.where(diagonal > 0.0, 1.0 / size_of(diagonal), 0.0)
    slack = _STEP * (np.abs(constraints) * sd[:, None, :]).sum(axis=2)
    t, exists, active = stationary_points(gram, slope, constraints, limits)
    feasible = exists & _obeys(t, constraints, limits, slack, active)
    curved = (gram[:, None] @ t[..., None])[..., 0] * t
    linear = slope[:, None, :] * t
    value = np.where(feasible, (curved - 2.0 * linear).sum(axis=2) + square[:, None], np.inf)
    cell, best = np.arange(k), value.argmin(axis=1)
    size = (np.abs(curved) + 2.0 * np.abs(linear)).sum(axis=2)[cell, best] + square
    return CellMinima(value[cell, best], rounding * size, t[cell, best])


def _obeys(t: Array, constraints: Array, limits: Array, slack: Array, active: Bool) -> Bool:
    """Whether points t (k, sets, q) obey all constraints; the active ones hold by construction."""
    with np.errstate(invalid="ignore", over="ignore"):
        terms = constraints[:, None] * t[:, :, None, :]
        size = np.abs(terms).sum(axis=3) + np.abs(limits)[:, None]
        obeyed = terms.sum(axis=3) - limits[:, None] <= _FEASIBLE * size + slack[:, None]
    return np.asarray((obeyed | active).all(axis=2))


def stationary_points(
    gram: Array, slope: Array, constraints: Array, limits: Array
) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
    """Stationary points of t'Gt - 2 g't with each choice of up to q of the p constraints active.

    With q at most three and a handful of constraints all active sets can be enumerated; no general solver of
    quadratic programs does thousands of them at once.

    Parameters
    ----------
    gram, slope : ndarray, (k, q, q) and (k, q)
    constraints, limits : ndarray, (k, p, q) and (k, p)
        An active constraint holds as constraint @ t = limit.

    Returns
    -------
    points : ndarray, (k, sets, q)
    exists : ndarray of bool, (k, sets)
        False where the quadratic is flat under the set, or its constraints do not meet in one point.
    active : ndarray of bool, (sets, p)
        The constraints of each set.
    """
    _, n_constraints, q = constraints.shape
    points, exists, active = [], [], []
    for n_active in range(q + 1):
        chosen = list(itertools.combinations(range(n_constraints), n_active))
        sets = np.array(chosen, dtype=np.intp).reshape(len(chosen), n_active)
        if q == 2 and n_active == 1:
            t, fine = _on_lines(gram, slope, constraints, limits)
        else:
            t, fine = _stationary(gram, slope, constraints[:, sets], limits[:, sets])
        points.append(t)
        exists.append(fine)
        own = np.zeros((len(sets), n_constraints), dtype=bool)
        own[np.arange(len(sets))[:, None], sets] = True
        active.append(own)
    return np.concatenate(points, axis=1), np.concatenate(exists, axis=1), np.concatenate(active)


def _on_lines(
    gram: Array, slope: Array, constraints: Array, limits: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Minima along each constraint in two unknowns, in closed form, which keeps more digits."""
    size = size_of(gram[:, range(2), range(2)])
    scaled = constraints / size[:, None]
    norm = np.sqrt((scaled * scaled).sum(axis=2))
    norm = np.where(norm > 0.0, norm, 1.0)
    scaled = scaled / norm[..., None]
    foot = scaled * (limits / norm)[..., None]
    along = scaled[..., ::-1] * np.array([-1.0, 1.0])
    matrix = gram / (size[:, :, None] * size[:, None, :])
    curvature = ((along @ matrix) * along).sum(axis=2)
    good = curvature > FLAT
    step = ((slope / size)[:, None] - foot @ matrix) * along
    length = step.sum(axis=2) / np.where(good, curvature, 1.0)
    return (foot + length[..., None] * along) / size[:, None], good


def _stationary(
    gram: Array, slope: Array, constraints: Array, limits: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Stationary points where all the given constraints hold as equations, from the KKT system.

    constraints (k, sets, active, q) and limits (k, sets, active); gives points (k, sets, q).
    """
    k, n_sets, n_active, q = constraints.shape
    if n_active == q:
        return _corners(constraints, limits)
    size = size_of(gram[:, range(q), range(q)])
    scaled = constraints / size[:, None, None, :]
    norm = np.sqrt((scaled * scaled).sum(axis=3))
    norm = np.where(norm > 0.0, norm, 1.0)
    scaled = scaled / norm[..., None]
    system = np.zeros((k, n_sets, q + n_active, q + n_active))
    system[:, :, :q, :q] = (gram / (size[:, :, None] * size[:, None, :]))[:, None]
    system[:, :, q:, :q] = scaled
    system[:, :, :q, q:] = np.swapaxes(scaled, 2, 3)
    right = np.zeros((k, n_sets, q + n_active))
    right[:, :, :q] = (slope / size)[:, None]
    right[:, :, q:] = limits / norm
    good = np.abs(np.linalg.det(system)) > FLAT
    system[~good] = np.eye(q + n_active)
    t = np.linalg.solve(system, right[..., None])[..., :q, 0] / size[:, None]
    return t, good


def _corners(constraints: Array, limits: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Points where q constraints meet, whatever the quadratic is there."""
    q = constraints.shape[3]
    columns = np.abs(constraints).max(axis=2, initial=0.0)
    columns = np.where(columns > 0.0, columns, 1.0)
    system = constraints / columns[:, :, None, :]
    rows = np.abs(system).max(axis=3, initial=0.0)
    rows = np.where(rows > 0.0, rows, 1.0)
    system = system / rows[..., None]
    good = np.abs(np.linalg.det(system)) > _PARALLEL
    system[~good] = np.eye(q)
    corner = np.linalg.solve(system, (limits / rows)[..., None])[..., 0]
    return corner / columns, good


def size_of(diagonal: Array) -> Array:
    """Scale of an unknown; 1 where no row knows it."""
    return np.asarray(np.where(diagonal > 0.0, np.sqrt(diagonal), 1.0))
