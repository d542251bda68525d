"""Stationary points of convex quadratics under every set of active constraints, many quadratics at once.

With q unknowns at most three and a handful of constraints all active sets can be enumerated; no general
solver of quadratic programs does thousands of them at once.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FLAT = 1e-14  # below this share of its diagonal a pivot counts as zero
_PARALLEL = 1e-12  # below this determinant constraints do not meet in one point


def stationary_points(
    gram: Array, slope: Array, constraints: Array, limits: Array
) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
    """Stationary points of t'Gt - 2 g't with each choice of up to q of the p constraints active.

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
