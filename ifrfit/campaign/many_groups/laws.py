"""The marginal laws of the constants of many groups: distribution functions, and what follows from them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from ifrfit.campaign.many_groups.gauss_rule import three_nodes
from ifrfit.campaign.many_groups.group_law import GroupLaw, NormalMixture
from ifrfit.campaign.many_groups.values import total

Array = NDArray[np.float64]
Index = NDArray[np.intp]

NODES, WEIGHTS = np.polynomial.legendre.leggauss(6)  # of a panel
_TO_POWERS = np.linalg.inv(np.vander(NODES, increasing=True)).T  # values at the nodes @ this: coefficients
_E_SPAN = 5.5  # sd of e_n on either side of its best value
_SMALL = 1e-11  # mass of a node over the largest, below which it is left out


@cache
def _legendre(nodes: int) -> tuple[Array, Array]:
    return np.polynomial.legendre.leggauss(nodes)


@dataclass(frozen=True)
class KappaLaw(GroupLaw):
    """Of kappa: a polynomial in each panel.

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
    def made(cls, edges: Array, nodes: Array, density: Array) -> KappaLaw:
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


@dataclass(frozen=True)
class ConstantLaw(NormalMixture):
    """Of the closure constant: normal laws cut off at its bounds, one for each node of kappa.

    Heights are masses over what a law has between the bounds.

    Attributes
    ----------
    under : ndarray, (groups, nodes)
        What each law, uncut, has below the lower bound.
    low, high : ndarray, (groups,)
    """

    under: Array
    low: Array
    high: Array

    @classmethod
    def made(cls, middle: Array, width: Array, height: Array, domain: tuple[float, float]) -> ConstantLaw:
        """From the normal law at each node, (groups, panels, 6)."""
        groups = middle.shape[0]
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
        """What all of them, uncut, have below the lower bound, (groups, 1)."""
        return total(self.height * self.under)[:, None]

    def with_fewer_nodes(self) -> ConstantLaw:
        """The same to some 1e-6 sd: three nodes a panel, where middles lie on a line, and no small ones."""
        groups = self.middle.shape[0]
        lines = self.middle.reshape(groups, -1, NODES.size)
        first, last = lines[:, :, :1], lines[:, :, -1:]
        places, heights = three_nodes(NODES, self.height.reshape(lines.shape))
        middle = (first + (last - first) * (places - NODES[0]) / (NODES[-1] - NODES[0])).reshape(groups, -1)
        width = np.repeat(self.width[:, :: NODES.size], 3, axis=1)
        under = ndtr((self.low[:, None] - middle) / width)
        height = heights.reshape(groups, -1)
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

    def between(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Nodes between some places of each group, (groups, n), and their masses, (groups, n, m) each."""
        low, high = (np.clip(each, self.low[:, None], self.high[:, None]) for each in (low, high))
        half = 0.5 * (high - low)
        rule, weights = _legendre(self.nodes.shape[1])
        nodes = low[:, :, None] + half[:, :, None] * (1.0 + rule)
        z = (nodes - self.middle[:, None, None]) / self.width[:, None, None]
        mass = half[:, :, None] * weights * np.exp(-0.5 * z * z) / (1.0 + nodes)
        return nodes, mass / self.scale[:, None, None]


@dataclass(frozen=True)
class FrictionLaw(GroupLaw):
    """Of mu = kappa/(1 + e_n), kappa and e_n independent but for the Jacobian, which is in the law of e_n.

    Attributes
    ----------
    kappa : KappaLaw
    scale, mass : ndarray, (groups, m)
        1 + e_n at its nodes, and the share that each stands for.
    mean, sd : ndarray, (groups,)
    """

    kappa: KappaLaw
    scale: Array
    mass: Array
    mean: Array
    sd: Array

    @classmethod
    def made(cls, kappa: KappaLaw, e_n: RestitutionLaw) -> FrictionLaw:
        """From both laws."""
        scale = 1.0 + e_n.nodes
        return cls(kappa, scale, e_n.mass, *_over(kappa, scale, e_n.mass))

    @property
    def in_hand(self) -> int:
        """Those of e_n, with the powers of kappa at each."""
        return int(self.scale.shape[1]) * self.kappa.in_hand

    @property
    def ends(self) -> tuple[Array, Array]:
        """Those of kappa over those of 1 + e_n."""
        low, high = self.kappa.ends
        return low / self.scale.max(axis=1), high / self.scale.min(axis=1)

    def start(self, levels: Array) -> Array:
        """Near the quantiles, (groups, n): those of kappa, moved and stretched by what e_n adds."""
        whole = self.mass.sum(axis=1)  # more than all where the law is cut
        mean, sd = _over(self.kappa, self.scale, self.mass / whole[:, None])
        away = self.kappa.start(levels / whole[:, None]) - self.kappa.mean[:, None]
        return np.asarray(mean[:, None] + away * (sd / self.kappa.sd)[:, None])

    def below(self, x: Array) -> tuple[Array, Array]:
        """Probability below, and density at, some places of each group, (groups, n)."""
        kappa = x[:, :, None] * self.scale[:, None, :]
        share, density = self.kappa.below(kappa.reshape(kappa.shape[0], -1))
        share, density = share.reshape(kappa.shape), density.reshape(kappa.shape)
        weight = self.mass[:, None]
        return (share * weight).sum(axis=2), (density * weight * self.scale[:, None]).sum(axis=2)


def _over(kappa: KappaLaw, scale: Array, mass: Array) -> tuple[Array, Array]:
    """Mean and sd of kappa over an independent scale, whose nodes have these masses; (groups,) each."""
    inverse = 1.0 / scale
    mean = (mass * inverse).sum(axis=1)
    variance = (mass * (inverse - mean[:, None]) ** 2).sum(axis=1)
    return kappa.mean * mean, np.hypot(kappa.sd * np.sqrt(mean**2 + variance), kappa.mean * np.sqrt(variance))
