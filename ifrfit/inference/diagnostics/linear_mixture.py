"""Mixtures of two linear regressions that differ in one slope, by expectation and maximisation, many at once.

The law about its optimum, as residuals and slopes in units of the noise: what two kinds of impacts take off
-2 log likelihood is known in milliseconds, whatever their share and distance, before any law is computed.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

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
_MORE = 4_000  # that what it found is held against
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
    theta : ndarray, (p,)
        Constants about which the law is linear.
    free : ndarray of int, (k,)
        Places in theta of the slopes.
    """

    residual: Array
    slopes: Array
    rows: Index
    first: Index
    groups: tuple[Index, ...]
    theta: Array
    free: Index

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
            theta,
            free,
        )

    @property
    def free_constants(self) -> Array:
        """Free constants about which the law is linear, (k,)."""
        return self.theta[self.free]

    @property
    def of_impact(self) -> Index:
        """Number of each row's impact, (n,)."""
        return np.repeat(np.arange(self.first.size), np.diff(self.first, append=self.rows.size))

    def by_impact(self, of_rows: Array) -> Array:
        """Sums over the rows of each impact, (..., n) to (..., impacts)."""
        return np.asarray(np.add.reduceat(of_rows, self.first, axis=-1))

    def about(self, problem: Problem, thetas: Array) -> list[Linearised]:
        """The same rows in the same units, about other constants, (m, p)."""
        sigma = likely_sigma(problem, self.theta)[self.rows]
        residuals = problem.residual(thetas)[:, self.rows] / sigma
        return [
            replace(
                self,
                residual=residual,
                slopes=problem.jacobian(theta)[np.ix_(self.rows, self.free)] / sigma[:, None],
                theta=theta,
            )
            for theta, residual in zip(thetas, residuals, strict=True)
        ]

    def thinned(self, most: int = _MOST) -> Linearised:
        """Some of the impacts, where there are more."""
        count = self.first.size
        if count <= most:
            return self
        kept = np.zeros(count, dtype=bool)
        kept[(np.arange(1, most + 1) * _GOLDEN % 1.0 * count).astype(np.intp)] = True
        own = kept[self.of_impact]
        place = np.cumsum(own) - 1
        return Linearised(
            self.residual[own],
            self.slopes[own],
            self.rows[own],
            np.flatnonzero(np.diff(self.of_impact[own], prepend=-1)),
            tuple(place[rows[own[rows]]] for rows in self.groups),
            self.theta,
            self.free,
        )


@dataclass(frozen=True)
class LinearKinds:
    """The best mixture in one constant.

    Attributes
    ----------
    column : int
        Of the slopes.
    first, second : ndarray, (k,)
        Free constants of both kinds.
    share : float
        Of the second kind.
    drop : float
        Fall of -2 log likelihood without the impact that speaks most.
    spread : float
        Scatter of the constant from impact to impact, of one kind.
    noises : ndarray, (groups,)
        Unknown ones, in those of one kind.
    about : (ndarray, ndarray), (p,) each
        Constants about which the law of either kind is linear.
    """

    column: int
    first: Array
    second: Array
    share: float
    drop: float
    spread: float
    noises: Array
    about: tuple[Array, Array]


@dataclass(frozen=True)
class Start:
    """Two kinds to start from, each with the law linear about constants of its own.

    Attributes
    ----------
    column : int
    first, second : Linearised
    change : ndarray, (k + 1,)
        Of the free constants of the first kind from there; last, of that in which they differ of the second.
    share : float
        Of the second kind.
    """

    column: int
    first: Linearised
    second: Linearised
    change: Array
    share: float


def linear_kinds(linear: Linearised, columns: Index, others: Sequence[Start] = ()) -> list[LinearKinds]:
    """The best mixture in each of some constants (columns of the slopes).

    Parameters
    ----------
    linear : Linearised
        At the optimum.
    columns : ndarray of int
    others : sequence of Start
        Further places to start from, of the same rows.
    """
    spread = {column: _spread(linear, column) for column in columns.tolist()}
    starts = [start for column, size in spread.items() if size for start in _starts(linear, column, size)]
    starts += [start for start in others if spread.get(start.column)]
    if not starts:
        return []
    search = _Search.of(starts)
    change = np.stack([start.change for start in starts])
    share = np.array([start.share for start in starts])
    state = search.run(linear, change, share, np.ones((len(starts), linear.residual.size)), _FIRST_STEPS)
    better = _best(search.columns, state[-1].sum(axis=1), _KEPT)
    search = search.some(better)
    change, share, variance, _ = (part[better] for part in state)
    change, share, variance, gain = search.run(linear, change, share, variance, _LAST_STEPS)
    drop = gain.sum(axis=1) - gain.max(axis=1)
    found = []
    for i in _best(search.columns, gain.sum(axis=1), 1).tolist():
        start = starts[int(better[i])]
        first, second = change[i, :-1].copy(), change[i, :-1].copy()
        second[start.column] = change[i, -1]
        found.append(
            LinearKinds(
                start.column,
                start.first.free_constants + first,
                start.second.free_constants + second,
                float(share[i]),
                float(drop[i]),
                spread[start.column],
                np.sqrt([variance[i, rows[0]] for rows in linear.groups]),
                (start.first.theta, start.second.theta),
            )
        )
    return found


