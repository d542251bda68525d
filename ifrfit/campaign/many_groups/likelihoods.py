"""chi2 of many groups: its quadratics, its certified optimum, and what of the constants it leaves open."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.campaign.many_groups.curvature import Curvature
from ifrfit.campaign.many_groups.kappa_support import KappaSupport
from ifrfit.campaign.many_groups.of_groups import OfGroups
from ifrfit.campaign.many_groups.profiles import LIMITS, GroupProfiles
from ifrfit.campaign.many_groups.quantities import E_N, KAPPA, MU, OWN
from ifrfit.campaign.many_groups.sticking_sets import GroupOptima, StickingSets
from ifrfit.campaign.many_groups.values import Restitution, Tangential, total
from ifrfit.inference.model.parameters import Domain
from ifrfit.inference.optimize.least_squares import NO_DIGITS
from ifrfit.inference.profile.intervals import marginal_of_profile
from ifrfit.inference.result.types import Estimate
from ifrfit.inference.summary.status import Known, estimate_of
from ifrfit.physics.impulse_laws import Coefficients

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]

_PROFILED = (OWN, MU, KAPPA)
_LOST = 1e-4  # of chi2, that rounding may take from sums of squares: some 1e-5 sd of what is found
_OUTSIDE = 4.0  # sd by which e_n or the closure constant, were they free, may lie outside their domains


@dataclass(frozen=True)
class PlainLikelihoods(OfGroups):
    """chi2 of many groups: its quadratics, its optimum, and where it is low.

    Attributes
    ----------
    sets : StickingSets
    optima : GroupOptima
    e_n : Restitution
    support : KappaSupport
    curvature : Curvature
    chi2 : ndarray, (groups,)
        Of all values at the optimum, from their residuals: sums of squares lose digits that it has.
    domains : tuple of Domain
        Of e_n, the closure constant, mu and kappa.
    """

    sets: StickingSets
    optima: GroupOptima
    e_n: Restitution
    support: KappaSupport
    curvature: Curvature
    chi2: Array
    domains: tuple[Domain, ...]

    @classmethod
    def of(
        cls, tangential: Tangential, e_n: Restitution, law: Coefficients, domains: Sequence[Domain]
    ) -> PlainLikelihoods:
        """From the values of each group; `law` with b1 = 0."""
        own = domains[OWN].lower, domains[OWN].upper
        with np.errstate(all="ignore"):  # what is not finite is not resolved
            sets = StickingSets.of(tangential, law)
            optima = sets.minima(own)
            support = KappaSupport.of(sets, optima, own, domains[KAPPA].prior_upper)
            curvature = Curvature.of(optima, e_n, domains)
            friction = np.minimum(law.b0, optima.kappa[:, None] / tangential.tau)
            left = tangential.factor - (law.a0 + law.a1 * optima.constant[:, None] + friction)
            chi2 = total(tangential.weight * left**2) + e_n.chi2
        return cls(sets, optima, e_n, support, curvature, chi2, tuple(domains))

    @property
    def own(self) -> tuple[float, float]:
        """Domain of the closure constant."""
        return self.domains[OWN].lower, self.domains[OWN].upper

    @property
    def most(self) -> float:
        """Where the default prior of mu ends."""
        return self.domains[MU].prior_upper

    @property
    def is_certain(self) -> Bool:
        """Whether chi2 leaves no doubt for what is to follow, (groups,)."""
        optima, curvature = self.optima, self.curvature
        with np.errstate(all="ignore"):
            found = (optima.kappa > 0.0) & optima.is_unique & np.isfinite(self.e_n.sd)
            found &= (self.e_n.inside > -_OUTSIDE) & (optima.beyond < _OUTSIDE)
            found &= curvature.is_local[:, E_N] & (self.chi2 < NO_DIGITS)
            found &= np.finfo(float).eps * self.sets.coefficients[0].max(axis=1) < _LOST
        return np.asarray(found)

    @property
    def optimum(self) -> Array:
        """Of e_n, the closure constant, mu and kappa, (groups, 4)."""
        e_n, kappa = self.e_n.best, self.optima.kappa
        return np.stack((e_n, self.optima.constant, kappa / (1.0 + e_n), kappa), axis=1)

    def left_open(self) -> LeftOpen:
        """What profiles say of quantities that the curvature leaves open, where that is no value.

        Where it is a matter of digits whether it leaves one open, a profile that gives a value decides
        nothing.
        """
        asked_for, is_open = ~self.curvature.is_local, self.curvature.is_open
        found = np.full(is_open.shape, None, dtype=object)
        failed = np.zeros(is_open.shape[0], dtype=bool)
        groups = np.flatnonzero(asked_for[:, _PROFILED].any(axis=1))
        if not groups.size:
            return LeftOpen(found, failed)
        some = self.of_groups(groups)
        asked = {quantity: np.flatnonzero(asked_for[groups, quantity]) for quantity in _PROFILED}
        with np.errstate(all="ignore"):
            below = GroupProfiles.of(some.sets, some.optima, some.own, some.e_n).below(asked)
        for quantity, rows in asked.items():
            failed[groups[rows]] |= np.isnan(below[quantity]).any(axis=(1, 2))
            optimum, is_seen = some.optimum[rows, quantity], some.curvature.is_finite[rows, quantity]
            for group, own, value, seen in zip(groups[rows], below[quantity], optimum, is_seen, strict=True):
                estimate = _of_profile(self.domains[quantity], own, float(value), bool(seen))
                if estimate.value is None:  # else the posterior says more
                    found[group, quantity] = estimate
                    failed[group] |= not is_open[group, quantity]
        return LeftOpen(found, failed)


@dataclass(frozen=True)
class LeftOpen(OfGroups):
    """What profiles say of quantities that have no value.

    Attributes
    ----------
    estimates : ndarray of Estimate or None, (groups, 4)
    failed : ndarray of bool, (groups,)
        Where profiles came to no end, or something is open by a matter of digits.
    """

    estimates: NDArray[np.object_]
    failed: Bool

    @property
    def is_open(self) -> Bool:
        """Whether a quantity has no value, (groups, 4)."""
        return np.asarray(self.estimates != None, dtype=bool)  # noqa: E711 - of each element


def _of_profile(domain: Domain, below: Array, optimum: float, is_seen: bool) -> Estimate:
    """What a profile says of a quantity by the ends of what lies below each of `LIMITS`, (4, 2)."""
    hulls = dict(zip(LIMITS, map(tuple, below.tolist()), strict=True))
    ends = domain.lower, domain.upper
    return estimate_of(
        domain, marginal_of_profile(ends, optimum, math.inf, hulls.__getitem__), Known(seen=is_seen)
    )
