"""Sums over impacts that decide every fit of a bilinear closure, by intervals of tau.

On either side of its transition such a closure is linear: a tangential value is o + s k with k = A + B c
where it sticks and k = a0 + a1 c + kappa/tau where it slides. The misfit of the impacts of one interval of
tau, as long as no transition lies inside, is therefore a quadratic in the constants. Its coefficients are
the seven sums kept here; w is the weight, r = value - o, and x = 1/tau less that of the middle of the
interval (`middles`):

    n, sum w s^2, sum w s^2 x, sum w s^2 x^2, sum w s r, sum w s r x, sum w r^2

They do not depend on the closure. Sums are kept as unevaluated pairs of doubles (Knuth 1969; Dekker 1971,
Numer. Math. 18, 224), so that neither the order of impacts nor the parts they came in change a bit of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.physics.compiling import compiled

Array = NDArray[np.float64]
Index = NDArray[np.intp]

N, S_1, S_X, S_XX, S_Z, S_ZX, S_ZZ = range(7)  # z = r/s: named as moments of x and z under the weight w s^2
SUMS = 7


def bin_of(slip: Array, cosine: Array, bins: int) -> Index:
    """Interval of each impact: equal steps of tau/(1 + tau), where tau = slip/cosine."""
    both = slip + cosine
    share = np.divide(slip, both, out=np.zeros_like(both), where=both > 0.0)
    return np.minimum((share * bins).astype(np.intp), bins - 1)


def edges(bins: int) -> Array:
    """Values of tau between the intervals, (bins + 1,); the last is infinite."""
    share = np.arange(bins + 1) / bins
    with np.errstate(divide="ignore"):
        return share / (1.0 - share)


def middles(bins: int) -> Array:
    """1/tau in the middle of each interval, (bins,): about it 1/tau keeps its digits."""
    share = (np.arange(bins) + 0.5) / bins
    return np.asarray((1.0 - share) / share)


def about_zero(sums: Array) -> Array:
    """The sums with x = 1/tau itself, (..., bins, `SUMS`)."""
    x = middles(sums.shape[-2])
    found = sums.copy()
    found[..., S_X] += x * sums[..., S_1]
    found[..., S_XX] += x * (2.0 * sums[..., S_X] + x * sums[..., S_1])
    found[..., S_ZX] += x * sums[..., S_Z]
    return found


@dataclass(frozen=True)
class Moments:
    """Sums of each group and interval.

    Attributes
    ----------
    high, low : ndarray, (groups, bins, `SUMS`)
        A sum is the high part, to rounding; the low part is what that leaves.
    """

    high: Array
    low: Array

    @classmethod
    def nothing(cls, groups: int, bins: int) -> Moments:
        """Of no impacts."""
        shape = (groups, bins, SUMS)
        return cls(np.zeros(shape), np.zeros(shape))

    def add(self, group: Index, place: Index, w: Array, s: Array, r: Array, x: Array) -> None:
        """Add impacts, (n,) each: group, interval, weight, slope, value less offset, and x."""
        compiled(_accumulate)(self.high, self.low, group, place, w, s, r, x)

    def merge(self, other: Moments) -> Moments:
        """The sums of both."""
        high, low = _two_sum(self.high, other.high)
        low = low + (self.low + other.low)
        return Moments(*_two_sum(high, low))


@dataclass(frozen=True)
class ExactSum:
    """A sum of numbers that no order or parting changes, but for ties of its last bit."""

    high: float = 0.0
    low: float = 0.0

    def add(self, values: Array) -> ExactSum:
        """With some more numbers."""
        return self.merge(ExactSum(*compiled(_exact_sum)(values)))

    def merge(self, other: ExactSum) -> ExactSum:
        """The sum of both."""
        # an addend may come with more in its low part than its high part has in its last digit
        high, low = _two_sum(np.array([self.high]), np.array([other.high]))
        high, low = _two_sum(high, low + (self.low + other.low))
        return ExactSum(float(high[0]), float(low[0]))


def _two_sum(a: Array, b: Array) -> tuple[Array, Array]:
    """The rounded sum and what rounding left, exactly."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def _exact_sum(values: Array) -> tuple[float, float]:
    # what rounding leaves is added up beside: small as it is, its own rounding is of second order
    high, low = 0.0, 0.0
    for i in range(values.size):
        total = high + values[i]
        part = total - high
        low += (high - (total - part)) + (values[i] - part)
        high = total
    return high, low


def _accumulate(
    high: Array, low: Array, group: Index, place: Index, w: Array, s: Array, r: Array, x: Array
) -> None:
    terms = np.empty(7)
    for i in range(w.size):
        ws = w[i] * s[i]
        terms[0] = 1.0
        terms[1] = ws * s[i]
        terms[2] = terms[1] * x[i]
        terms[3] = terms[2] * x[i]
        terms[4] = ws * r[i]
        terms[5] = terms[4] * x[i]
        terms[6] = w[i] * r[i] * r[i]
        g, b = group[i], place[i]
        for k in range(7):
            a, t = high[g, b, k], terms[k]
            total = a + t
            part = total - a
            rest = (a - (total - part)) + (t - part) + low[g, b, k]
            new = total + rest
            high[g, b, k] = new
            low[g, b, k] = rest - (new - total)
