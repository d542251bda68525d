"""Marginals as such: moments, distribution function, errors; those of shared parameters and of noises.

Errors are how far results move between the rules and the coarse ones inside them, eq. (7) of
``docs/theory/posterior.md``; an unknown noise has its law given the sum of squares, averaged over the
posterior of that sum, eq. (11). The marginals of the parameters of one series are in `parameter_marginals`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.distributions.protocol import LEVELS
from ifrfit.inference.posterior.density_grid import PanelErrors
from ifrfit.inference.posterior.discrete_law import DiscreteLaw
from ifrfit.inference.posterior.joint_grid import JointDensity
from ifrfit.inference.posterior.nodes import Quantity
from ifrfit.inference.posterior.noise_scale import NoiseScale
from ifrfit.inference.posterior.quadrature_axis import (
    PanelCdf,
    QuadratureAxis,
    quantiles,
    quantiles_near_normal,
)

Array = NDArray[np.float64]
Moments = Callable[[int], tuple[float, float]]  # of a level: mean and standard deviation
Cdf = Callable[[Array, int], Array]  # of thresholds (n,) and a number of levels: probabilities, (levels, n)

Factors = tuple[tuple[int, "Array | Quantity"], ...]
OUTER = -1  # in the place of a series: values at the outer nodes
_TINY = 1e-300
_THRESHOLDS = 256  # of a distribution function at once
# places in sd at which a normal law has its quantiles at `LEVELS`, and further out for skewed ones
_NORMAL = np.array([-2.8, -1.959964, -0.994458, 0.0, 0.994458, 1.959964, 2.8])
_HALF_DENSITY = 0.5 * np.exp(-0.5 * np.minimum(np.abs(_NORMAL), 1.959964) ** 2) / math.sqrt(2.0 * math.pi)
_ENDS = np.array([LEVELS[0], LEVELS[-1]])
_OF_TAIL = 0.4  # of the tolerance, in the probability beyond a quantile: 0.17 sd of it at 2.5 %
_FURTHEST = 1e-12  # such a probability
_BESIDE = 1.0  # tolerance of the quantiles at which changes are taken: a thousandth of the probability
_NEARLY = 0.01  # in probability: how near to a normal law the tails have to be
_ORDER = 24  # of the rules in the logarithm of sigma
_WIDTH = 3.0  # of their panels, in sd of the law given the sum of squares: exact to rounding
_FALL = 40.0  # of the log density beyond which that law is not followed
_FEWEST, _MOST = 16, 96  # nodes for functions of a sum of squares
_AT_ONCE = 16_384  # sums of squares, which stay in the cache with two polynomials


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
    factors: Factors = ()
    kinks: Callable[[Array], tuple[QuadratureAxis, Array]] | None = None
    errors: Callable[[Array, Array], list[PanelErrors]] | None = None

    def mass_above(self, value: float) -> float:
        """Probability above a value."""
        return float(1.0 - self.cdf(np.array([value]), 1)[0, 0])

    def below(self, value: Array) -> Array:
        """Probability below values (n,), which may lie outside the support."""
        found = np.where(value >= self.high, 1.0, 0.0)
        inside = (value > self.low) & (value < self.high)
        if inside.any():
            at = value[inside]
            parts = [at[i : i + _THRESHOLDS] for i in range(0, at.size, _THRESHOLDS)]
            reached = np.concatenate([self.cdf(part, 1)[0] for part in parts])
            found[inside] = np.minimum(np.maximum(reached, 0.0), 1.0)
        return found

    @cached_property
    def at_normal_places(self) -> tuple[Array, Array]:
        """Where a normal law has its quantiles, (7,), and the probabilities there by both levels, (2, 7)."""
        mean, sd = self.moments(0)
        at = np.minimum(np.maximum(mean + sd * _NORMAL, self.low), self.high)
        return at, self.cdf(at, 2)

    def quantiles(self, p: Array, tolerance: float) -> Array:
        """Where the distribution function takes the values p; an open end is cut 1e6 sd above the mean."""
        mean, sd = self.moments(0)
        tail = min(float(p[p.argmin()]), 1.0 - float(p[p.argmax()]))
        accuracy = tolerance * min(_OF_TAIL * max(tail, _FURTHEST), 1e-2)
        if self.kinks is None and sd > 0.0:
            at, reached = self.at_normal_places
            ends = self.low, self.high
            found = quantiles_near_normal(lambda t: self.cdf(t, 1)[0], p, ends, at, reached[0], accuracy)
            if found is not None:
                return found
        high = self.high if math.isfinite(self.high) else mean + 1e6 * sd
        accuracy = min(accuracy, 1e-3 * tolerance)
        return quantiles(lambda t: self.cdf(t, 1)[0], p, self.low, high, mean, sd, accuracy)

    def at_levels(self, tolerance: float) -> Array:
        """Quantiles at `LEVELS`, worked out once."""
        if tolerance not in self._known_quantiles:
            self._known_quantiles[tolerance] = self.quantiles(np.array(LEVELS), tolerance)
        return self._known_quantiles[tolerance]

    def density_at_levels(self, tolerance: float) -> Array:
        """Density at these quantiles, worked out once."""
        if tolerance not in self._known_densities:
            self._known_densities[tolerance] = self.density(self.at_levels(tolerance))
        return self._known_densities[tolerance]

    @cached_property
    def _known_quantiles(self) -> dict[float, Array]:
        return {}

    @cached_property
    def _known_densities(self) -> dict[float, Array]:
        return {}

    def density(self, at: Array) -> Array:
        """Density at values (n,), as the slope of the distribution function about them."""
        step = 0.02 * self.moments(0)[1]
        around = np.clip(np.stack((at - step, at + step)), self.low, self.high)
        below = self.cdf(around.reshape(-1), 1)[0].reshape(around.shape)
        width = around[1] - around[0]  # none where draws are one to rounding
        return np.asarray((below[1] - below[0]) / np.where(width > 0.0, width, np.inf))


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
    means = [_mean_product(density, q.factors) for q in marginals]
    away = [mean - float((share * mean).sum()) for mean in means]
    found = np.diag([q.moments(0)[1] ** 2 for q in marginals])
    for i, j in combinations(range(len(marginals)), 2):
        within = _covariance_within(density, marginals[i].factors, marginals[j].factors)
        found[i, j] = found[j, i] = float((share * (away[i] * away[j] + within)).sum())
    return found


def _covariance_within(density: JointDensity, first: Factors, second: Factors) -> Array | float:
    """Covariance of two products at each outer node, (m,); series are independent there."""
    common = {number for number, _ in first} & {number for number, _ in second} - {OUTER}
    if not common:
        return 0.0
    pairs = [[of for of in each if of[0] in common] for each in (first, second)]
    if len(common) > 1 or any(len(pair) > 1 for pair in pairs):
        product = _mean_product(density, (*first, *second))
        return product - _mean_product(density, first) * _mean_product(density, second)
    (number,) = common
    rest = [_mean_product(density, tuple(of for of in each if of[0] != number)) for each in (first, second)]
    grid, share = density.grids[number], density.share[0]
    about = []
    for ((_, of),) in pairs:
        assert not isinstance(of, np.ndarray)
        about.append(_about(of, float((share * grid.expectation(of)[0]).sum())))
    one, other = about
    # about places near their means: products of what is known to eight digits would lose all that they say
    within = grid.expectation(one, other)[0] - grid.expectation(one)[0] * grid.expectation(other)[0]
    return np.asarray(rest[0] * rest[1] * within)


def _about(of: Quantity, place: float) -> Quantity:
    return lambda nodes: of(nodes) - place


def _mean_product(density: JointDensity, factors: Factors) -> Array:
    """Mean of a product at each outer node, (m,); series are independent there."""
    by_series: dict[int, list[Quantity]] = {}
    found: Array = np.ones(1)
    for number, factor in factors:
        if isinstance(factor, np.ndarray):
            found = found * factor
        else:
            by_series.setdefault(number, []).append(factor)
    for number, of_series in by_series.items():
        found = found * density.grids[number].expectation(*of_series)[0]
    return found


def largest_error(marginals: Mapping[str, Marginal], tolerance: float) -> float:
    """As `whole_error`; of means and standard deviations alone where these exceed the tolerance already."""
    moved = _error_of_moments(marginals)
    return moved if moved > tolerance else max(moved, _error_of_quantiles(marginals, tolerance))


def whole_error(marginals: Mapping[str, Marginal], tolerance: float) -> float:
    """Largest change of any result between the rules and the coarse ones inside them, in sd.

    A quantile changes by the change of the distribution function there over the density. Both are taken
    where a normal law has its quantiles, and the density as no less than half of that law's.
    """
    return max(_error_of_moments(marginals), _error_of_quantiles(marginals, tolerance))


def _error_of_moments(marginals: Mapping[str, Marginal]) -> float:
    worst = 0.0
    for own in marginals.values():
        mean, sd = own.moments(0)
        if sd == 0.0:
            continue
        coarse_mean, coarse_sd = own.moments(1)
        changes = [abs(coarse_mean - mean) / sd, abs(coarse_sd - sd) / sd]
        worst = max(worst, *(change if math.isfinite(change) else math.inf for change in changes))
    return worst


def _error_of_quantiles(marginals: Mapping[str, Marginal], tolerance: float) -> float:
    worst = 0.0
    for own in marginals.values():
        sd = own.moments(0)[1]
        if sd == 0.0:
            continue
        change, normal = math.inf, False
        if own.kinks is None:
            change, normal = _quantile_error_if_normal(own)
        # the integrand may have kinks or steps at the quantiles themselves
        if change > tolerance or not normal:
            change = _quantile_error(own, sd, tolerance)
        worst = max(worst, change if math.isfinite(change) else math.inf)
    return worst


def _quantile_error_if_normal(own: Marginal) -> tuple[float, bool]:
    """Largest change of quantiles, in sd, where a normal law has them; and whether this one is near to it."""
    fine, coarse = own.at_normal_places[1]
    change = np.abs(coarse - fine) / _HALF_DENSITY
    off = np.abs(fine[1:-1:4] - _ENDS)
    return float(change[change.argmax()]), bool(off[off.argmax()] < _NEARLY)


def _quantile_error(own: Marginal, sd: float, tolerance: float) -> float:
    """Largest change of the quantiles, in sd, with the density there."""
    # where panels are refined for the quantiles themselves, a place beside them says nothing
    accuracy = tolerance if own.kinks is not None or own.errors is not None else _BESIDE
    at = own.at_levels(accuracy)
    fine, coarse = own.cdf(at, 2)
    return float((np.abs(coarse - fine) / np.maximum(own.density_at_levels(accuracy), 1e-4 / sd)).max()) / sd


def errors_of_quantiles(marginals: Mapping[str, Marginal], tolerance: float) -> list[PanelErrors]:
    """Errors of panels that only distribution functions show, in sd of the quantiles that people ask for."""
    found: list[PanelErrors] = []
    for own in marginals.values():
        sd = own.moments(0)[1]
        if own.errors is not None and sd > 0.0:
            at = own.at_levels(tolerance)
            found += own.errors(at, 1.0 / np.maximum(own.density_at_levels(tolerance) * sd, 1e-4))
    return found


def noise_over_squares(own: NoiseScale, law: DiscreteLaw, negligible: float, name: str) -> Marginal:
    """The unknown sigma of a group, where a discrete law of its sum of squares is known.

    Parameters
    ----------
    own : NoiseScale
        The law of sigma given the sum of squares.
    law : DiscreteLaw
        Of the sum of squares.
    negligible : float
        Probability of sums of squares that are left out.
    name : str
    """
    square, weight = _compressed(law, own.n, negligible)
    axis = QuadratureAxis.of(_edges(own, float(square.min()), float(square.max())), _ORDER)
    nodes = axis.nodes()
    density = weight @ own.density(nodes, square[:, None])
    sigma, rule = np.exp(nodes), axis.weights()[0]
    panels = PanelCdf.of(axis, density)

    given = _GivenSquares(sigma, rule * density, panels)
    return Marginal(name, own.lower, own.upper, given.moments, given.cdf)


@dataclass(frozen=True)
class _GivenSquares:
    """The law of an unknown sigma, by nodes: results that hold one can be copied to other processes.

    Attributes
    ----------
    sigma : ndarray, (n,)
    probability : ndarray, (2, n)
        By the rules, and by the coarse ones.
    panels : PanelCdf
        In the logarithm of sigma.
    """

    sigma: Array
    probability: Array
    panels: PanelCdf

    def moments(self, level: int) -> tuple[float, float]:
        """Mean and standard deviation."""
        return self._moments[level]

    @cached_property
    def _moments(self) -> tuple[tuple[float, float], ...]:
        found = []
        for probability in self.probability:
            mean = float(probability @ self.sigma)
            found.append((mean, math.sqrt(max(float(probability @ (self.sigma - mean) ** 2), 0.0))))
        return tuple(found)

    def cdf(self, t: Array, levels: int) -> Array:
        """Distribution function, (levels, n)."""
        return self.panels.below_in_all(np.log(np.maximum(t, 1e-300)), levels)


def _edges(own: NoiseScale, least: float, most: float) -> Array:
    """Edges in the logarithm of sigma, about the laws given sums of squares from the least to the most."""
    low, high = math.log(own.lower), math.log(own.upper)
    # without bounds the log density is -n s - square/2 exp(-2 s)
    modes = [0.5 * math.log(max(square, 1e-300) / own.n) for square in (least, most)]
    inside = [min(max(mode, low), high) for mode in modes]
    r = 2.0 * _FALL / own.n
    start = max(inside[0] - 0.5 * math.log1p(r + math.sqrt(r * (r + 2.0))), low)
    end = min(inside[1] + _FALL / own.n + 0.5, high)
    width = _WIDTH / math.sqrt(2.0 * own.n)
    edges = np.linspace(start, end, 2 + int((end - start) / width))
    # a bound that cuts the law off leaves it steep there
    growing = 2.0 ** np.arange(60)
    if modes[0] < low:
        edges = np.concatenate((edges, low + _WIDTH / own.n * growing))
    if modes[1] > high:
        edges = np.concatenate((edges, high - _WIDTH * own.upper**2 / most * growing))
    return edges[(edges >= start) & (edges <= end)]


def _compressed(law: DiscreteLaw, n: float, negligible: float) -> tuple[Array, Array]:
    """A discrete law of sums of squares, probabilities (2, m), with the same moments on a few nodes.

    What follows from a sum of squares is smooth in its logarithm: the probabilities of all nodes are shared
    out over interpolation nodes, exactly for polynomials. Nodes that hold no more than `negligible` all
    together are left out: with them 9 of 67 drawn tables took 1.2 to 3.1 times as long, the others as long.
    """
    least = negligible / law.size
    low, high, total = math.inf, -math.inf, np.zeros((2, 1))
    for square, weight in _kept(law, least):
        low, high = min(low, math.log(square.min())), max(high, math.log(square.max()))
        total += weight.sum(axis=1, keepdims=True)
    if high - low < 1e-9:
        return np.exp(np.array([low])), total
    # the law given a sum of squares has the sd sqrt(2/n) in its logarithm
    count = min(_FEWEST + int(4.0 * (high - low) / math.sqrt(2.0 / n)), _MOST)
    # sum over the nodes of each Chebyshev polynomial, then the weights that have the same sums
    sums = np.zeros((2, count))
    for square, weight in _kept(law, least):
        y = np.clip((2.0 * np.log(square) - low - high) / (high - low), -1.0, 1.0)
        for begin in range(0, y.size, _AT_ONCE):
            own, share = y[begin : begin + _AT_ONCE], weight[:, begin : begin + _AT_ONCE]
            before, now, after, twice = np.ones_like(own), own, np.empty_like(own), 2.0 * own
            sums[:, 0] += share.sum(axis=1)
            for j in range(1, count):
                sums[:, j] += share @ now
                np.multiply(twice, now, out=after)
                after -= before
                before, now, after = now, after, before
    angle = np.pi * (np.arange(count) + 0.5) / count
    sums[:, 1:] *= 2.0
    at = np.cos(np.arange(count)[:, None] * angle) / count
    return np.exp(0.5 * (low + high) + 0.5 * (high - low) * np.cos(angle)), sums @ at


def _kept(law: DiscreteLaw, least: float) -> Iterator[tuple[Array, Array]]:
    """Sums of squares of more than the least probability, and their probabilities, in parts."""
    for square, weight in law.parts():
        kept = np.abs(weight[0]) > least
        if kept.any():
            yield np.maximum(square[kept], 1e-300), weight[:, kept]
