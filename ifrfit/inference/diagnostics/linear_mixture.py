"""Mixtures of two linear regressions that differ in one slope, by expectation and maximisation, many at once.

The law about its optimum, as residuals and slopes in units of the noise: what two kinds of impacts take off
-2 log likelihood is known in milliseconds, whatever their share and distance, before any law is computed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Index
from ifrfit.inference.optimize.noise_modes import likely_sigma

_FEWEST = 6  # impacts that tell of a constant, below which it is not asked
_STRONG = 0.1  # share of the strongest impact's information from which an impact does
_DISTANCES = (1.5, 2.5)  # of the kinds at the start, in the scatter of the constant from impact to impact
_SHARES = (0.5, 0.2)
_FIRST_STEPS, _LAST_STEPS = 6, 20  # with all starts, and with the better ones
_KEPT = 2  # starts of a constant
_LEAST_SHARE = 0.02
_LEAST_VARIANCE = 1e-6  # of a noise, in that of one kind
_RIDGE = 1e-9
_MOST = 1_000  # impacts, spread over the table, that the search looks at
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


@dataclass(frozen=True)
class Linearised:
    """Residuals and slopes at the optimum, in units of the noise, impact by impact.

    Attributes
    ----------
    residual : ndarray, (n,)
    slopes : ndarray, (n, k)
        By the free constants.
    rows : ndarray of int, (n,)
        Of the problem, in the order of their impacts.
    first : ndarray of int, (impacts,)
        Where the rows of each impact begin.
    groups : tuple of ndarray of int
        Places of the rows that share an unknown noise.
    """

    residual: Array
    slopes: Array
    rows: Index
    first: Index
    groups: tuple[Index, ...]

    @classmethod
    def of(cls, problem: Problem, theta: Array) -> Linearised:
        """At theta, with every unknown noise at its most likely."""
        sigma = likely_sigma(problem, theta)
        order = np.argsort(problem.rows.impacts, kind="stable")
        free = np.flatnonzero(problem.parameters.free)
        place = np.empty_like(order)
        place[order] = np.arange(order.size)
        return cls(
            (problem.residual(theta) / sigma)[order],
            (problem.jacobian(theta)[:, free] / sigma[:, None])[order],
            order,
            np.flatnonzero(np.diff(problem.rows.impacts[order], prepend=-1)),
            tuple(place[rows] for rows in problem.noise_groups().values()),
        )

    @property
    def of_impact(self) -> Index:
        """Number of each row's impact, (n,)."""
        return np.repeat(np.arange(self.first.size), np.diff(self.first, append=self.rows.size))

    def by_impact(self, of_rows: Array) -> Array:
        """Sums over the rows of each impact, (..., n) to (..., impacts)."""
        return np.asarray(np.add.reduceat(of_rows, self.first, axis=-1))

    def thinned(self) -> Linearised:
        """Some of the impacts, where there are very many."""
        count = self.first.size
        if count <= _MOST:
            return self
        kept = np.zeros(count, dtype=bool)
        kept[(np.arange(1, _MOST + 1) * _GOLDEN % 1.0 * count).astype(np.intp)] = True
        own = kept[self.of_impact]
        place = np.cumsum(own) - 1
        return Linearised(
            self.residual[own],
            self.slopes[own],
            self.rows[own],
            np.flatnonzero(np.diff(self.of_impact[own], prepend=-1)),
            tuple(place[rows[own[rows]]] for rows in self.groups),
        )


@dataclass(frozen=True)
class LinearKinds:
    """The best mixture in one constant.

    Attributes
    ----------
    column : int
        Of the slopes.
    change : ndarray, (k,)
        Of the free constants from the optimum to the first kind.
    difference : float
        Of the second kind from the first in the constant.
    share : float
        Of the second kind.
    drop : float
        Fall of -2 log likelihood without the impact that speaks most.
    spread : float
        Scatter of the constant from impact to impact, of one kind.
    """

    column: int
    change: Array
    difference: float
    share: float
    drop: float
    spread: float


def linear_kinds(linear: Linearised, columns: Index) -> list[LinearKinds]:
    """The best mixture in each of some constants, (columns of the slopes)."""
    thinned = linear.thinned()
    starts = [one for column in columns.tolist() for one in _starts(thinned, column)]
    if not starts:
        return []
    search = _Search.of(thinned, np.array([column for column, _, _ in starts]))
    difference, share = (np.array([one[i] for one in starts]) for i in (1, 2))
    change = np.zeros((len(starts), thinned.slopes.shape[1]))
    change[np.arange(len(starts)), search.columns] = -share * difference
    state = search.run(change, difference, share, np.ones((len(starts), thinned.residual.size)), _FIRST_STEPS)
    better = _best(search.columns, state[-1].sum(axis=1), _KEPT)
    search = _Search.of(thinned, search.columns[better])
    change, difference, share, variance, _ = (part[better] for part in state)
    change, difference, share, _, gain = search.run(change, difference, share, variance, _LAST_STEPS)
    best = _best(search.columns, gain.sum(axis=1), 1)
    drop = gain.sum(axis=1) - gain.max(axis=1)
    return [
        LinearKinds(
            int(search.columns[i]),
            change[i],
            float(difference[i]),
            float(share[i]),
            float(drop[i]),
            _spread(thinned, int(search.columns[i])),
        )
        for i in best.tolist()
    ]


