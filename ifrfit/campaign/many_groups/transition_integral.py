"""Posterior of many small groups at once, in closed form but for the transition.

With known noise, uniform priors and a closure whose transition does not depend on its constant, kappa alone
decides which impacts slide. Given kappa the closure constant c is a normal law cut off at its bounds; e_n is
independent of both, but for the Jacobian 1/(1 + e_n) of mu = kappa/(1 + e_n). So the posterior is an integral
over kappa, smooth between the transitions at the measured tau, times one over e_n. Groups that this does not
settle with digits to spare are for the general code.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from ifrfit.campaign.many_groups.curvature import Curvature
from ifrfit.campaign.many_groups.kappa_support import KappaSupport
from ifrfit.campaign.many_groups.laws import (
    NODES,
    WEIGHTS,
    ConstantLaw,
    FrictionLaw,
    GroupLaw,
    KappaLaw,
    RestitutionLaw,
)
from ifrfit.campaign.many_groups.of_groups import OfGroups
from ifrfit.campaign.many_groups.open_friction import laws_up_to, plateau_nodes
from ifrfit.campaign.many_groups.profiles import LIMITS, GroupProfiles
from ifrfit.campaign.many_groups.sticking_sets import GroupOptima, StickingSets
from ifrfit.campaign.many_groups.values import Restitution, Tangential, total
from ifrfit.inference.diagnostics.thresholds import HALF
from ifrfit.inference.distributions.protocol import LEVELS
from ifrfit.inference.model.parameters import Domain
from ifrfit.inference.profile.intervals import marginal_of_profile
from ifrfit.inference.result.types import Estimate
from ifrfit.inference.summary.estimates import reached_bounds
from ifrfit.inference.summary.status import Known, estimate_of
from ifrfit.physics.impulse_laws import Coefficients

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]
Index = NDArray[np.intp]

E_N, OWN, MU, KAPPA = range(4)  # quantities; OWN is the closure constant
TAILS = (0.05, 0.32, 0.68, 0.95)  # levels of intervals that end at a bound

_CLEAR = (
    6.0,
    3.5,
    3.5,
    3.5,
)  # sd from a bound at which nothing is asked of it; the rule asks for less than 2
_STEPLESS = 0.6  # sd of kappa over that of e_n times mu
_NARROW = 0.9  # of the sd below which a constant counts as determined
_WIDEST = 0.6  # sd of a panel
_RESOLUTION = 0.02  # sd: from a bound to where a density is taken
_OUTSIDE = 4.0  # sd by which e_n or the closure constant, were they free, may lie outside their domains


@dataclass(frozen=True)
class GroupLikelihoods(OfGroups):
    """chi2 of many groups: its quadratics, its optimum, and where it is low.

    Attributes
    ----------
    sets : StickingSets
    optima : GroupOptima
    e_n : Restitution
    support : KappaSupport
    curvature : Curvature
    domains : tuple of Domain
        Of e_n, the closure constant, mu and kappa.
    """

    sets: StickingSets
    optima: GroupOptima
    e_n: Restitution
    support: KappaSupport
    curvature: Curvature
    domains: tuple[Domain, ...]

    @classmethod
    def of(
        cls, tangential: Tangential, e_n: Restitution, law: Coefficients, domains: Sequence[Domain]
    ) -> GroupLikelihoods:
        """From the values of each group; `law` with b1 = 0."""
        own = domains[OWN].lower, domains[OWN].upper
        with np.errstate(all="ignore"):  # what is not finite is not resolved
            sets = StickingSets.of(tangential, law)
            optima = sets.minima(own)
            support = KappaSupport.of(sets, optima, own, domains[KAPPA].prior_upper)
            curvature = Curvature.of(optima, e_n, domains)
        return cls(sets, optima, e_n, support, curvature, tuple(domains))

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
            found &= (self.e_n.outside < _OUTSIDE) & (optima.beyond < _OUTSIDE)
            found &= (curvature.is_local | curvature.is_open).all(axis=1) & curvature.is_local[:, E_N]
        return np.asarray(found)

    @property
    def optimum(self) -> Array:
        """Of e_n, the closure constant, mu and kappa, (groups, 4)."""
        e_n, kappa = self.e_n.best, self.optima.kappa
        return np.stack((e_n, self.optima.constant, kappa / (1.0 + e_n), kappa), axis=1)

    def left_open(self) -> LeftOpen:
        """What profiles say of quantities that the curvature leaves open, where that is no value."""
        of = {OWN: GroupProfiles.of_constant, MU: GroupProfiles.of_mu, KAPPA: GroupProfiles.of_kappa}
        found: dict[tuple[int, int], Estimate] = {}
        failed = np.zeros(self.e_n.mean.size, dtype=bool)
        for quantity, ends in of.items():
            groups = np.flatnonzero(self.curvature.is_open[:, quantity])
            if not groups.size:
                continue
            some = self.of_groups(groups)
            with np.errstate(all="ignore"):
                below = ends(GroupProfiles.of(some.sets, some.optima, some.own, some.e_n))
            failed[groups] |= np.isnan(below).any(axis=(1, 2))
            optimum, is_seen = some.optimum[:, quantity], some.curvature.is_finite[:, quantity]
            for group, own, value, seen in zip(groups, below, optimum, is_seen, strict=True):
                estimate = _of_profile(self.domains[quantity], own, float(value), bool(seen))
                if estimate.value is None:  # else the posterior says more
                    found[int(group), quantity] = estimate
        return LeftOpen(found, failed)


class LeftOpen(NamedTuple):
    """Estimates without a value, by group and quantity, and in which groups profiles came to no end."""

    estimates: Mapping[tuple[int, int], Estimate]
    failed: Bool


def _of_profile(domain: Domain, below: Array, optimum: float, is_seen: bool) -> Estimate:
    """What a profile says of a quantity by the ends of what lies below each of `LIMITS`, (4, 2)."""
    hulls = dict(zip(LIMITS, map(tuple, below.tolist()), strict=True))
    ends = domain.lower, domain.upper
    return estimate_of(
        domain, marginal_of_profile(ends, optimum, math.inf, hulls.__getitem__), Known(seen=is_seen)
    )


@dataclass(frozen=True)
class GroupPosteriors:
    """What was found of each group; (groups,) each.

    Attributes
    ----------
    likelihoods : GroupLikelihoods
    resolved : ndarray of bool
        Whether it was settled; the others are for the general code.
    clear : ndarray of bool, (groups, 4)
        Whether e_n, the closure constant, mu and kappa are determined beyond doubt.
    left_open : mapping
        Estimates without a value, by group and quantity.
    sd : ndarray, (groups, 4)
    quantiles : ndarray, (groups, 4, 5)
        At `LEVELS`; nan of what is left open.
    correlation : ndarray, (groups, 3, 3)
        Of e_n, the closure constant and mu.
    reached : ndarray of bool, (groups, 4, 2)
        Whether the 95 % region of what is not clear reaches the lower, and the upper end of its domain.
    tails : ndarray, (groups, 4, 4)
        Quantiles at `TAILS` where it reaches one of them; else nan.
    """

    likelihoods: GroupLikelihoods
    resolved: Bool
    clear: Bool
    left_open: Mapping[tuple[int, int], Estimate]
    sd: Array
    quantiles: Array
    correlation: Array
    reached: Bool
    tails: Array


@dataclass(frozen=True)
class Integration:
    """How the integral over kappa is done, and for which groups.

    Attributes
    ----------
    panels : int
        Besides those that end at transitions.
    is_open : bool
        Whether kappa has mass up to the end of its domain.
    """

    panels: int
    is_open: bool

    def suits(self, likelihoods: GroupLikelihoods) -> Bool:
        """Which groups it is for, (groups,)."""
        support = likelihoods.support
        kind = support.is_open if self.is_open else support.is_closed
        with np.errstate(invalid="ignore"):
            narrow = (support.high - support.low) < _WIDEST * self.panels * support.sd
        return np.asarray(likelihoods.is_certain & kind & narrow)


# what most groups need, first
INTEGRATIONS = tuple(Integration(panels, is_open) for panels in (44, 88, 176) for is_open in (False, True))


def group_posteriors(likelihoods: GroupLikelihoods, how: Integration) -> GroupPosteriors:
    """Posterior of each group.

    Parameters
    ----------
    likelihoods : GroupLikelihoods
        Of groups that suit the way of integration.
    how : Integration
    """
    most, own_domain, e_n = likelihoods.most, likelihoods.own, likelihoods.e_n
    with np.errstate(all="ignore"):  # what is not finite is not resolved
        restitution = RestitutionLaw.made(e_n.mean, e_n.sd, e_n.domain)
        beyond = most * (1.0 + plateau_nodes(restitution)) if how.is_open else None
        grid = _Panels.of(likelihoods, how.panels, beyond)
        kappa = KappaLaw.made(grid.edges, grid.nodes, grid.density)
        own = ConstantLaw.made(grid.middle, grid.width, grid.height, own_domain)
        if how.is_open:
            laws, correlation = laws_up_to(most, restitution, own, kappa, grid.nodes, grid.density)
        else:
            mu = FrictionLaw.made(kappa, restitution)
            laws = (restitution, own.without_small_ones(), mu, kappa)
            correlation = _correlation(restitution, own, mu, kappa, grid)
        sd = np.stack([each.sd for each in laws], axis=1)
        left = likelihoods.left_open()
        asked = np.ones(sd.shape, dtype=bool)
        asked[*_places(left.estimates)] = False
        quantiles = _quantiles(laws, np.array(LEVELS), asked)
        resolved = ~left.failed & np.isfinite(sd).all(axis=1)
        resolved &= (np.isfinite(quantiles).all(axis=2) | ~asked).all(axis=1)
        # beyond, mass of mu ends at its domain for some e_n only
        resolved &= likelihoods.support.high < most * (1.0 + restitution.low)
        # the nodes of e_n would see steps where kappa is known much better
        resolved &= kappa.sd > _STEPLESS * laws[MU].mean * e_n.sd
        clear = np.stack(
            [_is_clear(sd, quantiles, likelihoods.domains, one) for one in range(len(laws))], axis=1
        )
        clear &= likelihoods.curvature.is_local
        asked &= resolved[:, None] & ~clear
        reached, tails = _at_ends(laws, likelihoods.domains, asked)
    return GroupPosteriors(
        likelihoods, resolved, clear, left.estimates, sd, quantiles, correlation, reached, tails
    )


def _places(estimates: Mapping[tuple[int, int], Estimate]) -> tuple[Index, Index]:
    """Groups and quantities."""
    groups, quantities = np.array(list(estimates), dtype=np.intp).reshape(-1, 2).T
    return groups, quantities


def _quantiles(laws: Sequence[GroupLaw], levels: Array, asked: Bool) -> Array:
    """Quantiles of laws, (groups, quantities, levels), where they are asked for; else nan."""
    found = np.full((*asked.shape, levels.size), np.nan)
    for quantity, law in enumerate(laws):
        groups = np.flatnonzero(asked[:, quantity])
        if groups.size:
            found[groups, quantity] = law.of_groups(groups).quantiles(levels)
    return found


def _at_ends(laws: Sequence[GroupLaw], domains: Sequence[Domain], asked: Bool) -> tuple[Bool, Array]:
    """Which ends of the domain laws reach, (groups, 4, 2), and quantiles at `TAILS`, (groups, 4, 4)."""
    reached = np.zeros((*asked.shape, 2), dtype=bool)
    for quantity, (every, domain) in enumerate(zip(laws, domains, strict=True)):
        groups = np.flatnonzero(asked[:, quantity])
        law = every.of_groups(groups)

        def below(x: Array, some: Index, law: GroupLaw = law) -> Array:
            share, _ = law.of_groups(some).below(x)
            return share

        if groups.size:
            bounds = domain.lower, domain.prior_upper
            reached[groups, quantity] = reached_bounds(law.mean, law.sd, bounds, _RESOLUTION, below)
    return reached, _quantiles(laws, np.array(TAILS), reached.sum(axis=2) == 1)


def _is_clear(sd: Array, quantiles: Array, domains: Sequence[Domain], quantity: int) -> Bool:
    """Whether a quantity is determined beyond doubt: narrow, and far from its bounds."""
    bounds = domains[quantity]
    middle, away = quantiles[:, quantity, 2], _CLEAR[quantity] * sd[:, quantity]
    inside = (middle - away > bounds.lower) & (middle + away < min(bounds.upper, bounds.prior_upper))
    return np.asarray(inside & (sd[:, quantity] < _NARROW * HALF * bounds.prior_sd))


@dataclass(frozen=True)
class _Panels:
    """Nodes in kappa, and what the closure constant is there.

    Attributes
    ----------
    edges : ndarray, (groups, panels + 1)
    nodes : ndarray, (groups, panels, 6)
    density : ndarray, (groups, panels, 6)
        Of kappa, over the whole mass.
    middle, width : ndarray, (groups, panels, 6)
        Of the normal law of the closure constant given kappa.
    height : ndarray, (groups, panels, 6)
        Mass of each node over what its normal law holds between the bounds.
    """

    edges: Array
    nodes: Array
    density: Array
    middle: Array
    width: Array
    height: Array

    @classmethod
    def of(cls, likelihoods: GroupLikelihoods, panels: int, beyond: Array | None = None) -> _Panels:
        """Panels between the ends, and between the edges beyond, (groups, m), where there are some."""
        sets, domain = likelihoods.sets, likelihoods.own
        low, high = likelihoods.support.low, likelihoods.support.high
        inside = (sets.walls > low[:, None]) & (sets.walls < high[:, None])
        most = int(inside.sum(axis=1).max(initial=0))
        kinks = np.sort(np.where(inside, sets.walls, np.inf), axis=1)[:, :most]
        even = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, panels + 1)
        edges = np.sort(np.minimum(np.concatenate((kinks, even), axis=1), high[:, None]), axis=1)
        edges = edges if beyond is None else np.concatenate((edges, beyond), axis=1)
        half = 0.5 * np.diff(edges, axis=1)
        middle = edges[:, :-1] + half
        nodes = middle[:, :, None] + half[:, :, None] * NODES
        cell = (sets.walls[:, None, 1:-1] < middle[:, :, None]).sum(axis=2)
        f = [np.take_along_axis(form, cell, axis=1)[:, :, None] for form in sets.coefficients]
        own = -(f[1] + f[4] * nodes) / (2.0 * f[3])
        width = np.broadcast_to(1.0 / np.sqrt(f[3]), own.shape)
        chi2 = f[0] + f[2] * nodes + f[5] * nodes**2 - f[3] * own**2
        height = width * np.exp(-0.5 * (chi2 - likelihoods.optima.chi2[:, None, None]))
        between = ndtr((domain[1] - own) / width) - ndtr((domain[0] - own) / width)
        weights = half[:, :, None] * WEIGHTS
        mass = total(weights * height * between)[:, None, None]
        density = height * between / mass
        return cls(edges, nodes, density, own, width, weights * height / mass)


def _correlation(
    restitution: RestitutionLaw, own: ConstantLaw, mu: FrictionLaw, kappa: KappaLaw, grid: _Panels
) -> Array:
    """Correlations of e_n, the closure constant and mu = kappa/(1 + e_n), (groups, 3, 3)."""
    nodes = grid.nodes.reshape(kappa.mean.size, -1)
    with_kappa = total(own.node_means * (nodes - kappa.mean[:, None]))
    inverse = restitution.mass / (1.0 + restitution.nodes)
    with_e_n = kappa.mean * (inverse * (restitution.nodes - restitution.mean[:, None])).sum(axis=1)
    found = np.tile(np.eye(3), (kappa.mean.size, 1, 1))
    found[:, OWN, MU] = found[:, MU, OWN] = with_kappa * inverse.sum(axis=1) / (own.sd * mu.sd)
    found[:, E_N, MU] = found[:, MU, E_N] = with_e_n / (restitution.sd * mu.sd)
    return found
