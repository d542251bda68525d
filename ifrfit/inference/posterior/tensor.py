"""Density of the unknowns of one series at all nodes, and what follows from it: masses, means, shares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.posterior.conditional import Spread
from ifrfit.inference.posterior.marginal import Panels
from ifrfit.inference.posterior.rule import partial, rule
from ifrfit.inference.posterior.sums import lifted

if TYPE_CHECKING:
    from ifrfit.inference.posterior.inner import Series

Array = NDArray[np.float64]


@dataclass
class Tensor:
    """Density at nodes along (outer nodes, e_n, transition, closure constant).

    Every weight and integral comes twice: by the rules, and by the coarse rules inside them.

    Attributes
    ----------
    series : Series
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
    spread : Spread or None
        Coordinate of the closure constant, where it is an unknown of the part.
    """

    series: Series
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
    spread: Spread | None
    _sides: dict[int, Array] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        series: Series,
        e_n: Array,
        x: Array,
        c: Array,
        mu: Array,
        logs: tuple[Array, Array],
        e_weight: Array,
        limits: tuple[Array, Array] | None,
        spread: Spread | None,
    ) -> Tensor:
        """Integrate the log densities (with the closure constant, apart from it) found at the nodes."""
        top = logs[0].max(axis=-1)
        whole = top + logs[1]
        shift = whole.max(axis=(1, 2))
        shift = np.where(np.isfinite(shift), shift, 0.0)
        with np.errstate(invalid="ignore"):
            f = np.exp(logs[0] - np.where(np.isfinite(top), top, 0.0)[..., None])
        apart = np.exp(whole - shift[:, None, None])
        nodes = (1, *np.broadcast_shapes(e_n.shape, x.shape)[1:])
        apart = np.broadcast_to(apart, np.broadcast_shapes(apart.shape, nodes, f.shape[:-1]))
        c_weight = np.ones((2, 1)) if spread is None else np.tile(rule(series.c_order).weights, 2)
        g = np.stack([apart * (f @ c_weight[level]) for level in (0, 1)])
        if not series.has_x_axis or series.x_axis is None:
            x_weight = np.ones((2, 1, 1, 1))
        else:
            x_weight = series.x_axis.weights_between(limits)
        h = (g * x_weight).sum(axis=-1)
        mass = (h * e_weight[:, None, :]).sum(axis=-1)
        return cls(
            series, e_n, x, c, mu, f, apart, shift, g, e_weight, x_weight, c_weight, mass, limits, spread
        )

    @property
    def log_mass(self) -> Array:
        """Log of the integral at each outer node, (2, m)."""
        return np.asarray(np.log(np.maximum(self.mass, 1e-300)) + self.shift)

    def outer(self, share: Array, level: int) -> Array:
        """Factor that turns densities into posterior ones, (m, 1, 1), from the share of each outer node."""
        if self.mass.shape[1] == 1:  # one law, whatever the outer node
            share = share.sum(keepdims=True)
        return np.asarray((share / np.maximum(self.mass[level], 1e-300))[:, None, None])

    def expect_each(self, value: Array, level: int) -> Array:
        """Mean of a value at the nodes, (m, n_e, n_x, n_c), broadcastable, at each outer node, (m,)."""
        if value.shape[-1] == 1:
            inner = self.g[level] * value[..., 0]
        else:
            inner = self.apart * ((self.f * value) @ self.c_weight[level])
        weight = self.x_weight[level] * self.e_weight[level][:, None]
        return np.asarray((inner * weight).sum(axis=(1, 2)) / np.maximum(self.mass[level], 1e-300))

    def e_law(self, level: int) -> Array:
        """Probability of each node of e_n, (m, n_e)."""
        h = (self.g[level] * self.x_weight[level]).sum(axis=-1) * self.e_weight[level]
        return np.asarray(h / np.maximum(self.mass[level], 1e-300)[:, None])

    def along_x(self, share: Array, level: int) -> Callable[[Array], Array]:
        """Posterior probability of a transition below x, as a function of x, (..., m, n_e) -> (...)."""
        axis = self.series.x_axis
        assert axis is not None
        to_t = self.series.to_t
        low, width = axis.low[None], axis.width[None]
        m, n_e, _ = self.g.shape[1:]
        values = self.g[level].reshape(m, n_e, -1, axis.order + 1)
        weight = (self.outer(share, level) * self.e_weight[level][:, None])[..., 0]
        if self.limits is None:
            summed = Panels.of(low, width, np.tensordot(weight, values, axes=([0, 1], [0, 1]))[None], level)
        rows = cache(lambda: Panels.of(low, width, values.reshape(m * n_e, *values.shape[2:]), level))

        def below(x: Array) -> Array:
            t = to_t(x)
            if self.limits is None:
                if t.shape[-2:] == (1, 1):
                    return np.asarray(summed.below(t[..., 0, :])[..., 0])
                start: Array | float = 0.0
            else:
                least, most = self.limits
                t = np.clip(t, least, most)
                least = np.broadcast_to(least, (m, n_e)).reshape(m * n_e)
                start = rows().below(least)
            t = np.broadcast_to(t, (*t.shape[:-2], m, n_e)).reshape(*t.shape[:-2], m * n_e)
            return np.asarray((rows().below(t) - start) @ weight.reshape(-1))

        return below

    def below_c(self, c: Array, share: Array, level: int) -> Array:
        """Posterior probability of a closure constant below c, (..., m, n_e, n_x) -> (...)."""
        weight = self.x_weight[level] * self.e_weight[level][:, None] * self.outer(share, level)
        weight = self.apart * weight
        below = self._below_c(c, level)
        if below.shape[-2] == 1 and below.shape[-3] == 1:  # one law of c for all e_n and outer nodes
            weight = weight.sum(axis=(0, 1), keepdims=True)
        return np.asarray((below * weight).sum(axis=(-3, -2, -1)))

    def _below_c(self, c: Array, level: int) -> Array:
        """Density at each (outer node, e_n, x), cut off at c."""
        spread = self.spread
        assert spread is not None
        if level not in self._sides:
            order = self.series.c_order
            sides = self.f.reshape(*self.f.shape[:-1], 2, order + 1)
            self._sides[level] = sides @ rule(order).antiderivative[level].T
        sides = self._sides[level]
        whole = sides.sum(axis=-1)  # of both sides
        distance = c - spread.mode
        right = distance >= 0.0
        reach = np.where(right, spread.reach[..., 1], spread.reach[..., 0])
        with np.errstate(divide="ignore", invalid="ignore"):
            v = np.arcsinh(np.abs(distance) / spread.size) / reach
        v = np.where(reach > 0.0, np.clip(v, 0.0, 1.0), 1.0)
        chosen = np.where(right[..., None], sides[..., 1, :], sides[..., 0, :])
        part = partial(chosen, v)
        return np.asarray(np.where(right, whole[..., 0] + part, whole[..., 0] - part))

    def along_x_below_c(self, c: Array, share: Array) -> Array:
        """Density along the transition of what lies below c, (rows, panels, nodes)."""
        assert self.series.x_axis is not None
        across = self.outer(share, 0) * self.e_weight[0][:, None]
        return np.asarray(self._below_c(c, 0) * self.apart * across).reshape(-1, *self.series.x_axis.shape)

    def along_e_below_c(self, c: Array, share: Array) -> Array:
        """Density along e_n of what lies below c, (rows, panels, nodes)."""
        assert self.series.e_axis is not None
        inner = (self._below_c(c, 0) * self.apart * self.x_weight[0]).sum(axis=-1) * self.outer(share, 0)[
            ..., 0
        ]
        return np.asarray(inner.reshape(-1, *self.series.e_axis.shape))

    def along_e_below_x(self, x: Array, share: Array) -> Array:
        """Density along e_n of what lies below a transition x, (m, n_e), as (rows, panels, nodes)."""
        assert self.series.e_axis is not None
        below = self.each_below(x) * self.outer(share, 0)[..., 0]
        return np.asarray(below.reshape(-1, *self.series.e_axis.shape))

    def each_below(self, x: Array) -> Array:
        """Integral up to a transition x, (m, n_e), at each outer node and e_n."""
        axis = self.series.x_axis
        assert axis is not None
        m, n_e, _ = self.g.shape[1:]
        panels = Panels.of(axis.low[None], axis.width[None], self.g[0].reshape(m * n_e, *axis.shape))
        t = np.broadcast_to(self.series.to_t(x), (m, n_e))
        start: Array | float = 0.0
        if self.limits is not None:
            least, most = (np.broadcast_to(end, (m, n_e)) for end in self.limits)
            t, start = np.clip(t, least, most), panels.below(least.reshape(-1))
        return np.asarray((panels.below(t.reshape(-1)) - start).reshape(m, n_e))

    def values_of(self, value: Array, share: Array, level: int) -> tuple[Array, Array]:
        """A value at all nodes with its probabilities, flat; those without any left out."""
        weight = self.apart * self.x_weight[level] * self.e_weight[level][:, None] * self.outer(share, level)
        if value.shape[-1] == 1:
            probability = (weight * (self.f @ self.c_weight[level]))[..., None]
        else:
            probability = self.f * weight[..., None] * self.c_weight[level]
        value = np.broadcast_to(value, probability.shape)
        if value.shape[0] > 1 and np.ptp(value, axis=0).max() == 0.0:  # the same at all outer nodes
            value, probability = value[0], probability.sum(axis=0)
        kept = np.abs(probability) > 1e-14
        return value[kept], probability[kept]

    def squares(self, group: int, share: Array) -> tuple[Array, Array]:
        """Sum of squares of a noise group at all nodes, (n,), and the probabilities of the nodes, (2, n)."""
        misfit = self.series.misfit
        q = misfit.quadratics(self.e_n, self.x)[group]
        more = misfit.curved(self.e_n[..., None], self.x[..., None], self.c, self.mu)[group]
        outer = np.stack([self.outer(share[level], level) for level in (0, 1)])
        weight = self.x_weight * self.e_weight[:, None, :, None] * outer
        if np.ndim(q.slope) == np.ndim(more) == 0:  # the group sees no more than e_n
            square: Array = np.asarray(q.square)
            square = square.reshape((1, 1, 1)) if square.ndim == 0 else square
            probability = self.g * weight
        else:
            square = lifted(q.square) + more
            if np.ndim(q.slope):
                d = self.c - misfit.reference.c
                square = square + d * (lifted(q.curvature) * d - 2.0 * lifted(q.slope))
            probability = self.apart * weight
            if square.shape[1] == 1 and self.f.shape[1] == 1:
                probability = probability.sum(axis=2, keepdims=True)
            probability = probability[..., None] * self.c_weight[:, None, None, None, :] * self.f
        alone = tuple(1 + axis for axis, size in enumerate(square.shape) if size == 1)
        probability = probability.sum(axis=alone, keepdims=True)
        return np.broadcast_to(square, probability.shape[1:]).reshape(-1), probability.reshape(2, -1)

    def e_density(self, share: Array, level: int) -> Array:
        """Marginal density of e_n at its nodes, (n_e,)."""
        h = (self.g[level] * self.x_weight[level]).sum(axis=-1)
        return np.asarray((h * self.outer(share, level)[..., 0]).sum(axis=0))

    def panel_errors(self, share: Array) -> dict[str, tuple[Array, Array]]:
        """Mass and error of the panels of e_n and of the transition; of the closure constant as a whole."""
        found: dict[str, tuple[Array, Array]] = {}
        outer = self.outer(share, 0)
        g, weight = self.g[0], self.x_weight
        across = outer * self.e_weight[0][:, None]
        if self.series.x_axis is not None and self.series.has_x_axis:
            axis = self.series.x_axis
            mass = (g * weight[0] * across).sum(axis=(0, 1)).reshape(-1, axis.order + 1).sum(axis=-1)
            found["x"] = mass, axis.errors((g * across).reshape(-1, *axis.shape))
        if self.series.e_axis is not None and self.series.has_e_axis:
            axis = self.series.e_axis
            h = (g * weight[0]).sum(axis=-1) * outer[..., 0]
            mass = (h * self.e_weight[0]).sum(axis=0).reshape(axis.shape).sum(axis=-1)
            found["e_n"] = mass, axis.errors(h.reshape(-1, *axis.shape))
        if self.spread is not None:
            sides = self.f.reshape(*self.f.shape[:-1], 2, -1) @ rule(self.series.c_order).differences.T
            part = self.apart * (across * weight[0])
            if sides.shape[0] == sides.shape[1] == 1:
                part = part.sum(axis=(0, 1), keepdims=True)
            error = (np.abs(sides).sum(axis=-2) * part[..., None]).sum(axis=(0, 1, 2)).max()
            found["c"] = (np.ones(1), np.array([error]))
        return found
