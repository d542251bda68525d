"""Constants of a changed table, by a search without proof: cheap enough to try every slip on every fit.

`ifrfit.inference.optimize.batched_search` looks for the constants of one problem from many places. Here a
table has values of its own, which may depend on a size beside the constants: of these no analytic slope, kink
or prior is at hand. A fall of -2 log likelihood is wanted to a thousandth, and a search takes about half as
long as one there.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Index

# from parameters, (m, q), to values, (m, n)
Values = Callable[[Array], Array]

# values that are linear in e_n at given kappa need no choice of it
_GRID = {"e_n": (0.75,), "mu": (0.03, 0.07, 0.12, 0.2, 0.35, 0.6)}
_CURVED_GRID = (0.3, 0.6, 0.9)
_PLACES = 4  # of the closure's own constant
_STEPS = 12
_HALVINGS = 5
_TRUSTED = 0.5  # share of the promised fall with which a whole step is taken
_AT_ONCE = 1_000_000  # values that are computed together
_AT_REST = 1e-3  # fall of minus twice the log likelihood below which the search ends
_DIFFERENCE = 1e-7
_ROWS_OF_STARTS = 48  # by which places are compared
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
_PATIENCE = 2  # steps before a table may be given up
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
        with np.errstate(over="ignore"):  # a step that leads so far is not taken
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
        return np.delete(np.arange(self.base.size), np.concatenate([np.empty(0, int), *self.groups]))

    def without(self, row: int) -> Misfit:
        """The same when one row counts for nothing."""
        base = self.base.copy()
        base[row] = np.inf
        return Misfit(base, tuple(rows[rows != row] for rows in self.groups))

    def of_rows(self, rows: Index) -> Misfit:
        """The same for some of the rows."""
        place = np.full(self.base.size, -1, dtype=np.intp)
        place[rows] = np.arange(rows.size)
        groups = (own[own >= 0] for own in (place[group] for group in self.groups))
        return Misfit(self.base[rows], tuple(own for own in groups if own.size))

    def sigma(self, residual: Array) -> Array:
        """Standard uncertainty of each row at the best noises, (..., n)."""
        sigma = np.broadcast_to(self.base, residual.shape).copy()
        for rows in self.groups:
            square = ((residual[..., rows] / self.base[rows]) ** 2).mean(axis=-1, keepdims=True)
            sigma[..., rows] *= np.sqrt(np.maximum(square, 1e-300))
        return sigma


def without_nan(values: Array, far: float = 0.0) -> Array:
    """Values with a number in the place of nan, and of finite size; those that are so are given back."""
    with np.errstate(over="ignore", invalid="ignore"):
        is_finite = math.isfinite(values.sum())
    return values if is_finite else np.nan_to_num(values, nan=far)


def starts(problem: Problem, theta: Array) -> Array:
    """Places all over the domain, and theta, (m, p)."""
    axes: list[tuple[float, ...]] = []
    for name, at in problem.parameters.positions.items():
        one = problem.parameters.entries[int(at[0])]
        if one.fixed is not None:
            axes.append((one.fixed,))
        elif name in _GRID:
            given = _CURVED_GRID if name == "e_n" and problem.rows.has_kind("curved") else _GRID[name]
            # readings of e_n hold on to theirs, wherever the other constants are
            own = (float(theta[at[0]]),) if name == "e_n" else ()
            axes.append(tuple(x for x in given if one.lower <= x <= one.upper) + own or (one.lower,))
        else:
            low, high = max(one.lower, -10.0), min(one.upper, 10.0)
            axes.append(tuple(np.linspace(low, high, _PLACES).tolist()))
    grid = list(itertools.product(*axes))
    found = np.empty((len(grid) + 1, theta.size))
    for column, entries in enumerate(problem.parameters.positions.values()):
        found[:-1, entries] = np.array([point[column] for point in grid])[:, None]
    for number, entry in enumerate(problem.parameters.entries):
        if entry.fixed is not None:
            found[:, number] = entry.fixed
    found[-1] = theta
    return found


def in_parts(places: Array, n: int) -> list[Array]:
    """Several places, (m, q), in parts of which n values each fit into memory."""
    return np.array_split(places, min(len(places), 1 + len(places) * n // _AT_ONCE))


def spread(n: int, count: int) -> Index:
    """Some of n places, `count` at most: spread over all, in step with no order that these may have."""
    return np.unique((np.arange(1, count + 1) * _GOLDEN % 1.0 * n).astype(np.intp))


def best_start(values: Callable[[Array, Index], Array], misfit: Misfit, value: Array, tried: Array) -> Array:
    """Of several thetas, (m, p), the one whose values lie nearest: they are asked of some rows, (m, rows)."""
    rows = np.arange(value.size) if value.size <= _ROWS_OF_STARTS else spread(value.size, _ROWS_OF_STARTS)
    far = misfit.of_rows(rows).likelihood(value[rows] - np.nan_to_num(values(tried, rows), nan=1e3))
    return np.asarray(tried[np.argmin(far)])


def search(
    values: Values,
    misfit: Misfit,
    value: Array,
    start: Array,
    bounds: tuple[Array, Array],
    target: float = math.inf,
    *,
    near: bool = False,
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
    target : float
        Minus twice the log likelihood: a table is given up whose steps are too short to reach it.
    near : bool
        Whether the start lies so near to the best constants that the first step tells that already.

    Returns
    -------
    x : ndarray, (q,)
    residual : ndarray, (n,)
    """
    lower, upper = bounds
    x = np.clip(start, lower, upper)
    slopes, residual = _linearised(values, value, x, bounds)
    now = float(misfit.likelihood(residual))
    for left_over in range(_STEPS, 0, -1):
        change = _step(misfit, x, slopes, residual, bounds)
        promised = now - float(misfit.likelihood(residual - change @ slopes))
        if not promised > _AT_REST or (near and now - left_over * promised >= target):
            break
        # the whole step is taken with the slopes at its end, and only where it fails, parts of it are tried
        whole = np.clip(x + change, lower, upper)
        slopes, left = _linearised(values, value, whole, bounds)
        best = float(misfit.likelihood(left)), whole, left
        if not now - best[0] >= _TRUSTED * promised:
            tried = np.clip(x + 0.5 ** np.arange(1, _HALVINGS)[:, None] * change, lower, upper)
            for part in in_parts(tried, value.size):
                left = value - without_nan(values(part))
                nearest = int(np.argmin(far := misfit.likelihood(left)))
                if far[nearest] < best[0]:
                    best = float(far[nearest]), part[nearest], left[nearest]
        fall = now - best[0]
        if not fall > _AT_REST:
            break
        if best[1] is not whole:
            slopes, _ = _linearised(values, value, best[1], bounds)
        now, x, residual = best
        # too far away to be reached at this pace
        if left_over <= _STEPS - _PATIENCE + 1 and now - left_over * fall >= target:
            break
    return x, residual


