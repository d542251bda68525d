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

from ifrfit.inference.diagnostics.thresholds import GAP
from ifrfit.inference.optimize.branch_and_bound import least_value, minimise
from ifrfit.inference.optimize.piecewise import Array, PiecewiseOptimum, PiecewiseProblem
from ifrfit.inference.optimize.piecewise_profile import PiecewiseProfile
from ifrfit.inference.optimize.scalar_search import are_distinct, bounded_minimum, minimum_near, scalar_minima

_CUTS = 300  # at the most
_NARROW = 1e-13
_CUT = 0.125  # of an interval, to either side of the minimum in it


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
