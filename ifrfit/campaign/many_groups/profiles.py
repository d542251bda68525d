"""Profiles of chi2 in many groups at once: where they cross a limit, in closed form but for the crossing.

What the data leave open has an interval of the profile, not of the posterior. In each set of sticking impacts
chi2 is convex, so that the least at a given kappa, closure constant or mu = kappa/(1 + e_n) is that of a
quadratic between two ends; and of all sets only those count that come near the best.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ifrfit.campaign.many_groups.quantities import KAPPA, MU, OWN
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
        rise = np.where(rise <= max(LIMITS), rise, np.inf)  # whatever other groups have room for
        most = int(np.isfinite(rise).sum(axis=1).max(initial=1))
        nearest = np.sort(np.argsort(rise, axis=1, kind="stable")[:, :most], axis=1)

        def near(values: Array) -> Array:
            return np.take_along_axis(values, nearest, axis=1)

        forms = np.stack([near(form) for form in sets.coefficients])
        forms[0] -= best
        kappas, constants = near(places), near(sets.constant(places, own))
        walls = near(sets.walls[:, :-1]), near(sets.walls[:, 1:])
        return cls(*walls, forms, near(rise), kappas, constants, own, e_n)

    def below(self, asked: Mapping[int, Index]) -> dict[int, Array]:
        """Ends of what lies below each of `LIMITS`, (n, 4, 2), for quantities in the groups asked for."""
        of = {OWN: self._of_constant, MU: self._of_mu, KAPPA: self._of_kappa}
        profiles = [of[quantity](groups) for quantity, groups in asked.items()]
        _cross(profiles)
        return {quantity: each.found for quantity, each in zip(asked, profiles, strict=True)}

    def _of_constant(self, groups: Index) -> _Profile:
        def rise(c: Array, groups: Index) -> Array:
            f0, f1, f2, f3, f4, f5 = self.forms[:, groups]
            low, c = self.low[groups], c[:, None]
            kappa = -(f2 + f4 * c) / (2.0 * f5)
            kappa = np.clip(np.where(np.isfinite(kappa), kappa, low), low, self.high[groups])
            value = f0 + f1 * c + f2 * kappa + f3 * c**2 + f4 * c * kappa + f5 * kappa**2
            return self._least(value, groups)

        ends = (np.full(groups.size, end) for end in self.own)
        return self._profile(rise, groups, self.constants, *ends)

    def _of_kappa(self, groups: Index) -> _Profile:
        def rise(kappa: Array, groups: Index) -> Array:
            kappa = kappa[:, None]
            value = self._at(kappa, groups)
            inside = (kappa >= self.low[groups]) & (kappa <= self.high[groups])
            return self._least(np.where(inside, value, np.inf), groups)

        return self._profile(rise, groups, self.kappas, *self._ends(groups), has_end=False)

    def _of_mu(self, groups: Index) -> _Profile:
        """With e_n at its best: kappa = mu (1 + e_n) is linear in it."""

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
        lower, upper = self._ends(groups)
        ends = lower / (1.0 + self.e_n.domain[1]), upper / (1.0 + self.e_n.domain[0])
        return self._profile(rise, groups, places, *ends, has_end=False)

    def _ends(self, groups: Index) -> tuple[Array, Array]:
        """kappa below and above which the rise exceeds all limits, or stays what it is, (n,) each."""
        there = np.isfinite(self.least[groups])
        low, high = self.low[groups], self.high[groups]
        upper = np.where(np.isinf(high), low, high)
        return np.where(there, low, np.inf).min(axis=1), np.where(there, upper, -np.inf).max(axis=1)

    def _at(self, kappa: Array, groups: Index) -> Array:
        """Rise at a kappa, with the closure constant at its best, (n, k)."""
        f0, f1, f2, f3, f4, f5 = self.forms[:, groups]
        c = np.clip(-(f1 + f4 * kappa) / (2.0 * f3), *self.own)
        return np.asarray(f0 + f1 * c + f2 * kappa + f3 * c**2 + f4 * c * kappa + f5 * kappa**2)

    def _least(self, value: Array, groups: Index) -> Array:
        """Least of the sets, (n,); far above the limits where there is none."""
        own = np.where(np.isfinite(self.least[groups]) & np.isfinite(value), value, _FAR)
        return np.asarray(np.minimum(own, _FAR).min(axis=1))

    def _profile(
        self, rise: Rise, groups: Index, places: Array, lower: Array, upper: Array, *, has_end: bool = True
    ) -> _Profile:
        """What is known before any search.

        Parameters
        ----------
        rise : callable
        groups : ndarray, (n,)
        places : ndarray, (all groups, k)
            Value at the least of each set.
        lower, upper : ndarray, (n,)
            Ends of the domain, or where the rise is above all limits.
        has_end : bool
            Whether the domain ends at `upper`; else it is endless, with a plateau where every impact sticks.
        """
        least, places = self.least[groups], places[groups]
        plateau = np.where(np.isinf(self.high[groups]), least, np.inf).min(axis=1)
        at_lower, at_upper = rise(lower, groups), rise(upper, groups)
        found = np.empty((groups.size, len(LIMITS), 2))
        brackets: list[_Brackets] = []
        for k, most in enumerate(LIMITS):
            inside = least <= most
            first = np.where(inside, places, np.inf).min(axis=1)
            last = np.where(inside, places, -np.inf).max(axis=1)
            found[:, k, 0] = lower
            found[:, k, 1] = upper if has_end else np.inf
            below = np.flatnonzero((at_lower > most) & (lower < first))
            above = np.flatnonzero(at_upper > most if has_end else (plateau > most))
            brackets.append(_Brackets.of(k, 0, below, first[below], lower[below]))
            brackets.append(_Brackets.of(k, 1, above, last[above], upper[above]))
        return _Profile(
            rise, groups, _Brackets(*(np.concatenate(each) for each in zip(*brackets, strict=True))), found
        )


class _Brackets(NamedTuple):
    """Between which values the rise crosses a limit: numbers of limit, side and row, inside and outside."""

    limit: Index
    side: Index
    row: Index
    inside: Array
    outside: Array

    @classmethod
    def of(cls, limit: int, side: int, row: Index, inside: Array, outside: Array) -> _Brackets:
        """Of one side of one limit, (m,) each."""
        return cls(np.full(row.size, limit), np.full(row.size, side), row, inside, outside)


class _Profile(NamedTuple):
    """The rise of chi2 with one quantity, in which groups, and the ends of what lies below each limit."""

    rise: Rise
    groups: Index
    brackets: _Brackets
    found: Array  # (n, 4, 2)


def _cross(profiles: Sequence[_Profile]) -> None:
    """Write where each rise is a limit, by one search for all of them: steps cost more than places."""
    limit, side, row, inside, outside = (
        np.concatenate(each) for each in zip(*(each.brackets for each in profiles), strict=True)
    )
    if not row.size:
        return
    from scipy.optimize.elementwise import find_root  # 0.1 s, where the data leave something open

    sizes = [each.brackets.row.size for each in profiles]
    which = np.repeat(np.arange(len(profiles)), sizes)
    groups = np.concatenate([each.groups[each.brackets.row] for each in profiles])
    root = np.sqrt(np.array(LIMITS))[limit]

    def over(x: Array, which: Index, groups: Index, root: Array) -> Array:
        found = np.empty_like(x)
        for k, each in enumerate(profiles):
            own = which == k
            if own.any():
                found[own] = np.sqrt(np.maximum(each.rise(x[own], groups[own]), 0.0)) - root[own]
        return found

    crossing = find_root(over, (inside, outside), args=(which, groups, root), tolerances={"xrtol": _EXACT})
    at = np.where(crossing.success, crossing.x, np.nan)
    for k, each in enumerate(profiles):
        own = which == k
        each.found[row[own], limit[own], side[own]] = at[own]
