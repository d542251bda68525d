"""The marginal laws of many groups, in closed form but for the transition.

With known noise, uniform priors and a closure whose transition does not depend on its constant, kappa alone
decides which impacts slide. Given kappa the closure constant c is a normal law cut off at its bounds; e_n is
independent of both, but for the Jacobian 1/(1 + e_n) of mu = kappa/(1 + e_n). So the posterior is an integral
over kappa, smooth between the transitions at the measured tau, times one over e_n.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from ifrfit.campaign.many_groups.friction_law import FrictionLaw, FrictionOverKappa, FrictionOverRestitution
from ifrfit.campaign.many_groups.group_law import GroupLaw
from ifrfit.campaign.many_groups.laws import ConstantLaw, RestitutionLaw
from ifrfit.campaign.many_groups.likelihoods import PlainLikelihoods
from ifrfit.campaign.many_groups.open_friction import laws_up_to, plateau_nodes
from ifrfit.campaign.many_groups.panel_law import WEIGHTS, PanelLaw, panel_nodes
from ifrfit.campaign.many_groups.quantities import E_N, MU, OWN
from ifrfit.campaign.many_groups.values import padded, total

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]
Index = NDArray[np.intp]

_PANELS = (0, 32, 48, 80, 240)  # groups that need about as many are done together
_NODES = (40, 80)  # over e_n: the more, where kappa is about as sharp
# sd of kappa over that of e_n times mu, below which few nodes of e_n are not enough, and many hardly are
_SHARP = 2.0, 0.6
_TOO_SHARP = 0.25  # for any of them
# the same of corners: the latter times what the slope of kappa's density changes by, over its greatest value
_CORNERS = 0.2, 1.0
_E_CLEAR = 5.5  # sd of e_n from its bounds
# what a panel spans at most: sd of kappa, e-folds of its density, and widths of the constant given kappa
_WIDEST, _STEEPEST, _FARTHEST = 0.8, 1.4, 1.0
_WIDEST_OF_E_N = 1.0  # sd of it that a panel spans at most where friction is integrated over kappa
_BESIDE, _OUTSIDE = 3.0, 1.6  # widths inside a bound of the closure constant, and outside


class AlikeGroups(NamedTuple):
    """Groups over which the integral is done together.

    Attributes
    ----------
    groups : ndarray of int
    is_open : bool
        Whether kappa has mass up to the end of its domain.
    nodes : int
        Over e_n, for the law of friction; none where that is an integral over kappa.
    """

    groups: Index
    is_open: bool
    nodes: int


def alike_groups(likelihoods: PlainLikelihoods) -> list[AlikeGroups]:
    """Those that need about as many panels and nodes; groups that need more than any are left out."""
    gaps, support = _Gaps.of(likelihoods), likelihoods.support
    narrower = gaps.for_friction(likelihoods)
    panels, narrow = (each.panels.sum(axis=1) for each in (gaps, narrower))
    spread = likelihoods.optimum[:, MU] * likelihoods.e_n.sd
    corner = spread * gaps.corner
    is_sharp, is_sharper = (
        (support.sd < sharp * spread) | (corner > most) for sharp, most in zip(_SHARP, _CORNERS, strict=True)
    )
    # elsewhere the law of e_n, or that of kappa, has an end where the other one has mass
    over_kappa = is_sharper & support.is_closed & (likelihoods.e_n.inside > _E_CLEAR)
    over_kappa &= narrow <= _PANELS[-1]
    over_e_n = ~over_kappa & (corner <= _CORNERS[1]) & (support.sd >= _TOO_SHARP * spread)
    found = []
    kinds = over_kappa, over_e_n & ~is_sharp, over_e_n & is_sharp
    for nodes, kind in zip((0, *_NODES), kinds, strict=True):
        needed = panels if nodes else narrow
        for (fewest, most), is_open in product(pairwise(_PANELS), (False, True)):
            suits = (needed > fewest) & (needed <= most) & (support.is_open if is_open else support.is_closed)
            groups = np.flatnonzero(suits & kind)
            if groups.size:
                found.append(AlikeGroups(groups, is_open, nodes))
    return found


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


def marginal_laws(likelihoods: PlainLikelihoods, is_open: bool, nodes: int) -> MarginalLaws:
    """Integrate over kappa and e_n.

    Parameters
    ----------
    likelihoods : PlainLikelihoods
        Of `alike_groups`.
    is_open : bool
        Whether kappa has mass up to the end of its domain.
    nodes : int
        Over e_n, for the law of friction; none where that is an integral over kappa.
    """
    most, own_domain, e_n = likelihoods.most, likelihoods.own, likelihoods.e_n
    restitution = RestitutionLaw.made(e_n.mean, e_n.sd, e_n.domain, nodes or _NODES[0])
    beyond = most * (1.0 + plateau_nodes(restitution)) if is_open else None
    gaps = _Gaps.of(likelihoods)
    grid = _Panels.of(likelihoods, gaps if nodes else gaps.for_friction(likelihoods), beyond)
    kappa = PanelLaw.made(grid.edges, grid.nodes, grid.density)
    own = ConstantLaw.made(grid.middle, grid.width, grid.height, own_domain)
    mu: FrictionLaw
    if nodes:
        mu = FrictionOverRestitution.made(kappa, restitution)
    else:
        mu = FrictionOverKappa.made(kappa, restitution, grid.weights)
    laws: Sequence[GroupLaw]
    if is_open:
        laws, correlation = laws_up_to(most, restitution, own, mu, kappa, grid.nodes, grid.density)
    else:
        laws = restitution, own.with_fewer_nodes(), mu, kappa
        correlation = _correlation(restitution, own, mu, kappa, grid)
    # beyond, mass of mu ends at its domain for some e_n only
    proper = likelihoods.support.high < most * (1.0 + restitution.low)
    if nodes:  # those of e_n would see steps where kappa is known much better
        proper &= kappa.sd > _SHARP[1] * laws[MU].mean * e_n.sd
    return MarginalLaws(laws, correlation, proper)


class _Gaps(NamedTuple):
    """What lies between the transitions in the support of kappa, in (groups, gaps) each.

    Attributes
    ----------
    low, width : ndarray
    panels : ndarray of float
        So many that each is narrow; none where there is no further gap.
    corner : ndarray, (groups,)
        The most by which the slope of kappa's density changes at a transition, over its greatest value.
    """

    low: Array
    width: Array
    panels: Array
    corner: Array

    @classmethod
    def of(cls, likelihoods: PlainLikelihoods) -> _Gaps:
        """Of each group."""
        sets, support, (least, most) = likelihoods.sets, likelihoods.support, likelihoods.own
        edges = np.clip(sets.walls, support.low[:, None], support.high[:, None])
        low, high = edges[:, :-1], edges[:, 1:]
        width = high - low
        _, f1, f2, f3, f4, f5 = sets.coefficients
        with np.errstate(all="ignore"):
            own = np.stack([-(f1 + f4 * kappa) / (2.0 * f3) for kappa in (low, high)])
            slopes = f2 + f4 * np.clip(own, least, most) + 2.0 * f5 * np.stack((low, high))
            slope = np.where(slopes[0] * slopes[1] > 0.0, 0.5 * np.abs(slopes).min(axis=0), 0.0)
            # a bound that holds the closure constant makes chi2 rise more steeply with kappa
            away = np.minimum(own - least, most - own).min(axis=0) * np.sqrt(f3)
            bend = np.sqrt(np.where(away < _BESIDE, f5, f5 - f4**2 / (4.0 * f3)))
            of_kappa = width * np.maximum(bend / _WIDEST, slope / _STEEPEST)
            # what a normal law has between the bounds changes faster the farther outside it lies
            farther = np.maximum(-away / _OUTSIDE, 1.0)
            of_own = np.abs(own[1] - own[0]) * np.sqrt(f3) * farther / _FARTHEST
            # errors are as the sixth power, and as the mass, whose share in the sd is the greater far away
            optima = likelihoods.optima
            away = (optima.places - optima.kappa[:, None]) / support.sd[:, None]
            little = np.exp((optima.chi2[:, None] - optima.least) / 12.0)
            little = np.minimum(little * np.maximum(away**2, 1.0) ** (1.0 / 6.0), 1.0)
            needed = np.maximum(of_kappa, of_own) * little
            panels = np.where(width > 0.0, np.maximum(np.ceil(needed), 1.0), 0.0)
            corner = _corners(likelihoods, low, width, slopes)
        return cls(low, width, panels, corner)

    def for_friction(self, likelihoods: PlainLikelihoods) -> _Gaps:
        """With panels so narrow that e_n is smooth over each, in what mu = kappa/(1 + e_n) makes of it."""
        e_n = likelihoods.e_n
        relative = (e_n.sd / (1.0 + e_n.best))[:, None]
        with np.errstate(all="ignore"):
            needed = self.width / (_WIDEST_OF_E_N * relative * self.low)  # where kappa is least, at each
            panels = np.where(self.width > 0.0, np.maximum(np.ceil(needed), self.panels), 0.0)
        return self._replace(panels=panels)


def _corners(likelihoods: PlainLikelihoods, low: Array, width: Array, slopes: Array) -> Array:
    """The sharpest corner of kappa's density in each group, by the slopes of chi2 at the ends of gaps."""
    gap = np.where(width > 0.0, np.arange(width.shape[1]), -1)
    before = np.maximum.accumulate(gap, axis=1)[:, :-1]  # of each the last one; walls may lie on one another
    turn = np.abs(np.take_along_axis(slopes[1], before, axis=1) - slopes[0][:, 1:])
    rise = likelihoods.sets.at(low, likelihoods.own)[:, 1:] - likelihoods.optima.chi2[:, None]
    inside = (before >= 0) & (width[:, 1:] > 0.0)
    return np.asarray(np.where(inside, 0.5 * turn * np.exp(-0.5 * rise), 0.0).max(axis=1))


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

    @property
    def weights(self) -> Array:
        """The share of kappa that each node stands for."""
        return np.asarray(self.density * WEIGHTS * 0.5 * np.diff(self.edges, axis=1)[:, :, None])

    @classmethod
    def of(cls, likelihoods: PlainLikelihoods, gaps: _Gaps, beyond: Array | None = None) -> _Panels:
        """Panels between the ends, and between the edges beyond, (groups, m), where there are some."""
        sets, domain, high = likelihoods.sets, likelihoods.own, likelihoods.support.high
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
        middle, nodes = edges[:, :-1] + half, panel_nodes(edges)
        cell = (sets.walls[:, None, 1:-1] < middle[:, :, None]).sum(axis=2)
        f = [np.take_along_axis(form, cell, axis=1)[:, :, None] for form in sets.coefficients]
        own = -(f[1] + f[4] * nodes) / (2.0 * f[3])
        width = np.broadcast_to(1.0 / np.sqrt(f[3]), own.shape)
        chi2 = f[0] + f[2] * nodes + f[5] * nodes**2 - f[3] * own**2
        height = width * np.exp(-0.5 * (chi2 - likelihoods.optima.chi2[:, None, None]))
        facing = np.where(own < domain[0], -1.0, 1.0)  # so that tails keep their digits
        between = ndtr(facing * (domain[1] - own) / width) - ndtr(facing * (domain[0] - own) / width)
        between *= facing
        weights = half[:, :, None] * WEIGHTS
        mass = total(weights * height * between)[:, None, None]
        density = height * between / mass
        return cls(edges, nodes, density, own, width, weights * height / mass)


def _correlation(
    restitution: RestitutionLaw, own: ConstantLaw, mu: FrictionLaw, kappa: PanelLaw, grid: _Panels
) -> Array:
    """Correlations of e_n, the closure constant and mu = kappa/(1 + e_n), (groups, 3, 3)."""
    nodes = grid.nodes.reshape(kappa.mean.size, -1)
    centred = own.node_means - own.mean[:, None] * own.node_masses
    with_kappa = total(centred * (nodes - kappa.mean[:, None]))
    inverse = restitution.mass / (1.0 + restitution.nodes)
    # 1/(1 + e_n) less what it is at the mean, as differences that keep their digits
    away = restitution.nodes - restitution.mean[:, None]
    with_e_n = -kappa.mean * (inverse * away**2).sum(axis=1) / (1.0 + restitution.mean)
    found = np.tile(np.eye(3), (kappa.mean.size, 1, 1))
    found[:, OWN, MU] = found[:, MU, OWN] = with_kappa * inverse.sum(axis=1) / (own.sd * mu.sd)
    found[:, E_N, MU] = found[:, MU, E_N] = with_e_n / (restitution.sd * mu.sd)
    return found
