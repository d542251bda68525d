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
        return self.draw_rest(domain, np.zeros(u.shape), np.zeros(u.shape), u)

    def draw_rest(self, domain: Domain, at: Array, z: Array, u: Array) -> Array:
        """Points (m, d) whose first coordinates and their z are given, from uniform numbers of the others."""
        first = at.shape[1] - u.shape[1]
        for j, centre, size, low, high in self._conditionals(domain, at, z, range(first, at.shape[1])):
            z[:, j] = cut_quantile(low, high, u[:, j - first])
            at[:, j] = np.clip(centre + size * z[:, j], *domain.ends(j, at))
        return at

    def log_density(self, domain: Domain, at: Array) -> Array:
        """Log density at points of the domain, (m,)."""
        return self.log_density_of_first(domain, at, domain.dimensions)[0]

    def log_density_of_first(self, domain: Domain, at: Array, first: int) -> tuple[Array, Array]:
        """Log density of the first coordinates alone, (m,), and their z, (m, first), at points (m, first)."""
        z, total = np.empty((at.shape[0], first)), np.zeros(at.shape[0])
        for j, centre, size, low, high in self._conditionals(domain, at, z, range(first)):
            z[:, j] = (at[:, j] - centre) / size
            inside = np.maximum(between(low, high), _TINY)
            # the logarithm of a product is cheaper than the logarithms of all
            total -= np.log((1.0 + 0.25 * z[:, j] ** 2) ** 2.5 * inside * (size / 0.375))
        return total, z

    def lengthened(self, domain: Domain, first: int = 0) -> list[Component]:
        """The component as long as the domain along one coordinate, the later ones following it.

        One for each coordinate but the first ones. A posterior given few rows with an unknown noise has tails
        that no normal law has, along a constant that the others hardly depend on: points that are uniform in
        all of them miss it.
        """
        found = []
        for j in range(first, domain.dimensions):
            low, high = domain.ends(j, self.centre[None])
            root = self.root.copy()
            root[:, j] *= max(1.0, 0.25 * float((high - low)[0]) / float(root[j, j]))
            found.append(Component(self.centre, root))
        return found

    def _conditionals(
        self, domain: Domain, at: Array, z: Array, places: range
    ) -> Iterator[tuple[int, Array, float, Array, Array]]:
        """Of each coordinate: its number, centre, size, and ends in units of it, given those before."""
        for j in places:
            centre = self.centre[j] + z[:, :j] @ self.root[j, :j]
            size = float(self.root[j, j])
            low, high = domain.ends(j, at)
            yield j, centre, size, (low - centre) / size, (high - centre) / size


@dataclass(frozen=True)
class Uniform:
    """Uniform in each coordinate between its ends, given those before it."""

    def draw(self, domain: Domain, u: Array) -> Array:
        """Points (m, d) from uniform numbers (m, d)."""
        return self.draw_rest(domain, np.zeros(u.shape), u)

    def draw_rest(self, domain: Domain, at: Array, u: Array) -> Array:
        """Points (m, d) whose first coordinates are given, from uniform numbers of the others."""
        first = at.shape[1] - u.shape[1]
        for j in range(first, at.shape[1]):
            low, high = domain.ends(j, at)
            at[:, j] = low + (high - low) * u[:, j - first]
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
