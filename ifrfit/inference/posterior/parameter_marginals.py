"""Marginals of the parameters of one series, of kappa, and of the transition.

A quantity that rises with the closure constant at every node is below t where c is below a threshold, which
differs from node to node: its distribution function is the mean of the conditional ones of c, eq. (9) of
``docs/theory/posterior.md``. Of one that falls, it is the mean of their complements.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.posterior.density_grid import DensityGrid, PanelErrors
from ifrfit.inference.posterior.joint_grid import JointDensity
from ifrfit.inference.posterior.marginals import Cdf, Marginal, Moments
from ifrfit.inference.posterior.nodes import Nodes, Quantity
from ifrfit.inference.posterior.quadrature_axis import PanelCdf, QuadratureAxis
from ifrfit.inference.posterior.series_integral import ClosureConstantFree, RestitutionFree, sticking_bound

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Errors = Callable[[Array, Array], list[PanelErrors]]

_TINY = 1e-300
_AT_ONCE = 20_000  # nodes times thresholds looked at together: their arrays stay in the cache


def series_marginal(density: JointDensity, number: int, kind: str, parameter: FreeParameter) -> Marginal:
    """Of e_n, c or mu of one series.

    Parameters
    ----------
    density : JointDensity
    number : int
        Of the series.
    kind : {"e_n", "c", "mu"}
    parameter : FreeParameter
        The one that the series integrates over.
    """
    grid = density.grids[number]
    errors: Errors | None = None
    if kind == "e_n":
        quantity, cdf = _value_of_e_n, _e_n(density, grid)
    elif kind == "mu":
        quantity, (cdf, errors) = _value_of_mu, _friction(density, grid, 1.0 + grid.nodes.e_n)
    else:
        quantity, (cdf, errors) = _value_of_c, _c(density, grid)
    moments, factors = _moments(density, grid, quantity), ((number, quantity),)
    return Marginal(parameter.name, parameter.lower, parameter.upper, moments, cdf, factors, errors=errors)


def _value_of_e_n(nodes: Nodes) -> Array:
    return nodes.e_n[..., None]


def _value_of_c(nodes: Nodes) -> Array:
    return nodes.c


def _value_of_mu(nodes: Nodes) -> Array:
    return nodes.mu


def _value_of_kappa(nodes: Nodes) -> Array:
    return nodes.mu * (1.0 + nodes.e_n[..., None])


def _moments(density: JointDensity, grid: DensityGrid, quantity: Quantity) -> Moments:
    """Mean and standard deviation of a quantity of one series."""

    @cache
    def at_levels() -> list[tuple[float, float]]:
        mean, square, place = grid.mean_and_square(quantity, density.share)
        means, squares = ((density.share * each).sum(axis=1) for each in (mean, square))
        variances = squares - (means - place) ** 2
        return [(float(m), math.sqrt(max(float(v), 0.0))) for m, v in zip(means, variances, strict=True)]

    return lambda level: at_levels()[level]


def _e_n(density: JointDensity, grid: DensityGrid) -> Cdf:
    """Distribution function of e_n."""
    if grid.series.e_axis is not None:
        return PanelCdf.of_levels(grid.series.e_axis, grid.e_density(density.share)).below_in_all
    mu, b, below = grid.nodes.mu[..., 0], _bound(grid), grid.x_cdf(density.share)  # e_n = x b/mu - 1
    return lambda t, levels: below((mu * (1.0 + t[:, None, None, None]) / b)[..., 0], levels)


def _c(density: JointDensity, grid: DensityGrid) -> tuple[Cdf, Errors | None]:
    """Distribution function of the closure constant, and the errors of panels over which it is averaged."""
    if not isinstance(grid.series.role, ClosureConstantFree):
        by_c = ConditionalCdf(grid, density.share, np.zeros((1, 1, 1)), lambda t, zero: t + zero)
        return by_c.probability, _errors_by_c(density, grid, by_c)
    kappa = (grid.nodes.mu[..., 0] * (1.0 + grid.nodes.e_n))[..., 0]
    below = grid.x_cdf(density.share)
    k = grid.series.squares.coefficients

    def cdf(t: Array, levels: int) -> Array:
        # b(c) = mu (1 + e_n)/x falls as x rises, and c with it where b1 > 0
        b = np.asarray(sticking_bound(k, t[:, None, None]))
        with np.errstate(divide="ignore", invalid="ignore"):
            x = np.where(b > 0.0, kappa / b, np.inf)
        return 1.0 - below(x, levels) if k.b1 > 0.0 else below(x, levels)

    return cdf, None


def _friction(density: JointDensity, grid: DensityGrid, divisor: Array) -> tuple[Cdf, Errors]:
    """Distribution function of x b(c)/divisor, and the errors of panels over which it is averaged."""
    if grid.series.is_unbounded and grid.series.integrates_c:
        by_c = _friction_by_c(grid, divisor, density.share)
        return by_c.probability, _errors_by_c(density, grid, by_c)
    ratio, axis = _x_per_friction(grid, divisor), grid.series.e_axis

    def errors(at: Array, per: Array) -> list[PanelErrors]:
        if axis is None or grid.series.x_axis is None:
            return []
        outer = grid.outer(density.share)[0, ..., 0]
        below = [grid.mass_below(t * ratio, 0).reshape(grid.g.shape[1:3]) * outer for t in at]
        return [_largest(axis, below, per)]

    return friction_cdf(grid, divisor, density.share), errors


def friction_cdf(grid: DensityGrid, divisor: Array, share: Array) -> Cdf:
    """Distribution function of x b(c)/divisor.

    Parameters
    ----------
    grid : DensityGrid
    divisor : ndarray, (m, n_e, n_x), broadcastable
    share : ndarray, (2, m)
        Probabilities of the outer nodes.
    """
    if grid.series.is_unbounded and grid.series.integrates_c:
        return _friction_by_c(grid, divisor, share).probability
    ratio = _x_per_friction(grid, divisor)
    below = grid.x_cdf(share)
    frictionless = np.isinf(ratio)  # below every value, 0 too
    finite = np.where(frictionless, 1.0, ratio)
    return lambda t, levels: below(np.where(frictionless, np.inf, t[:, None, None] * finite), levels)


def _friction_by_c(grid: DensityGrid, divisor: Array, share: Array) -> ConditionalCdf:
    """Where x b(c)/divisor is below a value, by the closure constant."""
    k = grid.series.squares.coefficients
    per_x = divisor / np.maximum(grid.nodes.x, _TINY)
    return ConditionalCdf(grid, share, per_x, lambda t, own: (t * own - k.b0) / k.b1, falls=k.b1 < 0.0)


def _errors_by_c(density: JointDensity, grid: DensityGrid, by_c: ConditionalCdf) -> Errors:
    """Errors of panels over which conditional distribution functions of the closure constant are averaged."""

    def errors(at: Array, per: Array) -> list[PanelErrors]:
        inner = [by_c.density_below(float(t)) * grid.factor for t in at]
        along_c = np.array([float((by_c.error_along_c(at) * per).max())])
        found: list[PanelErrors] = [(grid.series, np.ones(1), along_c)]
        for axis in grid.series.axes:
            found.append(
                _largest(axis, [grid.density_along(axis, part, density.share) for part in inner], per)
            )
        return found

    return errors


def _largest(axis: QuadratureAxis, densities: Sequence[Array], per: Array) -> PanelErrors:
    """Largest errors of several densities along an axis, each times its factor."""
    each = [
        axis.errors(one.reshape(-1, *axis.shape)) * factor for one, factor in zip(densities, per, strict=True)
    ]
    return axis, np.ones(axis.shape[0]), np.max(each, axis=0)


def _bound(grid: DensityGrid) -> Array:
    """b(c), (m, n_e, n_x), where the series does not integrate over c, or b does not depend on it."""
    k = grid.series.squares.coefficients
    b = np.asarray(sticking_bound(k, grid.nodes.c[..., 0] if k.b1 else 0.0))
    return b.reshape((1, 1, 1)) if b.ndim == 0 else b


def _x_per_friction(grid: DensityGrid, divisor: Array) -> Array:
    """The transition over x b(c)/divisor, (m, n_e); infinite where a bound of 0 leaves no friction."""
    with np.errstate(divide="ignore"):
        return np.asarray((divisor / _bound(grid))[..., 0])


def kappa_marginal(density: JointDensity, number: int, name: str) -> Marginal:
    """Of kappa = mu (1 + e_n) of one series."""
    grid = density.grids[number]
    series, nodes = grid.series, grid.nodes
    moments = _moments(density, grid, _value_of_kappa)
    mu_ends, e_ends = _ends(series.mu, nodes.values.mu), _ends(series.e_n, nodes.e_n)
    low, high = (mu * (1.0 + e_n) for mu, e_n in zip(mu_ends, e_ends, strict=True))
    if isinstance(series.role, ClosureConstantFree) and isinstance(series.e_n, FreeParameter):
        mu = float(nodes.mu.reshape(-1)[0])  # it is given, so e_n alone moves kappa
        below = _e_n(density, grid)
        return Marginal(name, low, high, moments, lambda t, levels: below(t / mu - 1.0, levels))
    cdf, errors = _friction(density, grid, np.ones((1, 1, 1)))
    return Marginal(name, low, high, moments, cdf, kinks=_kappa_kinks(density, grid), errors=errors)


def _ends(known: FreeParameter | float | None, at: Array) -> tuple[float, float]:
    """Ends of a parameter's domain; of its nodes where it is fixed or shared."""
    if isinstance(known, FreeParameter):
        return known.lower, known.upper
    return float(np.min(at)), float(np.max(at))