def _starts(linear: Linearised, column: int) -> list[tuple[int, float, float]]:
    """Differences and shares of the second kind to start from."""
    spread = _spread(linear, column)
    return [
        (column, sign * distance * spread, share)
        for distance in _DISTANCES
        for share in _SHARES
        for sign in (1.0, -1.0)
        if spread > 0.0
    ]


def _spread(linear: Linearised, column: int) -> float:
    """Scatter of a constant from impact to impact; 0 where too few impacts tell of it."""
    slope = linear.slopes[:, column]
    strength = linear.by_impact(slope**2)
    strong = strength > _STRONG * strength.max(initial=0.0)
    if strong.sum() < _FEWEST:
        return 0.0
    shift = linear.by_impact(slope * linear.residual)[strong] / strength[strong]
    return math.sqrt(max(float(np.average(shift**2, weights=strength[strong])), 1e-24))


def _best(columns: Index, gain: Array, many: int) -> Index:
    """Places of the largest gains, so many for each column."""
    order = np.argsort(-np.nan_to_num(gain, nan=-np.inf), kind="stable")
    return np.concatenate([order[columns[order] == column][:many] for column in np.unique(columns)])


@dataclass(frozen=True)
class _Search:
    """Expectation and maximisation for several (m) pairs of kinds at once."""

    linear: Linearised
    columns: Index
    along: Array  # slope of the constant in which the kinds differ, (m, n)
    products: Array  # of the slopes, (n, k k)

    @classmethod
    def of(cls, linear: Linearised, columns: Index) -> _Search:
        slopes = linear.slopes
        products = (slopes[:, :, None] * slopes[:, None, :]).reshape(len(slopes), -1)
        return cls(linear, columns, slopes[:, columns].T, products)

    def run(
        self, change: Array, difference: Array, share: Array, variance: Array, steps: int
    ) -> tuple[Array, Array, Array, Array, Array]:
        """Some steps: change, (m, k), difference and share, (m,), variance, (m, n); gain, (m, impacts)."""
        linear, of_impact = self.linear, self.linear.of_impact
        before = linear.by_impact(linear.residual**2)
        for step in range(steps + 1):
            left = linear.residual - change @ linear.slopes.T
            other = left - difference[:, None] * self.along
            logs = np.log(variance)
            first = -0.5 * linear.by_impact(left**2 / variance + logs) + np.log1p(-share)[:, None]
            second = -0.5 * linear.by_impact(other**2 / variance + logs) + np.log(share)[:, None]
            total = np.logaddexp(first, second)
            if step == steps:
                break
            of_second = np.exp(second - total)
            share = np.clip(of_second.mean(axis=1), _LEAST_SHARE, 1.0 - _LEAST_SHARE)
            weight = of_second[:, of_impact]
            square = left**2 + weight * (other**2 - left**2)
            for rows in linear.groups:
                mean = square[:, rows].mean(axis=1, keepdims=True)
                variance[:, rows] = np.maximum(mean, _LEAST_VARIANCE)
            change, difference = self._maximum(weight, 1.0 / variance)
        return change, difference, share, variance, 2.0 * total + before

    def _maximum(self, of_second: Array, weight: Array) -> tuple[Array, Array]:
        """Constants and difference by weighted least squares."""
        slopes, residual = self.linear.slopes, self.linear.residual
        m, k = len(weight), slopes.shape[1]
        normal, right = np.empty((m, k + 1, k + 1)), np.empty((m, k + 1))
        normal[:, :k, :k] = (weight @ self.products).reshape(m, k, k)
        own = of_second * weight * self.along
        normal[:, :k, k] = normal[:, k, :k] = own @ slopes
        normal[:, k, k] = (own * self.along).sum(axis=1)
        right[:, :k], right[:, k] = (weight * residual) @ slopes, own @ residual
        largest = np.einsum("mii->mi", normal).max(axis=1)
        normal += (_RIDGE * largest)[:, None, None] * np.eye(k + 1)
        found = np.linalg.solve(normal, right[..., None])[..., 0]
        return found[:, :k], found[:, k]
