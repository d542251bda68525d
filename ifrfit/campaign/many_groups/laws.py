"""The marginal laws of the restitutions of many groups: of e_n, and of the closure constant given kappa."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from ifrfit.campaign.many_groups.gauss_rule import three_nodes
from ifrfit.campaign.many_groups.group_law import GroupLaw, NormalMixture
from ifrfit.campaign.many_groups.panel_law import NODES, PanelLaw, panel_nodes
from ifrfit.campaign.many_groups.values import total

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_E_SPAN = 5.5  # sd of e_n on either side of its best value
_E_PANELS = 24  # between them: half an sd each
_SMALL = 1e-11  # mass of a node over the largest, below which it is left out


@cache
def _legendre(nodes: int) -> tuple[Array, Array]:
    return np.polynomial.legendre.leggauss(nodes)


@dataclass(frozen=True)
class ConstantLaw(NormalMixture):
    """Of the closure constant: normal laws cut off at its bounds, one for each node of kappa.

    Heights are masses over what a law has between the bounds. A law whose mean lies below them is seen from
    its other side, with negative width and height: what is left of its upper tail would lose all digits.

    Attributes
    ----------
    under : ndarray, (groups, nodes)
        What each law, uncut, has below the lower bound; seen from its other side, above it.
    low, high : ndarray, (groups,)
    """

    under: Array
    low: Array
    high: Array

    @classmethod
    def made(cls, middle: Array, width: Array, height: Array, domain: tuple[float, float]) -> ConstantLaw:
        """From the normal law at each node, (groups, panels, 6)."""
        groups = middle.shape[0]
        facing = np.where(middle[:, :, :1] < domain[0], -1.0, 1.0)  # one for a panel
        width, height = facing * width, facing * height
        middle, width, height = (each.reshape(groups, -1) for each in (middle, width, height))
        bounds = np.full(groups, domain[0]), np.full(groups, domain[1])
        under = ndtr((domain[0] - middle) / width)
        alone = cls(middle, width, height, bounds[0], bounds[0], under, *bounds)
        return alone.weighted(np.ones_like(height))

    def weighted(self, weight: Array) -> ConstantLaw:
        """The same normal laws with other masses, (groups, nodes) times as large."""
        middle, width, height = self.middle, self.width, self.height * weight
        low, high = ((end[:, None] - middle) / width for end in (self.low, self.high))
        between = ndtr(high) - self.under
        slope, lean = (
            (np.exp(-0.5 * low**2) * a - np.exp(-0.5 * high**2) * b) / math.sqrt(2.0 * math.pi)
            for a, b in ((1.0, 1.0), (low, high))
        )
        mean = total(height * (middle * between + width * slope))
        offset = middle - mean[:, None]
        square = (offset**2 + width**2) * between + width**2 * lean + 2.0 * offset * width * slope
        return replace(self, height=height, mean=mean, sd=np.sqrt(total(height * square)))

    @property
    def ends(self) -> tuple[Array, Array]:
        """Where each law begins and ends."""
        return self.low, self.high

    def below(self, x: Array) -> tuple[Array, Array]:
        """Probability below, and density at, some places of each group, (groups, n)."""
        share, density = super().below(x)
        outside = (x < self.low[:, None]) | (x > self.high[:, None])
        return share - self._cut, np.where(outside, 0.0, density)

    def share(self, x: Array) -> Array:
        """Probability below some places of each group, (groups, n)."""
        return super().share(x) - self._cut

    @property
    def _cut(self) -> Array:
        """What of `share` all of them, uncut, have at the lower bound, (groups, 1)."""
        return total(self.height * self.under)[:, None]

    def with_fewer_nodes(self) -> ConstantLaw:
        """The same to some 1e-6 sd: three nodes a panel, where middles lie on a line, and no small ones."""
        groups = self.middle.shape[0]
        lines = self.middle.reshape(groups, -1, NODES.size)
        first, last = lines[:, :, :1], lines[:, :, -1:]
        places, heights = three_nodes(NODES, np.abs(self.height).reshape(lines.shape))
        middle = (first + (last - first) * (places - NODES[0]) / (NODES[-1] - NODES[0])).reshape(groups, -1)
        width = np.repeat(self.width[:, :: NODES.size], 3, axis=1)
        under = ndtr((self.low[:, None] - middle) / width)
        height = np.copysign(heights.reshape(groups, -1), width)
        every = replace(self, middle=middle, width=width, height=height, under=under)
        masses = every.node_masses
        small = masses <= _SMALL * masses.max(axis=1, keepdims=True)
        most = int((~small).sum(axis=1).max(initial=1))
        order = np.argsort(small, axis=1, kind="stable")[:, :most]
        arrays = (middle, width, np.where(small, 0.0, height), under)
        middle, width, height, under = (np.take_along_axis(each, order, axis=1) for each in arrays)
        return replace(self, middle=middle, width=width, height=height, under=under)

    @property
    def node_masses(self) -> Array:
        """Mass of each node, (groups, nodes)."""
        return np.asarray(self.height * (ndtr((self.high[:, None] - self.middle) / self.width) - self.under))

    @property
    def node_means(self) -> Array:
        """Mean times mass at each node, (groups, nodes)."""
        low, high = ((end[:, None] - self.middle) / self.width for end in (self.low, self.high))
        slope = (np.exp(-0.5 * low**2) - np.exp(-0.5 * high**2)) / math.sqrt(2.0 * math.pi)
        return self.height * (self.middle * (ndtr(high) - self.under) + self.width * slope)


@dataclass(frozen=True)
class RestitutionLaw(GroupLaw):
    """Of e_n: a normal law between its bounds, with the Jacobian 1/(1 + e_n) of mu = kappa/(1 + e_n).

    Attributes
    ----------
    middle, width : ndarray, (groups,)
        Of the normal law.
    low, high : ndarray, (groups,)
        Where it is cut, by a bound or far out.
    nodes, mass : ndarray, (groups, m)
        Places, and the share of the law that each stands for.
    scale : ndarray, (groups,)
        Of the law over the normal density and its Jacobian.
    mean, sd : ndarray, (groups,)
    """

    middle: Array
    width: Array
    low: Array
    high: Array
    nodes: Array
    mass: Array
    scale: Array
    mean: Array
    sd: Array

    @classmethod
    def made(cls, middle: Array, width: Array, domain: tuple[float, float], nodes: int) -> RestitutionLaw:
        """From mean and sd of the normal law, (groups,) each, and the number of nodes."""
        rule, weights = _legendre(nodes)
        best = np.clip(middle, *domain)
        low = np.maximum(best - _E_SPAN * width, domain[0])
        high = np.minimum(best + _E_SPAN * width, domain[1])
        half = 0.5 * (high - low)
        places = (low + half)[:, None] + half[:, None] * rule
        z = (places - middle[:, None]) / width[:, None]
        mass = weights * half[:, None] * np.exp(-0.5 * z * z) / (1.0 + places)
        scale = mass.sum(axis=1)
        mass = mass / scale[:, None]
        mean = (mass * places).sum(axis=1)
        sd = np.sqrt((mass * (places - mean[:, None]) ** 2).sum(axis=1))
        return cls(middle, width, low, high, places, mass, scale, mean, sd)

    @property
    def in_hand(self) -> int:
        """Nodes."""
        return int(self.nodes.shape[1])

    @property
    def ends(self) -> tuple[Array, Array]:
        """Where each law begins and ends."""
        return self.low, self.high

    def below(self, x: Array) -> tuple[Array, Array]:
        """Probability below, and density at, some places of each group, (groups, n)."""
        low = np.broadcast_to(self.low[:, None], x.shape)
        _, mass = self.between(low, x)
        own = (x - self.middle[:, None]) / self.width[:, None]
        inside = (x >= low) & (x <= self.high[:, None])
        density = np.where(inside, np.exp(-0.5 * own**2) / (1.0 + x), 0.0)
        return mass.sum(axis=2), density / self.scale[:, None]

    def in_panels(self) -> PanelLaw:
        """The same as polynomials, of which many places are asked."""
        edges = self.low[:, None] + (self.high - self.low)[:, None] * np.linspace(0.0, 1.0, _E_PANELS + 1)
        nodes = panel_nodes(edges)
        z = (nodes - self.middle[:, None, None]) / self.width[:, None, None]
        return PanelLaw.made(edges, nodes, np.exp(-0.5 * z * z) / (1.0 + nodes) / self.scale[:, None, None])

    def between(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Nodes between some places of each group, (groups, n), and their masses, (groups, n, m) each."""
        low, high = (np.clip(each, self.low[:, None], self.high[:, None]) for each in (low, high))
        half = 0.5 * (high - low)
        rule, weights = _legendre(self.nodes.shape[1])
        nodes = low[:, :, None] + half[:, :, None] * (1.0 + rule)
        z = (nodes - self.middle[:, None, None]) / self.width[:, None, None]
        mass = half[:, :, None] * weights * np.exp(-0.5 * z * z) / (1.0 + nodes)
        return nodes, mass / self.scale[:, None, None]
