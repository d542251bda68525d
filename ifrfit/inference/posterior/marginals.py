"""Marginals as such: mean, standard deviation and distribution function, and those of shared parameters.

Those of the parameters of one series are in `parameter_marginals`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.posterior.density_grid import PanelErrors
from ifrfit.inference.posterior.joint_grid import JointDensity
from ifrfit.inference.posterior.panel_cdf import PanelCdf
from ifrfit.inference.posterior.quadrature_axis import QuadratureAxis

Array = NDArray[np.float64]
Moments = Callable[[int], tuple[float, float]]  # of a level: mean and standard deviation
Cdf = Callable[[Array, int], Array]  # of thresholds (n,) and a number of levels: probabilities, (levels, n)

OUTER = -1  # in the place of a series: values at the outer nodes
_TINY = 1e-300


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
    factors : tuple of (int, ndarray)
        The quantity as a product over independent series: number of the series, or `OUTER`, and values at its
        nodes.
    kinks : callable or None
        From quantiles to an axis and where on it they put kinks into the integrand of the distribution
        function, so that panels are to be split there.
    errors : callable or None
        From thresholds, and factors of what is found there, to the largest errors that only distribution
        functions show: conditional ones may be steps where the densities themselves are smooth.
    """

    name: str
    low: float
    high: float
    moments: Moments
    cdf: Cdf
    factors: tuple[tuple[int, Array], ...] = ()
    kinks: Callable[[Array], tuple[QuadratureAxis, Array]] | None = None
    errors: Callable[[Array, Array], list[PanelErrors]] | None = None

    def mass_above(self, value: float) -> float:
        """Probability above a value."""
        return float(1.0 - self.cdf(np.array([value]), 1)[0, 0])

    @cached_property
    def known_quantiles(self) -> dict[float, tuple[Array, Array]]:
        """Quantiles at `LEVELS` and the densities there, by the accuracy that they were asked with."""
        return {}


def moments_of(expectation: Callable[[Callable[[Array], Array]], Array]) -> Moments:
    """Mean and standard deviation from expectations of functions at both levels, (2,)."""

    @cache
    def at_levels() -> list[tuple[float, float]]:
        mean = expectation(lambda v: v)
        square = expectation(lambda v: (v - mean[0]) ** 2) - (mean - mean[0]) ** 2
        return [(float(m), math.sqrt(max(float(v), 0.0))) for m, v in zip(mean, square, strict=True)]

    return lambda level: at_levels()[level]


def shared_marginal(density: JointDensity, number: int, name: str) -> Marginal:
    """Of a parameter that the series share."""
    one = density.integral.shared[number]
    rows = density.outer_marginal(number)

    def cdf(t: Array, levels: int) -> Array:
        t = np.log(np.maximum(t, _TINY)) if one.log else t
        return rows.below_in_all(t, levels)

    def expectation(of: Callable[[Array], Array]) -> Array:
        return np.asarray(density.share @ of(density.at[one.kind]))

    factors = ((OUTER, density.at[one.kind]),)
    return Marginal(name, one.parameter.lower, one.parameter.upper, moments_of(expectation), cdf, factors)


def shared_kappa_marginal(density: JointDensity, e_number: int, mu_number: int, name: str) -> Marginal:
    """kappa = mu (1 + e_n) where both are shared."""
    e, mu = density.integral.shared[e_number], density.integral.shared[mu_number]
    rows = [
        PanelCdf.of(mu.axis, density.outer_density(level, e_number, mu_number), level) for level in (0, 1)
    ]
    factor = 1.0 + e.values()

    def cdf(t: Array, levels: int) -> Array:
        weights = e.axis.weights()
        return np.stack([rows[level].below(t[:, None] / factor) @ weights[level] for level in range(levels)])

    def expectation(of: Callable[[Array], Array]) -> Array:
        return np.asarray(density.share @ of(density.at["mu"] * (1.0 + density.at["e_n"])))

    low = mu.parameter.lower * (1.0 + e.parameter.lower)
    return Marginal(name, low, mu.parameter.upper * (1.0 + e.parameter.upper), moments_of(expectation), cdf)


def scaled_marginal(of: Marginal, factor: float, offset: float, name: str) -> Marginal:
    """Of offset + factor times another quantity."""

    def moments(level: int) -> tuple[float, float]:
        mean, sd = of.moments(level)
        return offset + factor * mean, factor * sd

    def cdf(t: Array, levels: int) -> Array:
        if factor == 0.0:
            return np.tile(np.where(t >= offset, 1.0, 0.0), (levels, 1))
        return of.cdf((t - offset) / factor, levels)

    return Marginal(name, offset + factor * of.low, offset + factor * of.high, moments, cdf)


def covariance(density: JointDensity, marginals: Sequence[Marginal]) -> Array:
    """Posterior covariance, by the law of total covariance over the outer nodes."""
    share = density.share[0]
    means = [float((share * _mean_product(density, q.factors)).sum()) for q in marginals]
    found = np.zeros((len(marginals), len(marginals)))
    for i, first in enumerate(marginals):
        for j, second in enumerate(marginals[:i]):
            product = _mean_product(density, (*first.factors, *second.factors))
            found[i, j] = found[j, i] = float((share * product).sum()) - means[i] * means[j]
        found[i, i] = first.moments(0)[1] ** 2
    return found


def _mean_product(density: JointDensity, factors: tuple[tuple[int, Array], ...]) -> Array:
    """Mean of a product at each outer node, (m,); series are independent there."""
    by_series: dict[int, list[Array]] = {}
    for number, values in factors:
        by_series.setdefault(number, []).append(values)
    found: Array = np.ones(1)
    for number, of_series in by_series.items():
        if number == OUTER:
            mean = np.asarray(math.prod(of_series))
        else:
            mean = density.grids[number].expectation(*of_series)[0]
        found = found * mean
    return found
