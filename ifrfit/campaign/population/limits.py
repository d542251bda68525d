"""What groups say of a constant that they leave open on one side: a limit, and how sharp it is.

The likelihood of such a group rises over its limit and stays (mu where no impact slides), or rises towards a
bound of the constant (e_t near -1). In the coordinate of the population it is taken as a normal distribution
function, L(y) = Phi(+-(y - a)/b), through its two one-sided intervals. Without these groups a population
would be that of the groups that happen to determine the constant, and which ones these are the constant
decides: they are censored, not missing (Tobin 1958, Econometrica 26, 24).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr, ndtri

from ifrfit.campaign.population.columns import column
from ifrfit.campaign.population.coordinate import Coordinate
from ifrfit.inference.distributions.truncated_normal import half_width

Array = NDArray[np.float64]

# rise of chi2 at the ends of the one-sided intervals of a profile, and of a half normal law at its quantiles
_OF_PROFILE = np.array([half_width(2.0 * level - 1.0) for level in (0.68, 0.95)])
_OF_HALF_NORMAL = np.array([half_width(level) for level in (0.68, 0.95)])
_SHARPEST = 1e-3  # in the coordinate: what is sharper is no news to a population
_MOST = 256  # limits of one side; of more, neighbours are taken together


@dataclass(frozen=True)
class Limits:
    """Limits of several groups.

    Attributes
    ----------
    place, width : ndarray, (n,)
        a and b, in the coordinate.
    side : ndarray, (n,)
        1 for a lower limit, -1 for an upper one.
    count : ndarray, (n,)
        How many groups each stands for.
    rows : tuple of tuple of int
        Which rows of the campaign's table they are.
    """

    place: Array
    width: Array
    side: Array
    count: Array
    rows: tuple[tuple[int, ...], ...] = ()

    @classmethod
    def none(cls) -> Limits:
        """Of no group."""
        empty = np.empty(0)
        return cls(empty, empty, empty, empty)

    @classmethod
    def of(cls, name: str, rows: Sequence[Mapping[str, Any]], by: Coordinate) -> Limits:
        """Of the rows of a campaign's table in which a constant is one-sided."""
        status = f"{name}_status"
        numbers = np.array([k for k, row in enumerate(rows) if row.get(status) == "one_sided"], dtype=int)
        some = [rows[number] for number in numbers]
        ends = np.array(
            [[column(some, f"{name}_{end}{level}") for level in (95, 68)] for end in ("lo", "hi")]
        )
        is_inside = np.asarray(np.isfinite(by.to(ends)).all(axis=1))
        kept = np.flatnonzero(is_inside[0] != is_inside[1])  # a limit has a bound at its other end
        if not kept.size:
            return cls.none()
        side = np.where(is_inside[0, kept], 1.0, -1.0)
        far_end, near_end = by.to(ends[np.where(side > 0.0, 0, 1), :, kept].T)
        has_value = np.isfinite(column(some, name)[kept])
        one, other = (
            ndtri(np.exp(-0.5 * np.where(has_value, half, profile) ** 2))
            for half, profile in zip(_OF_HALF_NORMAL, _OF_PROFILE, strict=True)
        )
        width = np.maximum(side * (near_end - far_end) / (one - other), _SHARPEST)
        place = near_end - side * width * one
        found = tuple((number,) for number in numbers[kept].tolist())
        return cls(place, width, side, np.ones(place.size), found).together()

    @property
    def groups(self) -> int:
        """How many groups there are."""
        return round(float(self.count.sum()))

    def together(self) -> Limits:
        """The same with neighbours taken together where there are very many."""
        parts, rows = [], []
        for side in (-1.0, 1.0):
            own = np.flatnonzero(self.side == side)
            order = own[np.argsort(self.place[own], kind="stable")]
            for few in np.array_split(order, _MOST) if order.size > _MOST else order[:, None]:
                count = float(self.count[few].sum())
                place, width = ((self.count[few] * x[few]).sum() / count for x in (self.place, self.width))
                parts.append((float(place), float(width), side, count))
                rows.append(tuple(number for each in few.tolist() for number in self.rows[each]))
        if not parts:
            return Limits.none()
        place, width, side_of, count_of = np.array(parts).T
        return Limits(place, width, side_of, count_of, tuple(rows))

    def log_chance(self, mean: Array, variance: Array) -> Array:
        """Logarithm of the probability that normal laws over groups give each limit, (m, n)."""
        spread = np.sqrt(variance[:, None] + self.width**2)
        return np.asarray(log_ndtr(self.side * (mean[:, None] - self.place) / spread))

    def log_likelihood(self, mean: Array, variance: Array) -> tuple[Array, Array, Array]:
        """Of normal laws over groups: its logarithm, and its slope and bend by their means, (m,) each."""
        if not self.place.size:
            return np.zeros_like(mean), np.zeros_like(mean), np.zeros_like(mean)
        spread = np.sqrt(variance[:, None] + self.width**2)
        z = self.side * (mean[:, None] - self.place) / spread
        log_p = log_ndtr(z)
        mills = np.exp(-0.5 * z * z - log_p) / math.sqrt(2.0 * math.pi)
        first = self.count * self.side * mills / spread
        second = -self.count * mills * (mills + z) / spread**2
        return (self.count * log_p).sum(axis=1), first.sum(axis=1), second.sum(axis=1)


class MostlyOpen(NamedTuple):
    """A constant of which more groups give a limit than a value: of these there is no population.

    Attributes
    ----------
    name : str
    determined, limits : int
        How many groups determine it, and leave it open on one side.
    """

    name: str
    determined: int
    limits: int
