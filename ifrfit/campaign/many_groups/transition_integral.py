"""The marginal laws of many groups, in closed form but for the transition.

With known noise, uniform priors and a closure whose transition does not depend on its constant, kappa alone
decides which impacts slide. Given kappa the closure constant c is a normal law cut off at its bounds; e_n is
independent of both, but for the Jacobian 1/(1 + e_n) of mu = kappa/(1 + e_n). So the posterior is an integral
over kappa, smooth between the transitions at the measured tau, times one over e_n.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from ifrfit.campaign.many_groups.laws import (
    NODES,
    WEIGHTS,
    ConstantLaw,
    FrictionLaw,
    GroupLaw,
    KappaLaw,
    RestitutionLaw,
)
from ifrfit.campaign.many_groups.likelihoods import PlainLikelihoods
from ifrfit.campaign.many_groups.open_friction import laws_up_to, plateau_nodes
from ifrfit.campaign.many_groups.quantities import E_N, MU, OWN
from ifrfit.campaign.many_groups.values import padded, total

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]

_STEPLESS = 0.6  # sd of kappa over that of e_n times mu
_WIDEST = 0.6  # sd of a panel
_SMOOTH = 1.0  # of a width: normal laws so far apart add up to a smooth one, to 1e-8


@dataclass(frozen=True)
class Integration:
    """How the integral over kappa is done, and for which groups.

    Attributes
    ----------
    fewest, most : int
        Panels: more than the former, and no more than the latter.
    is_open : bool
        Whether kappa has mass up to the end of its domain.
    """

    fewest: int
    most: int
    is_open: bool

    def suits(self, likelihoods: PlainLikelihoods) -> Bool:
        """Which groups it is for, (groups,)."""
        support = likelihoods.support
        kind = support.is_open if self.is_open else support.is_closed
        panels = _Gaps.of(likelihoods).panels.sum(axis=1)
        return np.asarray(kind & (panels > self.fewest) & (panels <= self.most))


_PANELS = (0, 32, 48, 80, 240)  # groups that need about as many are done together
INTEGRATIONS = tuple(
    Integration(*panels, is_open) for panels in pairwise(_PANELS) for is_open in (False, True)
)


class MarginalLaws(NamedTuple):
    """The laws of e_n, the closure constant, mu and kappa in each group.

    Attributes
    ----------
    laws : sequence of GroupLaw
    correlation : ndarray, (groups, 3, 3)
        Of the first three.
    proper : ndarray of bool, (groups,)
        Whether the integral is one that this rule resolves.
    """

    laws: Sequence[GroupLaw]
    correlation: Array
    proper: Bool


def marginal_laws(likelihoods: PlainLikelihoods, how: Integration) -> MarginalLaws:
    """Integrate over kappa and e_n.

    Parameters
    ----------
    likelihoods : PlainLikelihoods
        Of groups that suit the way of integration.
    how : Integration
    """
    most, own_domain, e_n = likelihoods.most, likelihoods.own, likelihoods.e_n
    restitution = RestitutionLaw.made(e_n.mean, e_n.sd, e_n.domain)
    beyond = most * (1.0 + plateau_nodes(restitution)) if how.is_open else None
    grid = _Panels.of(likelihoods, beyond)
    kappa = KappaLaw.made(grid.edges, grid.nodes, grid.density)
    own = ConstantLaw.made(grid.middle, grid.width, grid.height, own_domain)
    laws: Sequence[GroupLaw]
    if how.is_open:
        laws, correlation = laws_up_to(most, restitution, own, kappa, grid.nodes, grid.density)
    else:
        mu = FrictionLaw.made(kappa, restitution)
        laws = restitution, own.without_small_ones(), mu, kappa
        correlation = _correlation(restitution, own, mu, kappa, grid)
    # beyond, mass of mu ends at its domain for some e_n only
    proper = likelihoods.support.high < most * (1.0 + restitution.low)
    # given kappa the constant may be known so well that its law is a staircase of nodes
    proper &= own.widest_step < _SMOOTH
    # the nodes of e_n would see steps where kappa is known much better
    proper &= kappa.sd > _STEPLESS * laws[MU].mean * e_n.sd
    return MarginalLaws(laws, correlation, proper)


class _Gaps(NamedTuple):
    """What lies between the transitions in the support of kappa, in (groups, gaps) each.

    Attributes
    ----------
    low, width : ndarray
    panels : ndarray of float
        So many that each is narrow; none where there is no further gap.
    """

    low: Array
    width: Array
    panels: Array

    @classmethod
    def of(cls, likelihoods: PlainLikelihoods) -> _Gaps:
        """Of each group."""
        support = likelihoods.support
        low, high = support.low[:, None], support.high[:, None]
        edges = np.clip(likelihoods.sets.walls, low, high)
        width = np.diff(edges, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            return cls(edges[:, :-1], width, np.ceil(width / (_WIDEST * support.sd[:, None])))


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
    def of(cls, likelihoods: PlainLikelihoods, beyond: Array | None = None) -> _Panels:
        """Panels between the ends, and between the edges beyond, (groups, m), where there are some."""
        sets, domain, high = likelihoods.sets, likelihoods.own, likelihoods.support.high
        gaps = _Gaps.of(likelihoods)
        of = gaps.panels.astype(np.intp)
        own, start, width = (
            np.repeat(each, of.ravel())
            for each in (np.arange(of.size) // of.shape[1], gaps.low.ravel(), (gaps.width / of).ravel())
        )
        number = np.arange(own.size) - np.repeat(np.cumsum(of) - of.ravel(), of.ravel())
        (edges,) = padded(own, high.size, [start + number * width], [np.inf])
        edges = np.minimum(np.concatenate((edges, high[:, None]), axis=1), high[:, None])
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
