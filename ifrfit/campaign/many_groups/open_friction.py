"""Posterior of groups in which friction has no upper end: kappa has a plateau, where every impact sticks.

The default prior of mu is uniform up to an end M, so that kappa = mu (1 + e_n) ends at M (1 + e_n) and is no
longer independent of e_n. With r(e_n) its law by itself, with the Jacobian, and q(kappa) that of kappa,

    p(e_n, kappa) ~ r(e_n) q(kappa)  for  kappa <= M (1 + e_n).

So kappa loses the share of e_n below kappa/M - 1, e_n gains with the share of kappa up to M (1 + e_n), and
the constant given kappa is what it was.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.campaign.many_groups.friction_law import FrictionLaw
from ifrfit.campaign.many_groups.group_law import GroupLaw
from ifrfit.campaign.many_groups.laws import ConstantLaw, RestitutionLaw
from ifrfit.campaign.many_groups.panel_law import WEIGHTS, PanelLaw
from ifrfit.campaign.many_groups.quantities import E_N, MU, OWN
from ifrfit.campaign.many_groups.values import total

Array = NDArray[np.float64]

_ORDERS = tuple((i, j) for i in range(3) for j in range(3))
_STEPS = 12  # panels over which kappa ends


def plateau_nodes(e_n: RestitutionLaw) -> Array:
    """The e_n of M (1 + e_n) between which panels of kappa end where its density falls, (groups, 13)."""
    return e_n.low[:, None] + (e_n.high - e_n.low)[:, None] * np.linspace(0.0, 1.0, _STEPS + 1)


@dataclass(frozen=True)
class _CutRestitution(GroupLaw):
    """Of e_n, where kappa ends at M (1 + e_n).

    Attributes
    ----------
    alone : RestitutionLaw
    kappa : PanelLaw
        By itself.
    most : float
        M.
    scale, mean, sd : ndarray, (groups,)
    """

    alone: RestitutionLaw
    kappa: PanelLaw
    most: float
    scale: Array
    mean: Array
    sd: Array

    @property
    def in_hand(self) -> int:
        """Nodes of e_n, with the powers of kappa at each."""
        return self.alone.in_hand * self.kappa.in_hand

    @property
    def ends(self) -> tuple[Array, Array]:
        """Those of e_n by itself."""
        return self.alone.ends

    def below(self, x: Array) -> tuple[Array, Array]:
        """Probability below, and density at, some places of each group, (groups, n)."""
        nodes, mass = self.alone.between(np.broadcast_to(self.alone.low[:, None], x.shape), x)
        share = (mass * self._upto(nodes)).sum(axis=2)
        _, density = self.alone.below(x)
        return share / self.scale[:, None], density * self._upto(x) / self.scale[:, None]

    def _upto(self, e_n: Array) -> Array:
        """Share of kappa up to its end."""
        share, _ = self.kappa.below((self.most * (1.0 + e_n)).reshape(e_n.shape[0], -1))
        return share.reshape(e_n.shape)


def laws_up_to(
    most: float,
    e_n: RestitutionLaw,
    own: ConstantLaw,
    mu: FrictionLaw,
    kappa: PanelLaw,
    nodes: Array,
    density: Array,
) -> tuple[tuple[GroupLaw, ...], Array]:
    """Laws of e_n, the closure constant, mu and kappa where mu ends at `most`, and the correlation of three.

    Parameters
    ----------
    most : float
    e_n, own, mu, kappa : GroupLaw
        As they would be without an end of mu.
    nodes, density : ndarray, (groups, panels, 6)
        Of kappa; the last panels lie between those of `plateau_nodes`.
    """
    shape = nodes.shape
    moments = {
        powers: np.concatenate((np.repeat(whole, shape[1] - _STEPS, axis=1), part), axis=1)
        for powers, whole, part in _moments(most, e_n, nodes[:, -_STEPS:])
    }
    left = moments[0, 0]
    half = 0.5 * np.diff(kappa.edges, axis=1)[:, :, None]
    mass = density * WEIGHTS * half
    scale = total(mass * left)
    mass = mass / scale[:, None, None]
    # mu about a place: mu - mu0 = (kappa - kappa0 - mu0 (e_n - m)) / (1 + e_n), of which products have digits
    place = kappa.mean / (1.0 + e_n.mean)
    away, mu0 = nodes - kappa.mean[:, None, None], place[:, None, None]
    of_mu = away * moments[1, 0] - mu0 * moments[1, 1]
    of_square = away**2 * moments[2, 0] - 2.0 * away * mu0 * moments[2, 1] + mu0**2 * moments[2, 2]
    of_product = away * moments[1, 1] - mu0 * moments[1, 2]
    e_off, mu_off = total(mass * moments[0, 1]), total(mass * of_mu)
    e_sd = np.sqrt(total(mass * moments[0, 2]) - e_off**2)
    mu_sd = np.sqrt(total(mass * of_square) - mu_off**2)
    of_kappa = PanelLaw.made(kappa.edges, nodes, density * left / scale[:, None, None])
    weight = left.reshape(shape[0], -1) / scale[:, None]
    of_own = own.weighted(weight)
    laws = (
        _CutRestitution(e_n, kappa, most, scale, e_n.mean + e_off, e_sd),
        of_own.with_fewer_nodes(),
        mu.cut_off(most, 1.0 / scale, place + mu_off, mu_sd),
        of_kappa,
    )

    centred = own.node_means - of_own.mean[:, None] * own.node_masses
    centred = centred.reshape(shape) / scale[:, None, None]
    found = np.tile(np.eye(3), (shape[0], 1, 1))
    for i, j, covariance in (
        (E_N, OWN, total(centred * moments[0, 1])),
        (OWN, MU, total(centred * of_mu)),
        (E_N, MU, total(mass * of_product) - e_off * mu_off),
    ):
        found[:, i, j] = found[:, j, i] = covariance / (laws[i].sd * laws[j].sd)
    return laws, found


def _moments(most: float, e_n: RestitutionLaw, nodes: Array) -> list[tuple[tuple[int, int], Array, Array]]:
    """Integrals of (e_n - m)^j/(1 + e_n)^i over e_n of mean m, and from kappa/M - 1 on; (i, j) first."""
    flat, mean = nodes.reshape(nodes.shape[0], -1), e_n.mean[:, None]
    e, mass = e_n.between(flat / most - 1.0, np.broadcast_to(e_n.high[:, None], flat.shape))
    parts = [each.reshape(nodes.shape) for each in _powers(e, mass, mean[:, :, None])]
    wholes = _powers(e_n.nodes, e_n.mass, mean)
    repeated = [np.repeat(each[:, None, None], nodes.shape[2], axis=2) for each in wholes]
    return list(zip(_ORDERS, repeated, parts, strict=True))


def _powers(e: Array, mass: Array, mean: Array) -> list[Array]:
    """Sums of (e - mean)^j/(1 + e)^i over the last axis, (i, j) as in `_ORDERS`."""
    found, off = [], e - mean
    for _ in range(3):
        first = mass * off
        found += [mass.sum(axis=-1), first.sum(axis=-1), (first * off).sum(axis=-1)]
        mass = mass / (1.0 + e)
    return found
