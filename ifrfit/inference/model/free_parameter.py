"""An unknown of the posterior: its domain and its proper prior."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.prior_laws import ShapedLaw

Array = NDArray[np.float64]

_WIDE = 10.0  # sd beyond the mean of a Gaussian prior to which an unbounded domain reaches


@dataclass(frozen=True)
class FreeParameter:
    """One free entry of theta.

    Attributes
    ----------
    name : str
        Its label in theta.
    lower, upper : float
        Domain, finite.
    prior : (float, float) or None
        Mean and sd of a Gaussian cut off at the domain; None for a uniform one.
    log_scale : float
        Log density of the uniform prior, or log of what normalises the Gaussian.
    shape : ShapedLaw or None
        Whose density stands in the place of both.
    """

    name: str
    lower: float
    upper: float
    prior: tuple[float, float] | None
    log_scale: float
    shape: ShapedLaw | None = None

    @classmethod
    def of(cls, name: str, constant: Parameter) -> FreeParameter:
        """The unknown behind a constant; an unbounded mu reaches to the end of its default prior."""
        lower, upper = constant.lower, constant.upper
        if math.isinf(upper):
            upper = constant.prior_upper
            if constant.prior is not None:
                upper = max(upper, constant.prior[0] + _WIDE * constant.prior[1])
        if constant.prior is None:
            return cls(name, lower, upper, None, -math.log(upper - lower))
        mean, sd = constant.prior
        log_scale = -_log_between((lower - mean) / sd, (upper - mean) / sd)
        return cls(name, lower, upper, constant.prior, log_scale, constant.shape)

    def log_prior(self, value: Array) -> Array | float:
        """Log density inside the domain."""
        if self.shape is not None:
            return self.shape.log_density(value, self.lower, self.upper)
        if self.prior is None:
            return self.log_scale
        mean, sd = self.prior
        z = (value - mean) / sd
        return np.asarray(self.log_scale - math.log(sd * math.sqrt(2.0 * math.pi)) - 0.5 * z * z)


def _log_between(low: float, high: float) -> float:
    """Log of the normal law's share between two ends, from the tail in which the digits are."""
    if low > 0.0:
        low, high = -high, -low
    top, bottom = float(special.log_ndtr(high)), float(special.log_ndtr(low))
    return top + math.log1p(-math.exp(bottom - top))
