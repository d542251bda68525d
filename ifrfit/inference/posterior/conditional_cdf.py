"""What lies below a value of the closure constant that may differ from node to node."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.posterior.clenshaw_curtis import integral_up_to, rule

if TYPE_CHECKING:
    from ifrfit.inference.posterior.density_grid import DensityGrid

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_AT_ONCE = 20_000  # nodes times thresholds looked at together: their arrays stay in the cache


@dataclass(frozen=True)
class TwoSidedIntegrals:
    """Integrals of the densities of the closure constant from the mode outward, at the nodes that count.

    Attributes
    ----------
    place : ndarray of int
        Of each (outer node, e_n, transition) of the density, among those that count; -1 for the others.
    coefficients : list of ndarray, (coefficients, 2 n)
        By level, of the integral below the mode, then above it.
    total : ndarray, (2 levels, 2 sides, n)
    mode, size, reach : ndarray, (n,), (n,), (2, n)
    """

    place: Index
    coefficients: list[Array]
    total: Array
    mode: Array
    size: Array
    reach: Array

    @classmethod
    def of(cls, tensor: DensityGrid) -> TwoSidedIntegrals:
        """Of all nodes but those that hold next to nothing all together."""
        spread = tensor.spread
        assert spread is not None
        shape = tensor.f.shape[:3]
        mass = (
            np.abs(tensor.g * tensor.weight).max(axis=0) / np.maximum(tensor.mass[0], 1e-300)[:, None, None]
        )
        alone = tuple(axis for axis, n in enumerate(shape) if n == 1)
        mass = mass.sum(axis=alone, keepdims=True).reshape(-1)
        used = np.flatnonzero(mass > _nothing(tensor) / (mass.size / shape[0]))
        place = np.full(mass.size, -1, dtype=np.intp)
        place[used] = np.arange(used.size)
        nodes = tensor.series.c_order + 1
        sides = tensor.f.reshape(-1, 2, nodes)[used]
        # the coarse integral is of half the order
        to_integral = rule(tensor.series.c_order).antiderivative
        kept = to_integral[0], to_integral[1, : (nodes - 1) // 2 + 2]
        coefficients = [np.concatenate([to @ sides[:, i].T for i in (0, 1)], axis=1) for to in kept]
        total = np.stack([found.sum(axis=0).reshape(2, -1) for found in coefficients])
        mode, size = (np.broadcast_to(y, shape).reshape(-1)[used] for y in (spread.mode, spread.size))
        reach = np.broadcast_to(spread.reach, (*shape, 2)).reshape(-1, 2)[used].T
        return cls(place, coefficients, total, mode, size, reach)


def _nothing(tensor: DensityGrid) -> float:
    return math.exp(-tensor.series.tail)


class ConditionalCdf:
    """Posterior probability of a closure constant below threshold(t, own), by t.

    Parameters
    ----------
    tensor : DensityGrid
    share : ndarray, (2, m)
        Of the outer nodes.
    own : ndarray, (m, n_e, n_x), broadcastable
        What the threshold depends on at each node.
    threshold : callable
        From t (n, 1) and `own` at some nodes (k,) to closure constants, (n, k), broadcastable.
    """

    def __init__(
        self, tensor: DensityGrid, share: Array, own: Array, threshold: Callable[[Array, Array], Array]
    ) -> None:
        sides = tensor.sides
        shape = np.broadcast_shapes(tensor.f.shape[:3], own.shape)
        weight = tensor.apart * tensor.weight * tensor.outer(share)
        alone = tuple(1 + axis for axis, n in enumerate(shape) if n == 1)
        weight = weight.sum(axis=alone, keepdims=True).reshape(2, -1)
        density = np.arange(sides.place.size).reshape(tensor.f.shape[:3])
        node = sides.place[np.broadcast_to(density, shape).reshape(-1)]
        mass = np.where(node >= 0, np.abs(weight).max(axis=0) * sides.total[0].sum(axis=0)[node], 0.0)
        at = np.flatnonzero(mass > _nothing(tensor) / mass.size)
        self._sides, self._threshold, self._shape = sides, threshold, shape
        self._at, self._node, self._weight = at, node[at], weight[:, at]
        self._own = np.broadcast_to(own, shape).reshape(-1)[at]
        whole = sides.total.sum(axis=1)[:, self._node]
        self._whole = np.maximum((self._weight * whole).sum(axis=1), 1e-300)

    def probability(self, t: Array, levels: int) -> Array:
        """At thresholds (n,), by the rules alone (1) or the coarse ones too (2), (levels, n)."""
        found = np.zeros((levels, t.size))
        if not t.size:
            return found
        step = max(256, _AT_ONCE // t.size)
        few = max(1, _AT_ONCE // step)
        for first in range(0, t.size, few):
            some = slice(first, first + few)
            for start in range(0, self._at.size, step):
                part = slice(start, start + step)
                below = self._below(t[some], part, levels)
                for level in range(levels):
                    found[level, some] += below[level] @ self._weight[level, part]
        return np.asarray(found / self._whole[:levels, None])

    def of_the_constant(self, t: Array) -> Array:
        """Change of the probability by the coarse rule along the closure constant alone, (n,)."""
        found = np.zeros(t.size)
        for start in range(0, self._at.size, _AT_ONCE // t.size):
            part = slice(start, start + _AT_ONCE // t.size)
            below = self._below(t, part, 2)
            found += (below[1] - below[0]) @ self._weight[0, part]
        return np.asarray(np.abs(found) / self._whole[0])

    def density(self, t: float) -> Array:
        """Density at each (outer node, e_n, transition), cut off, by the rules alone."""
        found = np.zeros(math.prod(self._shape))
        for start in range(0, self._at.size, _AT_ONCE):
            part = slice(start, start + _AT_ONCE)
            found[self._at[part]] = self._below(np.array([t]), part, 1)[0, 0]
        return np.asarray(found.reshape(self._shape))

    def _below(self, t: Array, part: slice, levels: int) -> Array:
        """Integrals up to the thresholds at some nodes, (levels, n, k)."""
        sides, node = self._sides, self._node[part]
        c = np.broadcast_to(self._threshold(t[:, None], self._own[part]), (t.size, node.size))
        distance = c - sides.mode[node]
        side = (distance >= 0.0).astype(np.intp)
        reach = sides.reach[side, node]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            v = np.arcsinh(np.abs(distance) / sides.size[node]) / reach
        inside = np.flatnonzero(((v < 1.0) & (reach > 0.0)).reshape(-1))
        column = (side * sides.mode.size + node).reshape(-1)[inside]
        at = v.reshape(-1)[inside]
        found = np.empty((levels, *side.shape))
        for level in range(levels):
            amount = sides.total[level][side, node].reshape(-1)  # beyond the reach all of a side
            amount[inside] = integral_up_to(sides.coefficients[level][:, column].T, at)
            amount = amount.reshape(side.shape)
            found[level] = sides.total[level, 0, node] + np.where(side == 1, amount, -amount)
        return found
