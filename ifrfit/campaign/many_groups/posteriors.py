"""What the posteriors of many groups say of each constant: values, intervals and statuses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from ifrfit.campaign.group_fit import estimate_cells
from ifrfit.campaign.many_groups.group_law import GroupLaw
from ifrfit.campaign.many_groups.likelihoods import LeftOpen, PlainLikelihoods
from ifrfit.campaign.many_groups.transition_integral import marginal_laws
from ifrfit.inference.diagnostics.thresholds import HALF
from ifrfit.inference.distributions.protocol import LEVELS
from ifrfit.inference.model.parameters import Domain
from ifrfit.inference.posterior.quadrature_posterior import RESOLUTION
from ifrfit.inference.result.types import Estimate
from ifrfit.inference.summary.estimates import reached_bounds
from ifrfit.inference.summary.status import Known, Marginal, OneSided, estimate_of

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]
Index = NDArray[np.intp]

TAILS = (0.05, 0.32, 0.68, 0.95)  # levels of intervals that end at a bound

# sd from a bound at which it plays no part: e_n, the constant, mu, kappa; the rule asks for less than 2
_CLEAR = (6.0, 3.5, 3.5, 3.5)
_NARROW = 0.9  # of the sd below which a constant counts as determined


@dataclass(frozen=True)
class GroupPosteriors:
    """What was found of each group; (groups,) each.

    Attributes
    ----------
    likelihoods : PlainLikelihoods
    resolved : ndarray of bool
        Whether it was settled; the others are for the general code.
    clear : ndarray of bool, (groups, 4)
        Whether e_n, the closure constant, mu and kappa are determined beyond doubt.
    left_open : LeftOpen
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

    likelihoods: PlainLikelihoods
    resolved: Bool
    clear: Bool
    left_open: LeftOpen
    sd: Array
    quantiles: Array
    correlation: Array
    reached: Bool
    tails: Array

    def cells(self, quantity: int) -> list[tuple[float | str | None, ...]]:
        """What the table holds of a quantity in each group, see `estimate_cells`."""
        low95, low68, median, high68, high95 = self.quantiles[:, quantity].T.tolist()
        numbers = (median, self.sd[:, quantity].tolist(), low68, high68, low95, high95)
        found: list[tuple[float | str | None, ...]] = list(zip(*numbers, repeat("determined")))
        is_plain = self.clear[:, quantity] & ~self.left_open.is_open[:, quantity]
        for group in np.flatnonzero(self.resolved & ~is_plain).tolist():
            found[group] = estimate_cells(self._estimate(group, quantity))
        return found

    def _estimate(self, group: int, quantity: int) -> Estimate:
        """What posterior or profile say of a quantity; near bounds the rule of all methods decides."""
        left_open: Estimate | None = self.left_open.estimates[group, quantity]
        if left_open is not None:
            return left_open
        domain = self.likelihoods.domains[quantity]
        low95, low68, median, high68, high95 = self.quantiles[group, quantity].tolist()
        sd = float(self.sd[group, quantity])

        def one_sided(is_below: bool) -> OneSided:
            low95, low68, high68, high95 = self.tails[group, quantity].tolist()
            if is_below:
                return OneSided((domain.lower, high68), (domain.lower, high95), sd)
            return OneSided((low68, domain.upper), (low95, domain.upper), sd)

        reaches_low, reaches_high = self.reached[group, quantity].tolist()
        intervals = (low68, high68), (low95, high95)
        marginal = Marginal(median, sd, *intervals, (reaches_low, reaches_high), one_sided)
        optimum = float(self.likelihoods.optimum[group, quantity])
        return estimate_of(domain, marginal, Known(optimum=optimum))


def group_posteriors(
    likelihoods: PlainLikelihoods, left_open: LeftOpen, is_open: bool, nodes: int
) -> GroupPosteriors:
    """Posterior of each group.

    Parameters
    ----------
    likelihoods : PlainLikelihoods
        Of `alike_groups`.
    left_open : LeftOpen
        What profiles say of them.
    is_open : bool
        Whether kappa has mass up to the end of its domain.
    nodes : int
        Over e_n.
    """
    with np.errstate(all="ignore"):  # what is not finite is not resolved
        laws, correlation, resolved = marginal_laws(likelihoods, is_open, nodes)
        sd = np.stack([each.sd for each in laws], axis=1)
        asked = ~left_open.is_open
        quantiles = _quantiles(laws, np.array(LEVELS), asked)
        resolved &= ~left_open.failed & np.isfinite(sd).all(axis=1)
        resolved &= (np.isfinite(quantiles).all(axis=2) | ~asked).all(axis=1)
        clear = np.stack(
            [_is_clear(sd, quantiles, likelihoods.domains, one) for one in range(len(laws))], axis=1
        )
        clear &= likelihoods.curvature.is_local
        asked &= resolved[:, None] & ~clear
        reached, tails = _at_ends(laws, quantiles, likelihoods.domains, asked)
        resolved &= (np.isfinite(tails).all(axis=2) | (reached.sum(axis=2) != 1)).all(axis=1)
    return GroupPosteriors(
        likelihoods, resolved, clear, left_open, sd, quantiles, correlation, reached, tails
    )


def _quantiles(laws: Sequence[GroupLaw], levels: Array, asked: Bool) -> Array:
    """Quantiles of laws, (groups, quantities, levels), where they are asked for; else nan."""
    found = np.full((*asked.shape, levels.size), np.nan)
    for quantity, law in enumerate(laws):
        groups = np.flatnonzero(asked[:, quantity])
        if groups.size:
            found[groups, quantity] = law.of_groups(groups).quantiles(levels)
    return found


def _at_ends(
    laws: Sequence[GroupLaw], quantiles: Array, domains: Sequence[Domain], asked: Bool
) -> tuple[Bool, Array]:
    """Which ends of the domain laws reach, (groups, 4, 2), and quantiles at `TAILS`, (groups, 4, 4)."""
    reached = np.zeros((*asked.shape, 2), dtype=bool)
    for quantity, (every, domain) in enumerate(zip(laws, domains, strict=True)):
        groups = np.flatnonzero(asked[:, quantity])
        law = every.of_groups(groups)

        def below(x: Array, some: Index, law: GroupLaw = law) -> Array:
            few = law.of_groups(some)
            parts = few.in_parts(x.shape[1])
            return np.concatenate([few.of_groups(part).share(x[part]) for part in parts])

        if groups.size:
            bounds = domain.lower, domain.prior_upper
            width68 = quantiles[groups, quantity, 3] - quantiles[groups, quantity, 1]
            reached[groups, quantity] = reached_bounds(law.mean, law.sd, width68, bounds, RESOLUTION, below)
    return reached, _quantiles(laws, np.array(TAILS), reached.sum(axis=2) == 1)


def _is_clear(sd: Array, quantiles: Array, domains: Sequence[Domain], quantity: int) -> Bool:
    """Whether a quantity is determined beyond doubt: narrow, and far from its bounds with its tails, too."""
    bounds = domains[quantity]
    upper = min(bounds.upper, bounds.prior_upper)
    low95, _, middle, _, high95 = quantiles[:, quantity].T
    own, away = sd[:, quantity], _CLEAR[quantity] * sd[:, quantity]
    inside = (middle - away > bounds.lower) & (middle + away < upper)
    inside &= (low95 - own > bounds.lower) & (high95 + own < upper)
    return np.asarray(inside & (own < _NARROW * HALF * bounds.prior_sd))
