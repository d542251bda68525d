"""Every marginal of a posterior, each from the part of the integral that holds it.

Where e_n is separated, kappa and e_n are independent given the shared parameters: the distribution function
of mu = kappa/(1 + e_n) is the mean of that of one of them over the other, eq. (10) of
``docs/theory/posterior.md``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.noise import noise_name
from ifrfit.inference.posterior.density_grid import DensityGrid
from ifrfit.inference.posterior.integral_layout import IntegralLayout
from ifrfit.inference.posterior.joint_grid import JointDensity
from ifrfit.inference.posterior.marginals import (
    Marginal,
    noise_over_squares,
    scaled_marginal,
    shared_kappa_marginal,
    shared_marginal,
)
from ifrfit.inference.posterior.nodes import Nodes
from ifrfit.inference.posterior.parameter_marginals import friction_cdf, kappa_marginal, series_marginal
from ifrfit.inference.posterior.quadrature_axis import QuadratureAxis
from ifrfit.inference.posterior.series_integral import TransitionKnown

Array = NDArray[np.float64]

_AT_ONCE = 100_000  # values of a distribution function asked for at once
_NEGLIGIBLE = 1e-13  # probability of a node of e_n that is left out
_TINY = 1e-300


def marginals_of(layout: IntegralLayout, density: JointDensity) -> dict[str, Marginal]:
    """Every marginal, in the order of theta, then kappa, then noises."""
    noises = _noise_marginals(layout, density)  # first: they hold arrays of the size of the grid for a while
    found: dict[str, Marginal] = {}
    kappas = kappa_marginals(layout, density)
    for kind in ("e_n", "c", "mu"):
        for block in range(len(layout.blocks)):
            parameter = layout.parameters[kind, block]
            if not isinstance(parameter, FreeParameter) or parameter.name in found:
                continue
            e_n = layout.parameters["e_n", block]
            if layout.separable and kind == "mu" and isinstance(e_n, FreeParameter):
                numbers = block, layout.restitution_series[block]
                kappa = kappas[layout.kappa_names[block]]
                made = quotient_marginal(density, kappa, found[e_n.name], numbers, parameter)
            else:
                made = _parameter_marginal(layout, density, kind, block, parameter)
            found[parameter.name] = made
    found |= kappas
    return found | noises


def _noise_marginals(layout: IntegralLayout, density: JointDensity) -> dict[str, Marginal]:
    found: dict[str, Marginal] = {}
    number = layout.integral.number_of("noise")
    if number is not None:
        found["noise"] = shared_marginal(density, number, "noise")
    for grid, names in zip(density.grids, layout.noise_groups, strict=True):
        for group, name in enumerate(names):
            law, label = grid.law_of_squares(group, density.share), noise_name(name)
            negligible = math.exp(-grid.series.tail)
            found[label] = noise_over_squares(grid.series.noise_scale(group), law, negligible, label)
    return found


def kappa_marginals(layout: IntegralLayout, density: JointDensity) -> dict[str, Marginal]:
    """Marginals of kappa, one a series where e_n or mu is separate."""
    found: dict[str, Marginal] = {}
    for block, name in enumerate(layout.kappa_names):
        if name and name not in found:
            found[name] = _kappa_marginal(layout, density, block, name)
    return found


def _parameter_marginal(
    layout: IntegralLayout, density: JointDensity, kind: str, block: int, parameter: FreeParameter
) -> Marginal:
    """Of e_n, c or mu, where mu is no quotient."""
    if layout.separable and kind == "e_n":
        return series_marginal(density, layout.restitution_series[block], "e_n", parameter)
    number = layout.integral.number_of(kind)
    if number is not None:
        return shared_marginal(density, number, parameter.name)
    return series_marginal(density, block, kind, parameter)


def _kappa_marginal(layout: IntegralLayout, density: JointDensity, block: int, name: str) -> Marginal:
    e_n, mu = layout.parameters["e_n", block], layout.parameters["mu", block]
    mu_number, e_number = (layout.integral.number_of(kind) for kind in ("mu", "e_n"))
    if mu_number is not None:
        if layout.separable:  # kappa has taken the place of mu
            return shared_marginal(density, mu_number, name)
        if e_number is not None:
            return shared_kappa_marginal(density, e_number, mu_number, name)
        if not isinstance(e_n, FreeParameter):
            return scaled_marginal(shared_marginal(density, mu_number, name), 1.0 + float(e_n), 0.0, name)
    number = block
    transition_is_known = isinstance(layout.integral.series[number].role, TransitionKnown)
    if transition_is_known and isinstance(e_n, FreeParameter) and not isinstance(mu, FreeParameter):
        of_e_n = _parameter_marginal(layout, density, "e_n", block, e_n)
        return scaled_marginal(of_e_n, float(mu), float(mu), name)
    return kappa_marginal(density, number, name)


def _kappa(nodes: Nodes) -> Array:
    """At the nodes of a series in which kappa has taken the place of mu."""
    return nodes.mu


def _inverse(nodes: Nodes) -> Array:
    """1/(1 + e_n)."""
    return np.asarray(1.0 / (1.0 + nodes.e_n[..., None]))


class _Quotient:
    """mu from the marginals of kappa and e_n, and the series that hold them.

    Parameters
    ----------
    density : JointDensity
    kappa, e_n : Marginal
    numbers : (int, int)
        Of the series that hold kappa and e_n.
    """

    def __init__(
        self, density: JointDensity, kappa: Marginal, e_n: Marginal, numbers: tuple[int, int]
    ) -> None:
        self._density, self._kappa, self._e_n = density, kappa, e_n
        self._friction, self._restitution = (density.grids[number] for number in numbers)
        self.e_is_common = self._restitution.mass.shape[1] == 1  # the same law, whatever the shared values
        (kappa_mean, kappa_sd), (e_mean, e_sd) = kappa.moments(0), e_n.moments(0)
        self.e_is_wider = e_sd / (1.0 + e_mean) > kappa_sd / max(kappa_mean, _TINY)

    @cached_property
    def moments(self) -> list[tuple[float, float]]:
        """Mean and standard deviation by the rules, and by the coarse ones."""
        share = self._density.share
        w, w_square, w_place = self._restitution.mean_and_square(_inverse, share)
        k, k_square, k_place = self._friction.mean_and_square(_kappa, share)
        w_variance, k_variance = w_square - (w - w_place) ** 2, k_square - (k - k_place) ** 2
        mean = (share * (k * w)).sum(axis=1)
        within = k_variance * (w * w + w_variance) + k * k * w_variance
        square = (share * (within + (k * w - mean[:, None]) ** 2)).sum(axis=1)
        return [(float(m), math.sqrt(max(float(v), 0.0))) for m, v in zip(mean, square, strict=True)]

    def cdf(self, t: Array, levels: int) -> Array:
        """Distribution function of mu, (levels, n): the mean over the narrower one, which is smoother."""
        if not self.e_is_common:
            return self._mean_over_e_given_shared(t, levels)
        return self._mean_over_kappa(t, levels) if self.e_is_wider else self._mean_over_e(t, levels)

    @cached_property
    def _e_law(self) -> tuple[Array, Array]:
        """1 + e_n at the nodes that count, (n,), and their probabilities, (2, m or 1, n)."""
        law = self._restitution.e_probabilities()
        kept = np.flatnonzero(law[0].max(axis=0) > _NEGLIGIBLE)
        return 1.0 + self._restitution.nodes.e_n.reshape(-1)[kept], law[:, :, kept]

    def _mean_over_kappa(self, t: Array, levels: int) -> Array:
        total = np.zeros((levels, t.size))
        step = max(1, _AT_ONCE // t.size)
        for value, probability in self._friction.law_of(_kappa, self._density.share):
            for part in (slice(start, start + step) for start in range(0, value.size, step)):
                e_n = value[part] / np.maximum(t, _TINY)[:, None] - 1.0
                above = 1.0 - self._e_n.cdf(e_n.reshape(-1), levels).reshape(levels, t.size, -1)
                total += (above @ probability[:levels, part, None])[..., 0]
        return total

    def _mean_over_e(self, t: Array, levels: int) -> Array:
        points, law = self._e_law
        below = self._kappa.cdf((t[:, None] * points).reshape(-1), levels).reshape(levels, t.size, -1)
        return np.asarray((below @ law[:levels, 0, :, None])[..., 0])

    def _mean_over_e_given_shared(self, t: Array, levels: int) -> Array:
        points, law = self._e_law
        one = np.ones((1, 1, 1))
        each = [
            friction_cdf(self._friction, one, self._density.share * law[:, :, j])(t * point, levels)
            for j, point in enumerate(points)
        ]
        return np.asarray(sum(each))

    def kinks(self) -> Callable[[Array], tuple[QuadratureAxis, Array]] | None:
        """Along kappa, where values of mu meet the ends of e_n; None where kappa is not averaged over."""
        if not (self.e_is_common and self.e_is_wider) or self._friction.series.is_unbounded:
            return None
        axis, per_kappa = _axis_of_kappa(self._density, self._friction)
        ends = self._e_n.low, self._e_n.high
        return lambda at: (axis, np.concatenate([at * (1.0 + end) * per_kappa for end in ends]))


def quotient_marginal(
    density: JointDensity,
    kappa: Marginal,
    e_n: Marginal,
    numbers: tuple[int, int],
    parameter: FreeParameter,
) -> Marginal:
    """mu = kappa/(1 + e_n) where nothing in the data ties the two.

    Parameters
    ----------
    density : JointDensity
    kappa, e_n : Marginal
    numbers : (int, int)
        Of the series that hold kappa and e_n.
    parameter : FreeParameter
        mu.
    """
    quotient = _Quotient(density, kappa, e_n, numbers)
    return Marginal(
        parameter.name,
        parameter.lower,
        parameter.upper,
        lambda level: quotient.moments[level],
        quotient.cdf,
        tuple(zip(numbers, (_kappa, _inverse), strict=True)),
        quotient.kinks(),
    )


def _axis_of_kappa(density: JointDensity, friction: DensityGrid) -> tuple[QuadratureAxis, float]:
    """Axis along which kappa runs, and its coordinate over kappa (where b does not depend on c)."""
    if friction.series.x_axis is not None:
        return friction.series.x_axis, 1.0 / friction.series.squares.coefficients.b0
    return next(one.axis for one in density.integral.shared if one.kind == "mu"), 1.0
