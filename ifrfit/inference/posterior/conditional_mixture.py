"""A law to draw the constants of one series from, where those that series share are given.

Eq. (20) of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ifrfit.inference.posterior.lattice_rule import Array
from ifrfit.inference.posterior.mixture_proposal import Component, Domain, Uniform, between

WIDE, WIDER = 0.15, 5.0  # share of components that are wider by a factor
LONG = 0.1  # share of the component that is as long as the domain along one coordinate
UNIFORM = 0.25  # share that is uniform over the domain
_TINY = 1e-300


@dataclass(frozen=True)
class ConditionalMixture:
    """A mixture of cut components over (given, own) coordinates, conditioned on the first `given` of them.

    The share of a component follows its density at what is given. Beside the components there are wider ones,
    the largest one as long as the domain along each coordinate, and a uniform law, whatever is given.

    Attributes
    ----------
    domain : Domain
    given : int
        Number of coordinates that are given.
    components : tuple of Component
    shares : ndarray, (k,)
        Sum 1.
    """

    domain: Domain
    given: int
    components: tuple[Component, ...]
    shares: Array

    @property
    def own(self) -> int:
        """Number of coordinates that are drawn."""
        return self.domain.dimensions - self.given

    @property
    def n_laws(self) -> int:
        """Number of laws that are mixed."""
        return len(self._laws) + 1

    @cached_property
    def _laws(self) -> list[tuple[float, int | None, Component]]:
        """All laws but the uniform: share, number of the component that scales it or None, and law."""
        k = self.given
        found: list[tuple[float, int | None, Component]] = []
        long = LONG if self.own > 1 else 0.0
        for share, factor in ((1.0 - WIDE - long - UNIFORM, 1.0), (WIDE, WIDER)):
            for number, each in enumerate(self.components):
                root = each.root.copy()
                root[k:, k:] *= factor
                found.append((share, number, Component(each.centre, root)))
        if long:
            largest = self.components[int(self.shares.argmax())]
            found += [(long / self.own, None, each) for each in largest.lengthened(self.domain, k)]
        return found

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
        return np.stack((*laws, UNIFORM + 0.0 * pi[0]), axis=1), np.array(z)

    def draw(self, at: Array, u: Array) -> Array:
        """Points, (n, m, d), where the first coordinates are given.

        Parameters
        ----------
        at : ndarray, (n, given)
        u : ndarray, (n, m, 1 + own)
            Uniform between 0 and 1; the first picks the law.
        """
        n, m, _ = u.shape
        d, k = self.domain.dimensions, self.given
        shares, z_given = self._of_given(at)
        below = np.cumsum(shares, axis=1)
        chosen = (u[:, :, 0, None] > below[:, None, :-1]).sum(axis=2).reshape(-1)
        flat = u.reshape(n * m, -1)
        found = np.empty((n * m, d))
        found[:, :k] = np.repeat(at, m, axis=0)
        outer = np.repeat(np.arange(n), m)
        for number, (_, parent, law) in enumerate(self._laws):
            rows = np.flatnonzero(chosen == number)
            if not rows.size:
                continue
            z = np.empty((rows.size, d))
            z[:, :k] = z_given[self._parent(parent), outer[rows]]
            found[rows] = law.draw_rest(self.domain, found[rows], z, flat[rows, 1:])
        rows = np.flatnonzero(chosen == len(self._laws))
        found[rows] = Uniform().draw_rest(self.domain, found[rows], flat[rows, 1:])
        return found.reshape(n, m, d)

    def log_density(self, at: Array) -> Array:
        """Log density of the own coordinates given the others, (n, m), at points (n, m, d)."""
        n, m, d = at.shape
        k = self.given
        shares, z_given = self._of_given(at[:, 0, :k])
        flat = at.reshape(n * m, d)
        ends = [self.domain.ends(j, flat) for j in range(k, d)]
        flat_density = np.ones(n * m)
        for low, high in ends:
            flat_density /= np.maximum(high - low, _TINY)
        total = np.repeat(shares[:, -1], m) * flat_density
        for number, (_, parent, law) in enumerate(self._laws):
            z = np.empty((n * m, d))
            z[:, :k] = np.repeat(z_given[self._parent(parent)], m, axis=0)
            density = np.repeat(shares[:, number], m)
            for j, (low, high) in enumerate(ends, start=k):
                size = law.root[j, j]
                centre = law.centre[j] + z[:, :j] @ law.root[j, :j]
                z[:, j] = (flat[:, j] - centre) / size
                inside = np.maximum(between((low - centre) / size, (high - centre) / size), _TINY)
                density = density * (0.375 / size) / ((1.0 + 0.25 * z[:, j] ** 2) ** 2.5 * inside)
            total += density
        return np.asarray(np.log(np.maximum(total, _TINY))).reshape(n, m)

    def _parent(self, parent: int | None) -> int:
        return int(self.shares.argmax()) if parent is None else parent


def conditional_mixture(
    domain: Domain, given: int, components: Sequence[Component], shares: Array
) -> ConditionalMixture:
    """Components over (given, own) coordinates as a law of the own ones."""
    return ConditionalMixture(domain, given, tuple(components), shares / shares.sum())
