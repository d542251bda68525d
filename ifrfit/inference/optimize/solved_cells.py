"""What branch and bound has found out about the cells of a problem: their local minima, their last digits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.optimize.piecewise import NEAR, Array, LinearRows, PiecewiseProblem
from ifrfit.inference.optimize.piecewise_quadratic import PiecewiseQuadratic, cell_constraints, cell_minima

TransitionAt = Callable[[Array], tuple[Array, Array]]  # as `Transition.at`

_WELL_CONDITIONED = 1e-6  # reciprocal condition of a Gram matrix that needs no orthogonalisation of the rows
_FLAT = 1e-8  # of a direction that would be 1 in a cell's own frame
DOUBT = 5e-10  # relative; a bound that lies lower than this below the value leaves doubt
_MOST_REFINED = 256  # cells that are solved again at the most
_STEP_CONVERGED = 1e-12  # of a standard deviation
_STEPS = 3  # at a cell, each from the last minimum


@dataclass(frozen=True)
class SolvedCells:
    """Minima of k cells that were solved, and a lower bound of each of the m cells.

    Attributes
    ----------
    values, errors : ndarray, (k,)
        Minima, and their rounding errors.
    points : ndarray, (k, q)
        Minimisers.
    cells : ndarray of int, (k,)
        Which cells they are.
    bounds : ndarray, (m,)
    all_near_solved : bool
        Whether every cell within `NEAR` of the least value is among them.
    """

    values: Array
    errors: Array
    points: Array
    cells: NDArray[np.intp]
    bounds: Array
    all_near_solved: bool

    @cached_property
    def best(self) -> int:
        """Place of the best among the solved."""
        return int(self.values.argmin())

    @property
    def value(self) -> float:
        """Least value."""
        return float(self.values[self.best])

    @property
    def point(self) -> Array:
        """Where it is, (q,)."""
        return np.asarray(self.points[self.best])

    @cached_property
    def near(self) -> NDArray[np.intp]:
        """Places, among the solved, of those within `NEAR` of the least value."""
        return (self.values <= self.value + NEAR).nonzero()[0]

    @property
    def cell(self) -> int:
        """In which cell."""
        return int(self.cells[self.best])

    @property
    def lowest_bound(self) -> float:
        """Least bound over all cells."""
        return float(self.bounds[self.bounds.argmin()])

    def lowest_bound_elsewhere(self) -> float:
        """Least bound over all cells but those that hold the least value."""
        rest = self.bounds.copy()
        same = self.values <= self.value + self.errors + self.errors[self.best]
        rest[self.cells[same]] = np.inf
        return float(rest[rest.argmin()])


def local_minima(transition: TransitionAt, high: Array, found: SolvedCells) -> list[tuple[float, Array]]:
    """Distinct local minima within `NEAR` of the least, best first; `transition` as `Transition.at`.

    A cell's minimum on a kink is one of the whole only if the cell beyond the kink goes no lower; equal
    neighbours are one minimum. Where there are too many cells for that, each unbroken run of cells whose
    bounds lie within `NEAR` counts as one.
    """
    if not found.all_near_solved:
        return _runs(found)
    near = found.near
    if near.size == 1:
        return [(found.value, found.point)]
    near = near[found.cells[near].argsort()]
    number, point = found.cells[near].tolist(), found.points[near]
    tolerance = max(1e-9 * abs(found.value), float(found.errors[found.best]), 1e-12)
    kappa, bound = (each.tolist() for each in transition(point))
    heights, minima, start = found.values[near].tolist(), [], 0
    for stop in range(1, len(number) + 1):
        if stop < len(number) and number[stop] == number[stop - 1] + 1:
            kink = float(high[number[stop - 1]])
            if _touches(kappa[stop - 1], kink * bound[stop - 1]) or _touches(kappa[stop], kink * bound[stop]):
                continue
        minima += _valleys(heights, start, stop, tolerance)
        start = stop
    return sorted(((heights[at], point[at]) for at in minima), key=lambda item: item[0])


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


def _touches(kappa: float, kink: float) -> bool:
    """Whether a point lies on a kink."""
    return abs(kappa - kink) < 1e-9 * (abs(kappa) + abs(kink))


def _valleys(values: list[float], start: int, stop: int, tolerance: float) -> list[int]:
    """Places of local minima in a chain of cells that touch: no lower neighbour, plateaus counted once."""
    found = []
    i = start
    while i < stop:
        end = i
        while end + 1 < stop and abs(values[end + 1] - values[i]) <= tolerance:
            end += 1
        left = i > start and values[i - 1] < values[i] - tolerance
        right = end + 1 < stop and values[end + 1] < values[i] - tolerance
        if not left and not right:
            found.append(i)
        i = end + 1
    return found


def refine(problem: PiecewiseProblem, quadratic: PiecewiseQuadratic, found: SolvedCells) -> SolvedCells:
    """Solve the best cell again from its own rows, then whatever its value does not exclude.

    What is still in doubt after that keeps its bound, and so shows in the gap. Where the sums leave no
    doubt, as they mostly do, nothing is solved again.
    """
    slack = DOUBT * max(1.0, abs(found.value))
    if found.errors[found.best] <= slack and found.lowest_bound >= found.value - slack:
        return found
    bounds = found.bounds.copy()
    starts = {int(cell): point for cell, point in zip(found.cells, found.points, strict=True)}
    refined: dict[int, tuple[float, float, Array]] = {}
    cell = found.cell
    while True:
        # a cell that was never solved is expanded about the best point so far
        value, error, point = _from_rows(problem, quadratic, cell, starts.get(cell, found.point))
        refined[cell] = value, error, point
        bounds[cell] = value - error
        best = min(value for value, _, _ in refined.values())
        below = np.flatnonzero(bounds < best - DOUBT * max(1.0, abs(best)))
        doubtful = [int(c) for c in below[np.argsort(bounds[below])] if int(c) not in refined]
        if not doubtful or len(refined) >= _MOST_REFINED:
            break
        cell = doubtful[0]
    sure = {c: s for c, s in refined.items() if np.isfinite(s[0])}
    if not sure:  # a cell that rounding closes where its two kinks meet: the sums know no less
        return found
    # values that were never confirmed must not pass for the best
    rest = ~np.isin(found.cells, list(refined)) & np.isfinite(found.values)
    values = np.where(found.values >= best, found.values, best + found.errors)[rest]
    return SolvedCells(
        np.concatenate(([value for value, _, _ in sure.values()], values)),
        np.concatenate(([error for _, error, _ in sure.values()], found.errors[rest])),
        np.concatenate(([point for _, _, point in sure.values()], found.points[rest])),
        np.concatenate((np.array(list(sure), dtype=np.intp), found.cells[rest])),
        bounds,
        found.all_near_solved,
    )


def _from_rows(
    problem: PiecewiseProblem, quadratic: PiecewiseQuadratic, cell: int, t: Array
) -> tuple[float, float, Array]:
    """Constrained minimum of one cell, in coordinates about t in which its Gram matrix is the identity.

    Gives the value, its rounding error and the minimiser; eq. (6) of certificate.md.
    """
    count = int(quadratic.n_stick[cell])
    parts = [problem.stick.take(slice(None, count)), problem.slide.take(slice(count, None)), problem.always]
    q = t.size
    gram: Array = sum((part.gram() for part in parts), start=np.zeros((q, q)))
    frame = _frame_of_gram(gram)
    start, to_rows = np.zeros(q), np.eye(q)
    if frame is None:
        frame = _frame_of_rows(np.concatenate([part.design for part in parts]))
        parts = [LinearRows.of(part.design @ frame, part.residuals(t)) for part in parts]
        gram = sum((part.gram() for part in parts), start=np.zeros((q, q)))
        # in this frame a direction is round or it is nothing but rounding
        flat: NDArray[np.bool_] = np.diag(gram) < _FLAT
        gram[flat] = gram[:, flat] = 0.0
        start, u = t, np.zeros(q)
    else:
        flat = np.zeros(q, dtype=bool)
        gram = np.asarray(frame.T @ gram @ frame)
        to_rows, u = frame, np.asarray(np.linalg.solve(frame, t))
    value, error, point = np.inf, 0.0, t
    at = slice(cell, cell + 1)
    for _ in range(_STEPS):
        residuals = [part.residuals(to_rows @ u) for part in parts]
        products = (part.transpose_times(r) for part, r in zip(parts, residuals, strict=True))
        downhill = sum(products, start=np.zeros(q))
        slope = to_rows.T @ downhill
        slope[flat] = 0.0  # no row tells anything there; a linear term does
        slope -= frame.T @ problem.half_linear
        square = np.array([sum(float(r @ r) for r in residuals)])
        solved = cell_minima(
            *cell_constraints(_in_frame(problem, point, frame), quadratic.low[at], quadratic.high[at]),
            gram[None],
            slope[None],
            square,
            quadratic.rounding,
            np.ones((1, q)),
        )
        if not np.isfinite(solved.values[0]):
            break
        shift = 0.0 if problem.linear is None else float(problem.linear @ point)
        value, error = float(solved.values[0]) + shift, float(solved.errors[0])
        ahead = start + frame @ (u + solved.points[0])
        if not _inside_domain(problem, ahead):  # a direction that is flat but for rounding led astray
            break
        u = u + solved.points[0]
        point = start + frame @ u
        if float(np.abs(solved.points[0]).max(initial=0.0)) <= _STEP_CONVERGED:
            break
    return value, error, point


def _inside_domain(problem: PiecewiseProblem, t: Array) -> bool:
    terms = problem.constraints * t
    size = np.abs(terms).sum(axis=1) + np.abs(problem.limits) + 1.0
    return bool((terms.sum(axis=1) - problem.limits <= 1e-9 * size).all())


def _in_frame(problem: PiecewiseProblem, center: Array, frame: Array) -> PiecewiseProblem:
    """The problem's constraints in u, with t = center + frame @ u."""
    return replace(
        problem,
        kappa=problem.kappa @ frame,
        kappa0=problem.kappa0 + float(problem.kappa @ center),
        bound=problem.bound @ frame,
        bound0=problem.bound0 + float(problem.bound @ center),
        constraints=problem.constraints @ frame,
        limits=problem.limits - problem.constraints @ center,
    )


