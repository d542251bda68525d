"""The cells of a piecewise problem: their quadratics, their bounds, their constrained minima."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.piecewise import Array, PiecewiseProblem, View

_RELATIVE_PIVOT = 1e-14  # below this share of its diagonal a pivot counts as zero
_FEASIBLE = 1e-11  # slack of a constraint, relative to its terms
_ROUNDING = 64.0 * np.finfo(float).eps  # of a sum of squares, relative to its largest partial sum
_FIRST = 8  # cells solved to get a first value
_CHUNK = 65536  # cells solved at once
_MOST = 4096  # cells solved beyond need, to count local minima


@dataclass(frozen=True)
class Cells:
    """Quadratics t'Gt - 2 g't + s of all m cells; the cells run along the last axis."""

    gram: Array  # (q, q, m)
    slope: Array  # (q, m)
    square: Array  # (m,)
    count: NDArray[np.intp]  # rows that stick
    low: Array  # tau of the last sticking row (0 for none)
    high: Array  # tau of the first sliding row (inf for none)
    rounding: float  # of any sum of squares here


@dataclass(frozen=True)
class Branched:
    """Cells solved exactly, and a lower bound of every cell."""

    values: Array
    points: Array
    held: NDArray[np.intp]  # walls that each point touches, -1 for none, (solved, q)
    solved: NDArray[np.intp]
    bounds: Array

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
    def walls(self) -> NDArray[np.intp]:
        """Walls that hold it."""
        held = self.held[self.best]
        return np.asarray(held[held >= 0])

    @property
    def cell(self) -> int:
        """In which cell."""
        return int(self.solved[self.best])

    def lowest_bound_elsewhere(self, rounding: float) -> float:
        """Least bound over all cells but those that hold the least value."""
        rest = np.ones(self.bounds.size, dtype=bool)
        rest[self.solved[self.values <= self.value + rounding]] = False
        return float(self.bounds[rest].min(initial=np.inf))


def build(problem: PiecewiseProblem, view: View) -> Cells:
    """Sum up the quadratics of all cells in the view's coordinates; rows of equal tau change together."""
    tau, q = problem.tau, problem.kappa.size
    change = np.empty(tau.size + 1, dtype=bool)
    change[0] = change[-1] = True
    np.greater(tau[1:], tau[:-1], out=change[1:-1])
    count = np.flatnonzero(change)
    stick, slide, rest = (view.of(rows) for rows in (problem.stick, problem.slide, problem.always))
    stick_columns = [*np.ascontiguousarray(stick.design.T), stick.target]
    slide_columns = [*np.ascontiguousarray(slide.design.T), slide.target]
    always = np.column_stack((rest.design, rest.target))
    constant = always.T @ always
    prefix, suffix = np.zeros(tau.size + 1), np.zeros(tau.size + 1)

    def total(i: int, j: int) -> Array:
        np.cumsum(stick_columns[i] * stick_columns[j], out=prefix[1:])
        np.cumsum((slide_columns[i] * slide_columns[j])[::-1], out=suffix[-2::-1])
        return np.asarray((prefix + suffix + constant[i, j])[change])

    gram = np.empty((q, q, count.size))
    for i, j in itertools.combinations_with_replacement(range(q), 2):
        gram[i, j] = gram[j, i] = total(i, j)
    slope = np.array([total(i, q) for i in range(q)]).reshape(q, count.size)
    square = total(q, q)
    return Cells(
        gram,
        slope - (view.frame.T @ problem.slope0)[:, None],
        square,
        count,
        np.concatenate(([0.0], tau))[change],
        np.concatenate((tau, [np.inf]))[change],
        _ROUNDING * float(square.max(initial=0.0)),
    )


def _unconstrained(cells: Cells) -> tuple[Array, NDArray[np.bool_]]:
    """Unconstrained minimum of every cell, and where a pivot vanished.

    Elimination on the Jacobi-scaled matrices, all cells at once. A cell with a vanished pivot has no
    unique minimiser; its minimum is not trusted as a bound.
    """
    q = cells.slope.shape[0]
    size = [_size(cells.gram[i, i]) for i in range(q)]
    a = [[cells.gram[i, j] / (size[i] * size[j]) for j in range(q)] for i in range(q)]
    z = [cells.slope[i] / size[i] for i in range(q)]
    singular = np.zeros(cells.square.size, dtype=bool)
    minimum = cells.square.copy()
    for k in range(q):
        flat = ~(a[k][k] > _RELATIVE_PIVOT)
        singular |= flat
        pivot = np.where(flat, np.inf, a[k][k])
        minimum -= z[k] * z[k] / pivot
        for i in range(k + 1, q):
            factor = a[i][k] / pivot
            z[i] = z[i] - factor * z[k]
            for j in range(k + 1, q):
                a[i][j] = a[i][j] - factor * a[k][j]
    return minimum, singular


def _size(diagonal: Array) -> Array:
    """Scale of an unknown; 1 where no row knows it."""
    return np.asarray(np.where(diagonal > 0.0, np.sqrt(diagonal), 1.0))


