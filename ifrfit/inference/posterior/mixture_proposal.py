"""Laws to draw constants from, heavy-tailed components beside a uniform one, and points to draw them by.

Eq. (15) to (17) and (20) of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.posterior.constants_density import Coordinates

Array = NDArray[np.float64]

_TINY = 1e-300
_AT_ONCE = 65_536  # points at once
# Generating vector of an extensible lattice in base 2, order-2 weights, up to 2^20 points: Cools, Kuo &
# Nuyens (2006), SIAM J. Sci. Comput. 28, 2162
_GENERATOR = np.array(
    [1, 182667, 469891, 498753, 110745, 446247, 250185, 118627, 245333, 283199,
     408519, 391023, 246327, 126539, 399185, 461527, 300343, 69681, 516695, 436179,
     106383, 238523, 413283, 70841, 47719, 300129, 113029, 123925, 410745, 211325,
     17489, 511893, 40767, 186077, 519471, 255369, 101819, 243573, 66189, 152143]
)  # fmt: skip
_INSIDE = 2.0**-40  # from the faces of the cube


def lattice(n: int, shift: Array, *, finer: bool = False) -> Array:
    """Points of the shifted lattice, (n, d).

    Averages over them are unbiased over uniform shifts, and for smooth integrands their error falls nearly as
    1/n, where that of random points falls as 1/sqrt(n).

    Parameters
    ----------
    n : int
        A power of 2.
    shift : ndarray, (d,)
        Uniform between 0 and 1; of at most 40 dimensions.
    finer : bool
        Give the other half of the lattice of 2 n points with this shift.
    """
    generator = _GENERATOR[: shift.size]
    steps = np.arange(n)[:, None] + (0.5 if finer else 0.0)
    return np.asarray(np.clip((steps * generator / n + shift) % 1.0, _INSIDE, 1.0 - _INSIDE))


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

    def draw(self, domain: Coordinates, u: Array) -> Array:
        """Points (m, d) from uniform numbers (m, d)."""
        return self.draw_rest(domain, np.zeros(u.shape), np.zeros(u.shape), u)

    def draw_rest(self, domain: Coordinates, at: Array, z: Array, u: Array) -> Array:
        """Points (m, d) whose first coordinates and their z are given, from uniform numbers of the others."""
        first = at.shape[1] - u.shape[1]
        for j, centre, size, low, high in self._conditionals(domain, at, z, range(first, at.shape[1])):
            z[:, j] = cut_quantile(low, high, u[:, j - first])
            at[:, j] = np.clip(centre + size * z[:, j], *domain.ends(j, at))
        return at

    def log_density(self, domain: Coordinates, at: Array) -> Array:
        """Log density at points of the domain, (m,)."""
        return self.log_density_of_first(domain, at, domain.dimensions)[0]

    def log_density_of_first(self, domain: Coordinates, at: Array, first: int) -> tuple[Array, Array]:
        """Log density of the first coordinates alone, (m,), and their z, (m, first), at points (m, first)."""
        z, total = np.empty((at.shape[0], first)), np.zeros(at.shape[0])
        for j, centre, size, low, high in self._conditionals(domain, at, z, range(first)):
            z[:, j] = (at[:, j] - centre) / size
            inside = np.maximum(between(low, high), _TINY)
            # the logarithm of a product is cheaper than the logarithms of all
            total -= np.log(_fall(z[:, j]) * inside * (size / 0.375))
        return total, z

    def lengthened(self, domain: Coordinates, first: int = 0) -> list[Component]:
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
        self, domain: Coordinates, at: Array, z: Array, places: range
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

    def draw(self, domain: Coordinates, u: Array) -> Array:
        """Points (m, d) from uniform numbers (m, d)."""
        return self.draw_rest(domain, np.zeros(u.shape), np.empty(u.shape), u)

    def draw_rest(self, domain: Coordinates, at: Array, z: Array, u: Array) -> Array:
        """Points (m, d) whose first coordinates are given, from uniform numbers of the others."""
        first = at.shape[1] - u.shape[1]
        for j in range(first, at.shape[1]):
            low, high = domain.ends(j, at)
            at[:, j] = low + (high - low) * u[:, j - first]
        return at

    def log_density(self, domain: Coordinates, at: Array) -> Array:
        """Log density at points of the domain, (m,)."""
        total = np.zeros(at.shape[0])
        for j in range(domain.dimensions):
            low, high = domain.ends(j, at)
            total -= np.log(np.maximum(high - low, _TINY))
        return total


@dataclass(frozen=True)
class Beside:
    """What a mixture has beside its components.

    Attributes
    ----------
    wide, factor : float
        Share of components that are wider by a factor.
    long : float
        Share of those that are as long as the domain, the largest one along each coordinate.
    uniform : float
        Share of the uniform law.
    """

    wide: float = 0.0
    factor: float = 1.0
    long: float = 0.0
    uniform: float = 0.0


@dataclass(frozen=True)
class MixtureProposal:
    """A mixture of components over (given, own) coordinates, conditioned on the first `given` of them.

    The share of a component follows its density at what is given; those of the longer components and of the
    uniform law do not.

    Attributes
    ----------
    domain : Coordinates
    components : tuple of Component
    shares : ndarray, (k,)
        Of the components; sum 1.
    beside : Beside
    given : int
        Number of coordinates that are given; 0 for a law of all.
    """

    domain: Coordinates
    components: tuple[Component, ...]
    shares: Array
    beside: Beside
    given: int = 0

    @property
    def own(self) -> int:
        """Number of coordinates that are drawn."""
        return self.domain.dimensions - self.given

    @property
    def n_laws(self) -> int:
        """Number of laws that are mixed."""
        return len(self._laws) + 1

    @property
    def all_components(self) -> list[Component]:
        """The components with the wider and the longer ones."""
        return [law for _, _, law in self._laws]

    @cached_property
    def _laws(self) -> list[tuple[float, int | None, Component]]:
        """All laws but the uniform: share, number of the component that scales it or None, and law."""
        k, beside = self.given, self.beside
        found: list[tuple[float, int | None, Component]] = []
        near = 1.0 - beside.wide - beside.long - beside.uniform
        for share, factor in ((near, 1.0), (beside.wide, beside.factor)):
            for number, each in enumerate(self.components if share else ()):
                root = each.root.copy()
                root[k:, k:] *= factor
                found.append((share, number, Component(each.centre, root)))
        if beside.long:
            longer = self.components[self._largest].lengthened(self.domain, k)
            found += [(beside.long / self.own, None, each) for each in longer]
        return found

    @property
    def _largest(self) -> int:
        return int(self.shares.argmax())

    def _of_given(self, at: Array) -> tuple[Array, Array]:
        """Shares of all laws, (n, laws), and z of the components there, (k, n, given), at what is given."""
        log_q, z = [], []
        for each in self.components:
            own, z_own = each.log_density_of_first(self.domain, at, self.given)
            log_q.append(own)
            z.append(z_own)
        log_share = np.array(log_q) + np.log(self.shares)[:, None]
        pi = np.exp(log_share - log_share.max(axis=0))
        pi /= pi.sum(axis=0)
        laws = [
            share * (1.0 if parent is None else pi[parent]) + 0.0 * pi[0] for share, parent, _ in self._laws
        ]
        return np.stack((*laws, self.beside.uniform + 0.0 * pi[0]), axis=1), np.array(z)

    def draw(self, u: Array, given: Array | None = None) -> Array:
        """Points, (n, m, d).

        Parameters
        ----------
        u : ndarray, (n, m, 1 + own)
            Uniform between 0 and 1; the first picks the law.
        given : ndarray, (n, given), optional
            The first coordinates, where such are given.
        """
        n, m, _ = u.shape
        d, k = self.domain.dimensions, self.given
        given = np.empty((n, 0)) if given is None else given
        shares, z_given = self._of_given(given)
        below = np.cumsum(shares, axis=1)
        chosen = (u[:, :, 0, None] > below[:, None, :-1]).sum(axis=2).reshape(-1)
        flat = u.reshape(n * m, -1)
        found = np.empty((n * m, d))
        found[:, :k] = np.repeat(given, m, axis=0)
        outer = np.repeat(np.arange(n), m)
        laws: list[tuple[int, Component | Uniform]] = [(self._parent(of), law) for _, of, law in self._laws]
        for number, (parent, law) in enumerate([*laws, (0, Uniform())]):
            rows = np.flatnonzero(chosen == number)
            if rows.size:
                z = np.empty((rows.size, d))
                z[:, :k] = z_given[parent, outer[rows]]
                found[rows] = law.draw_rest(self.domain, found[rows], z, flat[rows, 1:])
        return found.reshape(n, m, d)

    def log_density(self, at: Array) -> Array:
        """Log density of the own coordinates given the others, (n, m), at points (n, m, d)."""
        parts = np.array_split(at, min(1 + at.shape[0] * at.shape[1] // _AT_ONCE, at.shape[0]))
        return np.concatenate([self._log_density(part) for part in parts])

    def _log_density(self, at: Array) -> Array:
        n, m, d = at.shape
        k = self.given
        shares, z_given = self._of_given(at[:, 0, :k])
        flat = at.reshape(n * m, d)
        ends = [self.domain.ends(j, flat) for j in range(k, d)]
        width = np.prod([np.maximum(high - low, _TINY) for low, high in ends], axis=0)
        total = np.repeat(shares[:, -1], m) / width
        for number, (_, parent, law) in enumerate(self._laws):
            z = np.empty((n * m, d))
            z[:, :k] = np.repeat(z_given[self._parent(parent)], m, axis=0)
            density = np.repeat(shares[:, number], m)
            for j, (low, high) in enumerate(ends, start=k):
                size = law.root[j, j]
                centre = law.centre[j] + z[:, :j] @ law.root[j, :j]
                z[:, j] = (flat[:, j] - centre) / size
                inside = np.maximum(between((low - centre) / size, (high - centre) / size), _TINY)
                density = density * (0.375 / size) / (_fall(z[:, j]) * inside)
            total += density
        return np.asarray(np.log(np.maximum(total, _TINY))).reshape(n, m)

    def _parent(self, parent: int | None) -> int:
        return self._largest if parent is None else parent


def _fall(z: Array) -> Array:
    """How many times less the density of Student's t with 4 degrees of freedom is than at its mode."""
    t = 1.0 + 0.25 * z * z
    return np.asarray(t * t * np.sqrt(t))


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