def _kappa_kinks(
    density: JointDensity, grid: DensityGrid
) -> Callable[[Array], tuple[QuadratureAxis, Array]] | None:
    """Where values of kappa meet a bound of mu along e_n, or one of e_n along mu; None where none is met.

    The distribution function of kappa at t is an integral over e_n of the probability that mu is below
    t/(1 + e_n), which has a kink where that is a bound of mu.
    """
    series, integral = grid.series, density.integral
    along_mu = isinstance(series.role, RestitutionFree)
    number = integral.number_of("mu" if along_mu else "e_n")
    axis = None if number is None else integral.shared[number].axis
    if not along_mu and series.e_axis is not None:
        axis = series.e_axis
    parameter = series.e_n if along_mu else series.mu
    if grid.limits is None or axis is None or not isinstance(parameter, FreeParameter):
        return None
    ends = [end for end in (parameter.lower, parameter.upper) if along_mu or end > 0.0]
    return lambda at: (
        axis,
        np.concatenate([at / (1.0 + end) if along_mu else at / end - 1.0 for end in ends]),
    )


def transition_marginal(density: JointDensity, number: int) -> Marginal:
    """Of tau/(tau + unit) of one series: it has an end and moments also where the transition has none."""
    grid = density.grids[number]
    series = grid.series
    law, unit = series.squares.law, series.unit

    def tau(s: Array) -> Array:
        return np.asarray(unit * s / np.maximum(1.0 - s, _TINY))

    if law is None:
        below = grid.x_cdf(density.share)
        moments = _moments(density, grid, lambda nodes: (nodes.x / (nodes.x + unit))[..., None])
        return Marginal("tau", 0.0, 1.0, moments, lambda s, levels: below(tau(s)[:, None, None], levels))

    def scaled(nodes: Nodes) -> Array:
        x = nodes.x[..., None]
        return np.asarray(x / np.maximum(x + unit * law.bound(nodes.c), _TINY))

    moments = _moments(density, grid, scaled)
    if not (series.integrates_c and isinstance(series.c, FreeParameter)):
        below, bound = grid.x_cdf(density.share), law.bound(grid.nodes.c[..., 0])[..., 0]
        return Marginal(
            "tau", 0.0, 1.0, moments, lambda s, levels: below(tau(s)[:, None, None] * bound, levels)
        )
    by_c = ConditionalCdf(
        grid,
        density.share,
        grid.nodes.x,
        lambda s, at_x: law.constant_at(at_x / np.maximum(tau(s), _TINY)),
    )
    up_to = by_c.probability
    ends = law.bound(np.array([series.c.lower, series.c.upper]))
    if ends[0] > ends[1]:  # kappa/bound(c) rises with c
        return Marginal("tau", 0.0, 1.0, moments, up_to)
    return Marginal("tau", 0.0, 1.0, moments, lambda s, levels: 1.0 - up_to(s, levels))


