"""A law that is a polynomial in each panel of its axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.campaign.many_groups.group_law import GroupLaw
from ifrfit.campaign.many_groups.values import total

Array = NDArray[np.float64]

NODES, WEIGHTS = np.polynomial.legendre.leggauss(6)  # of a panel
_TO_POWERS = np.linalg.inv(np.vander(NODES, increasing=True)).T  # values at the nodes @ this: coefficients


def panel_nodes(edges: Array) -> Array:
    """Nodes of panels, (groups, panels, 6), from their edges, (groups, panels + 1)."""
    half = 0.5 * np.diff(edges, axis=1)[:, :, None]
    return np.asarray(edges[:, :-1, None] + half + half * NODES)


@dataclass(frozen=True)
class PanelLaw(GroupLaw):
    """A law whose density is a polynomial of the fifth degree in each panel.

    Attributes
    ----------
    edges : ndarray, (groups, panels + 1)
    density : ndarray, (groups, panels, 6)
        At the nodes of each panel.
    mean, sd : ndarray, (groups,)
    powers : ndarray, (groups, panels, 7)
        Coefficients of the mass up to a place in a panel, from its lower edge on.
    upto : ndarray, (groups, panels)
        Probability below each panel.
    """

    edges: Array
    mean: Array
    sd: Array
    powers: Array
    upto: Array

    @classmethod
    def made(cls, edges: Array, nodes: Array, density: Array) -> PanelLaw:
        """From the density at the nodes, (groups, panels, 6)."""
        half = 0.5 * np.diff(edges, axis=1)
        weights = density * WEIGHTS * half[:, :, None]
        mean = total(weights * nodes)
        sd = np.sqrt(total(weights * (nodes - mean[:, None, None]) ** 2))
        inner = (density[..., None] * _TO_POWERS).sum(axis=2) * half[:, :, None]
        inner /= np.arange(1.0, NODES.size + 1.0)
        first = -(inner * (-1.0) ** np.arange(1, NODES.size + 1)).sum(axis=2, keepdims=True)
        mass = (density * WEIGHTS).sum(axis=2) * half
        return cls(edges, mean, sd, np.concatenate((first, inner), axis=2), np.cumsum(mass, axis=1) - mass)

    @property
    def ends(self) -> tuple[Array, Array]:
        """Where the panels begin and end."""
        return self.edges[:, 0], self.edges[:, -1]

    @property
    def in_hand(self) -> int:
        """Powers."""
        return NODES.size + 1

    def start(self, levels: Array) -> Array:
        """Near the quantiles, (groups, n): as if each panel had one density; levels may differ by group."""
        levels = np.broadcast_to(levels, (self.mean.size, levels.shape[-1]))
        panel = (self.upto[:, None, 1:] <= levels[:, :, None]).sum(axis=2)
        low, high = (np.take_along_axis(self.edges[:, k:], panel, axis=1) for k in (0, 1))
        upto = np.concatenate((self.upto, np.ones((self.mean.size, 1))), axis=1)
        before, after = (np.take_along_axis(upto[:, k:], panel, axis=1) for k in (0, 1))
        return np.asarray(low + (high - low) * (levels - before) / (after - before))

    def below(self, x: Array) -> tuple[Array, Array]:
        """Probability below, and density at, some places of each group, (groups, n)."""
        walls = zip(self.edges[:, 1:-1], x, strict=True)
        panel = np.stack([np.searchsorted(*each) for each in walls])
        # of one array for all groups, as indices of two axes take ten times as long
        place = panel + self.edges.shape[1] * np.arange(x.shape[0])[:, None]
        low, high = self.edges.take(place), self.edges.take(place + 1)
        half = 0.5 * (high - low)
        half = np.where(half > 0.0, half, 1.0)  # a panel without width, beyond the ends alone
        at = np.clip((x - low - half) / half, -1.0, 1.0)
        place = panel + self.upto.shape[1] * np.arange(x.shape[0])[:, None]
        of = self.powers.reshape(-1, NODES.size + 1).take(place.ravel(), axis=0).reshape(*x.shape, -1)
        share, slope = np.zeros_like(at), np.zeros_like(at)
        for k in range(NODES.size, -1, -1):
            slope = slope * at + share
            share = share * at + of[:, :, k]
        outside = (x < self.edges[:, :1]) | (x > self.edges[:, -1:])
        density = np.where(outside, 0.0, slope / half)
        return share + self.upto.take(place), density
