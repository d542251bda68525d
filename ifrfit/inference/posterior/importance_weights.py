"""How evenly weights lie on points, and powers of them that lie evenly enough."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import special

Array = NDArray[np.float64]


def effective_share(log_weights: Array) -> float:
    """Kish's effective sample size over the number of points."""
    weights = special.softmax(log_weights)
    return float(1.0 / np.sum(weights**2)) / weights.size


def tempered(log_weights: Array, least: float) -> Array:
    """Log weights times the largest power up to one that leaves a share of the points effective."""
    low, high = 0.0, 1.0
    log_weights = np.where(np.isfinite(log_weights), log_weights, -1e300)
    if effective_share(log_weights) >= least:
        return log_weights
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if effective_share(middle * log_weights) >= least else (low, middle)
    return np.asarray(low * log_weights)
