"""Coordinates without ends, in which the constants of groups are normal over a population."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, log_expit, logit

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Coordinate:
    """A coordinate without ends for a constant: the logit of its share of the domain, its log, or itself."""

    lower: float
    upper: float

    def to(self, x: Array) -> Array:
        """The coordinate of values; infinite at the ends of the domain."""
        if math.isfinite(self.lower) and math.isfinite(self.upper):
            share = np.clip((x - self.lower) / (self.upper - self.lower), 0.0, 1.0)
            return np.asarray(logit(share))
        if math.isfinite(self.lower):
            with np.errstate(divide="ignore"):
                return np.log(np.maximum(x - self.lower, 0.0))
        return np.asarray(x, dtype=float)

    def back(self, y: Array) -> Array:
        """The values at coordinates."""
        if math.isfinite(self.lower) and math.isfinite(self.upper):
            return np.asarray(self.lower + (self.upper - self.lower) * expit(y))
        if math.isfinite(self.lower):
            return np.asarray(self.lower + np.exp(y))
        return np.asarray(y, dtype=float)

    def log_jacobian(self, y: Array) -> Array:
        """Logarithm of dx/dy but for a constant: of what a uniform density of x is over y."""
        if math.isfinite(self.lower) and math.isfinite(self.upper):
            return np.asarray(log_expit(y) + log_expit(-y))
        return np.asarray(y if math.isfinite(self.lower) else np.zeros_like(y))

    def tilt(self, y: Array) -> Array:
        """Slope of `log_jacobian`."""
        if math.isfinite(self.lower) and math.isfinite(self.upper):
            return np.asarray(-np.tanh(0.5 * y))
        return np.full_like(y, 1.0 if math.isfinite(self.lower) else 0.0)
