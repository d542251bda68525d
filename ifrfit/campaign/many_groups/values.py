"""The measured values of many groups, side by side: what knows the tangential impulse, and e_n."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.campaign.many_groups.of_groups import OfGroups

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True)
class Tangential(OfGroups):
    """Values of each group in the order of tau, (groups, most); the weight of what a group lacks is zero.

    Attributes
    ----------
    tau : ndarray
        Infinite where there is no value.
    factor : ndarray
        Impulse factor z = r/s that a value stands for.
    weight : ndarray
        s^2/sigma^2.
    """

    tau: Array
    factor: Array
    weight: Array


@dataclass(frozen=True)
class Restitution(OfGroups):
    """What the measured e_n say, as one value each: mean, sd and sum of squares about it, (groups,)."""

    mean: Array
    sd: Array
    square: Array
    domain: tuple[float, float]

    @classmethod
    def of(cls, e_n: Array, weight: Array, domain: tuple[float, float]) -> Restitution:
        """From values and sigma^-2, zero where a group lacks one, (groups, most) each."""
        whole = total(weight)
        mean = total(weight * e_n) / whole
        return cls(mean, 1.0 / np.sqrt(whole), total(weight * (e_n - mean[:, None]) ** 2), domain)

    @property
    def best(self) -> Array:
        """The best e_n in the domain."""
        return np.asarray(np.clip(self.mean, *self.domain))

    @property
    def inside(self) -> Array:
        """How far the mean lies from the nearer end of the domain, in sd."""
        return np.asarray(np.minimum(self.mean - self.domain[0], self.domain[1] - self.mean) / self.sd)

    @property
    def chi2(self) -> Array:
        """At the best."""
        return self.square + ((self.best - self.mean) / self.sd) ** 2


def padded(own: Index, groups: int, columns: Sequence[Array], fill: Sequence[float]) -> list[Array]:
    """Values of each group side by side, (groups, most); `own` does not decrease."""
    counts = np.bincount(own, minlength=groups)
    place = np.arange(own.size) - np.repeat(np.cumsum(counts) - counts, counts)
    found = []
    for column, empty in zip(columns, fill, strict=True):
        made = np.full((groups, int(counts.max(initial=1))), empty)
        made[own, place] = column
        found.append(made)
    return found


def total(values: Array) -> Array:
    """Sum of each group one value after the other: zeros, where other groups are longer, change no bit."""
    by_place = np.ascontiguousarray(values.reshape(values.shape[0], -1).T)
    if by_place.shape[1] == 1:  # would be summed in pairs
        return np.cumsum(by_place)[-1:]
    return np.asarray(np.add.reduce(by_place, axis=0))
