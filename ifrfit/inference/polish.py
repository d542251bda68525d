"""The last digits of a cell's minimiser, and the frame in which the cell is round."""

from __future__ import annotations

import numpy as np

from ifrfit.inference.cells import Branched, Cells, constraints
from ifrfit.inference.piecewise import Array, PiecewiseProblem

_WELL = 1e-6  # reciprocal condition of a Gram matrix that needs no orthogonalisation of the rows


def polish(problem: PiecewiseProblem, cells: Cells, found: Branched) -> tuple[Array, Array]:
    """Take the rounding of the sums out of the minimiser, and give the frame in which its cell is round.

    Newton steps with residuals from the rows; the constraints that hold t are kept. In the frame the
    cell's Gram matrix is near the identity, so that wide weights cost no digits there.
    """
    t, count = found.point, int(cells.count[found.cell])
    parts = (problem.stick.take(slice(None, count)), problem.slide.take(slice(count, None)), problem.always)
    walls, _ = constraints(problem, cells, np.array([found.cell]))
    held = _null_space(walls[0, found.walls])
    gram = sum((part.design.T @ part.design for part in parts), start=np.zeros((t.size, t.size)))
    frame = _frame_of_gram(gram)
    step = _frame_of_gram(held.T @ gram @ held)
    if frame is None or step is None:
        design = np.concatenate([part.design for part in parts])
        frame, step = _frame_of_rows(design), _frame_of_rows(design @ held)
    for _ in range(3):
        downhill = -problem.slope0
        for part in parts:
            downhill = downhill + part.design.T @ part.residuals(t)
        t = t + held @ (step @ (step.T @ (held.T @ downhill)))
    return t, frame


def _null_space(held: Array) -> Array:
    """Orthonormal directions along all held walls, (q, free)."""
    if held.shape[0] == 0 or held.shape[1] == 0:
        return np.eye(held.shape[1])
    _, singular, rows = np.linalg.svd(held)
    rank = int((singular > 1e-12 * singular[0]).sum()) if singular[0] > 0.0 else 0
    return np.asarray(rows[rank:].T)


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
