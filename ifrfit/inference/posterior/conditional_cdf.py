"""Distribution functions by way of the closure constant, eq. (9) of ``docs/theory/posterior.md``.

A quantity that rises with c at every node is below t where c is below a threshold, which differs from node to
node: its distribution function is the mean of the conditional ones of c. Of one that falls, it is the mean of
their complements.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.posterior.density_grid import DensityGrid

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_AT_ONCE = 20_000  # nodes times thresholds looked at together: their arrays stay in the cache


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
        density = np.arange(integrals.place.size).reshape(grid.f.shape[:3])
        node = integrals.place[np.broadcast_to(density, shape).reshape(-1)]
        mass = np.where(node >= 0, np.abs(weight).max(axis=0) * integrals.total[0].sum(axis=0)[node], 0.0)
        at = np.flatnonzero(mass > math.exp(-grid.series.tail) / mass.size)
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
