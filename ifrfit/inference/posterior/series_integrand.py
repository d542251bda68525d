"""The unknowns of one series, integrated at given values of those that series share.

The frictional unknown is always the transition x (the tau at which sticking ends), in which the data's
kinks stand still: mu, e_n or the closure constant follow from it. Given e_n and x, the closure constant is
taken on both sides of its conditional mode, in a coordinate that is fine there and wide in the tails.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.row_likelihood import RowLaw
from ifrfit.inference.posterior.closure_constant import (
    ConditionalCoordinate,
    ConditioningValues,
    c_domain,
    conditional_coordinate,
)
from ifrfit.inference.posterior.density_grid import DensityGrid
from ifrfit.inference.posterior.error_model_likelihood import error_model_log_likelihood
from ifrfit.inference.posterior.noise_scale import NoiseScale
from ifrfit.inference.posterior.quadratic_sums import Quadratic, with_c_axis
from ifrfit.inference.posterior.quadrature_axis import QuadratureAxis
from ifrfit.inference.posterior.sum_of_squares import SumOfSquares

Array = NDArray[np.float64]

_FRICTIONLESS = 1e-12  # mu below which e_n does not follow from the transition
_SLIPPERY = 1e-9  # kappa below which the closure constant does not follow from the transition
_HAIR = 1e-12  # of the largest transition: no more than rounding
_FARTHEST = 1.0 - 1e-12  # end of the scale of an unbounded transition


@dataclass
class SeriesIntegrand:
    """Rows that share one set of constants, and how each of these is known.

    Attributes
    ----------
    misfit : SumOfSquares
    noise : tuple of UnknownNoise or None
        One a noise group, or None where the weights hold sigma.
    e_n, c, mu : FreeParameter, float or None
        An unknown of this series, a fixed value, or None for one that `at` of `evaluate` gives.
    sigma : ndarray
        Likely noise of each group, relative to the weights.
    n_normal : int
        Power of 1/(1 + e_n) in the measure: how many mu are restated as kappa with this e_n.
    unit : float
        Of an unbounded transition.
    tail : float
        Fall of the log density beyond which the closure constant is not followed.
    law : RowLaw or None
        Of the rows, where their scatter is not plain: `misfit` then only says where to look.
    unseen : tuple of int
        Axes of (outer nodes, e_n, transition) that the law of the closure constant takes no notice of.
    """

    misfit: SumOfSquares
    noise: tuple[NoiseScale, ...] | None
    e_n: FreeParameter | float | None
    c: FreeParameter | float | None
    mu: FreeParameter | float | None
    sigma: Array
    n_normal: int = 0
    unit: float = 1.0
    e_axis: QuadratureAxis | None = None
    x_axis: QuadratureAxis | None = None
    c_order: int = 16
    tail: float = 40.0
    law: RowLaw | None = None
    unseen: tuple[int, ...] = ()
    role: str = field(init=False)
    log_norm: float = field(init=False)

    def __post_init__(self) -> None:
        tilted = self.misfit.coefficients.b1 != 0.0
        if isinstance(self.mu, FreeParameter):
            self.role = "mu"
        elif self.mu == 0.0:
            self.role = "none"
        elif tilted and isinstance(self.c, FreeParameter):
            self.role = "c"
        elif isinstance(self.e_n, FreeParameter):
            self.role = "e_n"
        else:
            self.role = "none"
        weight = self.misfit.weight
        self.log_norm = 0.0 if self.law is not None else float(np.log(weight).sum())
        if self.noise is None and self.law is None:
            self.log_norm -= 0.5 * weight.size * math.log(2.0 * math.pi)

    @property
    def has_e_axis(self) -> bool:
        """Whether e_n has panels of its own."""
        return isinstance(self.e_n, FreeParameter) and self.role != "e_n"

    @property
    def has_x_axis(self) -> bool:
        """Whether the transition has panels."""
        return self.role != "none"

    @property
    def has_c(self) -> bool:
        """Whether the closure constant is integrated about its conditional mode."""
        return isinstance(self.c, FreeParameter) and self.role != "c"

    @property
    def stretched(self) -> bool:
        """Whether x = unit t/(1 - t) takes the place of x, because x has no end."""
        return self.misfit.coefficients.b1 != 0.0

    def to_x(self, t: Array) -> Array:
        """The transition from its coordinate."""
        return np.asarray(self.unit * t / (1.0 - t)) if self.stretched else t

    def to_t(self, x: Array) -> Array:
        """The coordinate of a transition."""
        if not self.stretched:
            return x
        with np.errstate(invalid="ignore"):
            t = np.where(np.isinf(x), 1.0, x / (x + self.unit))
        return np.asarray(np.minimum(t, _FARTHEST))

    def _limits(self, e_n: Array | None, c: Array | None, mu: Array | None) -> tuple[Array, Array] | None:
        """Ends of the transition's coordinate, (m, n_e), where the domain cuts panels; else None."""
        assert self.x_axis is not None
        lower, upper = self._c_ends(c)
        with np.errstate(divide="ignore"):
            least, most = (1.0 / np.maximum(self.misfit.b(end), 1e-300) for end in (upper, lower))
        if self.role == "e_n":
            assert mu is not None
            assert isinstance(self.e_n, FreeParameter)
            ends = mu * (1.0 + self.e_n.lower) * least, mu * (1.0 + self.e_n.upper) * least
        else:
            assert e_n is not None
            floor: Array | float
            if isinstance(self.mu, FreeParameter):
                floor, top = self.mu.lower, np.asarray(self.mu.upper)
            else:
                assert mu is not None
                floor, top = mu, mu
            ends = floor * (1.0 + e_n) * least, top * (1.0 + e_n) * most
        low, high = (self.to_t(end[..., 0]) for end in ends)
        first, last = self.x_axis.panels[0, 0], self.x_axis.panels[-1, 1]
        if low.max() <= first + _HAIR * last and high.min() >= (1.0 - _HAIR) * last:
            return None
        low, high = np.broadcast_arrays(low, high)
        return low, high

    def _c_ends(self, c: Array | None) -> tuple[Array, Array]:
        if c is not None:
            return c, c
        assert isinstance(self.c, FreeParameter)
        return np.asarray(self.c.lower), np.asarray(self.c.upper)

    def evaluate(self, at: Mapping[str, Array]) -> DensityGrid:
        """Density at all nodes.

        Parameters
        ----------
        at : mapping
            "e_n", "c", "mu" and "noise" (a common factor) to shared values, one an outer node, (m,).
        """
        e, c, mu = (self._given(kind, at) for kind in ("e_n", "c", "mu"))
        log_measure: Array = np.zeros((1, 1, 1, 1))
        e_weight = np.ones((2, 1))
        if self.has_e_axis:
            assert self.e_axis is not None
            e, e_weight = self.e_axis.nodes()[None, :, None], self.e_axis.weights()
        limits = None
        if self.has_x_axis:
            assert self.x_axis is not None
            t = self.x_axis.nodes()[None, None, :]
            x = self.to_x(t)
            limits = self._limits(e, c, mu)
            if self.stretched:
                log_measure = log_measure + (math.log(self.unit) - 2.0 * np.log1p(-t))[..., None]
        else:
            assert mu is not None
            assert e is not None
            x = (
                np.zeros((1, 1, 1))
                if self.mu == 0.0
                else mu * (1.0 + e) / self.misfit.b(c if c is not None else 0.0)
            )
        with np.errstate(divide="ignore", invalid="ignore"):
            if self.role == "c":
                assert mu is not None
                assert e is not None
                assert isinstance(self.c, FreeParameter)
                k, room = self.misfit.coefficients, self.c.upper - self.c.lower
                kappa = np.maximum(mu * (1.0 + e), _SLIPPERY)
                # panels that the domain cuts are followed a little beyond it, where numbers are still tame
                x = np.maximum(x, kappa / self.misfit.b(self.c.upper + room))
                c = (kappa / x - k.b0) / k.b1
                log_measure = log_measure + np.log(kappa / abs(k.b1) / x**2)[..., None]
            if self.role == "e_n":
                assert mu is not None
                b = self.misfit.b(c if c is not None else 0.0) / np.maximum(mu, _FRICTIONLESS)
                e = np.maximum(x * b, _FRICTIONLESS) - 1.0
                log_measure = log_measure + np.log(b + 0.0 * x)[..., None]
        assert e is not None
        noise = at["noise"][:, None, None, None] if "noise" in at else None
        squares = self.misfit.quadratics(e, x)
        spread: ConditionalCoordinate | None = None
        if isinstance(self.c, FreeParameter) and self.has_c:
            mu_ends = (self.mu.lower, self.mu.upper) if isinstance(self.mu, FreeParameter) else None
            limits_c = c_domain(self.c, self.misfit.coefficients, mu_ends, e, x)
            near = self.misfit.with_mu(squares, e, x)
            place = ConditioningValues(near, e, x, None if noise is None else noise[..., 0])
            own = (self.misfit, self.noise, self.sigma, self.c)
            spread = conditional_coordinate(*own, place, limits_c, self.tail, self.law)
            nodes, log_jacobian = spread.nodes(self.c_order)
            log_measure = log_measure + log_jacobian
        else:
            assert c is not None
            nodes = c[..., None]
        if mu is not None:
            mu_at = mu[..., None]
        else:
            of_c = nodes if self.misfit.coefficients.b1 else np.zeros((1, 1, 1, 1))
            mu_at = np.asarray(x[..., None] * self.misfit.b(of_c) / (1.0 + e[..., None]))
        log_f, log_apart = self._log_density(squares, e, x, nodes, mu_at, noise)
        if log_measure.shape[-1] == 1:
            log_apart = log_apart + log_measure[..., 0]
        else:
            log_f = log_f + log_measure
        logs = log_f, log_apart
        return DensityGrid.of(self, e, x, nodes, mu_at, logs, e_weight, limits, spread)

    def _given(self, kind: str, at: Mapping[str, Array]) -> Array | None:
        known = {"e_n": self.e_n, "c": self.c, "mu": self.mu}[kind]
        if isinstance(known, FreeParameter):
            return None
        return at[kind][:, None, None] if known is None else np.full((1, 1, 1), known)

    def _log_density(
        self, squares: list[Quadratic], e: Array, x: Array, c: Array, mu: Array, noise: Array | None
    ) -> tuple[Array, Array]:
        """Log of likelihood and prior: what the closure constant takes part in, and what is apart from it.

        The second has the shape (m, n_e, n_x), the first one axis more; where e_n takes no part in the first
        one, that one is the smaller for it.
        """
        total, apart = self._log_likelihood(squares, e, x, c, mu, noise)
        apart = apart + self.log_norm
        if isinstance(self.e_n, FreeParameter):
            apart = apart + self.e_n.log_prior(e)
        if self.n_normal:
            apart = apart - self.n_normal * np.log1p(e)
        if isinstance(self.c, FreeParameter):
            total = total + self.c.log_prior(c)
        if isinstance(self.mu, FreeParameter):
            with np.errstate(divide="ignore"):
                total = total + np.log(np.maximum(self.misfit.b(c), 0.0))
            apart = apart - np.log1p(e)
            if self.misfit.coefficients.b1 and self.mu.prior is not None:
                total = total + self.mu.log_prior(mu)
            else:
                b = self.misfit.b(c[..., 0])
                apart = apart + self.mu.log_prior(x * b / (1.0 + e))
        return total, apart

    def _log_likelihood(
        self, squares: list[Quadratic], e: Array, x: Array, c: Array, mu: Array, noise: Array | None
    ) -> tuple[Array, Array]:
        """Of the rows, in two parts as `_log_density` has them."""
        total: Array = np.zeros((1, 1, 1, 1))
        apart: Array = np.zeros((1, 1, 1))
        if self.law is not None:
            return error_model_log_likelihood(self.law, self.misfit.coefficients, e, x, c, mu, noise), apart
        d = c - self.misfit.reference.c
        curved = self.misfit.curved(e[..., None], x[..., None], c, mu)
        for number, (q, more) in enumerate(zip(squares, curved, strict=True)):
            n = self.misfit.groups[number].size
            if not n:
                continue
            moving = (
                d * (with_c_axis(q.curvature) * d - 2.0 * with_c_axis(q.slope)) if np.ndim(q.slope) else 0.0
            )
            moving = moving + more
            if self.noise is not None:
                if np.ndim(moving):
                    square = np.maximum(with_c_axis(q.square) + moving, 0.0)
                    total = total + self.noise[number].log_likelihood(square)
                else:
                    apart = apart + self.noise[number].log_likelihood(np.maximum(q.square, 0.0))
            elif noise is not None:
                total = total - 0.5 * moving / noise**2
                apart = apart - 0.5 * q.square / noise[..., 0] ** 2 - n * np.log(noise[..., 0])
            else:
                total = total - 0.5 * moving
                apart = apart - 0.5 * q.square
        return total, apart
