"""The density of the parameters of one series at all nodes: its masses, means, laws and errors.

Derivation: ``docs/theory/posterior.md``, sections 1 to 4.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.posterior.closure_constant import TwoSidedIntegrals
from ifrfit.inference.posterior.discrete_law import DiscreteLaw
from ifrfit.inference.posterior.nodes import Nodes, Quantity
from ifrfit.inference.posterior.quadrature_axis import PanelCdf, QuadratureAxis, rule
from ifrfit.inference.posterior.series_integral import SeriesIntegral
from ifrfit.inference.posterior.slabs import Slab, slabs_of
from ifrfit.inference.posterior.sum_of_squares import with_c_axis

Array = NDArray[np.float64]

# An axis with the masses and errors of its panels, (panels,); a series for its closure constant, (1,)
PanelErrors = tuple[QuadratureAxis | SeriesIntegral, Array, Array]

_SINGLE = np.ones((2, 1))  # weights of a single node
_TINY = 1e-300
_NEGLIGIBLE = 1e-14  # probability of a node that is left out of a discrete law
_NEGLECTED = 1e-14  # probability that nodes hold in all whose closure constant is not followed
_MOST_OUTSIDE = 1.0  # log density above that of the domain up to which it is followed beyond the domain's end


@dataclass
class DensityGrid:
    """Density at nodes along (outer nodes, e_n, transition, closure constant), of sizes (m, n_e, n_x, n_c).

    Every weight and integral comes at two levels, by the rules and by the coarse rules inside them; so do the
    probabilities `share` of the outer nodes, (2, m). Functions of a number of levels give the rules alone (1)
    or both (2).

    Attributes
    ----------
    series : SeriesIntegral
    nodes : Nodes
    f : ndarray, (m, n_e, n_x, n_c), broadcastable
        Relative density of the closure constant given the others; of size 1 on axes it does not depend on.
    factor : ndarray, (m, n_e, n_x)
        What f is multiplied by; factor f exp(shift) is the density.
    shift : ndarray, (m,)
        Log of the scale at each outer node.
    g : ndarray, (2, m, n_e, n_x)
        factor f integrated over the closure constant.
    e_weight : ndarray, (2, n_e)
    x_weight : ndarray, (2, m, n_e, n_x), broadcastable
    c_weight : ndarray, (2, n_c)
    mass : ndarray, (2, m)
        Integral at each outer node, relative to exp(shift).
    limits : (ndarray, ndarray) or None
        Ends of the transition's coordinate where the domain cuts panels, (m, n_e).
    """

    series: SeriesIntegral
    nodes: Nodes
    f: Array
    factor: Array
    shift: Array
    g: Array
    e_weight: Array
    x_weight: Array
    c_weight: Array
    mass: Array
    limits: tuple[Array, Array] | None

    @classmethod
    def of(
        cls,
        series: SeriesIntegral,
        nodes: Nodes,
        logs: tuple[Array, Array],
        limits: tuple[Array, Array] | None,
    ) -> DensityGrid:
        """Integrate a density.

        Parameters
        ----------
        series, nodes, limits
            As the attributes.
        logs : (ndarray, ndarray)
            Log density at the nodes: what varies with the closure constant, (m, n_e, n_x, n_c), and the rest,
            (m, n_e, n_x), both broadcastable.
        """
        top = logs[0].max(axis=-1)
        whole = top + logs[1]
        if limits is not None and series.x_axis is not None:
            whole = _followed_outside(whole, series.x_axis, limits)
        shift = whole.max(axis=(1, 2))
        shift = np.where(np.isfinite(shift), shift, 0.0)
        f = logs[0]
        if not f.flags.writeable:
            f = f.copy()
        with np.errstate(invalid="ignore"):
            np.subtract(f, np.where(np.isfinite(top), top, 0.0)[..., None], out=f)
        np.exp(f, out=f)
        factor = np.exp(whole - shift[:, None, None])
        shape = np.broadcast(factor, nodes.e_n[:1], nodes.x[:1], f[..., 0]).shape
        if factor.shape != shape:
            factor = np.broadcast_to(factor, shape)
        c_weight = _SINGLE if nodes.coordinate is None else np.tile(rule(series.c_order).weights, 2)
        g = np.stack([factor * (f @ w) for w in c_weight])
        e_weight = _SINGLE if series.e_axis is None else series.e_axis.weights()
        if series.x_axis is None:
            x_weight = _SINGLE[:, :, None, None]
        else:
            x_weight = series.x_axis.weights_between(limits)
        mass = ((g * x_weight).sum(axis=-1) * e_weight[:, None, :]).sum(axis=-1)
        weights = e_weight, x_weight, c_weight
        return cls(series, nodes, f, factor, shift, g, *weights, mass, limits)

    @cached_property
    def weight(self) -> Array:
        """Of each node of e_n and of the transition, (2, m, n_e, n_x)."""
        return np.asarray(self.x_weight * self.e_weight[:, None, :, None])

    @property
    def log_mass(self) -> Array:
        """Log of the integral at each outer node, (2, m); -inf where no node of it has any density."""
        found = np.log(np.maximum(self.mass, _TINY)) + self.shift
        return np.where((self.factor > 0.0).any(axis=(1, 2)), found, -np.inf)

    def outer(self, share: Array) -> Array:
        """Factor that turns densities into posterior ones, (2, m, 1, 1)."""
        if self.mass.shape[1] == 1:  # the same density at every outer node
            share = share.sum(axis=1, keepdims=True)
        return np.asarray((share / np.maximum(self.mass, _TINY))[:, :, None, None])

    @property
    def slabs(self) -> list[Slab]:
        """Parts of the nodes that reductions work on, one after the other."""
        return slabs_of(self.f.shape[:3], max(self.f.size, self.g[0].size))

    def expectation(self, *quantities: Quantity) -> Array:
        """Mean of a product of quantities, at each outer node, (2, m)."""
        means = self._expectations(lambda nodes: [[of(nodes) for of in quantities]], 1)
        return np.asarray(means[0])

    def mean_and_square(self, quantity: Quantity, share: Array) -> tuple[Array, Array, float]:
        """Mean of a quantity and mean square of its distance from a place, (2, m), and that place.

        The place is its value at the likeliest node: near enough to lose no digits.
        """
        outer = int(share[0].argmax()) if self.mass.shape[1] > 1 else 0
        e_n, x = np.unravel_index(np.argmax((self.g[0] * self.weight[0])[outer]), self.g.shape[2:])
        node = self.nodes.at_modes()
        for axis, at in enumerate((outer, int(e_n), int(x))):
            node = node.part(Slab(axis, slice(at, at + 1)))
        place = float(quantity(node).reshape(-1)[0])

        def products(nodes: Nodes) -> list[list[Array]]:
            values = quantity(nodes)
            return [[values], [(values - place) ** 2]]

        mean, square = self._expectations(products, 2)
        return mean, square, place

    def _expectations(self, products: Callable[[Nodes], Sequence[Sequence[Array]]], count: int) -> Array:
        """Means of a number of products of values at the nodes, at each outer node, (count, 2, m)."""
        found = np.zeros((count, *self.mass.shape))
        for slab in self.slabs:
            rows = slab.nodes if slab.axis == 0 and self.mass.shape[1] > 1 else slice(None)
            for total, values in zip(found, products(self.nodes.part(slab)), strict=True):
                total[:, rows] += self._integral(slab, values)
        return np.asarray(found / np.maximum(self.mass, _TINY))

    def _integral(self, slab: Slab, values: Sequence[Array]) -> Array:
        """Integral of a product of values, (m, n_e, n_x, n_c), broadcastable, over a slab, (2, m).

        What does not vary with the closure constant is multiplied once that is integrated over: e_n times c
        at all nodes would be larger than any other array, by as much as there are nodes of e_n.
        """
        inner = slab.of(self.g, 1)
        with_c = [value for value in values if value.shape[-1] > 1]
        if with_c:
            product = math.prod(with_c, start=slab.of(self.f))
            factor = slab.of(self.factor)
            inner = np.stack([factor * (product @ w) for w in self.c_weight])
        for value in values:
            if value.shape[-1] == 1:
                inner = inner * value[..., 0]
        return np.asarray((inner * slab.of(self.weight, 1)).sum(axis=(2, 3)))

    def e_probabilities(self) -> Array:
        """Probability of each node of e_n, (2, m, n_e)."""
        h = (self.g * self.weight).sum(axis=-1)
        return np.asarray(h / np.maximum(self.mass, _TINY)[..., None])

    def e_density(self, share: Array) -> Array:
        """Marginal density of e_n at its nodes, (2, n_e)."""
        h = (self.g * self.x_weight).sum(axis=-1)
        return np.asarray((h * self.outer(share)[..., 0]).sum(axis=1))

    def x_cdf(self, share: Array) -> Callable[[Array, int], Array]:
        """Posterior probability of a transition below x, as a function of x, (..., m, n_e), and of levels."""
        weight = (self.outer(share)[..., 0] * self.e_weight[:, None]).reshape(2, 1, -1)
        if self.limits is None:
            summed = PanelCdf.of_levels(self._x_axis, weight @ self.g.reshape(2, weight.shape[-1], -1))

        def below(x: Array, levels: int) -> Array:
            if self.limits is None and x.shape[-2:] == (1, 1):
                return summed.below_in_all(self.series.to_t(x)[..., 0, 0], levels)
            return np.stack([self.mass_below(x, level) @ weight[level, 0] for level in range(levels)])

        return below

    def mass_below(self, x: Array, level: int) -> Array:
        """Integral over transitions below x, (..., m, n_e), at the outer nodes and e_n, (..., m n_e)."""
        rows = self._along_x[level]
        shape = self.g.shape[1:3]
        t, least = self.series.to_t(x), None
        if self.limits is not None:
            least, most = (np.broadcast_to(end, shape) for end in self.limits)
            t = np.clip(t, least, most)
        t = np.broadcast_to(t, (*t.shape[:-2], *shape))
        start = 0.0 if least is None else rows.below(least.reshape(-1))
        return np.asarray(rows.below(t.reshape(*t.shape[:-2], -1)) - start)

    @cached_property
    def _along_x(self) -> tuple[PanelCdf, PanelCdf]:
        """Integrals along the transition by the rules and the coarse ones, one row an outer node and e_n."""
        fine, coarse = (PanelCdf.of(self._x_axis, self.g[level], level) for level in (0, 1))
        return fine, coarse

    @cached_property
    def two_sided(self) -> TwoSidedIntegrals:
        """Integrals of the conditional densities of the closure constant."""
        if self.nodes.coordinate is None:
            raise ValueError("the closure constant of this series is not integrated over")
        mass = np.abs(self.factor * self.weight / np.maximum(self.mass, _TINY)[..., None, None]).max(axis=0)
        alone = tuple(axis for axis in range(3) if self.f.shape[axis] == 1)
        mass = mass.sum(axis=alone, keepdims=True) * (self.f @ self.c_weight[0])
        node = np.flatnonzero(mass > _NEGLECTED / mass.size)
        return TwoSidedIntegrals.of(self.f, self.nodes.coordinate, self.series.c_order, node)

    @property
    def _x_axis(self) -> QuadratureAxis:
        if self.series.x_axis is None:
            raise ValueError("the transition of this series is not integrated over")
        return self.series.x_axis

    def law_of(self, quantity: Quantity, share: Array) -> Iterator[tuple[Array, Array]]:
        """A quantity at the nodes, (n,), with their probabilities, (2, n), in parts.

        Without nodes of no probability.
        """
        for slab in self.slabs:
            value = quantity(self.nodes.part(slab))
            probability = self._probabilities(slab, share, value.shape)
            if value.shape[0] > 1 and np.ptp(value, axis=0).max() == 0.0:  # the same at all outer nodes
                value, probability = value[0], probability.sum(axis=1)
            kept = np.abs(probability[0]) > _NEGLIGIBLE
            yield value[kept], probability[:, kept]

    def law_of_squares(self, group: int, share: Array) -> DiscreteLaw:
        """Sum of squares of a noise group at the nodes."""
        slabs = self.series.squares.slabs(self.f.shape[:3], self.f.size)
        squares = [self._square(group, self.nodes.part(slab), len(slabs)) for slab in slabs]
        if squares[0].shape[slabs[0].axis] == 1:  # the same in every slab
            slabs, squares = [Slab(0, slice(None))], squares[:1]

        def parts() -> Iterator[tuple[Array, Array]]:
            for slab, square in zip(slabs, squares, strict=True):
                probability = self._probabilities(slab, share, square.shape)
                yield square.reshape(-1), probability.reshape(2, -1)

        return DiscreteLaw(sum(square.size for square in squares), parts)

    def _square(self, group: int, nodes: Nodes, slabs: int) -> Array:
        """Sum of squares of a noise group, of size 1 along the axes that its rows do not see."""
        squares, c = self.series.squares, nodes.c
        q = squares.quadratics(nodes.e_n, nodes.x)[group]
        more = squares.curved_of(group, nodes.e_n[..., None], nodes.x[..., None], c, nodes.mu, slabs)
        square: Array = np.asarray(q.square)
        square = (square.reshape((1, 1, 1)) if square.ndim == 0 else square)[..., None] + more
        if np.ndim(q.slope):
            d = c - squares.reference.c
            square = square + d * (with_c_axis(q.curvature) * d - 2.0 * with_c_axis(q.slope))
        return square

    def _probabilities(self, slab: Slab, share: Array, shape: tuple[int, ...]) -> Array:
        """Probabilities at both levels of values of a shape at the nodes of a slab, (2, *shape)."""
        weight = slab.of(self.weight, 1) * slab.of(self.outer(share), 1)
        if shape[-1] == 1:
            probability = (weight * slab.of(self.g, 1))[..., None]
        else:
            f, weight = slab.of(self.f), weight * slab.of(self.factor)
            unseen = tuple(1 + axis for axis in range(3) if shape[axis] == f.shape[axis] == 1)
            weight = weight.sum(axis=unseen, keepdims=True)
            probability = weight[..., None] * self.c_weight[:, None, None, None, :]
            probability *= f
        alone = tuple(1 + axis for axis, size in enumerate(shape) if size == 1)
        return np.asarray(probability.sum(axis=alone, keepdims=True) if alone else probability)

    def panel_masses(self, share: Array) -> list[tuple[QuadratureAxis, Array]]:
        """Mass of the panels of the transition and of e_n."""
        probability = (self.g * self.weight)[0] * self.outer(share)[0]
        found = []
        for axis, others in ((self.series.x_axis, (0, 1)), (self.series.e_axis, (0, 2))):
            if axis is not None:
                found.append((axis, probability.sum(axis=others).reshape(axis.shape).sum(axis=-1)))
        return found

    def panel_errors(self, share: Array) -> list[PanelErrors]:
        """Masses and errors of the panels, and one of each for the closure constant."""
        found: list[PanelErrors] = []
        for axis, mass in self.panel_masses(share):
            found.append((axis, mass, axis.errors(self.density_along(axis, self.g[0], share))))
        if self.nodes.coordinate is not None:
            part = self.factor * (self.outer(share)[0] * self.e_weight[0][:, None] * self.x_weight[0])
            if self.f.shape[0] == self.f.shape[1] == 1:
                part = part.sum(axis=(0, 1), keepdims=True)
            differences = rule(self.series.c_order).differences
            error = np.zeros(len(differences))
            for slab in self.slabs:
                f = slab.of(self.f)
                sides = np.abs(f.reshape(*f.shape[:-1], 2, -1) @ differences.T).sum(axis=-2)
                error += (sides * slab.of(part)[..., None]).sum(axis=(0, 1, 2))
            found.append((self.series, np.ones(1), error.max(keepdims=True)))
        return found

    def density_along(self, axis: QuadratureAxis, inner: Array, share: Array) -> Array:
        """Density along an axis, (rows, panels, nodes), of an integral over c at each node, (m, n_e, n_x)."""
        outer = self.outer(share)[0]
        if axis is self.series.x_axis:
            return np.asarray((inner * (outer * self.e_weight[0][:, None])).reshape(-1, *axis.shape))
        return np.asarray(((inner * self.x_weight[0]).sum(axis=-1) * outer[..., 0]).reshape(-1, *axis.shape))


def _followed_outside(log_density: Array, axis: QuadratureAxis, limits: tuple[Array, Array]) -> Array:
    """The log density as far as integrals between limits need it beyond them.

    A panel that a limit cuts keeps its nodes, and the likelihood may be larger beyond the domain by any
    factor: without an end to that, what lies inside would lose its digits. Panels outside hold nothing.

    Parameters
    ----------
    log_density : ndarray, (m, n_e, n_x), broadcastable
    axis : QuadratureAxis
        Panels of the transition's coordinate, n_x nodes in all.
    limits : (ndarray, ndarray)
        Ends of the domain in that coordinate, (m, n_e).

    Returns
    -------
    ndarray, (m, n_e, n_x)
    """
    low, high = (end[..., None] for end in limits)
    nodes = axis.nodes()
    beyond = np.maximum(np.maximum(low - nodes, nodes - high), 0.0)
    nearest = beyond == beyond.min(axis=-1, keepdims=True)  # all nodes inside, or the one next to the domain
    top = np.where(nearest, log_density, -np.inf).max(axis=-1, keepdims=True)
    first, last = axis.panels[:, 0], axis.panels[:, 1]
    is_cut = np.repeat((last >= low) & (first <= high), axis.order + 1, axis=-1)
    return np.where(is_cut, np.minimum(log_density, top + _MOST_OUTSIDE), -np.inf)
