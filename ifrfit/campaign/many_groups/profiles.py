"""Profiles of chi2 in many groups at once: where they cross a limit, in closed form but for the crossing.

What the data leave open has an interval of the profile, not of the posterior. In each set of sticking impacts
chi2 is convex, so that the least at a given kappa, closure constant or mu = kappa/(1 + e_n) is that of a
quadratic between two ends; and of all sets only those count that come near the best.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.campaign.many_groups.sticking_sets import GroupOptima, StickingSets
from ifrfit.campaign.many_groups.values import Restitution
from ifrfit.inference.profile.objective import limit

Array = NDArray[np.float64]
Index = NDArray[np.intp]

# of 68 and 95 %, of both tails, then of one
LIMITS = tuple(limit(level, one_sided=one) for one in (False, True) for level in (0.68, 0.95))
_EXACT = 1e-9  # relative error of a crossing
_FAR = 100.0  # rise that stands for all larger ones

Rise = Callable[[Array, Index], Array]  # of values in groups, (n,) each


@dataclass(frozen=True)
class GroupProfiles:
    """Rise of chi2 above the least, in the sets of sticking impacts that come near it.

    Attributes
    ----------
    low, high : ndarray, (groups, k)
        Between which kappa lies in a set; `high` is infinite where every impact sticks.
    forms : ndarray, (6, groups, k)
        As `StickingSets` has them, less the least chi2.
    least : ndarray, (groups, k)
        Least rise of a set, infinite where there are no more sets.
    kappas, constants : ndarray, (groups, k)
        Where it is.
    own : (float, float)
        Domain of the closure constant.
    e_n : Restitution
    """

    low: Array
    high: Array
    forms: Array
    least: Array
    kappas: Array
    constants: Array
    own: tuple[float, float]
    e_n: Restitution

    @classmethod
    def of(
        cls, sets: StickingSets, optima: GroupOptima, own: tuple[float, float], e_n: Restitution
    ) -> GroupProfiles:
        """From the sets of each group and the least chi2 of each."""
        best, least, places = optima.chi2[:, None], optima.least, optima.places
        rise = least - best
        most = int((rise <= max(LIMITS)).sum(axis=1).max(initial=1))
        nearest = np.sort(np.argsort(rise, axis=1, kind="stable")[:, :most], axis=1)

        def near(values: Array) -> Array:
            return np.take_along_axis(values, nearest, axis=1)

        forms = np.stack([near(form) for form in sets.coefficients])
        forms[0] -= best
        kappas, constants = near(places), near(sets.constant(places, own))
        walls = near(sets.walls[:, :-1]), near(sets.walls[:, 1:])
        return cls(*walls, forms, near(rise), kappas, constants, own, e_n)

    def of_constant(self) -> Array:
        """Ends of what lies below each of `LIMITS`, (groups, 4, 2), for the closure constant."""

        def rise(c: Array, groups: Index) -> Array:
            f0, f1, f2, f3, f4, f5 = self.forms[:, groups]
            low, c = self.low[groups], c[:, None]
            kappa = -(f2 + f4 * c) / (2.0 * f5)
            kappa = np.clip(np.where(np.isfinite(kappa), kappa, low), low, self.high[groups])
            value = f0 + f1 * c + f2 * kappa + f3 * c**2 + f4 * c * kappa + f5 * kappa**2
            return self._least(value, groups)

        ends = (np.full(self.least.shape[0], end) for end in self.own)
        return self._between(rise, self.constants, *ends)

    def of_kappa(self) -> Array:
        """Likewise for kappa."""

        def rise(kappa: Array, groups: Index) -> Array:
            kappa = kappa[:, None]
            value = self._at(kappa, groups)
            inside = (kappa >= self.low[groups]) & (kappa <= self.high[groups])
            return self._least(np.where(inside, value, np.inf), groups)

        return self._between(rise, self.kappas, *self._ends, has_end=False)

    def of_mu(self) -> Array:
        """Likewise for mu, with e_n at its best: kappa = mu (1 + e_n) is linear in it."""

        def rise(mu: Array, groups: Index) -> Array:
            _, f1, f2, f3, f4, f5 = self.forms[:, groups]
            low, high, mu = self.low[groups], self.high[groups], mu[:, None]
            mean, weight = self.e_n.mean[groups, None], self.e_n.sd[groups, None] ** -2.0

            def best(slope: Array, bend: Array) -> Array:
                """The e_n of the least slope kappa + bend kappa^2 + E(e_n)."""
                return (mean * weight - 0.5 * slope * mu - bend * mu**2) / (bend * mu**2 + weight)

            e_n = best(f2 - f1 * f4 / (2.0 * f3), f5 - f4**2 / (4.0 * f3))
            c = -(f1 + f4 * mu * (1.0 + e_n)) / (2.0 * f3)
            end = np.clip(c, *self.own)  # the least in the domain lies at this end
            e_n = np.where(end == c, e_n, best(f2 + f4 * end, f5))
            first = np.where(low > 0.0, np.maximum(low / mu - 1.0, self.e_n.domain[0]), self.e_n.domain[0])
            last = np.minimum(high / mu - 1.0, self.e_n.domain[1])
            e_n = np.clip(e_n, first, last)
            value = self._at(mu * (1.0 + e_n), groups) + weight * (e_n - mean) ** 2
            return self._least(np.where(first <= last, value, np.inf), groups) - base[groups]

        base = self.e_n.chi2 - self.e_n.square
        places = self.kappas / (1.0 + self.e_n.best[:, None])
        lower, upper = self._ends
        ends = lower / (1.0 + self.e_n.domain[1]), upper / (1.0 + self.e_n.domain[0])
        return self._between(rise, places, *ends, has_end=False)

    @property
    def _ends(self) -> tuple[Array, Array]:
        """kappa below and above which the rise exceeds all limits, or stays what it is, (groups,) each."""
        there = np.isfinite(self.least)
        lower = np.where(there, self.low, np.inf).min(axis=1)
        upper = np.where(np.isinf(self.high), self.low, self.high)
        return lower, np.where(there, upper, -np.inf).max(axis=1)

    def _at(self, kappa: Array, groups: Index) -> Array:
        """Rise at a kappa, with the closure constant at its best, (n, k)."""
        f0, f1, f2, f3, f4, f5 = self.forms[:, groups]
        c = np.clip(-(f1 + f4 * kappa) / (2.0 * f3), *self.own)
        return np.asarray(f0 + f1 * c + f2 * kappa + f3 * c**2 + f4 * c * kappa + f5 * kappa**2)

    def _least(self, value: Array, groups: Index) -> Array:
        """Least of the sets, (n,); far above the limits where there is none."""
        own = np.where(np.isfinite(self.least[groups]) & np.isfinite(value), value, _FAR)
        return np.asarray(np.minimum(own, _FAR).min(axis=1))

    def _between(
        self, rise: Rise, places: Array, lower: Array, upper: Array, *, has_end: bool = True
    ) -> Array:
        """Lowest and highest value below each limit, (groups, 4, 2).

        Parameters
        ----------
        rise : callable
        places : ndarray, (groups, k)
            Value at the least of each set.
        lower, upper : ndarray, (groups,)
            Ends of the domain, or where the rise is above all limits.
        has_end : bool
            Whether the domain ends at `upper`; else it is endless, with a plateau where every impact sticks.
        """
        groups = np.arange(lower.size)
        plateau = np.where(np.isinf(self.high), self.least, np.inf).min(axis=1)
        at_lower, at_upper = rise(lower, groups), rise(upper, groups)
        found = np.empty((lower.size, len(LIMITS), 2))
        brackets: list[tuple[int, int, Index, Array, Array]] = []
        for k, most in enumerate(LIMITS):
            inside = self.least <= most
            first = np.where(inside, places, np.inf).min(axis=1)
            last = np.where(inside, places, -np.inf).max(axis=1)
            found[:, k, 0] = lower
            found[:, k, 1] = upper if has_end else np.inf
            below = np.flatnonzero((at_lower > most) & (lower < first))
            above = np.flatnonzero(at_upper > most if has_end else (plateau > most))
            brackets += [(k, 0, below, first[below], lower[below]), (k, 1, above, last[above], upper[above])]
        self._cross(rise, brackets, found)
        return found

    @staticmethod
    def _cross(rise: Rise, brackets: list[tuple[int, int, Index, Array, Array]], found: Array) -> None:
        """Write where the rise is a limit: its number, side, groups, values inside and values outside."""
        from scipy.optimize.elementwise import find_root  # 0.1 s, where the data leave something open

        numbers = np.concatenate([np.full(groups.size, k) for k, _, groups, _, _ in brackets])
        sides = np.concatenate([np.full(groups.size, side) for _, side, groups, _, _ in brackets])
        groups, inside, outside = (np.concatenate([each[i] for each in brackets]) for i in (2, 3, 4))
        if not groups.size:
            return
        root = np.sqrt(np.array(LIMITS))[numbers]

        def over(x: Array, group: Index, root: Array) -> Array:
            shape = x.shape
            return (np.sqrt(np.maximum(rise(x.ravel(), group.ravel()), 0.0)) - root.ravel()).reshape(shape)

        crossing = find_root(over, (inside, outside), args=(groups, root), tolerances={"xrtol": _EXACT})
        found[groups, numbers, sides] = np.where(crossing.success, crossing.x, np.nan)
