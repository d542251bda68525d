"""Posterior of many small groups at once, in closed form but for the transition.

With known noise, uniform priors and a closure whose transition does not depend on its constant, kappa alone
decides which impacts slide. Given kappa the closure constant c is a normal law cut off at its bounds; e_n is
independent of both, but for the Jacobian 1/(1 + e_n) of mu = kappa/(1 + e_n). So the posterior is an integral
over kappa, smooth between the transitions at the measured tau, times one over e_n. Groups that this does not
settle with digits to spare, as where mu has no upper end, are for the general code.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from ifrfit.campaign.group_laws import (
    NODES,
    WEIGHTS,
    ConstantLaw,
    FrictionLaw,
    GroupLaw,
    KappaLaw,
    LawsOfOneGroup,
    RestitutionLaw,
    total,
)
from ifrfit.campaign.group_profiles import LIMITS, GroupProfiles, RestitutionMisfit
from ifrfit.campaign.open_friction import laws_up_to, plateau_nodes
from ifrfit.campaign.sticking_sets import GroupOptima, StickingSets, Tangential
from ifrfit.inference.diagnostics.thresholds import HALF
from ifrfit.inference.distributions.protocol import LEVELS
from ifrfit.inference.model.parameters import Domain
from ifrfit.physics.impulse_laws import Coefficients

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]
Index = NDArray[np.intp]

E_N, OWN, MU, KAPPA = range(4)  # quantities; OWN is the closure constant

_NEAR = 48.0  # of chi2 above the best within which the sharpness of kappa is looked at
_LOST = math.log(1e-6)  # of the variance of kappa, at most, beyond where the panels end
_CLEAR = (
    6.0,
    3.5,
    3.5,
    3.5,
)  # sd from a bound at which nothing is asked of it; the rule asks for less than 2
_STEPLESS = 0.6  # sd of kappa over that of e_n times mu
_NARROW = 0.9  # of the sd below which a constant counts as determined
_RIVAL_WIDTH = 1.25 * 1.959964  # sd about the optimum within which a rival needs no second look
_ROUNDED = 0.999  # of a width that is asked for: what lies nearer to it is for the general code
_WIDEST = 0.6  # sd of a panel
_OUTSIDE = 4.0  # sd by which e_n or the closure constant, were they free, may lie outside their domains


@dataclass(frozen=True)
class GroupPosteriors:
    """What was found of each group; (groups,) each.

    Attributes
    ----------
    resolved : ndarray of bool
        Whether it was settled; the others are for the general code.
    clear : ndarray of bool, (groups, 4)
        Whether e_n, the closure constant, mu and kappa lie well inside their bounds.
    sliding : ndarray of int
        Impacts that slide at the certified optimum.
    chi2 : ndarray
        Of the optimum.
    of_profile : ndarray of bool, (groups, 4)
        Whether the profile says what the data leave of a quantity: the curvature at the optimum does not fix
        it, or a rival lies far from it.
    is_curved : ndarray of bool, (groups, 4)
        Whether there is a curvature at the optimum.
    below : ndarray, (groups, 4, 4, 2)
        Ends of what lies below each of `LIMITS` in the profile of a quantity that is asked for; else nan.
    optimum : ndarray, (groups, 4)
        Of e_n, the closure constant, mu and kappa.
    sd : ndarray, (groups, 4)
    quantiles : ndarray, (groups, 4, 5)
        At `LEVELS`.
    correlation : ndarray, (groups, 3, 3)
        Of e_n, the closure constant and mu.
    laws : tuple of GroupLaw
        Of each quantity.
    """

    resolved: Bool
    clear: Bool
    sliding: Index
    chi2: Array
    of_profile: Bool
    is_curved: Bool
    below: Array
    optimum: Array
    sd: Array
    quantiles: Array
    correlation: Array
    laws: tuple[GroupLaw, ...]

    def laws_of(self, group: int) -> LawsOfOneGroup:
        """The laws of one group, each called by the number of its quantity."""
        return LawsOfOneGroup({str(k): law.of(np.array([group])) for k, law in enumerate(self.laws)})


@dataclass(frozen=True)
class GroupValues:
    """The measured values of each group.

    Attributes
    ----------
    tangential : Tangential
    e_n, e_n_weight : ndarray, (groups, most)
        Of e_n, and sigma^-2, zero where a group lacks one.
    """

    tangential: Tangential
    e_n: Array
    e_n_weight: Array

    def of(self, groups: Index) -> GroupValues:
        """The values of some groups."""
        return GroupValues(self.tangential.of(groups), self.e_n[groups], self.e_n_weight[groups])


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


# what most groups need, first
INTEGRATIONS = tuple(Integration(panels, is_open) for panels in (44, 176) for is_open in (False, True))


def group_posteriors(
    values: GroupValues, law: Coefficients, domains: Sequence[Domain], how: Integration
) -> GroupPosteriors:
    """Certified optimum and posterior of each group.

    Parameters
    ----------
    values : GroupValues
    law : Coefficients
        With b1 = 0.
    domains : sequence of Domain
        Of e_n, the closure constant, mu and kappa.
    how : Integration
        Groups that are not of its kind stay unresolved.
    """
    own_domain, e_domain = ((domains[one].lower, domains[one].upper) for one in (OWN, E_N))
    most = domains[MU].prior_upper
    with np.errstate(all="ignore"):  # what is not finite is not resolved
        sets = StickingSets.of(values.tangential, law)
        optima = sets.minima(own_domain)
        measured = RestitutionMisfit(*_normal(values.e_n, values.e_n_weight), *e_domain)
        e_hat, e_sd, e_best = measured.mean, measured.sd, measured.best
        restitution = RestitutionLaw.made(e_hat, e_sd, e_domain)
        ends = _Ends.of(sets, optima, own_domain, domains[KAPPA].prior_upper)
        beyond = most * (1.0 + plateau_nodes(restitution)) if how.is_open else None
        grid = _Panels.of(sets, optima, own_domain, ends, how.panels, beyond)
        fine = ends.is_open if how.is_open else ends.is_closed
        fine = fine & ((ends.high - ends.low) < _WIDEST * how.panels * ends.sd)
        grid = grid.where(fine)
        kappa = KappaLaw.made(grid.edges, grid.nodes, grid.density)
        own = ConstantLaw.made(grid.middle, grid.width, grid.height, own_domain)
        if how.is_open:
            laws, correlation = laws_up_to(most, restitution, own, kappa, grid.nodes, grid.density)
        else:
            laws = (restitution, own, FrictionLaw.made(kappa, restitution), kappa)
            correlation = _correlation(laws, grid)
        quantiles = np.stack([each.quantiles(np.array(LEVELS)) for each in laws], axis=1)
        sd = np.stack([each.sd for each in laws], axis=1)
        resolved = fine & np.isfinite(sd).all(axis=1) & np.isfinite(quantiles).all(axis=(1, 2))
        # beyond, mass of mu ends at its domain for some e_n only
        resolved &= (optima.kappa > 0.0) & (ends.high < most * (1.0 + restitution.low))
        resolved &= np.maximum(e_domain[0] - e_hat, e_hat - e_domain[1]) < _OUTSIDE * e_sd
        resolved &= optima.beyond < _OUTSIDE
        # the nodes of e_n would see steps where kappa is known much better
        resolved &= kappa.sd > _STEPLESS * quantiles[:, MU, 2] * e_sd
        curvature = _Curvature.of(optima, measured, domains)
        resolved &= (curvature.is_local | curvature.is_open).all(axis=1)
        resolved &= curvature.is_local[:, E_N] & optima.is_unique
        of_profile = curvature.is_open & resolved[:, None]
        below = _below_limits(sets, optima, own_domain, measured, of_profile)
        resolved &= ~(np.isnan(below).any(axis=(2, 3)) & of_profile).any(axis=1)
        clear = np.stack([_is_clear(sd, quantiles, domains, one) for one in range(len(laws))], axis=1)
        optimum = np.stack((e_best, optima.constant, optima.kappa / (1.0 + e_best), optima.kappa), axis=1)
        chi2 = optima.chi2 + total(values.e_n_weight * (values.e_n - e_best[:, None]) ** 2)
    return GroupPosteriors(
        resolved=resolved,
        clear=clear & curvature.is_local,
        sliding=optima.sliding,
        chi2=chi2,
        of_profile=of_profile,
        is_curved=curvature.is_finite,
        below=below,
        optimum=optimum,
        sd=sd,
        quantiles=quantiles,
        correlation=correlation,
        laws=laws,
    )


def _normal(e_n: Array, weight: Array) -> tuple[Array, Array]:
    """Mean and sd of the measured e_n."""
    whole = total(weight)
    return total(weight * e_n) / whole, 1.0 / np.sqrt(whole)


def _below_limits(
    sets: StickingSets,
    optima: GroupOptima,
    own: tuple[float, float],
    e_n: RestitutionMisfit,
    asked: Bool,
) -> Array:
    """Ends of what lies below the limits of profiles, (groups, 4, 4, 2), of the quantities asked for."""
    found = np.full((*asked.shape, len(LIMITS), 2), np.nan)
    of = {OWN: GroupProfiles.of_constant, MU: GroupProfiles.of_mu, KAPPA: GroupProfiles.of_kappa}
    for quantity, ends in of.items():
        groups = np.flatnonzero(asked[:, quantity])
        if groups.size:
            found[groups, quantity] = ends(GroupProfiles.of(sets, optima, own, e_n, groups))
    return found


@dataclass(frozen=True)
class _Curvature:
    """What the curvature at the optimum fixes; (groups, 4) each.

    Attributes
    ----------
    is_local : ndarray of bool
        Whether it fixes a quantity beyond doubt, with no rival far from it.
    is_open : ndarray of bool
        Whether it does not, beyond doubt.
    is_finite : ndarray of bool
    """

    is_local: Bool
    is_open: Bool
    is_finite: Bool

    @classmethod
    def of(cls, optima: GroupOptima, e_n: RestitutionMisfit, domains: Sequence[Domain]) -> _Curvature:
        scale = 1.0 + e_n.best
        kappa_sd, own_sd = np.sqrt(optima.kappa_variance), np.sqrt(optima.constant_variance)
        mu_sd = np.sqrt(optima.kappa_variance + (optima.kappa / scale * e_n.sd) ** 2) / scale
        sd = np.stack((e_n.sd, own_sd, mu_sd, kappa_sd), axis=1)
        enough = HALF * np.array([each.prior_sd for each in domains])

        def local(rivals: Array, share: float) -> Bool:
            """By distances of rivals, (2, groups), and a share of the widths that are asked for."""
            of_kappa, of_own = rivals
            none = np.zeros_like(of_own)
            distance = np.stack((none, of_own, of_kappa / scale, of_kappa), axis=1)
            beside = distance + _RIVAL_WIDTH * sd < share * enough
            return np.asarray((sd < share * enough) & ((distance < share * _RIVAL_WIDTH * sd) | beside))

        surely, perhaps = optima.rivals[:, 0], optima.rivals[:, 1]
        return cls(local(perhaps, _ROUNDED), ~local(surely, 1.0 / _ROUNDED), np.isfinite(sd))


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
    def of(
        cls,
        sets: StickingSets,
        optima: GroupOptima,
        domain: tuple[float, float],
        ends: _Ends,
        panels: int,
        beyond: Array | None = None,
    ) -> _Panels:
        """Panels between the ends, and between the edges beyond, (groups, m), where there are some."""
        low, high = ends.low, ends.high
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
        f = [np.take_along_axis(form, cell, axis=1)[:, :, None] for form in sets.forms]
        own = -(f[1] + f[4] * nodes) / (2.0 * f[3])
        width = np.broadcast_to(1.0 / np.sqrt(f[3]), own.shape)
        chi2 = f[0] + f[2] * nodes + f[5] * nodes**2 - f[3] * own**2
        height = width * np.exp(-0.5 * (chi2 - optima.chi2[:, None, None]))
        between = ndtr((domain[1] - own) / width) - ndtr((domain[0] - own) / width)
        weights = half[:, :, None] * WEIGHTS
        mass = total(weights * height * between)[:, None, None]
        density = height * between / mass
        return cls(edges, nodes, density, own, width, weights * height / mass)

    def where(self, asked: Bool) -> _Panels:
        """The same, and nan in the groups that are not asked for."""
        blank = np.where(asked, 1.0, np.nan)[:, None, None]
        return replace(self, density=self.density * blank, height=self.height * blank)


@dataclass(frozen=True)
class _Ends:
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
    ) -> _Ends:
        """Ends where kappa may be `highest` at most."""
        _, _, _, f3, f4, f5 = sets.forms
        low, high = sets.walls[:, :-1], sets.walls[:, 1:]
        best, inner = optima.chi2, optima.places
        # how sharply a set's chi2 rises with kappa, were the closure constant free
        bend = f5 - f4**2 / (4.0 * f3)
        sd = 1.0 / np.sqrt(np.where(optima.least < best[:, None] + _NEAR, bend, 0.0).max(axis=1))
        # a plateau as long as all that kappa may be, and what it adds to the variance
        above = 2.0 * (3.0 * np.log(highest / sd) - _LOST)
        edge = (best + above)[:, None]
        holds = optima.least < edge
        first, last = holds.argmax(axis=1), holds.shape[1] - 1 - holds[:, ::-1].argmax(axis=1)
        found = []
        for cell, walls in ((first, low), (last, high)):
            forms = np.take_along_axis(sets.forms, cell[None, :, None], axis=2)
            own = StickingSets(sets.walls, sets.count, forms)
            far, near = (np.take_along_axis(each, cell[:, None], axis=1) for each in (walls, inner))
            for _ in range(30):
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


def _correlation(laws: Sequence[GroupLaw], grid: _Panels) -> Array:
    """Correlations of e_n, the closure constant and mu = kappa/(1 + e_n), (groups, 3, 3)."""
    restitution, own, mu, kappa = laws
    assert isinstance(restitution, RestitutionLaw)
    assert isinstance(own, ConstantLaw)
    nodes = grid.nodes.reshape(kappa.mean.size, -1)
    with_kappa = total(own.node_means * (nodes - kappa.mean[:, None]))
    inverse = restitution.mass / (1.0 + restitution.nodes)
    with_e_n = kappa.mean * (inverse * (restitution.nodes - restitution.mean[:, None])).sum(axis=1)
    found = np.tile(np.eye(3), (kappa.mean.size, 1, 1))
    found[:, OWN, MU] = found[:, MU, OWN] = with_kappa * inverse.sum(axis=1) / (own.sd * mu.sd)
    found[:, E_N, MU] = found[:, MU, E_N] = with_e_n / (restitution.sd * mu.sd)
    return found
