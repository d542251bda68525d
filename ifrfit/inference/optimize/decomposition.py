"""Sums of functions that are linked by one parameter: their minimum, and its proof.

F(x) = sum_i f_i(x), each f_i the least sum of squares of a group of rows at a given x. What proves the
minimum is Lagrange's dual on ever smaller intervals: eqs. (7) to (9) of docs/theory/certificate.md.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.diagnostics.thresholds import GAP
from ifrfit.inference.optimize.branch_and_bound import least_value, minimise
from ifrfit.inference.optimize.piecewise import Array, PiecewiseBatch, PiecewiseOptimum, PiecewiseProblem
from ifrfit.inference.optimize.piecewise_quadratic import cell_constraints, quadratic_of
from ifrfit.inference.optimize.scalar_search import are_distinct, bounded_minimum, minimum_near, scalar_minima

_CUTS = 300  # at the most
_NARROW = 1e-13
_CUT = 0.125  # of an interval, to either side of the minimum in it

_AT_ONCE = 1_000_000  # constraints met at once
_SLACK = 1e-9  # of a constraint that the other unknown cannot move, relative to its terms


class Member(Protocol):
    """A function of the linking parameter that can be bounded from below."""

    def lower_bound(self, low: float, high: float, multiplier: float) -> float:
        """Proven lower bound of f(x) + multiplier * x over low <= x <= high."""
        ...


def lagrangian_bound(
    members: Sequence[Member], multipliers: Sequence[float], low: float, high: float
) -> float:
    """Lower bound of the sum of the members over an interval, eq. (8); the multipliers must sum to zero."""
    return sum(
        member.lower_bound(low, high, multiplier)
        for member, multiplier in zip(members, multipliers, strict=True)
    )


@dataclass(frozen=True)
class PiecewiseMember:
    """Least sum of squares of a piecewise problem at given values of one of its unknowns.

    Attributes
    ----------
    problem : PiecewiseProblem
        In one unknown or two, for all but `lower_bound`.
    unknown : int
        The one that links.
    """

    problem: PiecewiseProblem
    unknown: int

    @cached_property
    def optimum(self) -> PiecewiseOptimum:
        """Its own minimum over all unknowns."""
        return minimise(self.problem)

    @cached_property
    def profile(self) -> PiecewiseProfile:
        """Value and slope at many places, in closed form."""
        return PiecewiseProfile(self.problem, self.optimum.t, self.unknown)

    def value(self, x: float) -> float:
        """Value at one place, certified."""
        return least_value(self.problem.with_fixed(self.unknown, x))[0]

    def minimiser(self, x: float) -> Array:
        """All unknowns at a given value of the linking one, (q,)."""
        return np.insert(minimise(self.problem.with_fixed(self.unknown, x)).t, self.unknown, x)

    def lower_bound(self, low: float, high: float, multiplier: float) -> float:
        """Certified minimum with the multiplier over the interval, less its gap."""
        lowest, highest = self.problem.interval(self.unknown)
        low, high = max(low, lowest), min(high, highest)
        if multiplier * (low if multiplier > 0.0 else high) == -np.inf:
            return -np.inf  # where no row changes any more the multiplier leads down without end
        value, gap = least_value(
            self.problem.within(self.unknown, low, high).with_linear(self.unknown, multiplier)
        )
        return value - gap


@dataclass(frozen=True)
class LinkedOptimum:
    """The minimum of a decomposition.

    Attributes
    ----------
    minima : tuple of (float, float)
        Value and place of the distinct local minima that were found, best first.
    bound : float
        Nothing lies lower than this; -inf without a proof.
    """

    minima: tuple[tuple[float, float], ...]
    bound: float

    @property
    def gap(self) -> float:
        """How far the least value lies above the bound."""
        return max(0.0, self.minima[0][0] - self.bound)


@dataclass(frozen=True)
class Decomposition:
    """F(x) = sum of members, over an interval of the linking parameter."""

    members: tuple[PiecewiseMember, ...]
    low: float
    high: float

    def profile(self, x: Array) -> Array:
        """F at many places, quickly."""
        return np.asarray(np.sum([member.profile(x)[0] for member in self.members], axis=0))

    def value(self, x: float) -> float:
        """F at one place, certified."""
        return sum(member.value(x) for member in self.members)

    def lower_bound(self, low: float, high: float, x: float) -> float:
        """Lower bound over a part of the interval, with the multipliers of eq. (9) from x."""
        slopes = [float(member.profile(np.array([x]))[1][0]) for member in self.members]
        multipliers = np.mean(slopes) - np.array(slopes)
        return lagrangian_bound(self.members, multipliers.tolist(), low, high)

    def minimise(
        self,
        seeds: Sequence[float] = (),
        near: float | None = None,
        *,
        proven: bool = True,
        slack: float = 0.0,
    ) -> LinkedOptimum:
        """Search the profile, then prove the best of what is found.

        Parameters
        ----------
        seeds : sequence of float
            Places to look at, beside a grid.
        near : float, optional
            The only place to look at; then nothing is proven.
        proven : bool
            Without it there is no bound.
        slack : float
            Gap that is small enough, if that is more than rounding.
        """
        if near is None:
            dips = scalar_minima(self.profile, self.low, self.high, seeds)
        else:
            dips = [minimum_near(lambda x: float(self.profile(np.array([x]))[0]), near, self.low, self.high)]
        found = sorted((self.value(x), x) for _, x in dips)
        best, bound = self._prove(found[0], slack) if proven and near is None else (found[0], -np.inf)
        others = (dip for dip in found if are_distinct(dip[1], best[1]))
        return LinkedOptimum((best, *others), bound)

    def _prove(self, best: tuple[float, float], slack: float) -> tuple[tuple[float, float], float]:
        """Bound F by branching on x; gives the optimum, a better one if the branching met it, and a bound.

        The interval with the lowest bound is cut first, so that the bound of the whole rises with each cut.
        """

        def bounded(low: float, high: float) -> tuple[float, float, float]:
            x = best[1] if low <= best[1] <= high else 0.5 * (low + high)
            return self.lower_bound(low, high, x), low, high

        queue = [bounded(self.low, self.high)]
        for _ in range(_CUTS):
            bound, low, high = queue[0]
            small = max(0.5 * GAP * max(1.0, best[0]), slack)
            if bound >= best[0] - small or high - low <= _NARROW * (1.0 + abs(high)):
                break
            heapq.heappop(queue)
            middle = 0.5 * (low + high)
            if low <= best[1] <= high:
                step = _CUT * (high - low)
                ends = {low, max(low, best[1] - step), min(high, best[1] + step), high}
            else:
                ends = {low, middle, high}
                if self.value(middle) < best[0]:
                    best = min(best, bounded_minimum(self.value, low, high, 1e-12))
            for part in itertools.pairwise(sorted(ends)):
                heapq.heappush(queue, bounded(*part))
        return best, queue[0][0]


class PiecewiseProfile:
    """Least sum of squares at given values x of one unknown, and its slope there.

    In a cell it is that of a parabola between two ends, for all cells and many places at once. That is quick,
    and good for finding the way; what is found is taken again by the certified solver.

    Parameters
    ----------
    problem : PiecewiseProblem
        In one unknown or two.
    center : ndarray, (q,)
        Its minimum: sums about it keep their digits.
    unknown : int
        The one that is given.
    """

    def __init__(self, problem: PiecewiseProblem, center: Array, unknown: int) -> None:
        problem = problem.sorted_by_tau().about(center)
        quadratic = quadratic_of(PiecewiseBatch(problem))
        self._center = float(center[unknown])
        constraints, self._limits = cell_constraints(problem, quadratic.low, quadratic.high)
        gram, slope = quadratic.gram[:, :, 0], quadratic.slope[:, 0]
        self._constraint, self._gram = constraints[:, :, unknown], gram[unknown, unknown]
        self._slope, self._square = slope[unknown], quadratic.square[0]
        if slope.shape[0] == 1:
            nothing = np.zeros(quadratic.n_cells)
            self._other_constraint, self._mixed = np.zeros_like(self._constraint), nothing
            self._other_gram, self._other_slope = nothing, nothing
        else:
            other = 1 - unknown
            self._other_constraint, self._mixed = constraints[:, :, other], gram[unknown, other]
            self._other_gram, self._other_slope = gram[other, other], slope[other]

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """Least sum of squares at each x, and its derivative in the cell that holds it, both (n,)."""
        step = max(1, _AT_ONCE // self._limits.size)
        parts = [self._evaluate(x[i : i + step]) for i in range(0, x.size, step)]
        return np.concatenate([value for value, _ in parts]), np.concatenate([slope for _, slope in parts])

    def _evaluate(self, x: Array) -> tuple[Array, Array]:
        d = (x - self._center)[:, None]
        low, high, infeasible = self._ends(self._limits - self._constraint * d[..., None])
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.where(
                self._other_gram > 0.0, (self._other_slope - self._mixed * d) / self._other_gram, 0.0
            )
        t = np.minimum(np.maximum(t, low), high)
        value = self._square + d * (self._gram * d - 2.0 * self._slope)
        value = value + t * (2.0 * self._mixed * d + self._other_gram * t - 2.0 * self._other_slope)
        value = np.where(infeasible, np.inf, value)
        at = np.arange(x.size), value.argmin(axis=1)
        return value[at], (2.0 * (self._gram * d + self._mixed * t - self._slope))[at]

    def _ends(self, limits: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Between what the constraints leave the other unknown, (n, m), and where they leave it nothing."""
        normal = self._other_constraint
        with np.errstate(divide="ignore", invalid="ignore"):
            edge = limits / normal
        low = np.where(normal < 0.0, edge, -np.inf).max(axis=-1, initial=-np.inf)
        high = np.where(normal > 0.0, edge, np.inf).min(axis=-1, initial=np.inf)
        violated = limits < -_SLACK * (1.0 + np.abs(self._limits))
        empty = low > high + _SLACK * (1.0 + np.abs(high))
        return low, high, ((normal == 0.0) & violated).any(axis=-1) | empty