def _frame_of_gram(gram: Array) -> Array | None:
    """Matrix F with F' G F = 1 from a Gram matrix; None where it is too ill conditioned for that."""
    if gram.size == 0:
        return np.eye(gram.shape[0])
    size = np.sqrt(np.diag(gram))
    if size.min() <= 0.0:
        return None
    value, vector = np.linalg.eigh(gram / np.outer(size, size))
    if value[0] < _WELL_CONDITIONED:
        return None
    return np.asarray(vector / np.sqrt(value) / size[:, None])


def _frame_of_rows(design: Array) -> Array:
    """Matrix F with (A F)'(A F) = 1 from the rows A themselves; flat directions keep their unit."""
    n, q = design.shape
    if q == 0 or n == 0:
        return np.eye(q)
    # heavy rows first: without it orthogonalisation would drown the light ones
    order = np.argsort(-np.abs(design).max(axis=1), kind="stable")
    triangle: Array = np.asarray(np.linalg.qr(design[order], mode="r"))
    size = np.sqrt((triangle * triangle).sum(axis=0))
    size = np.where(size > 0.0, size, 1.0)
    _, singular, rows = np.linalg.svd(triangle / size)
    singular = np.concatenate((singular, np.zeros(q - singular.size)))
    singular = np.where(singular > 1e-14 * max(singular[0], 1e-300), singular, 1.0)
    return np.asarray((rows.T / singular) / size[:, None])
