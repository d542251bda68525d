"""Marginals of the quantities of one part of the integral."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.posterior.conditional_cdf import ConditionalCdf
from ifrfit.inference.posterior.density_grid import DensityGrid
from ifrfit.inference.posterior.joint_grid import ErrorsByAxis, JointDensity
from ifrfit.inference.posterior.marginals import Cdf, Marginal, Moments, moments_of
from ifrfit.inference.posterior.panel_cdf import PanelCdf
from ifrfit.inference.posterior.quadrature_axis import QuadratureAxis
from ifrfit.inference.posterior.series_integrand import SeriesIntegrand

Array = NDArray[np.float64]

ErrorsAt = Callable[[Array, Array], ErrorsByAxis]


def series_marginal(grid: JointDensity, number: int, kind: str, name: str) -> Marginal:
    """e_n, c, mu, kappa or the transition (its tau on a scale with an end) of one series."""
    tensor = grid.tensors[number]
    made = {"e_n": _e_n, "c": _c, "mu": _mu, "kappa": _kappa, "tau": _tau}[kind](grid, tensor, name)
    values = {"e_n": tensor.e_n[..., None], "c": tensor.c, "mu": tensor.mu}
    return replace(made, factors=((number, values[kind]),)) if kind in values else made


def _of_values(grid: JointDensity, tensor: DensityGrid, values: Array) -> Moments:
    return moments_of(lambda of: (grid.share * tensor.expect_each(of(values))).sum(axis=1))


def _e_n(grid: JointDensity, tensor: DensityGrid, name: str) -> Marginal:
    unknown = tensor.series.e_n
    assert isinstance(unknown, FreeParameter)
    moments = _of_values(grid, tensor, tensor.e_n[..., None])
    if tensor.series.role == "e_n":  # e_n = x b/mu - 1
        c = tensor.c[..., 0] if tensor.series.c is None else np.zeros((1, 1, 1))
        mu = tensor.mu[..., 0]
        b = np.asarray(tensor.series.misfit.b(c))
        law = tensor.along_x(grid.share)

        def by_x(t: Array, levels: int) -> Array:
            return law((mu * (1.0 + t[:, None, None, None]) / b)[..., 0], levels)

        return Marginal(name, unknown.lower, unknown.upper, moments, by_x)
    axis = tensor.series.e_axis
    assert axis is not None
    values = tensor.e_density(grid.share).reshape(2, *axis.shape)
    rows = PanelCdf.of_levels(axis.low[None], axis.width[None], values)
    return Marginal(name, unknown.lower, unknown.upper, moments, rows.below_in_all)


def _c(grid: JointDensity, tensor: DensityGrid, name: str) -> Marginal:
    unknown = tensor.series.c
    assert isinstance(unknown, FreeParameter)
    moments = _of_values(grid, tensor, tensor.c)
    if tensor.series.role == "c":  # b(c) = mu (1 + e_n)/x falls as x rises
        kappa = (tensor.mu[..., 0] * (1.0 + tensor.e_n))[..., 0]
        law = tensor.along_x(grid.share)

        def by_x(t: Array, levels: int) -> Array:
            b = np.asarray(tensor.series.misfit.b(t[:, None, None]))
            with np.errstate(divide="ignore", invalid="ignore"):
                x = np.where(b > 0.0, kappa / b, np.inf)
            return 1.0 - law(x, levels)

        return Marginal(name, unknown.lower, unknown.upper, moments, by_x)
    cut = ConditionalCdf(tensor, grid.share, np.zeros((1, 1, 1)), lambda t, own: t + own)
    errors = _errors_by_c(grid, tensor, cut)
    return Marginal(name, unknown.lower, unknown.upper, moments, cut.probability, errors=errors)


def _mu(grid: JointDensity, tensor: DensityGrid, name: str) -> Marginal:
    unknown = tensor.series.mu
    assert isinstance(unknown, FreeParameter)
    moments = _of_values(grid, tensor, tensor.mu)
    cdf, errors = _friction(grid, tensor, 1.0 + tensor.e_n)
    return Marginal(name, unknown.lower, unknown.upper, moments, cdf, errors=errors)


def _friction(grid: JointDensity, tensor: DensityGrid, factor: Array) -> tuple[Cdf, ErrorsAt]:
    """Distribution function of x b(c)/factor, and the errors of panels over which it is averaged."""
    if tensor.series.misfit.coefficients.b1 and tensor.series.has_c:
        cut = _cut_by_friction(tensor, factor, grid.share)
        return cut.probability, _errors_by_c(grid, tensor, cut)
    return friction_cdf(tensor, factor, grid.share), _errors_by_x(grid, tensor, factor)


def _cut_by_friction(tensor: DensityGrid, factor: Array, share: Array) -> ConditionalCdf:
    """Where x b(c)/factor is below a value."""
    k = tensor.series.misfit.coefficients
    return ConditionalCdf(
        tensor, share, factor / np.maximum(tensor.x, 1e-300), lambda t, per_x: (t * per_x - k.b0) / k.b1
    )


def friction_cdf(tensor: DensityGrid, factor: Array, share: Array) -> Cdf:
    """Distribution function of x b(c)/factor."""
    if tensor.series.misfit.coefficients.b1 and tensor.series.has_c:
        return _cut_by_friction(tensor, factor, share).probability
    ratio = _per_x(tensor, factor)
    below = tensor.along_x(share)
    return lambda t, levels: below(t[:, None, None] * ratio, levels)


def _errors_by_c(grid: JointDensity, tensor: DensityGrid, cut: ConditionalCdf) -> ErrorsAt:
    """Errors of panels over which conditional distribution functions of the closure constant are averaged."""

    def errors(at: Array, per: Array) -> ErrorsByAxis:
        share, series = grid.share, tensor.series
        left = [cut.density(float(t)) for t in at]
        found: list[tuple[QuadratureAxis | SeriesIntegrand, Array]] = [
            (series, np.array([float((cut.of_the_constant(at) * per).max())]))
        ]
        for axis, used, along in (
            (series.x_axis, series.has_x_axis, tensor.along_x_below),
            (series.e_axis, series.has_e_axis, tensor.along_e_below),
        ):
            if axis is not None and used:
                each = [axis.errors(along(part, share)) * one for part, one in zip(left, per, strict=True)]
                found.append((axis, np.asarray(np.max(each, axis=0))))
        return found

    return errors


def _errors_by_x(grid: JointDensity, tensor: DensityGrid, factor: Array) -> ErrorsAt:
    """Errors of panels over which the distribution function of x b/factor is averaged."""
    series = tensor.series

    def errors(at: Array, per: Array) -> ErrorsByAxis:
        if not (series.has_e_axis and series.has_x_axis):
            return []
        axis = series.e_axis
        assert axis is not None
        ratio = _per_x(tensor, factor)
        below = [tensor.along_e_below_x(t * ratio, grid.share) for t in at]
        each = [axis.errors(part) * one for part, one in zip(below, per, strict=True)]
        return [(axis, np.max(each, axis=0))]

    return errors


def _per_x(tensor: DensityGrid, factor: Array) -> Array:
    """The transition over x b(c)/factor, (m, n_e), where the closure constant is no unknown of the part."""
    misfit = tensor.series.misfit
    b = np.asarray(misfit.b(tensor.c[..., 0] if misfit.coefficients.b1 else 0.0))
    return np.asarray((factor / (b.reshape((1, 1, 1)) if b.ndim == 0 else b))[..., 0])


def _kappa(grid: JointDensity, tensor: DensityGrid, name: str) -> Marginal:
    series = tensor.series
    moments = _of_values(grid, tensor, tensor.mu * (1.0 + tensor.e_n[..., None]))
    ends: list[float] = []
    for end in ("lower", "upper"):
        e, mu = (
            getattr(u, end)
            if isinstance(u, FreeParameter)
            else (float(np.min(at)) if end == "lower" else float(np.max(at)))
            for u, at in ((series.e_n, tensor.e_n), (series.mu, tensor.mu))
        )
        ends.append(mu * (1.0 + e))
    if series.role == "c":  # mu is given, so e_n alone moves it
        mu_value = float(tensor.mu.reshape(-1)[0])
        e_n = _e_n(grid, tensor, name)
        return Marginal(
            name, ends[0], ends[1], moments, lambda t, levels: e_n.cdf(t / mu_value - 1.0, levels)
        )

    one = np.ones((1, 1, 1))
    cdf, errors = _friction(grid, tensor, one)
    return Marginal(name, ends[0], ends[1], moments, cdf, split=_walls(grid, tensor), errors=errors)


def _walls(grid: JointDensity, tensor: DensityGrid) -> Callable[[Array], bool] | None:
    """Splits panels where the bounds of mu (of e_n) cut kappa off, at another place for each e_n (mu)."""
    series = tensor.series
    axes = {one.kind: one.axis for one in grid.joint.shared if not one.log}
    by_mu = series.role == "e_n"
    axis = axes.get("mu") if by_mu else series.e_axis if series.has_e_axis else axes.get("e_n")
    unknown = series.e_n if by_mu else series.mu
    if tensor.limits is None or axis is None or not isinstance(unknown, FreeParameter):
        return None
    ends = [end for end in (unknown.lower, unknown.upper) if by_mu or end > 0.0]

    def split(at: Array) -> bool:
        return axis.split(np.concatenate([at / (1.0 + end) if by_mu else at / end - 1.0 for end in ends]))

    return split


def _tau(grid: JointDensity, tensor: DensityGrid, name: str) -> Marginal:
    """tau/(tau + unit): it has an end and moments also where the transition has none."""
    series = tensor.series
    own, unit = series.misfit.law, series.unit

    def tau(s: Array) -> Array:
        return np.asarray(unit * s / np.maximum(1.0 - s, 1e-300))

    if own is None:
        below = tensor.along_x(grid.share)
        moments = _of_values(grid, tensor, (tensor.x / (tensor.x + unit))[..., None])
        return Marginal(name, 0.0, 1.0, moments, lambda s, levels: below(tau(s)[:, None, None], levels))
    x = tensor.x[..., None]
    moments = _of_values(grid, tensor, x / np.maximum(x + unit * own.bound(tensor.c), 1e-300))
    if not series.has_c:
        below, bound = tensor.along_x(grid.share), own.bound(tensor.c[..., 0])[..., 0]
        return Marginal(
            name, 0.0, 1.0, moments, lambda s, levels: below(tau(s)[:, None, None] * bound, levels)
        )
    cut = ConditionalCdf(
        tensor, grid.share, tensor.x, lambda s, at_x: own.constant_at(at_x / np.maximum(tau(s), 1e-300))
    )
    up_to = cut.probability
    unknown = series.c
    assert isinstance(unknown, FreeParameter)
    ends = own.bound(np.array([unknown.lower, unknown.upper]))
    if ends[0] > ends[1]:  # kappa/bound(c) rises with c
        return Marginal(name, 0.0, 1.0, moments, up_to)
    return Marginal(name, 0.0, 1.0, moments, lambda s, levels: 1.0 - up_to(s, levels))
