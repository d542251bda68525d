"""Marginal of mu where e_n is apart."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.posterior.density_grid import DensityGrid
from ifrfit.inference.posterior.joint_grid import JointDensity
from ifrfit.inference.posterior.marginals import Marginal
from ifrfit.inference.posterior.parameter_marginals import friction_cdf
from ifrfit.inference.posterior.quadrature_axis import QuadratureAxis

Array = NDArray[np.float64]

_AT_ONCE = 100_000  # values of a distribution function asked for at once


def quotient_marginal(
    grid: JointDensity,
    of_kappa: Marginal,
    of_e: Marginal,
    parts: tuple[int, int],
    unknown: FreeParameter,
    name: str,
) -> Marginal:
    """mu = kappa/(1 + e_n) where nothing in the data ties the two, from their marginals and their parts."""
    friction, normal = (grid.tensors[part] for part in parts)
    at = normal.e_n[..., None]
    together = normal.mass.shape[1] == 1  # e_n has one law, whatever the shared unknowns
    kappa_mean, kappa_sd = of_kappa.moments(0)
    e_mean, e_sd = of_e.moments(0)
    e_is_wider = e_sd / (1.0 + e_mean) > kappa_sd / max(kappa_mean, 1e-300)

    @cache
    def values_of_kappa() -> tuple[Array, Array]:
        return friction.values_of(friction.mu, grid.share)

    @cache
    def law_of_e() -> tuple[Array, Array]:
        law = normal.e_law()  # (2, m or 1, n_e)
        kept = np.flatnonzero(law[0].max(axis=0) > 1e-13)
        return 1.0 + at.reshape(-1)[kept], law[:, :, kept]

    @cache
    def both_moments() -> list[tuple[float, float]]:
        inverse, of_mu = 1.0 / (1.0 + at), friction.mu
        w, k = normal.expect_each(inverse), friction.expect_each(of_mu)
        # about the means by the rules, for both levels
        off = (inverse - w[0][:, None, None, None]) ** 2, (of_mu - k[0][:, None, None, None]) ** 2
        spread_w = normal.expect_each(off[0]) - (w - w[0]) ** 2
        spread_k = friction.expect_each(off[1]) - (k - k[0]) ** 2
        mean = (grid.share * (k * w)).sum(axis=1)
        within = spread_k * (w * w + spread_w) + k * k * spread_w
        square = (grid.share * (within + (k * w - mean[:, None]) ** 2)).sum(axis=1)
        return [(float(m), math.sqrt(max(float(v), 0.0))) for m, v in zip(mean, square, strict=True)]

    def cdf(t: Array, levels: int) -> Array:
        if together and e_is_wider:  # average over kappa, which is the narrower one
            value, probability = values_of_kappa()
            total = np.zeros((levels, t.size))
            step = max(1, _AT_ONCE // t.size)
            for part in (slice(start, start + step) for start in range(0, value.size, step)):
                at_e = value[part] / np.maximum(t, 1e-300)[:, None] - 1.0
                found = 1.0 - of_e.cdf(at_e.reshape(-1), levels).reshape(levels, t.size, -1)
                total += (found @ probability[:levels, part, None])[..., 0]
            return total
        points, law = law_of_e()
        if together:
            found = of_kappa.cdf((t[:, None] * points).reshape(-1), levels).reshape(levels, t.size, -1)
            return np.asarray((found @ law[:levels, 0, :, None])[..., 0])
        one = np.ones((1, 1, 1))
        each = [
            friction_cdf(friction, one, grid.share * law[:, :, j])(t * point, levels)
            for j, point in enumerate(points)
        ]
        return np.asarray(sum(each))

    split = None
    if together and e_is_wider and not friction.series.stretched:
        axis, per_kappa = _axis_of_kappa(grid, friction)

        def split(at: Array) -> bool:
            """Where kappa meets the ends of e_n."""
            return axis.split(np.concatenate([at * (1.0 + end) * per_kappa for end in (of_e.low, of_e.high)]))

    factors = ((parts[0], friction.mu), (parts[1], 1.0 / (1.0 + at)))
    ends = unknown.lower, unknown.upper
    return Marginal(name, *ends, lambda level: both_moments()[level], cdf, split, factors)


def _axis_of_kappa(grid: JointDensity, friction: DensityGrid) -> tuple[QuadratureAxis, float]:
    """Axis along which kappa runs, and its coordinate over kappa (where the bound is not tilted)."""
    if friction.series.has_x_axis and friction.series.x_axis is not None:
        return friction.series.x_axis, 1.0 / float(friction.series.misfit.b(0.0))
    return next(one.axis for one in grid.joint.shared if one.kind == "mu"), 1.0
