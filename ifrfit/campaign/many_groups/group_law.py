"""A law of one quantity in each of many groups, and its quantiles.

A law holds arrays whose first axis is the group. `below` takes (groups, n) places and gives the probability
below them and the density there; quantiles follow by Newton's method between the ends of the law.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv, ndtr, ndtri

from ifrfit.campaign.many_groups.of_groups import OfGroups
from ifrfit.campaign.many_groups.values import total

Array = NDArray[np.float64]

_STEPS = 60
_CLOSE = 3e-4  # miss, in sd, from which one more step leaves no more than its square
_EMPTY = 1e-3  # density, over 1/sd, between modes: a quantile there hangs on the last digits of a probability
_AT_ONCE = 1 << 15  # numbers
_AWAY = 4.0  # sd from its mean to an end of a law that is begun with as a normal one
_FAR = 9.0  # sd of a normal law, beyond which nothing of it is looked for


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
        """Quantiles, (groups, n); nan where the search does not settle, or a law has next to nothing there.

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
            # between modes a law is so flat that what is next to nothing of its probability is a long way
            is_close = np.abs(miss) * np.maximum(slope / law.sd[:, None], 1.0) < _CLOSE
            # what is there stays, whatever other levels need
            there = np.where(is_inside, step, x)
            there = np.where(density * law.sd[:, None] < _EMPTY, np.inf, there)
            found[pending] = np.where(is_close & np.isnan(found[pending]), there, found[pending])
            step = np.where(is_inside, step, 0.5 * (low + high))
            left = np.flatnonzero(np.isnan(found[pending]).any(axis=1) & ~np.isnan(share).any(axis=1))
            if not left.size:
                break
            before = np.stack((miss, x, slope))[:, left]
            pending, law = pending[left], law.of_groups(left)
            x, low, high = step[left], low[left], high[left]
        return np.where(np.isinf(found), np.nan, found)


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
class NormalMixture(GroupLaw):
    """A mixture of normal laws, one for each node of another quantity.

    Attributes
    ----------
    middle, width, height : ndarray, (groups, nodes)
        Mean, sd and mass of each.
    mean, sd : ndarray, (groups,)
    """

    middle: Array
    width: Array
    height: Array
    mean: Array
    sd: Array

    @classmethod
    def of(cls, middle: Array, width: Array, height: Array) -> Self:
        """From masses that add up to 1 in each group."""
        mean = total(height * middle)
        variance = total(height * (width**2 + (middle - mean[:, None]) ** 2))
        return cls(middle, width, height, mean, np.sqrt(variance))

    @property
    def in_hand(self) -> int:
        """Nodes."""
        return int(self.middle.shape[1])

    @property
    def ends(self) -> tuple[Array, Array]:
        """Far out."""
        far = _FAR * self.width
        return (self.middle - far).min(axis=1), (self.middle + far).max(axis=1)

    def below(self, x: Array) -> tuple[Array, Array]:
        """Probability below, and density at, some places of each group, (groups, n)."""
        z, width, height = self._by_node(x)
        share = _summed(ndtr(z), height)
        np.square(z, out=z)
        z *= -0.5
        density = _summed(np.exp(z, out=z), height / width) / math.sqrt(2.0 * math.pi)
        return share, density

    def share(self, x: Array) -> Array:
        """Probability below some places of each group, (groups, n)."""
        z, _, height = self._by_node(x)
        return _summed(ndtr(z), height)

    def _by_node(self, x: Array) -> tuple[Array, Array, Array]:
        """Places in widths from the middle of each node, (nodes, groups, n), and width and height of each.

        Sums along the first axis are done one after the other.
        """
        arrays = (self.middle, self.width, self.height)
        middle, width, height = (np.ascontiguousarray(each.T)[:, :, None] for each in arrays)
        z = x - middle
        z /= width
        return z, width, height


def _summed(of_nodes: Array, height: Array) -> Array:
    """Sum over nodes, the first axis; what is given is not kept."""
    of_nodes *= height
    return np.asarray(of_nodes.sum(axis=0))
