"""Integrals of the conditional density of the closure constant from its mode outward, at many nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.posterior.clenshaw_curtis import integral_up_to, rule
from ifrfit.inference.posterior.closure_constant import ConditionalCoordinate

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True)
class TwoSidedIntegrals:
    """Polynomials of the integrals of the densities of c on either side of the mode.

    Attributes
    ----------
    place : ndarray of int
        Of each node of the density among those kept, counted along (outer nodes, e_n, transition); -1 for the
        others.
    coefficients : list of ndarray, (coefficients, 2 n)
        By level (rule, coarse rule), of the integral below the mode, then above it.
    total : ndarray, (2 levels, 2 sides, n)
    mode, size, u_max : ndarray, (n,), (n,), (2, n)
        Of the coordinate, as in `ConditionalCoordinate`.
    """

    place: Index
    coefficients: list[Array]
    total: Array
    mode: Array
    size: Array
    u_max: Array

    @classmethod
    def of(
        cls, f: Array, mass: Array, coordinate: ConditionalCoordinate, order: int, negligible: float
    ) -> TwoSidedIntegrals:
        """At all nodes but those that hold a negligible mass all together.

        Parameters
        ----------
        f : ndarray, (m, n_e, n_x, 2 (order + 1)), the first three axes broadcastable to those of `mass`
            Density in the coordinate, left side then right side.
        mass : ndarray, (m, n_e, n_x)
            Of each node, over the whole of its outer node.
        coordinate : ConditionalCoordinate
        order : int
        negligible : float
        """
        shape = f.shape[:3]
        alone = tuple(axis for axis, n in enumerate(shape) if n == 1)
        mass = mass.sum(axis=alone, keepdims=True).reshape(-1)
        used = np.flatnonzero(mass > negligible / (mass.size / shape[0]))
        place = np.full(mass.size, -1, dtype=np.intp)
        place[used] = np.arange(used.size)
        sides = f.reshape(-1, 2, order + 1)[used]
        # the coarse integral is of half the order
        to_integral = rule(order).antiderivative
        kept = to_integral[0], to_integral[1, : order // 2 + 2]
        coefficients = [np.concatenate([to @ sides[:, i].T for i in (0, 1)], axis=1) for to in kept]
        total = np.stack([found.sum(axis=0).reshape(2, -1) for found in coefficients])
        mode, size = (np.broadcast_to(y, shape).reshape(-1)[used] for y in (coordinate.mode, coordinate.size))
        u_max = np.broadcast_to(coordinate.u_max, (*shape, 2)).reshape(-1, 2)[used].T
        return cls(place, coefficients, total, mode, size, u_max)

    def below(self, c: Array, node: Index, levels: int) -> Array:
        """Integrals up to values of c, (levels, n, k).

        Parameters
        ----------
        c : ndarray, (n, k)
        node : ndarray of int, (k,)
            Among those kept.
        levels : int
            1 for the rules alone, 2 for the coarse ones too.
        """
        distance = c - self.mode[node]
        side = (distance >= 0.0).astype(np.intp)
        u_max = self.u_max[side, node]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            v = np.arcsinh(np.abs(distance) / self.size[node]) / u_max
        inside = np.flatnonzero(((v < 1.0) & (u_max > 0.0)).reshape(-1))
        column = (side * self.mode.size + node).reshape(-1)[inside]
        at = v.reshape(-1)[inside]
        found = np.empty((levels, *side.shape))
        for level in range(levels):
            amount = self.total[level][side, node].reshape(-1)  # beyond u_max all of a side
            amount[inside] = integral_up_to(self.coefficients[level].take(column, axis=1).T, at)
            amount = amount.reshape(side.shape)
            found[level] = self.total[level, 0, node] + np.where(side == 1, amount, -amount)
        return found
