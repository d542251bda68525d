"""Proof of an optimum over one shared value: Lagrange's dual on ever smaller intervals.

On an interval of the shared value give each series a multiplier (its own slope at one point, less the mean,
so that they sum to zero) and minimise it exactly over the interval and everything else. The sum of these
minima bounds all choices on the interval at once; with shrinking intervals the bound closes quadratically.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ifrfit.inference.diagnostics.thresholds import GAP
from ifrfit.inference.optimize.branch_and_bound import minimise
from ifrfit.inference.optimize.linear_families import kappa_form
from ifrfit.inference.optimize.parameter_group import Array, Constants, ParameterGroup
from ifrfit.inference.optimize.series_profile import Along

C, KAPPA = 1, 2  # places of the shared value among (e_n, c, kappa)

_INTERVALS = 400  # at the most
_NARROW = 1e-13

Dip = tuple[float, float]  # value, place


@dataclass(frozen=True)
class Shared:
    """Series with e_n held, the shared value's place, and what is known of it before (mean, sd)."""

    blocks: tuple[ParameterGroup, ...]
    place: int
    prior: tuple[float, float] | None

    @cached_property
    def series(self) -> tuple[Along, ...]:
        """Each series along the shared value."""
        return tuple(Along(block, _free_index(block, self.place)) for block in self.blocks)

    def along(self, x: Array) -> Array:
        """Sum of squares at many shared values, everything else at its best; to find the way."""
        return np.asarray(sum(series(x)[0] for series in self.series) + self.tie(x))

    def total(self, x: float) -> float:
        """Sum of squares at a shared value, everything else at its best."""
        parts = (minimise(kappa_form(_at(block, self.place, x)).problem).chi2 for block in self.blocks)
        return sum(parts) + float(self.tie(x))

    def tie(self, x: float | Array) -> float | Array:
        """Share of the prior."""
        return 0.0 if self.prior is None else ((x - self.prior[0]) / self.prior[1]) ** 2

    def bound(self, low: float, high: float, x: float) -> float:
        """Lower bound over the interval, with multipliers from x."""
        slopes = [float(series(np.array([x]))[1][0]) for series in self.series]
        if self.prior is not None:
            slopes.append(2.0 * (x - self.prior[0]) / self.prior[1] ** 2)
        pulls = np.mean(slopes) - np.array(slopes)
        bound = 0.0
        for block, pull in zip(self.blocks, pulls, strict=False):
            form = kappa_form(_within(block, self.place, low, high))
            direction = np.zeros(form.problem.kappa.size)
            direction[_free_index(block, self.place)] = pull
            result = minimise(replace(form.problem, linear=direction))
            bound += result.chi2 - result.gap
        if self.prior is not None:
            mean, sd = self.prior
            at = min(max(mean - 0.5 * float(pulls[-1]) * sd * sd, low), high)
            bound += float(self.tie(at)) + float(pulls[-1]) * at
        return bound


def prove(shared: Shared, best: Dip, limits: tuple[float, float]) -> tuple[Dip, float]:
    """Bound everything from below, by branching on the shared value.

    Returns
    -------
    best : (float, float)
        The optimum; a better one if the branching met it.
    bound : float
        What is proven of the whole range.
    """
    from scipy.optimize import minimize_scalar

    queue = [limits]
    proven = np.inf
    for _ in range(_INTERVALS):
        if not queue:
            break
        low, high = queue.pop()
        holds_best = low <= best[1] <= high
        x = best[1] if holds_best else 0.5 * (low + high)
        bound = shared.bound(low, high, x)
        if bound >= best[0] - 0.5 * GAP * max(1.0, best[0]) or high - low <= _NARROW * (1.0 + abs(high)):
            proven = min(proven, bound)
            continue
        if not holds_best and shared.total(x) < best[0]:
            found = minimize_scalar(
                shared.total, bounds=(low, high), method="bounded", options={"xatol": 1e-12}
            )
            best = min(best, (float(found.fun), float(found.x)))
        reach = 0.125 * (high - low)
        cuts = {low, high} | ({max(low, x - reach), min(high, x + reach)} if holds_best else {x})
        edges = sorted(cuts)
        queue += list(itertools.pairwise(edges))
    for low, high in queue:  # what the budget left over
        proven = min(proven, shared.bound(low, high, 0.5 * (low + high)))
    return best, float(proven)


def constants_at(block: ParameterGroup, place: int, x: float) -> Constants:
    """Best constants of a series at a shared value."""
    form = kappa_form(_at(block, place, x))
    return form.to_constants(minimise(form.problem).t)


def _at(block: ParameterGroup, place: int, x: float) -> ParameterGroup:
    if place == C:
        return replace(block, c=replace(block.c, fixed=x, prior=None))
    return replace(block, mu=replace(block.mu, fixed=x / (1.0 + (block.e_n.fixed or 0.0)), prior=None))


def _within(block: ParameterGroup, place: int, low: float, high: float) -> ParameterGroup:
    if place == C:
        return replace(block, c=replace(block.c, lower=low, upper=high))
    factor = 1.0 + (block.e_n.fixed or 0.0)
    return replace(block, mu=replace(block.mu, lower=low / factor, upper=high / factor))


def _free_index(block: ParameterGroup, place: int) -> int:
    return sum(x.fixed is None for x in (block.e_n, block.c, block.mu)[:place])
