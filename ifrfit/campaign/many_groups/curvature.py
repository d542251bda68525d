"""What the curvature of chi2 at the optimum fixes in each of many groups, as least squares has it.

Where it does not fix a quantity beyond doubt, or another optimum lies far away, profiles say what the data
leave of it: the rule of `ifrfit.inference.profile.least_squares_estimates`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.campaign.many_groups.of_groups import OfGroups
from ifrfit.campaign.many_groups.sticking_sets import GroupOptima
from ifrfit.campaign.many_groups.values import Restitution
from ifrfit.inference.diagnostics.thresholds import HALF
from ifrfit.inference.distributions.truncated_normal import half_width
from ifrfit.inference.model.parameters import Domain
from ifrfit.inference.profile.least_squares_estimates import BEYOND

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]

_RIVAL_WIDTH = BEYOND * half_width(0.95)  # sd about the optimum within which a rival needs no second look
_ROUNDED = 0.999  # of a width that is asked for: what lies nearer to it is for the general code


@dataclass(frozen=True)
class Curvature(OfGroups):
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
    def of(cls, optima: GroupOptima, e_n: Restitution, domains: Sequence[Domain]) -> Curvature:
        """From the optimum and the domains of e_n, the closure constant, mu and kappa."""
        scale = 1.0 + e_n.best
        kappa_sd, own_sd = np.sqrt(optima.kappa_variance), np.sqrt(optima.constant_variance)
        mu_sd = np.sqrt(optima.kappa_variance + (optima.kappa / scale * e_n.sd) ** 2) / scale
        sd = np.stack((e_n.sd, own_sd, mu_sd, kappa_sd), axis=1)
        enough = HALF * np.array([each.prior_sd for each in domains])

        def local(rivals: Array, share: float) -> Bool:
            """By distances of rivals, (groups, 2), and a share of the widths that are asked for."""
            of_kappa, of_own = rivals.T
            none = np.zeros_like(of_own)
            distance = np.stack((none, of_own, of_kappa / scale, of_kappa), axis=1)
            beside = distance + _RIVAL_WIDTH * sd < share * enough
            return np.asarray((sd < share * enough) & ((distance < share * _RIVAL_WIDTH * sd) | beside))

        surely, perhaps = optima.rivals[:, 0], optima.rivals[:, 1]
        return cls(local(perhaps, _ROUNDED), ~local(surely, 1.0 / _ROUNDED), np.isfinite(sd))