def refitted(problem: Problem, misfit: Misfit, theta: Array) -> tuple[Array, Array]:
    """Constants, (p,), and residuals, (n,), of one table by `search` from theta; fixed ones are free, too."""
    return search(problem.predict, misfit, problem.rows.value, theta, problem.parameters.bounds())


def _linearised(values: Values, value: Array, x: Array, bounds: tuple[Array, Array]) -> tuple[Array, Array]:
    """Slopes of the values by each parameter, (q, n), and residuals, (n,), at x."""
    step = _DIFFERENCE * np.where(x + _DIFFERENCE > bounds[1], -1.0, 1.0)
    found, done = np.empty((x.size + 1, value.size)), 0
    for part in in_parts(np.concatenate((x[None], x + np.diag(step))), value.size):
        found[done : done + len(part)] = values(part)
        done += len(part)
    at_x, slopes = np.split(without_nan(found), [1])
    slopes -= at_x
    slopes /= step[:, None]
    return slopes, value - at_x[0]


def _step(misfit: Misfit, x: Array, slopes: Array, residual: Array, bounds: tuple[Array, Array]) -> Array:
    """Gauss-Newton step, (q,), along what is not held by a bound."""
    lower, upper = bounds
    sigma = misfit.sigma(residual)
    scaled = slopes / sigma
    z = residual / sigma
    gradient = scaled @ z
    # a constant that lies on its bound but for rounding would take the step from those that can move
    room = _AT_BOUND * np.minimum(upper - lower, 1.0)
    held = (x <= lower + room) & (gradient < 0.0)
    held |= (x >= upper - room) & (gradient > 0.0)
    scaled[held] = 0.0
    return np.asarray(np.linalg.lstsq(scaled.T, z, rcond=_LOOSE)[0])
