"""Marginals as such: mean, standard deviation and distribution function of a quantity.

What the quantities of one part of the integral are is told in `series_marginal`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.posterior.joint_grid import ErrorsByAxis, JointDensity

Array = NDArray[np.float64]
Moments = Callable[[int], tuple[float, float]]
Cdf = Callable[[Array, int], Array]  # of thresholds (n,) and a number of levels, (levels, n)


@dataclass(frozen=True)
class Marginal:
    """One marginal.

    Attributes
    ----------
    name : str
    low, high : float
        Support.
    moments : callable
        From the level (0 for the rules, 1 for the coarse ones inside them) to mean and standard deviation.
    cdf : callable
        From thresholds (n,) and 1 or 2, for the rules alone or the coarse ones too, to probabilities,
        (1 or 2, n).
    split : callable or None
        Splits panels where these quantiles put a kink into the integrand; whether it split any.
    errors : callable or None
        From thresholds, and factors of what is found there, to the largest errors that only distribution
        functions show: in each panel of an axis over which conditional ones are averaged, which can be steps
        where the densities themselves are smooth, and of the closure constant.
    factors : tuple of (int, ndarray)
        The quantity as a product over independent parts of the integral: part and values at its nodes; -1 for
        values at the outer nodes.
    """

    name: str
    low: float
    high: float
    moments: Moments
    cdf: Cdf
    split: Callable[[Array], bool] | None = None
    factors: tuple[tuple[int, Array], ...] = ()
    errors: Callable[[Array, Array], ErrorsByAxis] | None = None

    @cached_property
    def known(self) -> dict[float, tuple[Array, Array]]:
        """Quantiles at `LEVELS` and the densities there, by the accuracy that they were asked with."""
        return {}


def moments_of(expect: Callable[[Callable[[Array], Array]], Array]) -> Moments:
    """Mean and standard deviation from expectations by both levels, (2,)."""

    @cache
    def both() -> list[tuple[float, float]]:
        mean = expect(lambda v: v)
        square = expect(lambda v: (v - mean[0]) ** 2) - (mean - mean[0]) ** 2
        return [(float(m), math.sqrt(max(float(v), 0.0))) for m, v in zip(mean, square, strict=True)]

    return lambda level: both()[level]


def shared(grid: JointDensity, number: int, name: str) -> Marginal:
    """Of an unknown that the series share."""
    one = grid.joint.shared[number]
    rows = grid.outer_marginal(number)

    def cdf(t: Array, levels: int) -> Array:
        t = np.log(np.maximum(t, 1e-300)) if one.log else t
        return rows.below_in_all(t, levels)

    def expect(of: Callable[[Array], Array]) -> Array:
        return np.asarray(grid.share @ of(grid.at[one.kind]))

    factors = ((-1, grid.at[one.kind]),)
    return Marginal(name, one.unknown.lower, one.unknown.upper, moments_of(expect), cdf, factors=factors)


def product_of_shared(grid: JointDensity, e_number: int, mu_number: int, name: str) -> Marginal:
    """kappa = mu (1 + e_n) where both are shared."""
    e, mu = grid.joint.shared[e_number], grid.joint.shared[mu_number]
    rows = [grid.outer_rows(mu_number, level, e_number) for level in (0, 1)]
    at = 1.0 + e.values()

    def cdf(t: Array, levels: int) -> Array:
        weights = e.axis.weights()
        return np.stack([rows[level].below(t[:, None] / at) @ weights[level] for level in range(levels)])

    def expect(of: Callable[[Array], Array]) -> Array:
        return np.asarray(grid.share @ of(grid.at["mu"] * (1.0 + grid.at["e_n"])))

    ends = mu.unknown.lower * (1.0 + e.unknown.lower), mu.unknown.upper * (1.0 + e.unknown.upper)
    return Marginal(name, *ends, moments_of(expect), cdf)


def covariance(grid: JointDensity, quantities: Sequence[Marginal]) -> Array:
    """Posterior covariance, by the law of total covariance over the outer nodes."""
    share = grid.share[0]
    means = [float((share * _product(grid, q.factors)).sum()) for q in quantities]
    found = np.zeros((len(quantities), len(quantities)))
    for i, first in enumerate(quantities):
        for j, second in enumerate(quantities[: i + 1]):
            both = _product(grid, (*first.factors, *second.factors))
            found[i, j] = found[j, i] = float((share * both).sum()) - means[i] * means[j]
        found[i, i] = first.moments(0)[1] ** 2
    return found


def _product(grid: JointDensity, factors: tuple[tuple[int, Array], ...]) -> Array:
    """Mean of a product at each outer node; parts are independent there."""
    by_part: dict[int, Array] = {}
    for part, values in factors:
        by_part[part] = by_part[part] * values if part in by_part else values
    found: Array = np.ones(1)
    for part, values in by_part.items():
        found = found * (values if part < 0 else grid.tensors[part].expect_each(values)[0])
    return found


def scaled(of: Marginal, factor: float, offset: float, name: str) -> Marginal:
    """offset + factor times another quantity."""

    def moments(level: int) -> tuple[float, float]:
        mean, sd = of.moments(level)
        return offset + factor * mean, factor * sd

    def cdf(t: Array, levels: int) -> Array:
        if factor == 0.0:
            return np.tile(np.where(t >= offset, 1.0, 0.0), (levels, 1))
        return of.cdf((t - offset) / factor, levels)

    return Marginal(name, offset + factor * of.low, offset + factor * of.high, moments, cdf)
