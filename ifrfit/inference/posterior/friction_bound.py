"""The bound of mu, which ties kappa and e_n where mass reaches it: each is weighted by the other.

Eq. (25) of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.posterior.kappa_integral import KappaIntegral, Region, SlidingCells
from ifrfit.inference.posterior.plain_question import MOST_PANELS
from ifrfit.inference.posterior.quadrature_axis import PanelCdf
from ifrfit.inference.posterior.restitution_integral import RestitutionIntegral, RestitutionLaw

Array = NDArray[np.float64]

_LEAST_KEPT = 0.01  # share of the laws without the bound within it: what is left out is told from that
_LEAST_ABOVE = 1e-10  # probability of e_n above, from which on means there are rounding


@dataclass(frozen=True)
class FrictionBound:
    """kappa and e_n within mu <= highest, from their laws without that bound.

    Attributes
    ----------
    highest : float
        The bound.
    free_kappa, free_e_n : KappaIntegral, RestitutionIntegral
        Without it, kappa up to where it is for the largest e_n.
    kappa, e_n : KappaIntegral, RestitutionIntegral
        Within it.
    above : ndarray, (2, 3, nodes)
        At each node of kappa the integrals over e_n that the bound leaves, of 1 and (1 + e_n)^-1 and
        (1 + e_n)^-2.
    """

    highest: float
    free_kappa: KappaIntegral
    free_e_n: RestitutionIntegral
    kappa: KappaIntegral
    e_n: RestitutionIntegral
    above: Array

    @classmethod
    def of(
        cls,
        cells: SlidingCells,
        region: Region,
        likelihood: RestitutionLaw,
        bounds: tuple[float, FreeParameter],
        width: float,
        tolerance: float,
    ) -> FrictionBound | None:
        """None where it would take very many panels, or most of the laws without the bound is beyond it.

        Parameters
        ----------
        cells, region, likelihood :
            Of kappa, up to the bound at the largest e_n; and of e_n.
        bounds : (float, FreeParameter)
            The bound of mu, and the closure constant with its own.
        width : float
            Of panels, in sd of what varies along them.
        tolerance : float
        """
        highest, c = bounds
        first = highest * (1.0 + likelihood.low)  # from where on the bound cuts
        last_wall = float(cells.walls[-2])  # above, the density is constant but for the bound
        of_e_n = width
        if last_wall > first:
            of_e_n *= min(1.0, region.sd / (highest * likelihood.sd))
        walls = cells.walls_between(region.low, region.high)
        e_n = RestitutionIntegral.of(likelihood, of_e_n, tolerance, walls[walls > first] / highest - 1.0)
        even = min(region.high, first, last_wall)
        count = math.ceil((even - region.low) / (width * region.sd))
        if e_n is None or count > MOST_PANELS:
            return None
        # even panels, one up to where the bound cuts, and those of e_n
        edges = np.linspace(region.low, even, count + 1) if count > 0 else np.array([region.low])
        others = np.append(highest * (1.0 + np.unique(e_n.law.axis.panels)), region.high)
        others = others[(others > edges[-1]) & (others <= region.high)]
        kappa = KappaIntegral.of(cells, (walls, np.concatenate((edges, others))), c, tolerance)
        if kappa is None:
            return None
        inverse = 1.0 / (1.0 + e_n.nodes)
        powers = np.stack((np.ones_like(inverse), inverse, inverse * inverse))
        above = _above(e_n, kappa.kappa / highest - 1.0, powers)
        below = kappa.law.below_in_all(highest * (1.0 + e_n.nodes), 2)
        if float(e_n.share[0] @ below[0]) < _LEAST_KEPT:
            return None
        within = kappa.times(above[:, 0], tolerance), e_n.times(below, tolerance)
        return cls(highest, kappa, e_n, *within, above)

    @property
    def log_mass(self) -> Array:
        """Log of the integral over both by both levels, (2,)."""
        return self.kappa.log_mass + self.free_e_n.log_mass

    @property
    def change_by_order(self) -> float:
        """How far the log of the integral over kappa of that over e_n is from the same in the other order."""
        other = self.e_n.log_mass + self.free_kappa.log_mass
        return float(np.abs(self.log_mass - other).max())

    def given_kappa(self, of: Array) -> Array:
        """Mean at each node of kappa of what is given at the nodes of e_n, by the rules."""
        above = _above(self.free_e_n, self.kappa.kappa / self.highest - 1.0, of[None])[0, 0]
        whole = self.above[0, 0]
        is_some = whole > _LEAST_ABOVE
        return np.asarray(np.where(is_some, above / np.where(is_some, whole, 1.0), of[-1]))

    @cached_property
    def mu_moments(self) -> list[tuple[float, float]]:
        """Mean and standard deviation of mu by both levels, eq. (26)."""
        kappa, (whole, first, second) = self.kappa.kappa, self.above.swapaxes(0, 1)
        share = self.free_kappa.share / (self.free_kappa.share * whole).sum(axis=1, keepdims=True)
        mean = (share * kappa * first).sum(axis=1)
        about = kappa * (kappa * second - 2.0 * mean[0] * first) + mean[0] ** 2 * whole
        variance = (share * about).sum(axis=1) - (mean - mean[0]) ** 2
        return [(float(m), math.sqrt(max(float(v), 0.0))) for m, v in zip(mean, variance, strict=True)]


def _above(e_n: RestitutionIntegral, at: Array, of: Array) -> Array:
    """Integrals over e_n above ascending places (n,), of what is given at its nodes, (k, nodes).

    By both levels, (2, k, n).
    """
    cut = int(at.searchsorted(e_n.likelihood.low))
    rows = PanelCdf.of_levels(e_n.law.axis, e_n.density[:, None] * of)
    found = np.broadcast_to(rows.total[:, None], (rows.total.size, at.size)).copy()
    found[:, cut:] -= rows.below_in_all(at[cut:], rows.total.size)
    return found.reshape(2, of.shape[0], at.size)
