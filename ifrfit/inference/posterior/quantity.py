"""Marginals: mean, standard deviation and distribution function of every quantity, from a grid of densities."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.posterior.axis import Axis
from ifrfit.inference.posterior.joint import Grid
from ifrfit.inference.posterior.marginal import Panels
from ifrfit.inference.posterior.tensor import Tensor
from ifrfit.inference.posterior.unknown import Unknown

Array = NDArray[np.float64]

Moments = Callable[[int], tuple[float, float]]
Cdf = Callable[[Array, int], Array]

_AT_ONCE = 4_000_000  # numbers of a threshold's table held at once
_SMOOTH = 40  # nodes for functions of a sum of squares


@dataclass(frozen=True)
class Quantity:
    """One marginal.

    Attributes
    ----------
    name : str
    low, high : float
        Support.
    moments : callable
        From the level (0 for the rules, 1 for the coarse ones inside them) to mean and standard deviation.
    cdf : callable
        From thresholds (n,) and the level to probabilities.
    split : callable or None
        Splits panels where these quantiles put a kink into the integrand; whether it split any.
    errors : callable or None
        From thresholds to the error in each panel of an axis over which conditional distribution functions are
        averaged: these can be steps where the densities themselves are smooth.
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
    errors: Callable[[Array], list[tuple[Axis, Array]]] | None = None


def _moments(expect: Callable[[Callable[[Array], Array], int], float]) -> Moments:
    """Mean and standard deviation from expectations."""

    def moments(level: int) -> tuple[float, float]:
        mean = expect(lambda v: v, level)
        variance = expect(lambda v: (v - mean) ** 2, level)
        return mean, math.sqrt(max(variance, 0.0))

    return cache(moments)


def shared(grid: Grid, number: int, name: str) -> Quantity:
    """Of an unknown that the series share."""
    one = grid.joint.shared[number]
    rows = [grid.outer_rows(number, level) for level in (0, 1)]

    def cdf(t: Array, level: int) -> Array:
        t = np.log(np.maximum(t, 1e-300)) if one.log else t
        return rows[level].below(t[:, None])[:, 0]

    def expect(of: Callable[[Array], Array], level: int) -> float:
        return float(grid.share[level] @ of(grid.at[one.kind]))

    factors = ((-1, grid.at[one.kind]),)
    return Quantity(name, one.unknown.lower, one.unknown.upper, _moments(expect), cdf, factors=factors)


def product_of_shared(grid: Grid, e_number: int, mu_number: int, name: str) -> Quantity:
    """kappa = mu (1 + e_n) where both are shared."""
    e, mu = grid.joint.shared[e_number], grid.joint.shared[mu_number]
    rows = [grid.outer_rows(mu_number, level, e_number) for level in (0, 1)]
    at = 1.0 + e.values()

    def cdf(t: Array, level: int) -> Array:
        return rows[level].below(t[:, None] / at) @ e.axis.weights()[level]

    def expect(of: Callable[[Array], Array], level: int) -> float:
        return float(grid.share[level] @ of(grid.at["mu"] * (1.0 + grid.at["e_n"])))

    ends = mu.unknown.lower * (1.0 + e.unknown.lower), mu.unknown.upper * (1.0 + e.unknown.upper)
    return Quantity(name, *ends, _moments(expect), cdf)


def of_series(grid: Grid, number: int, kind: str, name: str) -> Quantity:
    """e_n, c, mu, kappa or tau (the transition) of one series."""
    tensor = grid.tensors[number]
    made = {"e_n": _e_n, "c": _c, "mu": _mu, "kappa": _kappa, "tau": _tau}[kind](grid, tensor, name)
    values = {"e_n": tensor.e_n[..., None], "c": tensor.c, "mu": tensor.mu}
    return replace(made, factors=((number, values[kind]),)) if kind in values else made


def covariance(grid: Grid, quantities: Sequence[Quantity]) -> Array:
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


def _product(grid: Grid, factors: tuple[tuple[int, Array], ...]) -> Array:
    """Mean of a product at each outer node; parts are independent there."""
    by_part: dict[int, Array] = {}
    for part, values in factors:
        by_part[part] = by_part[part] * values if part in by_part else values
    found: Array = np.ones(1)
    for part, values in by_part.items():
        found = found * (values if part < 0 else grid.tensors[part].expect_each(values, 0))
    return found


def _of_values(grid: Grid, tensor: Tensor, values: Array) -> Moments:
    return _moments(
        lambda of, level: float((grid.share[level] * tensor.expect_each(of(values), level)).sum())
    )


