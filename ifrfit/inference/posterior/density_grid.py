"""Density of the unknowns of one series at all nodes, and what follows from it: masses, means, shares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.posterior.clenshaw_curtis import rule
from ifrfit.inference.posterior.closure_constant import ConditionalCoordinate
from ifrfit.inference.posterior.conditional_cdf import TwoSidedIntegrals
from ifrfit.inference.posterior.panel_cdf import PanelCdf
from ifrfit.inference.posterior.quadratic_sums import with_c_axis
from ifrfit.inference.posterior.quadrature_axis import QuadratureAxis

if TYPE_CHECKING:
    from ifrfit.inference.posterior.series_integrand import SeriesIntegrand

Array = NDArray[np.float64]

_ALONE = np.ones((2, 1))  # weights of a single node


@dataclass
class DensityGrid:
    """Density at nodes along (outer nodes, e_n, transition, closure constant).

    Every weight and integral comes twice, by the rules and by the coarse rules inside them; so do the shares
    of the outer nodes, (2, m). Functions of a number of levels give the rules alone (1) or both (2).

    Attributes
    ----------
    series : SeriesIntegrand
    e_n, x : ndarray, (m, n_e, n_x), broadcastable
    c, mu : ndarray, (m, n_e, n_x, n_c), broadcastable
    f : ndarray, (m, n_e, n_x, n_c), broadcastable
        Density of the closure constant, relative.
    apart : ndarray, (m, n_e, n_x)
        Factor of f that the closure constant takes no part in; their product is relative to exp(shift).
    shift : ndarray, (m,)
    g : ndarray, (2, m, n_e, n_x)
        Integrated over the closure constant.
    e_weight : ndarray, (2, n_e)
    x_weight : ndarray, (2, m, n_e, n_x)
    c_weight : ndarray, (2, n_c)
    mass : ndarray, (2, m)
        Integral at each outer node, relative to exp(shift).
    limits : (ndarray, ndarray) or None
        Ends of the transition's coordinate where they cut panels, (m, n_e).
    spread : ConditionalCoordinate or None
        Coordinate of the closure constant, where it is an unknown of the part.
    """

    series: SeriesIntegrand
    e_n: Array
    x: Array
    c: Array
    mu: Array
    f: Array
    apart: Array
    shift: Array
    g: Array
    e_weight: Array
    x_weight: Array
    c_weight: Array
    mass: Array
    limits: tuple[Array, Array] | None
    spread: ConditionalCoordinate | None

    @classmethod
    def of(
        cls,
        series: SeriesIntegrand,
        e_n: Array,
        x: Array,
        c: Array,
        mu: Array,
        logs: tuple[Array, Array],
        e_weight: Array,
        limits: tuple[Array, Array] | None,
        spread: ConditionalCoordinate | None,
    ) -> DensityGrid:
        """Integrate the log densities (with the closure constant, apart from it) found at the nodes."""
        top = logs[0].max(axis=-1)
        whole = top + logs[1]
        shift = whole.max(axis=(1, 2))
        shift = np.where(np.isfinite(shift), shift, 0.0)
        with np.errstate(invalid="ignore"):
            f = np.exp(logs[0] - np.where(np.isfinite(top), top, 0.0)[..., None])
        apart = np.exp(whole - shift[:, None, None])
        shape = np.broadcast(apart, e_n[:1], x[:1], f[..., 0]).shape
        if apart.shape != shape:
            apart = np.broadcast_to(apart, shape)
        c_weight = _ALONE if spread is None else np.tile(rule(series.c_order).weights, 2)
        g = np.stack([apart * (f @ w) for w in c_weight])
        if not series.has_x_axis or series.x_axis is None:
            x_weight = _ALONE[:, :, None, None]
        else:
            x_weight = series.x_axis.weights_between(limits)
        mass = ((g * x_weight).sum(axis=-1) * e_weight[:, None, :]).sum(axis=-1)
        return cls(
            series, e_n, x, c, mu, f, apart, shift, g, e_weight, x_weight, c_weight, mass, limits, spread
        )

    @cached_property
    def weight(self) -> Array:
        """Of each node of e_n and of the transition, (2, m, n_e, n_x)."""
        return np.asarray(self.x_weight * self.e_weight[:, None, :, None])

    @property
    def log_mass(self) -> Array:
        """Log of the integral at each outer node, (2, m)."""
        return np.asarray(np.log(np.maximum(self.mass, 1e-300)) + self.shift)

    def outer(self, share: Array) -> Array:
        """Factor that turns densities into posterior ones, (2, m, 1, 1)."""
        if self.mass.shape[1] == 1:  # one law, whatever the outer node
            share = share.sum(axis=1, keepdims=True)
        return np.asarray((share / np.maximum(self.mass, 1e-300))[:, :, None, None])

    def expect_each(self, value: Array) -> Array:
        """Mean of a value at the nodes, (m, n_e, n_x, n_c), broadcastable, at each outer node, (2, m)."""
        if value.shape[-1] == 1:
            inner = self.g * value[..., 0]
        else:
            product = self.f * value
            inner = np.stack([self.apart * (product @ w) for w in self.c_weight])
        return np.asarray((inner * self.weight).sum(axis=(2, 3)) / np.maximum(self.mass, 1e-300))

    def e_law(self) -> Array:
        """Probability of each node of e_n, (2, m, n_e)."""
        h = (self.g * self.weight).sum(axis=-1)
        return np.asarray(h / np.maximum(self.mass, 1e-300)[..., None])

    def along_x(self, share: Array) -> Callable[[Array, int], Array]:
        """Posterior probability of a transition below x, by levels, as a function of x, (..., m, n_e)."""
        axis = self.series.x_axis
        assert axis is not None
        to_t = self.series.to_t
        low, width = axis.low[None], axis.width[None]
        m, n_e, _ = self.g.shape[1:]
        weight = (self.outer(share)[..., 0] * self.e_weight[:, None]).reshape(2, 1, -1)
        if self.limits is None:
            total = weight @ self.g.reshape(2, m * n_e, -1)
            summed = PanelCdf.of_levels(low, width, total.reshape(2, *axis.shape))
        each = cache(
            lambda level: PanelCdf.of(low, width, self.g[level].reshape(m * n_e, *axis.shape), level)
        )

        def below(x: Array, levels: int) -> Array:
            t = to_t(x)
            if self.limits is None and t.shape[-2:] == (1, 1):
                return summed.below_in_all(t[..., 0, 0], levels)
            least = None
            if self.limits is not None:
                least, most = (np.broadcast_to(end, (m, n_e)) for end in self.limits)
                t = np.clip(t, least, most)
            t = np.broadcast_to(t, (*t.shape[:-2], m, n_e)).reshape(*t.shape[:-2], m * n_e)
            found = []
            for level in range(levels):
                rows = each(level)
                start = 0.0 if least is None else rows.below(least.reshape(-1))
                found.append((rows.below(t) - start) @ weight[level, 0])
            return np.stack(found)

        return below

    @cached_property
    def sides(self) -> TwoSidedIntegrals:
        """Integrals of the closure constant's densities, for `ConditionalCdf`."""
        return TwoSidedIntegrals.of(self)

    def along_x_below(self, cut: Array, share: Array) -> Array:
        """Density along the transition of what a cut leaves at each node, (rows, panels, nodes)."""
        assert self.series.x_axis is not None
        across = self.outer(share)[0] * self.e_weight[0][:, None]
        return np.asarray(cut * self.apart * across).reshape(-1, *self.series.x_axis.shape)

    def along_e_below(self, cut: Array, share: Array) -> Array:
        """Density along e_n of what a cut leaves at each node, (rows, panels, nodes)."""
        assert self.series.e_axis is not None
        inner = (cut * self.apart * self.x_weight[0]).sum(axis=-1)
        return np.asarray((inner * self.outer(share)[0, ..., 0]).reshape(-1, *self.series.e_axis.shape))

    def along_e_below_x(self, x: Array, share: Array) -> Array:
        """Density along e_n of what lies below a transition x, (m, n_e), as (rows, panels, nodes)."""
        assert self.series.e_axis is not None
        below = self.each_below(x) * self.outer(share)[0, ..., 0]
        return np.asarray(below.reshape(-1, *self.series.e_axis.shape))

    def each_below(self, x: Array) -> Array:
        """Integral up to a transition x, (m, n_e), at each outer node and e_n."""
        axis = self.series.x_axis
        assert axis is not None
        m, n_e, _ = self.g.shape[1:]
        panels = PanelCdf.of(axis.low[None], axis.width[None], self.g[0].reshape(m * n_e, *axis.shape))
        t = np.broadcast_to(self.series.to_t(x), (m, n_e))
        start: Array | float = 0.0
        if self.limits is not None:
            least, most = (np.broadcast_to(end, (m, n_e)) for end in self.limits)
            t, start = np.clip(t, least, most), panels.below(least.reshape(-1))
        return np.asarray((panels.below(t.reshape(-1)) - start).reshape(m, n_e))

    def values_of(self, value: Array, share: Array) -> tuple[Array, Array]:
        """A value at all nodes, (n,), with its probabilities, (2, n); those without any left out."""
        weight = self.weight * self.outer(share)
        if value.shape[-1] == 1:
            probability = (weight * self.g)[..., None]
        else:
            weight = weight * self.apart
            probability = self.f * weight[..., None] * self.c_weight[:, None, None, None, :]
        value = np.broadcast_to(value, probability.shape[1:])
        if value.shape[0] > 1 and np.ptp(value, axis=0).max() == 0.0:  # the same at all outer nodes
            value, probability = value[0], probability.sum(axis=1)
        kept = np.abs(probability[0]) > 1e-14
        return value[kept], probability[:, kept]

    def squares(self, group: int, share: Array) -> tuple[Array, Array]:
        """Sum of squares of a noise group at all nodes, (n,), and the probabilities of the nodes, (2, n)."""
        misfit = self.series.misfit
        q = misfit.quadratics(self.e_n, self.x)[group]
        more = misfit.curved(self.e_n[..., None], self.x[..., None], self.c, self.mu)[group]
        weight = self.weight * self.outer(share)
        if np.ndim(q.slope) == np.ndim(more) == 0:  # the group sees no more than e_n
            square: Array = np.asarray(q.square)
            square = square.reshape((1, 1, 1)) if square.ndim == 0 else square
            probability = self.g * weight
        else:
            square = with_c_axis(q.square) + more
            if np.ndim(q.slope):
                d = self.c - misfit.reference.c
                square = square + d * (with_c_axis(q.curvature) * d - 2.0 * with_c_axis(q.slope))
            probability = self.apart * weight
            if square.shape[1] == 1 and self.f.shape[1] == 1:
                probability = probability.sum(axis=2, keepdims=True)
            probability = probability[..., None] * self.c_weight[:, None, None, None, :] * self.f
        alone = tuple(1 + axis for axis, size in enumerate(square.shape) if size == 1)
        probability = probability.sum(axis=alone, keepdims=True)
        return np.broadcast_to(square, probability.shape[1:]).reshape(-1), probability.reshape(2, -1)

    def e_density(self, share: Array) -> Array:
        """Marginal density of e_n at its nodes, (2, n_e)."""
        h = (self.g * self.x_weight).sum(axis=-1)
        return np.asarray((h * self.outer(share)[..., 0]).sum(axis=1))

    def panel_masses(self, share: Array) -> list[tuple[QuadratureAxis, Array]]:
        """Mass of the panels of e_n and of the transition."""
        probability = (self.g * self.weight)[0] * self.outer(share)[0]
        series = self.series
        found = []
        for axis, used, others in (
            (series.x_axis, series.has_x_axis, (0, 1)),
            (series.e_axis, series.has_e_axis, (0, 2)),
        ):
            if axis is not None and used:
                found.append((axis, probability.sum(axis=others).reshape(axis.shape).sum(axis=-1)))
        return found

    def panel_errors(self, share: Array) -> list[tuple[QuadratureAxis | None, Array, Array]]:
        """Mass and error of the panels of e_n and of the transition; of the closure constant as a whole."""
        outer = self.outer(share)[0]
        g, x_weight = self.g[0], self.x_weight[0]
        across = outer * self.e_weight[0][:, None]
        found: list[tuple[QuadratureAxis | None, Array, Array]] = []
        for axis, mass in self.panel_masses(share):
            along = g * across if axis is self.series.x_axis else (g * x_weight).sum(axis=-1) * outer[..., 0]
            found.append((axis, mass, axis.errors(along.reshape(-1, *axis.shape))))
        if self.spread is not None:
            sides = self.f.reshape(*self.f.shape[:-1], 2, -1) @ rule(self.series.c_order).differences.T
            part = self.apart * (across * x_weight)
            if sides.shape[0] == sides.shape[1] == 1:
                part = part.sum(axis=(0, 1), keepdims=True)
            error = (np.abs(sides).sum(axis=-2) * part[..., None]).sum(axis=(0, 1, 2)).max()
            found.append((None, np.ones(1), np.array([error])))
        return found