def constraints(problem: PiecewiseProblem, cells: Cells, which: NDArray[np.intp]) -> tuple[Array, Array]:
    """Walls (m, walls, q) and limits (m, walls) of the chosen cells: the domain, then the two kinks."""
    m = which.size
    walls = np.broadcast_to(problem.walls, (m, *problem.walls.shape))
    limits = np.broadcast_to(problem.limits, (m, problem.limits.size))
    low = cells.low[which, None]
    high = cells.high[which, None]
    open_end = np.isinf(high)
    high = np.where(open_end, 0.0, high)
    low_wall = low * problem.bound - problem.kappa
    high_wall = np.where(open_end, 0.0, problem.kappa - high * problem.bound)
    low_limit = problem.kappa0 - low * problem.bound0
    high_limit = np.where(open_end, 1.0, high * problem.bound0 - problem.kappa0)
    walls = np.concatenate((walls, low_wall[:, None], high_wall[:, None]), axis=1)
    return walls, np.concatenate((limits, low_limit, high_limit), axis=1)


def _inside(t: Array, walls: Array, limits: Array, active: tuple[int, ...]) -> NDArray[np.bool_]:
    """Whether t obeys all constraints, up to rounding; the active ones hold by construction."""
    terms = walls * t[:, None, :]
    size = np.abs(terms).sum(axis=2) + np.abs(limits)
    obeyed = terms.sum(axis=2) - limits <= _FEASIBLE * size
    obeyed[:, active] = True
    return np.asarray(obeyed.all(axis=1))


def _solve(
    problem: PiecewiseProblem, view: View, cells: Cells, which: NDArray[np.intp]
) -> tuple[Array, Array, NDArray[np.intp]]:
    """Constrained minimum of each chosen cell, exactly: the best stationary point over all its faces.

    Faces on which the quadratic is flat are passed over: then a face of lower dimension has the same value.
    Whether a point lies in its cell is judged in the problem's own coordinates.
    """
    walls, limits = constraints(problem, cells, which)
    local_walls, local_limits = walls @ view.frame, limits - walls @ view.center
    gram = np.moveaxis(cells.gram[:, :, which], -1, 0)
    slope, square = cells.slope[:, which].T, cells.square[which]
    m, n_walls, q = walls.shape
    best = np.full(m, np.inf)
    points, held = np.zeros((m, q)), np.full((m, q), -1)
    for n_active in range(q + 1):
        for active in itertools.combinations(range(n_walls), n_active):
            u, good = _stationary(gram, slope, local_walls[:, active], local_limits[:, active])
            if not good.any():
                continue
            t = view.center + u @ view.frame.T
            good &= _inside(t, walls, limits, active)
            value = ((gram @ u[:, :, None])[:, :, 0] * u - 2.0 * slope * u).sum(axis=1) + square
            better = good & (value < best)
            best[better] = value[better]
            points[better] = t[better]
            held[better] = -1
            held[better, :n_active] = active
    return best, points, held


def _stationary(gram: Array, slope: Array, walls: Array, limits: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Stationary points of the quadratics on the faces where the given walls are touched."""
    m, n_active, q = walls.shape
    size = _size(gram[:, range(q), range(q)])
    scaled = walls / size[:, None, :]
    norm = np.sqrt((scaled * scaled).sum(axis=2))
    norm = np.where(norm > 0.0, norm, 1.0)
    scaled = scaled / norm[:, :, None]
    system = np.zeros((m, q + n_active, q + n_active))
    system[:, :q, :q] = gram / (size[:, :, None] * size[:, None, :])
    system[:, q:, :q] = scaled
    system[:, :q, q:] = np.swapaxes(scaled, 1, 2)
    right = np.concatenate((slope / size, limits / norm), axis=1)
    good = np.abs(np.linalg.det(system)) > _RELATIVE_PIVOT
    system[~good] = np.eye(q + n_active)
    t = np.linalg.solve(system, right[:, :, None])[:, :q, 0] / size
    return t, good


def branch(problem: PiecewiseProblem, view: View, cells: Cells) -> Branched:
    """Solve every cell whose bound does not lie above the best value, and those within 4 of it.

    The cells with the lowest bounds give a first value; all that its bound admits follow. The value only
    falls, so nothing that could hold the minimum is left out.
    """
    minimum, singular = _unconstrained(cells)
    bounds = np.where(singular, 0.0 if problem.pull is None else -np.inf, minimum)
    first = np.argpartition(bounds, min(_FIRST, bounds.size) - 1)[:_FIRST]
    chunks = [_solve(problem, view, cells, first)]
    best = float(chunks[0][0].min())
    admitted = bounds <= best + cells.rounding
    near = np.flatnonzero(~admitted & (bounds <= best + 4.0))
    if near.size > _MOST:
        near = near[np.argpartition(bounds[near], _MOST)[:_MOST]]
    admitted[near] = True
    admitted[first] = False
    more = np.flatnonzero(admitted)
    for part in np.array_split(more, 1 + more.size // _CHUNK):
        chunks.append(_solve(problem, view, cells, part))
    values, points, held = (np.concatenate(parts) for parts in zip(*chunks, strict=True))
    solved = np.concatenate((first, more))
    bounds[solved] = values
    return Branched(values, points, held, solved, bounds)
