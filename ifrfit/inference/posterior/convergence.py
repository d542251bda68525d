"""Error estimates: how far results move between the rules and the coarse ones inside them.

Eq. (7) of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.distributions.protocol import LEVELS
from ifrfit.inference.posterior.density_grid import PanelErrors
from ifrfit.inference.posterior.marginals import Marginal
from ifrfit.inference.posterior.panel_cdf import quantiles

Array = NDArray[np.float64]

# places in sd at which a normal law has its quantiles at `LEVELS`, and further out for skewed ones
_NORMAL = np.array([-2.8, -1.959964, -0.994458, 0.0, 0.994458, 1.959964, 2.8])
_DENSITY = np.exp(-0.5 * np.minimum(np.abs(_NORMAL), 1.959964) ** 2) / math.sqrt(2.0 * math.pi)
_BESIDE = 1.0  # tolerance of the quantiles at which changes are taken: a thousandth of the probability
_NEARLY = 0.01  # in probability: how near to a normal law the tails have to be


def largest_error(marginals: Mapping[str, Marginal], tolerance: float, *, is_last: bool) -> float:
    """Largest change of any result between the rules and the coarse ones inside them, in sd.

    A quantile changes by the change of the distribution function there over the density. Both are taken
    where a normal law has its quantiles, and the density as no less than half of that law's.

    Parameters
    ----------
    marginals : mapping
    tolerance : float
    is_last : bool
        Whether it is the error that is reported. Before that, quantiles are left out where means or standard
        deviations move by more than the tolerance already.
    """
    worst = 0.0
    for own in marginals.values():
        mean, sd = own.moments(0)
        if sd == 0.0:
            continue
        coarse_mean, coarse_sd = own.moments(1)
        changes = [abs(coarse_mean - mean) / sd, abs(coarse_sd - sd) / sd]
        worst = max(worst, *(change if math.isfinite(change) else math.inf for change in changes))
    if worst > tolerance and not is_last:  # the rest would be no use yet
        return worst
    for own in marginals.values():
        mean, sd = own.moments(0)
        if sd == 0.0:
            continue
        change, normal = math.inf, False
        if own.kinks is None:
            change, normal = _quantile_error_if_normal(own, mean, sd)
        if (
            change > tolerance or not normal
        ):  # the integrand may have kinks or steps at the quantiles themselves
            change = _quantile_error(own, sd, tolerance)
        worst = max(worst, change if math.isfinite(change) else math.inf)
    return worst


def _quantile_error_if_normal(own: Marginal, mean: float, sd: float) -> tuple[float, bool]:
    """Largest change of quantiles, in sd, where a normal law has them; and whether this one is near to it."""
    at = np.clip(mean + sd * _NORMAL, own.low, own.high)
    fine, coarse = own.cdf(at, 2)
    change = float((np.abs(coarse - fine) / (0.5 * _DENSITY)).max())
    return change, bool((np.abs(fine[[1, -2]] - (LEVELS[0], LEVELS[-1])) < _NEARLY).all())


def _quantile_error(own: Marginal, sd: float, tolerance: float) -> float:
    """Largest change of the quantiles, in sd, with the density there."""
    # where panels are refined for the quantiles themselves, a place beside them says nothing
    accuracy = tolerance if own.kinks is not None or own.errors is not None else _BESIDE
    at, density = quantiles_at_levels(own, accuracy)
    fine, coarse = own.cdf(at, 2)
    return float((np.abs(coarse - fine) / np.maximum(density, 1e-4 / sd)).max()) / sd


def quantiles_at_levels(own: Marginal, accuracy: float) -> tuple[Array, Array]:
    """Quantiles at `LEVELS`, and the densities there."""
    if accuracy not in own.known_quantiles:
        sd = own.moments(0)[1]
        at = quantiles_of(own, np.array(LEVELS), accuracy)
        step = 0.02 * sd
        around = np.clip(np.stack((at - step, at + step)), own.low, own.high)
        below = own.cdf(around.reshape(-1), 1)[0].reshape(around.shape)
        own.known_quantiles[accuracy] = at, (below[1] - below[0]) / (around[1] - around[0])
    return own.known_quantiles[accuracy]


def errors_of_quantiles(marginals: Mapping[str, Marginal], tolerance: float) -> list[PanelErrors]:
    """Errors of panels that only distribution functions show, in sd of the quantiles that people ask for."""
    found: list[PanelErrors] = []
    for own in marginals.values():
        sd = own.moments(0)[1]
        if own.errors is not None and sd > 0.0:
            at, density = quantiles_at_levels(own, tolerance)
            found += own.errors(at, 1.0 / np.maximum(density * sd, 1e-4))
    return found


def quantiles_of(own: Marginal, p: Array, tolerance: float) -> Array:
    """Where the distribution function takes the values p; an open upper end is cut 1e6 sd above the mean."""
    mean, sd = own.moments(0)
    low, high = own.low, own.high if math.isfinite(own.high) else mean + 1e6 * sd
    return quantiles(lambda t: own.cdf(t, 1)[0], p, low, high, mean, sd, 1e-3 * tolerance)
