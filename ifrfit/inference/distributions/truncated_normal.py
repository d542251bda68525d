"""Normal and Student-t distributions cut off at bounds."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from scipy import special

_FAR = 8.0  # beyond so many sd the tails are followed on a log scale


@dataclass(frozen=True)
class TruncatedNormal:
    """A normal (or Student-t) distribution restricted to [lower, upper].

    Attributes
    ----------
    mode : float
        Its largest density inside the bounds: the optimum.
    center, sd : float
        Before it is cut; the centre lies beyond a bound that holds the optimum back. An infinite sd stands
        for a quantity that the data do not see: then everything between the bounds is equally likely.
    lower, upper : float
        Bounds, may be infinite.
    dof : float
        Degrees of freedom of Student's t; infinite for the normal distribution.
    """

    mode: float
    center: float
    sd: float
    lower: float
    upper: float
    dof: float = math.inf

    def quantile(self, p: float) -> float:
        """Quantile p, 0 to 1."""
        if math.isinf(self.sd):
            return self.lower if p == 0.0 else self.lower + p * (self.upper - self.lower)
        if self.sd == 0.0:
            return min(max(self.center, self.lower), self.upper)
        low, high = (self.lower - self.center) / self.sd, (self.upper - self.center) / self.sd
        # from the tail in which the bounds lie, so that probabilities keep their digits
        if low > 0.0:
            return self.center - self.sd * _cut(1.0 - p, -high, -low, self.dof)
        return self.center + self.sd * _cut(p, low, high, self.dof)

    def cdf(self, x: float) -> float:
        """Probability below x."""
        if x <= self.lower or x >= self.upper:
            return float(x >= self.upper)
        if math.isinf(self.sd):
            return (x - self.lower) / (self.upper - self.lower)
        if self.sd == 0.0:
            return float(x >= self.mode)
        below, _ = _functions(self.dof)
        # from the tail in which the bounds lie, so that probabilities keep their digits
        sign = -1.0 if self.center < self.lower else 1.0
        low, at, high = (below(sign * (y - self.center) / self.sd) for y in (self.lower, x, self.upper))
        return min(max((at - low) / (high - low), 0.0), 1.0) if high != low else float(x >= self.mode)

    def half_width(self, level: float) -> float:
        """Half width of the central interval of the given level before the cut."""
        return half_width(level, self.dof) * self.sd


def _cut(p: float, low: float, high: float, dof: float) -> float:
    cdf, inverse = _functions(dof)
    below, above = cdf(low), cdf(high)
    if above - below <= 0.0 or (math.isinf(dof) and high < -_FAR):
        # so far out that the tail is exponential with rate |high|
        rate = max(abs(high), 1.0)
        reach = 1.0 - math.exp(-rate * (high - low)) if math.isfinite(low) else 1.0
        return max(low, high + math.log1p(-(1.0 - p) * reach) / rate)
    return min(max(inverse(below + p * (above - below)), low), high)


def _functions(dof: float) -> tuple[Callable[[float], float], Callable[[float], float]]:
    if math.isinf(dof):
        return lambda x: float(special.ndtr(x)), lambda p: float(special.ndtri(p))
    return lambda x: float(special.stdtr(dof, x)), lambda p: float(special.stdtrit(dof, p))


def half_width(level: float, dof: float = math.inf) -> float:
    """Half width of the central interval of the given level, in sd."""
    return _functions(dof)[1](0.5 + 0.5 * level)