class ConditionalCdf:
    """Posterior probability of a closure constant below threshold(t, own), by t.

    Parameters
    ----------
    grid : DensityGrid
        Of a series that integrates over its closure constant.
    share : ndarray, (2, m)
        Probabilities of the outer nodes.
    own : ndarray, (m, n_e, n_x), broadcastable
        What the threshold depends on at each node.
    threshold : callable
        From t (n, 1) and `own` at some nodes (k,) to closure constants, (n, k), broadcastable.
    falls : bool
        Whether the quantity falls as c rises: then it is below t where c is above the threshold.
    """

    def __init__(
        self,
        grid: DensityGrid,
        share: Array,
        own: Array,
        threshold: Callable[[Array, Array], Array],
        *,
        falls: bool = False,
    ) -> None:
        integrals = grid.two_sided
        shape = np.broadcast_shapes(grid.f.shape[:3], own.shape)
        weight = grid.factor * grid.weight * grid.outer(share)
        alone = tuple(1 + axis for axis, n in enumerate(shape) if n == 1)
        weight = weight.sum(axis=alone, keepdims=True).reshape(2, -1)
        followed = np.full(math.prod(grid.f.shape[:3]), -1)
        followed[integrals.node] = np.arange(integrals.node.size)
        node = np.broadcast_to(followed.reshape(grid.f.shape[:3]), shape).reshape(-1)
        mass = np.abs(weight).max(axis=0) * integrals.total[0].sum(axis=0)[node]
        at = np.flatnonzero((mass > math.exp(-grid.series.tail) / mass.size) & (node >= 0))
        self._integrals, self._threshold, self._shape = integrals, threshold, shape
        self._falls = falls
        self._at, self._node, self._weight = at, node[at], weight[:, at]
        self._own = np.broadcast_to(own, shape).reshape(-1)[at]
        whole = integrals.total.sum(axis=1)[:, self._node]
        self._whole = np.maximum((self._weight * whole).sum(axis=1), 1e-300)

    def probability(self, t: Array, levels: int) -> Array:
        """At thresholds (n,), by the rules alone (1) or the coarse ones too (2), (levels, n)."""
        found = np.zeros((levels, t.size))
        if not t.size:
            return found
        few = max(1, _AT_ONCE // max(256, _AT_ONCE // t.size))
        for first in range(0, t.size, few):
            some = slice(first, first + few)
            for part in self._parts(t.size):
                below = self._below(t[some], part, levels)
                for level in range(levels):
                    found[level, some] += below[level] @ self._weight[level, part]
        return np.asarray(found / self._whole[:levels, None])

    def error_along_c(self, t: Array) -> Array:
        """Change of the probability by the coarse rule along the closure constant alone, (n,)."""
        found = np.zeros(t.size)
        for part in self._parts(t.size):
            below = self._below(t, part, 2)
            found += (below[1] - below[0]) @ self._weight[0, part]
        return np.asarray(np.abs(found) / self._whole[0])

    def density_below(self, t: float) -> Array:
        """Integral over what lies below a threshold at each (outer node, e_n, transition), by the rules."""
        found = np.zeros(math.prod(self._shape))
        for part in self._parts(1):
            found[self._at[part]] = self._below(np.array([t]), part, 1)[0, 0]
        return np.asarray(found.reshape(self._shape))

    def _parts(self, thresholds: int) -> Iterator[slice]:
        """Nodes, so many at once that their arrays stay in the cache."""
        step = max(256, _AT_ONCE // thresholds)
        yield from (slice(start, start + step) for start in range(0, self._at.size, step))

    def _below(self, t: Array, part: slice, levels: int) -> Array:
        """Integrals up to the thresholds at some nodes, (levels, n, k)."""
        node = self._node[part]
        c = np.broadcast_to(self._threshold(t[:, None], self._own[part]), (t.size, node.size))
        below = self._integrals.below(c, node, levels)
        if not self._falls:
            return below
        return np.asarray(self._integrals.total.sum(axis=1)[:levels, None, node] - below)
