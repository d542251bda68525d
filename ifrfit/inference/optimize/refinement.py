"""The last digits: the best cell from its own rows, and every cell that rounding leaves in doubt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.optimize.piecewise import Array, PiecewiseProblem, Rows
from ifrfit.inference.optimize.regime_sums import Branched, Cells, solve_cells

_WELL = 1e-6  # reciprocal condition of a Gram matrix that needs no orthogonalisation of the rows
_FLAT = 1e-8  # of a direction that would be 1 in a cell's own frame
_TOLERANCE = 5e-10  # relative; a bound that lies lower than this below the value leaves doubt
_MOST = 256  # cells that are solved again at the most
_AT_REST = 1e-12  # of a standard deviation
_LOOKS = 3  # at a cell, each from where the last one led


def settle(problem: PiecewiseProblem, cells: Cells, found: Branched) -> Branched:
    """Solve the best cell again from its own rows, then whatever its value does not exclude.

    What is still in doubt after that keeps its bound, and so shows in the gap. Where the sums leave no
    doubt, as they mostly do, nothing is solved again.
    """
    slack = _TOLERANCE * max(1.0, abs(found.value))
    if found.errors[found.best] <= slack and not (found.bounds < found.value - slack).any():
        return found
    bounds = found.bounds.copy()
    starts = {int(cell): point for cell, point in zip(found.solved, found.points, strict=True)}
    settled: dict[int, tuple[float, float, Array]] = {}
    cell = found.cell
    while True:
        # a cell that was never solved is looked at from the best point so far; its walls hold it in place
        value, error, point = _from_rows(problem, cells, cell, starts.get(cell, found.point))
        settled[cell] = value, error, point
        bounds[cell] = value - error
        best = min(value for value, _, _ in settled.values())
        below = np.flatnonzero(bounds < best - _TOLERANCE * max(1.0, abs(best)))
        doubtful = [int(c) for c in below[np.argsort(bounds[below])] if int(c) not in settled]
        if not doubtful or len(settled) >= _MOST:
            break
        cell = doubtful[0]
    # values that were never confirmed must not pass for the best
    rest = ~np.isin(found.solved, list(settled)) & np.isfinite(found.values)
    sure = {c: s for c, s in settled.items() if np.isfinite(s[0])}
    values = np.where(found.values >= best, found.values, best + found.errors)[rest]
    return Branched(
        np.concatenate(([value for value, _, _ in sure.values()], values)),
        np.concatenate(([error for _, error, _ in sure.values()], found.errors[rest])),
        np.concatenate(([point for _, _, point in sure.values()], found.points[rest])),
        np.concatenate((np.array(list(sure), dtype=np.intp), found.solved[rest])),
        bounds,
        found.counted,
    )


def _from_rows(problem: PiecewiseProblem, cells: Cells, cell: int, t: Array) -> tuple[float, float, Array]:
    """Constrained minimum of one cell, in coordinates about t in which its Gram matrix is the identity."""
    count = int(cells.count[cell])
    parts = [problem.stick.take(slice(None, count)), problem.slide.take(slice(count, None)), problem.always]
    q = t.size
    gram: Array = sum((part.gram() for part in parts), start=np.zeros((q, q)))
    frame = _frame_of_gram(gram)
    start, to_rows = np.zeros(q), np.eye(q)
    if frame is None:
        frame = _frame_of_rows(np.concatenate([part.design for part in parts]))
        parts = [Rows.of(part.design @ frame, part.residuals(t)) for part in parts]
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
    for _ in range(_LOOKS):
        residuals = [part.residuals(to_rows @ u) for part in parts]
        onto = (part.onto(r) for part, r in zip(parts, residuals, strict=True))
        downhill = sum(onto, start=np.zeros(q))
        slope = to_rows.T @ downhill - frame.T @ problem.slope0
        slope[flat] = 0.0
        square = np.array([sum(float(r @ r) for r in residuals)])
        alone = Cells(
            gram[:, :, None],
            slope[:, None],
            square,
            cells.count[at],
            cells.low[at],
            cells.high[at],
            cells.rounding,
        )
        solved = solve_cells(_seen_from(problem, point, frame), alone, np.array([0]), np.ones((1, q)))
        if not np.isfinite(solved.values[0]):
            break
        shift = 0.0 if problem.pull is None else float(problem.pull @ point)
        value, error = float(solved.values[0]) + shift, float(solved.errors[0])
        ahead = start + frame @ (u + solved.points[0])
        if not _inside_domain(problem, ahead):  # a direction that is flat but for rounding led astray
            break
        u = u + solved.points[0]
        point = start + frame @ u
        if float(np.abs(solved.points[0]).max(initial=0.0)) <= _AT_REST:
            break
    return value, error, point


def _inside_domain(problem: PiecewiseProblem, t: Array) -> bool:
    terms = problem.walls * t
    size = np.abs(terms).sum(axis=1) + np.abs(problem.limits) + 1.0
    return bool((terms.sum(axis=1) - problem.limits <= 1e-9 * size).all())


def _seen_from(problem: PiecewiseProblem, center: Array, frame: Array) -> PiecewiseProblem:
    """The problem's walls in u, with t = center + frame @ u."""
    return replace(
        problem,
        kappa=problem.kappa @ frame,
        kappa0=problem.kappa0 + float(problem.kappa @ center),
        bound=problem.bound @ frame,
        bound0=problem.bound0 + float(problem.bound @ center),
        walls=problem.walls @ frame,
        limits=problem.limits - problem.walls @ center,
    )


def _frame_of_gram(gram: Array) -> Array | None:
    """Matrix F with F' G F = 1 from a Gram matrix; None where it is too ill conditioned for that."""
    if gram.size == 0:
        return np.eye(gram.shape[0])
    size = np.sqrt(np.diag(gram))
    if size.min() <= 0.0:
        return None
    value, vector = np.linalg.eigh(gram / np.outer(size, size))
    if value[0] < _WELL:
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
