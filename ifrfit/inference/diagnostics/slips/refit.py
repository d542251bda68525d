"""Constants of a changed table, by a search without proof: cheap enough to try every slip on every fit."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Index

Values = Callable[[Array], Array]

_GRID = {"e_n": (0.3, 0.6, 0.9), "mu": (0.03, 0.07, 0.12, 0.2, 0.35, 0.6)}
_PLACES = 4  # of the closure's own constant
_STEPS = 12
_HALVINGS = 5
_AT_REST = 1e-3  # fall of minus twice the log likelihood below which the search ends
_DIFFERENCE = 1e-7
_AT_BOUND = 1e-9
_LOOSE = 1e-6  # relative singular value below which a combination of constants stays where it is


@dataclass(frozen=True)
class Misfit:
    """Weighted squares of residuals by noise group, with what turns them into a likelihood.

    Attributes
    ----------
    base : ndarray, (n,)
        Standard uncertainty of each row up to the noise of its group.
    groups : tuple of ndarray of int
        Rows that share an unknown noise; of all others sigma is known.
    """

    base: Array
    groups: tuple[Index, ...]

    @classmethod
    def of(cls, problem: Problem) -> Misfit:
        """Of the noise of a problem."""
        return cls(problem.noise.base, tuple(problem.noise_groups().values()))

    def likelihood(self, residual: Array) -> Array:
        """Minus twice the log likelihood of residuals, (..., n), at the best noises, but for a constant."""
        z = (residual / self.base) ** 2
        if not self.groups:
            return np.asarray(z.sum(axis=-1))
        total = np.asarray(z[..., self.known].sum(axis=-1))
        for rows in self.groups:
            total = total + rows.size * np.log(np.maximum(z[..., rows].sum(axis=-1), 1e-300))
        return np.asarray(total)

    @cached_property
    def known(self) -> Index:
        """Rows of no group."""
        return np.setdiff1d(np.arange(self.base.size), np.concatenate([np.empty(0, int), *self.groups]))

    def without(self, row: int) -> Misfit:
        """The same when one row counts for nothing."""
        base = self.base.copy()
        base[row] = np.inf
        return Misfit(base, tuple(rows[rows != row] for rows in self.groups))

    def sigma(self, residual: Array) -> Array:
        """Standard uncertainty of each row at the best noises, (n,)."""
        sigma = self.base.copy()
        for rows in self.groups:
            sigma[rows] *= math.sqrt(max(float(((residual / self.base)[rows] ** 2).mean()), 1e-300))
        return sigma


def starts(problem: Problem, theta: Array) -> Array:
    """Places all over the domain, and theta, (m, p)."""
    axes: list[tuple[float, ...]] = []
    for name, places in problem.parameters.positions.items():
        one = problem.parameters.entries[int(places[0])]
        if one.fixed is not None:
            axes.append((one.fixed,))
        elif name in _GRID:
            axes.append(tuple(x for x in _GRID[name] if one.lower <= x <= one.upper) or (one.lower,))
        else:
            low, high = max(one.lower, -10.0), min(one.upper, 10.0)
            axes.append(tuple(np.linspace(low, high, _PLACES).tolist()))
    grid = list(itertools.product(*axes))
    found = np.empty((len(grid) + 1, theta.size))
    for column, places in enumerate(problem.parameters.positions.values()):
        found[:-1, places] = np.array([point[column] for point in grid])[:, None]
    for at, entry in enumerate(problem.parameters.entries):
        if entry.fixed is not None:
            found[:, at] = entry.fixed
    found[-1] = theta
    return found


def best_start(values: Values, misfit: Misfit, value: Array, tried: Array) -> Array:
    """Of several thetas, (m, p), the one whose values lie nearest."""
    far = misfit.likelihood(value - np.nan_to_num(values(tried), nan=1e3))
    return np.asarray(tried[int(np.argmin(far))])


def search(
    values: Values,
    misfit: Misfit,
    value: Array,
    start: Array,
    bounds: tuple[Array, Array],
    free: NDArray[np.bool_],
) -> tuple[Array, Array]:
    """Gauss-Newton within bounds; noises follow from the residuals.

    Parameters
    ----------
    values : callable
        From parameters, (m, q), to values, (m, n).
    misfit : Misfit
    value : ndarray, (n,)
        As measured.
    start : ndarray, (q,)
    bounds : (ndarray, ndarray), (q,) each
    free : ndarray of bool, (q,)

    Returns
    -------
    x : ndarray, (q,)
    residual : ndarray, (n,)
    """
    lower, upper = bounds
    x = np.clip(start, lower, upper)
    residual = value - np.nan_to_num(values(x[None]))[0]
    now = float(misfit.likelihood(residual))
    for _ in range(_STEPS):
        step = _DIFFERENCE * np.where(x + _DIFFERENCE > upper, -1.0, 1.0)
        moved = np.nan_to_num(values(x + np.diag(step)[free]))
        columns = (moved - (value - residual)).T / step[free]
        sigma = misfit.sigma(residual)
        scaled = columns / sigma[:, None]
        gradient = scaled.T @ (residual / sigma)
        # a constant that lies on its bound but for rounding would take the step from those that can move
        room = _AT_BOUND * np.minimum(upper - lower, 1.0)[free]
        at_end = (x[free] <= lower[free] + room) & (gradient < 0.0)
        at_end |= (x[free] >= upper[free] - room) & (gradient > 0.0)
        change = np.zeros(x.size)
        inner = np.zeros(int(free.sum()))
        inner[~at_end] = np.linalg.lstsq(scaled[:, ~at_end], residual / sigma, rcond=_LOOSE)[0]
        change[free] = inner
        tried = np.clip(x + 0.5 ** np.arange(_HALVINGS)[:, None] * change, lower, upper)
        left = value - np.nan_to_num(values(tried))
        far = misfit.likelihood(left)
        best = int(np.argmin(far))
        if not far[best] < now - _AT_REST:
            break
        x, residual, now = tried[best], left[best], float(far[best])
    return x, residual
