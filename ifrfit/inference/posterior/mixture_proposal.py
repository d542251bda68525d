"""A law to draw constants from: heavy-tailed components inside the domain, and a uniform one over all of it.

Eq. (15) and (16) of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import special

Array = NDArray[np.float64]

_TINY = 1e-300
_AT_ONCE = 8192  # points whose arrays stay in the cache


class Domain(Protocol):
    """Where coordinates may lie: the ends of each depend on no more than those before it."""

    @property
    def dimensions(self) -> int:
        """Number of coordinates."""
        ...

    def ends(self, place: int, at: Array) -> tuple[Array, Array]:
        """Ends of a coordinate, (m,) each, where the ones before it are those of points (m, d)."""
        ...


@dataclass(frozen=True)
class Component:
    """A law with the tails of Student's t with 4 degrees of freedom in every direction, cut at the domain.

    Coordinate j is centre_j + sum over i <= j of root_ji z_i, and each z_j has Student's t, cut so that the
    coordinate lies between its ends.

    Attributes
    ----------
    centre : ndarray, (d,)
    root : ndarray, (d, d)
        Lower triangular.
    """

    centre: Array
    root: Array

    def draw(self, domain: Domain, u: Array) -> Array:
        """Points (m, d) from uniform numbers (m, d)."""
        at, z = np.zeros(u.shape), np.zeros(u.shape)
        for j, centre, size, low, high in self._conditionals(domain, at, z):
            z[:, j] = cut_quantile(low, high, u[:, j])
            ends = domain.ends(j, at)
            at[:, j] = np.clip(centre + size * z[:, j], *ends)
        return at

    def log_density(self, domain: Domain, at: Array) -> Array:
        """Log density at points of the domain, (m,)."""
        z, total = np.empty(at.shape), np.full(at.shape[0], self._log_scale)
        for j, centre, size, low, high in self._conditionals(domain, at, z):
            z[:, j] = (at[:, j] - centre) / size
            # the logarithm of a product is cheaper than the logarithms of both
            total -= np.log((1.0 + 0.25 * z[:, j] ** 2) ** 2.5 * np.maximum(between(low, high), _TINY))
        return total

    def log_density_of_first(self, domain: Domain, at: Array, first: int) -> tuple[Array, Array]:
        """Log density of the first coordinates alone, (m,), and their z, (m, first), at points (m, first)."""
        z, total = np.empty((at.shape[0], first)), np.zeros(at.shape[0])
        for j in range(first):
            size = float(self.root[j, j])
            centre = self.centre[j] + z[:, :j] @ self.root[j, :j]
            low, high = domain.ends(j, at)
            z[:, j] = (at[:, j] - centre) / size
            inside = np.maximum(between((low - centre) / size, (high - centre) / size), _TINY)
            total -= np.log((1.0 + 0.25 * z[:, j] ** 2) ** 2.5 * inside * (size / 0.375))
        return total, z

    @property
    def _log_scale(self) -> float:
        return float(np.log(0.375 / np.diag(self.root)).sum())

    def _conditionals(
        self, domain: Domain, at: Array, z: Array
    ) -> Iterator[tuple[int, Array, float, Array, Array]]:
        """Of each coordinate: its number, centre, size, and ends in units of it, given those before."""
        for j in range(domain.dimensions):
            centre = self.centre[j] + z[:, :j] @ self.root[j, :j]
            size = float(self.root[j, j])
            low, high = domain.ends(j, at)
            yield j, centre, size, (low - centre) / size, (high - centre) / size


@dataclass(frozen=True)
class Uniform:
    """Uniform in each coordinate between its ends, given those before it."""

    def draw(self, domain: Domain, u: Array) -> Array:
        """Points (m, d) from uniform numbers (m, d)."""
        at = np.zeros(u.shape)
        for j in range(domain.dimensions):
            low, high = domain.ends(j, at)
            at[:, j] = low + (high - low) * u[:, j]
        return at

    def log_density(self, domain: Domain, at: Array) -> Array:
        """Log density at points of the domain, (m,)."""
        total = np.zeros(at.shape[0])
        for j in range(domain.dimensions):
            low, high = domain.ends(j, at)
            total -= np.log(np.maximum(high - low, _TINY))
        return total


@dataclass(frozen=True)
class MixtureProposal:
    """Components with their weights.

    Attributes
    ----------
    domain : Domain
    components : tuple of Component or Uniform
    weights : ndarray, (k,)
        Sum 1.
    """

    domain: Domain
    components: tuple[Component | Uniform, ...]
    weights: Array

    def draw(self, u: Array) -> Array:
        """Points (m, d) from uniform numbers (m, 1 + d), of which the first picks the component."""
        below = np.cumsum(self.weights)
        chosen = np.minimum(np.searchsorted(below, u[:, 0]), self.weights.size - 1)
        at = np.empty((u.shape[0], self.domain.dimensions))
        for number, component in enumerate(self.components):
            rows = np.flatnonzero(chosen == number)
            if rows.size:
                at[rows] = component.draw(self.domain, u[rows, 1:])
        return at

    def log_density(self, at: Array) -> Array:
        """Log density at points of the domain, (m,)."""
        parts = np.array_split(at, 1 + at.shape[0] // _AT_ONCE)
        return np.concatenate([self._log_density(part) for part in parts])

    def _log_density(self, at: Array) -> Array:
        each = np.stack([component.log_density(self.domain, at) for component in self.components])
        return np.asarray(special.logsumexp(each + np.log(self.weights)[:, None], axis=0))


def _below(x: Array) -> Array:
    """Distribution function of Student's t with 4 degrees of freedom, for x <= 0 without loss of digits."""
    root = np.sqrt(4.0 + x * x)
    r = np.where(x < 0.0, 4.0 / (root * (root + np.abs(x))), 1.0 + x / root)
    return np.asarray(0.25 * r * r * (3.0 - r))


def _at_share(p: Array) -> Array:
    """The inverse of `_below`, from the roots of its cubic."""
    w = (2.0 / 3.0) * np.arcsin(np.sqrt(p))
    r = 2.0 * np.sin(0.5 * w) ** 2 + np.sqrt(3.0) * np.sin(w)
    return np.asarray(2.0 * (r - 1.0) / np.sqrt(np.maximum(r * (2.0 - r), _TINY)))


def _flipped(low: Array, high: Array) -> tuple[NDArray[np.bool_], Array, Array]:
    """Ends in the tail in which probabilities keep their digits, and where they were turned round."""
    flip = low > 0.0
    return flip, np.where(flip, -high, low), np.where(flip, -low, high)


def between(low: Array, high: Array) -> Array:
    """Probability between two ends."""
    _, a, b = _flipped(low, high)
    return np.asarray(_below(b) - _below(a))


def cut_quantile(low: Array, high: Array, p: Array) -> Array:
    """Quantile p of the law cut at two ends."""
    flip, a, b = _flipped(low, high)
    below, above = _below(a), _below(b)
    share = np.where(flip, 1.0 - p, p)
    x = np.clip(_at_share(below + share * (above - below)), a, b)
    return np.asarray(np.where(flip, -x, x))
