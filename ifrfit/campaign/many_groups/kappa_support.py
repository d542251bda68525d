"""Where kappa has its mass in each of many groups: from where to where an integral has to go."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.campaign.many_groups.of_groups import OfGroups
from ifrfit.campaign.many_groups.sticking_sets import GroupOptima, StickingSets

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]

_NEAR = 48.0  # of chi2 above the best within which the sharpness of kappa is looked at
_LOST = math.log(1e-6)  # of the variance of kappa, at most, beyond where the mass ends
_HALVINGS = 30
_BESIDE = 3.0  # sd from the least of a set, and from a bound of the closure constant


@dataclass(frozen=True)
class KappaSupport(OfGroups):
    """Between which kappa has its mass, (groups,) each.

    Attributes
    ----------
    low, high : ndarray
        Low is 0 where the density has not come to its end there. High, where it is open above, is the
        highest transition: kappa has a plateau from there on.
    sd : ndarray
        Least sd of kappa between them.
    is_closed, is_open : ndarray of bool
        Whether the upper end is inside the domain, or not.
    """

    low: Array
    high: Array
    sd: Array
    is_closed: Bool
    is_open: Bool

    @classmethod
    def of(
        cls, sets: StickingSets, optima: GroupOptima, domain: tuple[float, float], highest: float
    ) -> KappaSupport:
        """Ends where kappa may be `highest` at most."""
        _, _, _, f3, f4, f5 = sets.coefficients
        low, high = sets.walls[:, :-1], sets.walls[:, 1:]
        best, inner = optima.chi2, optima.places
        # how sharply a set's chi2 rises with kappa: where a bound holds the closure constant, more so
        bend = f5 - f4**2 / (4.0 * f3)
        aside = inner + np.array([[[-1.0]], [[0.0]], [[1.0]]]) * _BESIDE / np.sqrt(bend)
        own = -(sets.coefficients[1] + f4 * np.clip(aside, low, high)) / (2.0 * f3)
        away = np.minimum(own - domain[0], domain[1] - own) * np.sqrt(f3)
        bend = np.where((away < _BESIDE).any(axis=0), f5, bend)
        sd = 1.0 / np.sqrt(np.where(optima.least < best[:, None] + _NEAR, bend, 0.0).max(axis=1))
        # a plateau as long as all that kappa may be, and what it adds to the variance
        above = 2.0 * (3.0 * np.log(highest / sd) - _LOST)
        edge = (best + above)[:, None]
        holds = optima.least < edge
        first, last = holds.argmax(axis=1), holds.shape[1] - 1 - holds[:, ::-1].argmax(axis=1)
        found = []
        for cell, walls in ((first, low), (last, high)):
            forms = np.take_along_axis(sets.forms, cell[:, None, None], axis=2)
            own = StickingSets(sets.walls, sets.count, forms)
            far, near = (np.take_along_axis(each, cell[:, None], axis=1) for each in (walls, inner))
            for _ in range(_HALVINGS):
                half = 0.5 * (far + near)
                is_far = own.at(half, domain) > edge
                far, near = np.where(is_far, half, far), np.where(is_far, near, half)
            found.append(far[:, 0])
        proper, is_open = holds.any(axis=1), last >= sets.count
        from_zero = (sets.at(low, domain)[:, :1] <= edge)[:, 0]
        top = np.take_along_axis(sets.walls, sets.count[:, None], axis=1)[:, 0]
        return cls(
            low=np.where(from_zero, 0.0, found[0]),
            high=np.where(is_open, top, found[1]),
            sd=sd,
            is_closed=proper & ~is_open,
            is_open=proper & is_open,
        )
