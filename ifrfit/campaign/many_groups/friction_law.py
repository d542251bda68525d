"""The marginal law of friction of many groups: mu = kappa/(1 + e_n), kappa and e_n independent.

But for the Jacobian 1/(1 + e_n), which is in the law of e_n. Its distribution function is an integral over
either of them: over e_n where kappa is smooth on the scale of mu e_n's sd, over kappa where it has corners,
as outliers make, or narrow peaks.
"""

from __future__ import annotations

from abc import ABC
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ifrfit.campaign.many_groups.gauss_rule import three_nodes
from ifrfit.campaign.many_groups.group_law import GroupLaw
from ifrfit.campaign.many_groups.laws import RestitutionLaw
from ifrfit.campaign.many_groups.panel_law import NODES, PanelLaw

Array = NDArray[np.float64]

_Common = tuple[PanelLaw, RestitutionLaw, Array, Array, Array, Array]


@dataclass(frozen=True)
class FrictionLaw(GroupLaw, ABC):
    """Of mu.

    Attributes
    ----------
    kappa : PanelLaw
    e_n : RestitutionLaw
    high : ndarray, (groups,)
        Where it ends.
    whole : ndarray, (groups,)
        How much there would be if it did not end there, at least 1.
    mean, sd : ndarray, (groups,)
    """

    kappa: PanelLaw
    e_n: RestitutionLaw
    high: Array
    whole: Array
    mean: Array
    sd: Array

    @classmethod
    def _common(cls, kappa: PanelLaw, e_n: RestitutionLaw) -> _Common:
        """What all have of both laws."""
        _, high = kappa.ends
        return kappa, e_n, high / (1.0 + e_n.low), np.ones_like(high), *_product(kappa, e_n)

    def cut_off(self, most: float, whole: Array, mean: Array, sd: Array) -> Self:
        """The same up to an end, with what there would be without it, and mean and sd as they are then."""
        return replace(self, high=np.full_like(self.high, most), whole=whole, mean=mean, sd=sd)

    @property
    def ends(self) -> tuple[Array, Array]:
        """Where each law begins and ends."""
        low, _ = self.kappa.ends
        return low / (1.0 + self.e_n.high), self.high

    def start(self, levels: Array) -> Array:
        """Near the quantiles, (groups, n): those of kappa, moved and stretched by what e_n adds."""
        mean, sd = _product(self.kappa, self.e_n)
        away = self.kappa.start(levels / self.whole[:, None]) - self.kappa.mean[:, None]
        return np.asarray(mean[:, None] + away * (sd / self.kappa.sd)[:, None])


def _product(kappa: PanelLaw, e_n: RestitutionLaw) -> tuple[Array, Array]:
    """Mean and sd of kappa times 1/(1 + e_n), (groups,) each."""
    inverse = 1.0 / (1.0 + e_n.nodes)
    mean = (e_n.mass * inverse).sum(axis=1)
    sd = np.sqrt((e_n.mass * (inverse - mean[:, None]) ** 2).sum(axis=1))
    return kappa.mean * mean, np.hypot(kappa.sd * np.hypot(mean, sd), kappa.mean * sd)


@dataclass(frozen=True)
class FrictionOverRestitution(FrictionLaw):
    """By the nodes of e_n."""

    @classmethod
    def made(cls, kappa: PanelLaw, e_n: RestitutionLaw) -> FrictionOverRestitution:
        """From both laws."""
        return cls(*cls._common(kappa, e_n))

    @property
    def in_hand(self) -> int:
        """Nodes, with the powers of kappa at each."""
        return self.e_n.in_hand * self.kappa.in_hand

    def below(self, x: Array) -> tuple[Array, Array]:
        """Probability below, and density at, some places of each group, (groups, n)."""
        scale, mass = 1.0 + self.e_n.nodes, self.whole[:, None] * self.e_n.mass
        kappa = x[:, :, None] * scale[:, None]
        share, density = self.kappa.below(kappa.reshape(kappa.shape[0], -1))
        share, density = share.reshape(kappa.shape), density.reshape(kappa.shape)
        return (share * mass[:, None]).sum(axis=2), (density * (mass * scale)[:, None]).sum(axis=2)


@dataclass(frozen=True)
class FrictionOverKappa(FrictionLaw):
    """By nodes of kappa.

    Attributes
    ----------
    panels : PanelLaw
        The law of e_n.
    nodes, mass : ndarray, (groups, m)
        Of kappa, and what of it each stands for.
    """

    panels: PanelLaw
    nodes: Array
    mass: Array

    @classmethod
    def made(cls, kappa: PanelLaw, e_n: RestitutionLaw, weights: Array) -> FrictionOverKappa:
        """From both laws; `weights` of kappa at the nodes of its panels, (groups, panels, 6)."""
        places, mass = three_nodes(NODES, weights)
        low, high = kappa.edges[:, :-1, None], kappa.edges[:, 1:, None]
        nodes = low + 0.5 * (high - low) * (1.0 + places)
        nodes, mass = (each.reshape(each.shape[0], -1) for each in (nodes, mass))
        return cls(*cls._common(kappa, e_n), e_n.in_panels(), nodes, mass)

    @property
    def in_hand(self) -> int:
        """Nodes, with the powers of e_n at each."""
        return int(self.nodes.shape[1]) * self.panels.in_hand

    def below(self, x: Array) -> tuple[Array, Array]:
        """Probability below, and density at, some places of each group, (groups, n)."""
        scale = self.nodes[:, None] / x[:, :, None]  # 1 + e_n there
        under, density = self.panels.below(scale.reshape(scale.shape[0], -1) - 1.0)
        under, density = under.reshape(scale.shape), density.reshape(scale.shape)
        mass = (self.whole[:, None] * self.mass)[:, None]
        return _in_turn(mass * (1.0 - under)), _in_turn(mass * density * scale / x[:, :, None])


def _in_turn(of_nodes: Array) -> Array:
    """Sums over the last axis one after the other: zeros, where other groups have more, change no bit."""
    return np.asarray(np.add.reduce(np.ascontiguousarray(np.moveaxis(of_nodes, 2, 0)), axis=0))
