"""Weights of points: the evidence that they tell, how evenly they lie, powers that lie evenly enough."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ifrfit.inference.diagnostics.thresholds import LARGEST_WEIGHT

Array = NDArray[np.float64]

REPLICATES = 16  # lattices with shifts of their own
_FEWEST = 400  # effective draws below which an evidence is not believed: 0.05 if they were independent

_REACH, _HALVINGS = 30.0, 30  # of the logarithm below that of the highest power, and steps in it


def effective_share(log_weights: Array) -> float:
    """Kish's effective sample size over the number of points."""
    weights = special.softmax(log_weights)
    return float(1.0 / np.sum(weights**2)) / weights.size


def even_power(log_weights: Array, least: float, highest: float = 1.0) -> float:
    """The largest power of the weights, up to the highest, that leaves a share of the points effective."""
    if effective_share(highest * log_weights) >= least:
        return highest
    low, high = math.log(highest) - _REACH, math.log(highest)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        is_even = effective_share(math.exp(middle) * log_weights) >= least
        low, high = (middle, high) if is_even else (low, middle)
    return math.exp(low)


def tempered(log_weights: Array, least: float) -> Array:
    """Log weights times the largest power up to one that leaves a share of the points effective."""
    log_weights = np.where(np.isfinite(log_weights), log_weights, -1e300)
    return np.asarray(even_power(log_weights, least) * log_weights)


def replicated_evidence(log_weights: Array) -> tuple[float, float]:
    """Log of the mean weight, and its standard error from the scatter of the replicates' means, eq. (18).

    Parameters
    ----------
    log_weights : ndarray, (m,)
        Log of density over the one drawn from, replicate by replicate.
    """
    each = log_weights.reshape(REPLICATES, -1)
    log_z = special.logsumexp(each, axis=1) - math.log(each.shape[1])
    relative = np.exp(log_z - log_z.max())
    error = float(relative.std(ddof=1) / relative.mean()) / math.sqrt(REPLICATES)
    return float(special.logsumexp(log_z) - math.log(REPLICATES)), error


def believed_evidence(log_weights: Array) -> tuple[float, float]:
    """As `replicated_evidence`; the error is infinite where few draws carry the weight."""
    found, error = replicated_evidence(log_weights)
    weights = special.softmax(log_weights)
    is_even = float(weights.max()) <= LARGEST_WEIGHT and float(weights @ weights) <= 1.0 / _FEWEST
    return found, error if is_even else math.inf
