"""The marginal laws of many groups at once: distribution functions, and what follows from them.

A law holds arrays whose first axis is the group. `below` takes (groups, n) places and gives the probability
below them and the density there; quantiles follow by Newton's method between the ends of the law.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv, ndtr, ndtri

from ifrfit.campaign.many_groups.of_groups import OfGroups
from ifrfit.campaign.many_groups.values import total

Array = NDArray[np.float64]
Index = NDArray[np.intp]

NODES, WEIGHTS = np.polynomial.legendre.leggauss(6)  # of a panel
_TO_POWERS = np.linalg.inv(np.vander(NODES, increasing=True)).T  # values at the nodes @ this: coefficients
_E_NODES, _E_WEIGHTS = np.polynomial.legendre.leggauss(40)
_E_SPAN = 6.5  # sd of e_n on either side
_STEPS = 60
_CLOSE = 3e-4  # miss, in sd, from which one more step leaves no more than its square
_AT_ONCE = 1 << 15  # numbers
_AWAY = 4.0  # sd from its mean to an end of a law that is begun with as a normal one
_SMALL, _COUNTS = 1e-11, 1e-6  # mass of a node over the largest: left out, and looked at
_NARROW = 0.3  # of a width: normal laws so near one another are as good as two


class GroupLaw(OfGroups, ABC):
    """The law of one quantity in each of many groups; the fields are arrays, (groups, ...)."""

    mean: Array
    sd: Array

    @property
    def in_hand(self) -> int:
        """How many numbers `below` has in hand for a place."""
        return 1

    @property
    @abstractmethod
    def ends(self) -> tuple[Array, Array]:
        """Where each law begins and ends, (groups,) each."""

    @abstractmethod
    def below(self, x: Array) -> tuple[Array, Array]:
        """Probability below, and density at, some places of each group, (groups, n)."""

    def share(self, x: Array) -> Array:
        """Probability below some places of each group, (groups, n)."""
        return self.below(x)[0]

    def in_parts(self, places: int) -> list[slice]:
        """So few groups at once that what is in hand for some places of each stays in the cache."""
        size = self.mean.size
        most = max(1, _AT_ONCE // (places * self.in_hand))
        return [slice(first, first + most) for first in range(0, size, most)]

    def start(self, levels: Array) -> Array:
        """Near the quantiles, (groups, n): a normal law, or the beta law that has the ends, mean and sd."""
        low, high = self.ends
        x = self.mean[:, None] + self.sd[:, None] * ndtri(levels)
        away = np.minimum(self.mean - low, high - self.mean)
        cut = np.flatnonzero(away < _AWAY * self.sd)
        low, span = low[cut, None], (high - low)[cut, None]
        share = (self.mean[cut, None] - low) / span
        size = share * (1.0 - share) * (span / self.sd[cut, None]) ** 2 - 1.0
        beta = low + span * betaincinv(size * share, size * (1.0 - share), levels)
        x[cut] = np.where(np.isfinite(beta), beta, x[cut])
        return x

    def quantiles(self, levels: Array) -> Array:
        """Quantiles, (groups, n); nan where the search does not settle.

        Newton's method in the quantile of the normal law that has the same probability, in which most laws
        are nearly straight, with the cubic through a second place: that of the step before, at first that of
        another level.
        """
        low, high = (np.repeat(end[:, None], levels.size, axis=1) for end in self.ends)
        goal = ndtri(levels)
        x = np.clip(self.start(levels), low, high)
        found = np.full_like(x, np.nan)
        pending, law = np.arange(x.shape[0]), self
        before: Array | None = None
        for _ in range(_STEPS):
            parts = [law.of_groups(part).below(x[part]) for part in law.in_parts(levels.size)]
            share, density = (np.concatenate(each) for each in zip(*parts, strict=True))
            low, high = np.where(share < levels, x, low), np.where(share > levels, x, high)
            with np.errstate(divide="ignore", invalid="ignore"):  # a step without end is not taken
                z = ndtri(share)
                miss, slope = goal - z, np.exp(-0.5 * z * z) / (math.sqrt(2.0 * math.pi) * density)
                step = x + miss * slope + _bend(miss, x, slope, *_beside(goal, z, x, slope, before))
            is_inside = (step >= low) & (step <= high)
            if before is not None:  # where a law is all but flat, steps lead nowhere
                is_inside &= np.abs(miss) < 0.5 * np.abs(before[0])
            is_close = np.abs(miss) < _CLOSE
            # what is there stays, whatever other levels need
            there = np.where(is_inside, step, x)
            found[pending] = np.where(is_close & np.isnan(found[pending]), there, found[pending])
            step = np.where(is_inside, step, 0.5 * (low + high))
            left = np.flatnonzero(np.isnan(found[pending]).any(axis=1) & ~np.isnan(share).any(axis=1))
            if not left.size:
                break
            before = np.stack((miss, x, slope))[:, left]
            pending, law = pending[left], law.of_groups(left)
            x, low, high = step[left], low[left], high[left]
        return found


def _beside(goal: Array, z: Array, x: Array, slope: Array, before: Array | None) -> Array:
    """Miss, place and slope of a second place for each, (3, groups, n)."""
    if before is not None:
        return before
    levels = np.arange(goal.size)
    other = levels + np.where(goal > z, 1, -1)
    other = np.where((other < 0) | (other >= goal.size), 2 * levels - other, other)
    z, x, slope = (np.take_along_axis(each, other, axis=1) for each in (z, x, slope))
    return np.stack((goal - z, x, slope))


def _bend(miss: Array, x: Array, slope: Array, miss0: Array, x0: Array, slope0: Array) -> Array:
    """What the cubic through two places, with the slopes there, adds to the straight line at the last one."""
    h = miss - miss0
    chord = (x0 - x) / h
    bend = (miss / h) ** 2 * (
        (3.0 * chord - 2.0 * slope - slope0) * h + (slope + slope0 - 2.0 * chord) * miss
    )
    is_known = np.isfinite(bend) & (np.abs(bend) < 0.5 * np.abs(miss * slope))
    return np.where(is_known, bend, 0.0)


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
class ConstantLaw(GroupLaw):
    """Of the closure constant: a mixture of normal laws cut off at its bounds, one for each node of kappa.

    Attributes
    ----------
    middle, width, height : ndarray, (groups, nodes)
        Of each normal law, uncut; heights are masses over what the law has between the bounds.
    under : ndarray, (groups, nodes)
        What each law has below the lower bound.
    low, high, mean, sd : ndarray, (groups,)
    """

    middle: Array
    width: Array
    height: Array
    under: Array
    low: Array
    high: Array
    mean: Array
    sd: Array

    @classmethod
    def made(cls, middle: Array, width: Array, height: Array, domain: tuple[float, float]) -> ConstantLaw:
        """From the normal law at each node, (groups, panels, 6)."""
        groups = middle.shape[0]
        middle, width, height = (each.reshape(groups, -1) for each in (middle, width, height))
        bounds = np.full(groups, domain[0]), np.full(groups, domain[1])
        under = ndtr((domain[0] - middle) / width)
        alone = cls(middle, width, height, under, *bounds, bounds[0], bounds[0])
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
    def in_hand(self) -> int:
        """Nodes of kappa."""
        return int(self.middle.shape[1])

    @property
    def ends(self) -> tuple[Array, Array]:
        """Where each law begins and ends."""
        return self.low, self.high

    def below(self, x: Array) -> tuple[Array, Array]:
        """Probability below, and density at, some places of each group, (groups, n)."""
        z, width, height = self._by_node(x)
        share = self._share(z, height)
        np.square(z, out=z)
        z *= -0.5
        density = np.exp(z, out=z)
        density *= height / width
        outside = (x < self.low[:, None]) | (x > self.high[:, None])
        return share, np.where(outside, 0.0, density.sum(axis=0) / math.sqrt(2.0 * math.pi))

    def share(self, x: Array) -> Array:
        """Probability below some places of each group, (groups, n)."""
        z, _, height = self._by_node(x)
        return self._share(z, height)

    def _by_node(self, x: Array) -> tuple[Array, Array, Array]:
        """Places in widths from the middle of each node, (nodes, groups, n), and width and height of each.

        Sums along the first axis are done one after the other.
        """
        arrays = (self.middle, self.width, self.height)
        middle, width, height = (np.ascontiguousarray(each.T)[:, :, None] for each in arrays)
        z = x - middle
        z /= width
        return z, width, height

    def _share(self, z: Array, height: Array) -> Array:
        share = ndtr(z)
        share *= height
        return np.asarray(share.sum(axis=0) - total(self.height * self.under)[:, None])

    @property
    def widest_step(self) -> Array:
        """Largest distance of the middles of neighbouring nodes that count, in widths, (groups,).

        The distribution function is smooth where it is small, and a staircase where it is large.
        """
        masses = self.node_masses
        counts = masses > _COUNTS * masses.max(axis=1, keepdims=True)
        step = np.abs(np.diff(self.middle, axis=1)) / np.minimum(self.width[:, 1:], self.width[:, :-1])
        return np.asarray(np.where(counts[:, 1:] & counts[:, :-1], step, 0.0).max(axis=1))

    def with_fewer_nodes(self) -> ConstantLaw:
        """The same to some 1e-6 sd: two nodes stand for those of a narrow panel, and small ones are left out.

        The two have mass, mean, variance and third moment of the middles that they stand for (Gauss's rule).
        """
        shape = (self.middle.shape[0], -1, NODES.size)
        middle, height, width = (each.reshape(shape) for each in (self.middle, self.height, self.width))
        mass = height.sum(axis=2)
        mean = (height * middle).sum(axis=2) / mass
        off = middle - mean[:, :, None]
        square = height * off**2
        variance, third = square.sum(axis=2) / mass, (square * off).sum(axis=2) / mass
        lean = np.where(variance > 0.0, 0.5 * third / variance, 0.0)
        half = np.sqrt(lean**2 + variance)
        share = np.where(half > 0.0, 0.5 - 0.5 * lean / half, 0.5)  # of the upper one
        # outside the bounds what a normal law has between them changes faster
        width = width[:, :, 0]
        outside = np.maximum(np.maximum(self.low[:, None] - mean, mean - self.high[:, None]), 0.0)
        narrow = np.abs(middle[:, :, -1] - middle[:, :, 0]) * (width + outside) < _NARROW * width**2
        two = np.stack((mean + lean - half, mean + lean + half), axis=2)
        of_two = mass[:, :, None] * np.stack((1.0 - share, share), axis=2)
        middle, height = middle.copy(), np.where(narrow[:, :, None], 0.0, height)
        middle[:, :, :2] = np.where(narrow[:, :, None], two, middle[:, :, :2])
        height[:, :, :2] = np.where(narrow[:, :, None], of_two, height[:, :, :2])
        return self._with(middle.reshape(self.middle.shape), height.reshape(self.middle.shape))

    def _with(self, middle: Array, height: Array) -> ConstantLaw:
        """With these nodes, less those that stand for next to nothing; those that are left come first."""
        under = ndtr((self.low[:, None] - middle) / self.width)
        masses = replace(self, middle=middle, height=height, under=under).node_masses
        small = masses <= _SMALL * masses.max(axis=1, keepdims=True)
        most = int((~small).sum(axis=1).max(initial=1))
        order = np.argsort(small, axis=1, kind="stable")[:, :most]
        arrays = (middle, self.width, np.where(small, 0.0, height), under)
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
    nodes, mass : ndarray, (groups, 40)
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
    def made(cls, middle: Array, width: Array, domain: tuple[float, float]) -> RestitutionLaw:
        """From mean and sd of the normal law, (groups,) each."""
        low = np.maximum(middle - _E_SPAN * width, domain[0])
        high = np.minimum(middle + _E_SPAN * width, domain[1])
        half = 0.5 * (high - low)
        nodes = (low + half)[:, None] + half[:, None] * _E_NODES
        z = (nodes - middle[:, None]) / width[:, None]
        mass = _E_WEIGHTS * half[:, None] * np.exp(-0.5 * z * z) / (1.0 + nodes)
        scale = mass.sum(axis=1)
        mass = mass / scale[:, None]
        mean = (mass * nodes).sum(axis=1)
        sd = np.sqrt((mass * (nodes - mean[:, None]) ** 2).sum(axis=1))
        return cls(middle, width, low, high, nodes, mass, scale, mean, sd)

    @property
    def in_hand(self) -> int:
        """Nodes."""
        return _E_NODES.size

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
        """Nodes between some places of each group, (groups, n), and their masses, (groups, n, 40) each."""
        low, high = (np.clip(each, self.low[:, None], self.high[:, None]) for each in (low, high))
        half = 0.5 * (high - low)
        nodes = low[:, :, None] + half[:, :, None] * (1.0 + _E_NODES)
        z = (nodes - self.middle[:, None, None]) / self.width[:, None, None]
        mass = half[:, :, None] * _E_WEIGHTS * np.exp(-0.5 * z * z) / (1.0 + nodes)
        return nodes, mass / self.scale[:, None, None]


@dataclass(frozen=True)
class FrictionLaw(GroupLaw):
    """Of mu = kappa/(1 + e_n), kappa and e_n independent but for the Jacobian, which is in the law of e_n.

    Attributes
    ----------
    kappa : KappaLaw
    scale, mass : ndarray, (groups, 40)
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