def _e_n(grid: Grid, tensor: Tensor, name: str) -> Quantity:
    unknown = tensor.series.e_n
    assert isinstance(unknown, Unknown)
    moments = _of_values(grid, tensor, tensor.e_n[..., None])
    if tensor.series.role == "e_n":  # e_n = x b/mu - 1
        c = tensor.c[..., 0] if tensor.series.c is None else np.zeros((1, 1, 1))
        mu = tensor.mu[..., 0]
        b = np.asarray(tensor.series.misfit.b(c))
        laws = _laws(grid, tensor)

        def by_x(t: Array, level: int) -> Array:
            return laws(level)((mu * (1.0 + t[:, None, None, None]) / b)[..., 0])

        return Quantity(name, unknown.lower, unknown.upper, moments, by_x)
    axis = tensor.series.e_axis
    assert axis is not None
    rows = []
    for level in (0, 1):
        values = tensor.e_density(grid.share[level], level).reshape(1, -1, axis.order + 1)
        rows.append(Panels.of(axis.low[None], axis.width[None], values, level))
    return Quantity(
        name, unknown.lower, unknown.upper, moments, lambda t, level: rows[level].below(t[:, None])[:, 0]
    )


def _c(grid: Grid, tensor: Tensor, name: str) -> Quantity:
    unknown = tensor.series.c
    assert isinstance(unknown, Unknown)
    moments = _of_values(grid, tensor, tensor.c)
    if tensor.series.role == "c":  # b(c) = mu (1 + e_n)/x falls as x rises
        kappa = (tensor.mu[..., 0] * (1.0 + tensor.e_n))[..., 0]
        laws = _laws(grid, tensor)

        def by_x(t: Array, level: int) -> Array:
            b = np.asarray(tensor.series.misfit.b(t[:, None, None]))
            with np.errstate(divide="ignore", invalid="ignore"):
                x = np.where(b > 0.0, kappa / b, np.inf)
            return 1.0 - laws(level)(x)

        return Quantity(name, unknown.lower, unknown.upper, moments, by_x)
    below = _by_c(tensor, lambda t: t)

    def errors(at: Array) -> list[tuple[Axis, Array]]:
        axis = tensor.series.x_axis
        if axis is None or not tensor.series.has_x_axis:
            return []
        each = [tensor.along_x_below_c(t[None, None, None], grid.share[0]) for t in at]
        return [(axis, np.max([axis.errors(part) for part in each], axis=0))]

    return Quantity(
        name,
        unknown.lower,
        unknown.upper,
        moments,
        lambda t, level: below(t, grid.share[level], level),
        errors=errors,
    )