def confirmed_by_more(
    problem: Problem, linear: Linearised, found: Sequence[LinearKinds], least: float
) -> list[LinearKinds]:
    """What was found of some of very many impacts, by more of them.

    What two kinds explain grows with the number of impacts, and what chance explains does not: of the fall by
    more of them twice the share of the former counts.

    Parameters
    ----------
    problem : Problem
    linear : Linearised
        Of all impacts, at the optimum.
    found : sequence of LinearKinds
    least : float
        Fall of -2 log likelihood below which kinds are let go of.
    """
    more = linear.thinned(_MORE)
    if more.first.size <= _MOST:
        return list(found)
    return [_by_more(problem, more, one) for one in found if one.drop > least]


def _by_more(problem: Problem, linear: Linearised, one: LinearKinds) -> LinearKinds:
    first, second = linear.about(problem, np.stack(one.about))
    last = one.second[one.column] - second.free_constants[one.column]
    change = np.append(one.first - first.free_constants, last)
    search = _Search.of([Start(one.column, first, second, change, one.share)])
    variance = np.ones((1, linear.residual.size))
    for rows, noise in zip(linear.groups, one.noises, strict=True):
        variance[:, rows] = noise**2
    change, share, variance, gain = search.run(
        linear, change[None], np.array([one.share]), variance, _LAST_STEPS
    )
    moved = change[0, :-1].copy()
    moved[one.column] = change[0, -1]
    fall = float(gain.sum() - gain.max())
    return replace(
        one,
        first=first.free_constants + change[0, :-1],
        second=second.free_constants + moved,
        share=float(share[0]),
        drop=min(one.drop, 2.0 * fall * _MOST / linear.first.size),
        noises=np.sqrt([variance[0, rows[0]] for rows in linear.groups]),
    )


def _starts(linear: Linearised, column: int, spread: float) -> Iterator[Start]:
    """Differences and shares of the second kind to start from."""
    for distance, share, sign in itertools.product(_DISTANCES, _SHARES, (1.0, -1.0)):
        change = np.zeros(linear.slopes.shape[1] + 1)
        change[column] = -sign * distance * spread * share
        change[-1] = sign * distance * spread * (1.0 - share)
        yield Start(column, linear, linear, change, share)


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
    """Expectation and maximisation for several (m) pairs of kinds at once.

    Attributes
    ----------
    columns : ndarray of int, (m,)
    residual : ndarray, (2, m, n)
        Of both kinds, where the law is linear about.
    slopes : ndarray, (2, m, n, k + 1)
        By the constants of the first kind, and that in which the second differs.
    """

    columns: Index
    residual: Array
    slopes: Array

    @classmethod
    def of(cls, starts: Sequence[Start]) -> _Search:
        columns = np.array([start.column for start in starts])
        residual = np.stack(
            [[one.residual for one in (start.first, start.second)] for start in starts], axis=1
        )
        slopes = np.stack([[one.slopes for one in (start.first, start.second)] for start in starts], axis=1)
        slopes = np.concatenate((slopes, np.zeros((*slopes.shape[:-1], 1))), axis=-1)
        every = np.arange(columns.size)
        slopes[1, every, :, -1] = slopes[1, every, :, columns]
        slopes[1, every, :, columns] = 0.0
        return cls(columns, residual, slopes)

    def some(self, kept: Index) -> _Search:
        """Some of the pairs."""
        return _Search(self.columns[kept], self.residual[:, kept], self.slopes[:, kept])

    def run(
        self, linear: Linearised, change: Array, share: Array, variance: Array, steps: int
    ) -> tuple[Array, Array, Array, Array]:
        """Some steps: change, (m, k + 1), share, (m,), variance, (m, n), and gain, (m, impacts)."""
        of_impact = linear.of_impact
        before = linear.by_impact(linear.residual**2)
        for step in range(steps + 1):
            square = (self.residual - (self.slopes @ change[:, :, None])[..., 0]) ** 2
            each = -0.5 * linear.by_impact(square / variance + np.log(variance))
            each += np.log(np.stack((1.0 - share, share)))[:, :, None]
            total = np.logaddexp(each[0], each[1])
            if step == steps:
                break
            of_second = np.exp(each[1] - total)
            share = np.clip(of_second.mean(axis=1), _LEAST_SHARE, 1.0 - _LEAST_SHARE)
            weight = of_second[:, of_impact]
            weight = np.stack((1.0 - weight, weight))
            mean = (weight * square).sum(axis=0)
            for rows in linear.groups:
                variance[:, rows] = np.maximum(mean[:, rows].mean(axis=1, keepdims=True), _LEAST_VARIANCE)
            change = self._maximum(weight / variance)
        return change, share, variance, 2.0 * total + before

    def _maximum(self, weight: Array) -> Array:
        """Constants of both kinds by least squares with weights, (2, m, n)."""
        weighted = np.swapaxes(self.slopes * weight[..., None], -1, -2)
        normal = (weighted @ self.slopes).sum(axis=0)
        right = (weighted @ self.residual[..., None]).sum(axis=0)
        largest = np.einsum("mii->mi", normal).max(axis=1)
        normal += (_RIDGE * largest)[:, None, None] * np.eye(normal.shape[-1])
        return np.asarray(np.linalg.solve(normal, right)[..., 0])