def _by_c(tensor: Tensor, threshold: Callable[[Array], Array]) -> Callable[[Array, Array, int], Array]:
    """Distribution function of what is below t where the closure constant is below threshold(t)."""
    size = int(np.prod(tensor.f.shape[:3])) * (tensor.series.c_order + 2)
    step = max(1, _AT_ONCE // size)

    def below(t: Array, share: Array, level: int) -> Array:
        parts = [
            tensor.below_c(threshold(t[i : i + step, None, None, None]), share, level)
            for i in range(0, t.size, step)
        ]
        return np.concatenate(parts)

    return below


def _mu(grid: Grid, tensor: Tensor, name: str) -> Quantity:
    unknown = tensor.series.mu
    assert isinstance(unknown, Unknown)
    moments = _of_values(grid, tensor, tensor.mu)
    cdf = _friction_cdf(grid, tensor, 1.0 + tensor.e_n)

    def errors(at: Array) -> list[tuple[Axis, Array]]:
        axis = tensor.series.e_axis
        k = tensor.series.misfit.coefficients
        if axis is None or not tensor.series.has_e_axis or (k.b1 and tensor.series.has_c):
            return []
        b = np.asarray(tensor.series.misfit.b(tensor.c[..., 0] if k.b1 else 0.0))
        ratio = ((1.0 + tensor.e_n) / (b.reshape((1, 1, 1)) if b.ndim == 0 else b))[..., 0]
        each = [tensor.along_e_below_x(t * ratio, grid.share[0]) for t in at]
        return [(axis, np.max([axis.errors(part) for part in each], axis=0))]

    return Quantity(name, unknown.lower, unknown.upper, moments, cdf, errors=errors)


def _laws(grid: Grid, tensor: Tensor) -> Callable[[int], Callable[[Array], Array]]:
    """Distribution function of the transition by level, made once."""
    return cache(lambda level: tensor.along_x(grid.share[level], level))


def _friction_cdf(grid: Grid, tensor: Tensor, factor: Array) -> Cdf:
    """Distribution function of x b(c)/factor."""
    below = cache(lambda level: _friction_below(tensor, factor, grid.share[level], level))
    return lambda t, level: below(level)(t)


def _friction_below(tensor: Tensor, factor: Array, share: Array, level: int) -> Callable[[Array], Array]:
    misfit = tensor.series.misfit
    k = misfit.coefficients
    if k.b1 and tensor.series.has_c:
        per_x = factor / np.maximum(tensor.x, 1e-300)
        by_c = _by_c(tensor, lambda t: (t * per_x - k.b0) / k.b1)
        return lambda t: by_c(t, share, level)
    b = np.asarray(misfit.b(tensor.c[..., 0] if k.b1 else 0.0))
    ratio = (factor / (b.reshape((1, 1, 1)) if b.ndim == 0 else b))[..., 0]
    below = tensor.along_x(share, level)
    return lambda t: below(t[:, None, None] * ratio)


def _kappa(grid: Grid, tensor: Tensor, name: str) -> Quantity:
    series = tensor.series
    moments = _of_values(grid, tensor, tensor.mu * (1.0 + tensor.e_n[..., None]))
    ends = []
    for end in ("lower", "upper"):
        e, mu = (
            getattr(u, end)
            if isinstance(u, Unknown)
            else (float(np.min(at)) if end == "lower" else float(np.max(at)))
            for u, at in ((series.e_n, tensor.e_n), (series.mu, tensor.mu))
        )
        ends.append(mu * (1.0 + e))
    if series.role == "c":  # mu is given, so e_n alone moves it
        mu_value = float(tensor.mu.reshape(-1)[0])
        e_n = _e_n(grid, tensor, name)
        return Quantity(name, *ends, moments, lambda t, level: e_n.cdf(t / mu_value - 1.0, level))

    axes = {one.kind: one.axis for one in grid.joint.shared if not one.log}
    cuts = [
        (series.e_axis if series.has_e_axis else axes.get("e_n"), series.mu, lambda t, end: t / end - 1.0)
    ]
    if series.role == "e_n":
        cuts = [(axes.get("mu"), series.e_n, lambda t, end: t / (1.0 + end))]

    def split(at: Array) -> bool:
        """The bounds of mu (of e_n) cut kappa off at another place for each e_n (mu)."""
        axis, unknown, place = cuts[0]
        assert axis is not None
        assert isinstance(unknown, Unknown)
        ends = [end for end in (unknown.lower, unknown.upper) if series.role == "e_n" or end > 0.0]
        return bool(axis.split(np.concatenate([place(at, end) for end in ends])))

    kinked = tensor.limits is not None and cuts[0][0] is not None and isinstance(cuts[0][1], Unknown)
    return Quantity(
        name, *ends, moments, _friction_cdf(grid, tensor, np.ones((1, 1, 1))), split if kinked else None
    )


def _tau(grid: Grid, tensor: Tensor, name: str) -> Quantity:
    moments = _of_values(grid, tensor, tensor.x[..., None])
    laws = _laws(grid, tensor)
    return Quantity(name, 0.0, math.inf, moments, lambda t, level: laws(level)(t[:, None, None]))


def friction_apart(
    grid: Grid, of_kappa: Quantity, kappa: int, e_n: int, unknown: Unknown, name: str
) -> Quantity:
    """mu = kappa/(1 + e_n) where nothing in the data ties the two."""
    friction, normal = grid.tensors[kappa], grid.tensors[e_n]
    at = normal.e_n[..., None]
    together = normal.mass.shape[1] == 1  # e_n has one law, whatever the shared unknowns
    of_e = _e_n(grid, normal, "e_n")
    kappa_mean, kappa_sd = of_kappa.moments(0)
    e_mean, e_sd = of_e.moments(0)
    e_is_wider = e_sd / (1.0 + e_mean) > kappa_sd / max(kappa_mean, 1e-300)

    @cache
    def values_of_kappa(level: int) -> tuple[Array, Array]:
        return friction.values_of(friction.mu, grid.share[level], level)

    def moments(level: int) -> tuple[float, float]:
        share = grid.share[level]
        w = normal.expect_each(1.0 / (1.0 + at), level)
        spread_w = normal.expect_each((1.0 / (1.0 + at) - w[:, None, None, None]) ** 2, level)
        k = friction.expect_each(friction.mu, level)
        spread_k = friction.expect_each((friction.mu - k[:, None, None, None]) ** 2, level)
        mean = float((share * (k * w)).sum())
        within = spread_k * (w * w + spread_w) + k * k * spread_w
        return mean, math.sqrt(max(float((share * (within + (k * w - mean) ** 2)).sum()), 0.0))

    def cdf(t: Array, level: int) -> Array:
        share = grid.share[level]
        law = normal.e_law(level)  # (m or 1, n_e)
        kept = np.flatnonzero(law.max(axis=0) > 1e-13)
        points = 1.0 + at.reshape(-1)[kept]
        if together and e_is_wider:  # average over kappa, which is the narrower one
            value, probability = values_of_kappa(level)
            at_e = value / np.maximum(t, 1e-300)[:, None] - 1.0
            found = of_e.cdf(at_e.reshape(-1), level).reshape(t.size, -1)
            return np.asarray((1.0 - found) @ probability)
        if together:
            found = of_kappa.cdf((t[:, None] * points).reshape(-1), level).reshape(t.size, -1)
            return np.asarray(found @ law[0, kept])
        one = np.ones((1, 1, 1))
        parts = [
            _friction_below(friction, one, share * law[:, j], level)(t * point)
            for j, point in zip(kept, points, strict=True)
        ]
        return np.asarray(sum(parts))

    factors = ((kappa, friction.mu), (e_n, 1.0 / (1.0 + at)))
    return Quantity(name, unknown.lower, unknown.upper, cache(moments), cdf, factors=factors)


def scaled(of: Quantity, factor: float, offset: float, name: str) -> Quantity:
    """offset + factor times another quantity."""

    def moments(level: int) -> tuple[float, float]:
        mean, sd = of.moments(level)
        return offset + factor * mean, factor * sd

    def cdf(t: Array, level: int) -> Array:
        if factor == 0.0:
            return np.where(t >= offset, 1.0, 0.0)
        return of.cdf((t - offset) / factor, level)

    return Quantity(name, offset + factor * of.low, offset + factor * of.high, moments, cdf)


def noise(grid: Grid, number: int, group: int, name: str) -> Quantity:
    """The unknown sigma of a noise group."""
    tensor = grid.tensors[number]
    series = tensor.series
    assert series.noise is not None
    own = series.noise[group]
    squares = [_compressed(tensor, grid.share[level], level, group) for level in (0, 1)]

    def moments(level: int) -> tuple[float, float]:
        square, weight = squares[level]
        mean = float(weight @ own.moment(square, 1))
        second = float(weight @ (own.moment(square, 2) - 2.0 * mean * own.moment(square, 1) + mean * mean))
        return mean, math.sqrt(max(second, 0.0))

    def cdf(t: Array, level: int) -> Array:
        square, weight = squares[level]
        return np.asarray(own.cdf(t[:, None], square) @ weight)

    return Quantity(name, own.lower, own.upper, moments, cdf)


def _compressed(tensor: Tensor, share: Array, level: int, group: int) -> tuple[Array, Array]:
    """Sums of squares of a group with their probabilities, told by their values at a few nodes.

    What follows from a sum of squares is smooth in its logarithm: the probabilities of all nodes are shared
    out over interpolation nodes, exactly for polynomials.
    """
    square, weight = tensor.squares(group, share, level)
    kept = np.abs(weight) > 1e-14
    log_q, weight = np.log(np.maximum(square[kept], 1e-300)), weight[kept]
    low, high = float(log_q.min()), float(log_q.max())
    if high - low < 1e-9:
        return np.exp(np.array([low])), np.array([weight.sum()])
    cosine = np.cos(np.pi * (np.arange(_SMOOTH) + 0.5) / _SMOOTH)
    y = np.clip((2.0 * log_q - low - high) / (high - low), -1.0, 1.0)
    # sum over the nodes of each Chebyshev polynomial, then the weights that have the same sums
    sums = np.empty(_SMOOTH)
    before, now = np.ones_like(y), y
    sums[0] = weight.sum()
    for j in range(1, _SMOOTH):
        sums[j] = weight @ now
        before, now = now, 2.0 * y * now - before
    at = np.cos(np.arange(_SMOOTH)[:, None] * np.arccos(cosine))
    share_out = (at.T * np.where(np.arange(_SMOOTH) == 0, 1.0, 2.0) / _SMOOTH) @ sums
    return np.exp(0.5 * (low + high) + 0.5 * (high - low) * cosine), share_out
