"""Sums over impacts that decide every fit of a bilinear closure, by intervals of tau.

On either side of its transition such a closure is linear: a tangential value is o + s k with k = A + B c
where it sticks and k = a0 + a1 c + kappa/tau where it slides. The misfit of the impacts of one interval of
tau, as long as no transition lies inside, is therefore a quadratic in the constants. Its coefficients are
the seven sums kept here; w is the weight, r = value - o, and x = 1/tau less that of the middle of the
interval (`tau_intervals`):

    n, sum w s^2, sum w s^2 x, sum w s^2 x^2, sum w s r, sum w s r x, sum w r^2

They do not depend on the closure. Sums are kept as unevaluated pairs of doubles (Knuth 1969; Dekker 1971,
Numer. Math. 18, 224), so that neither the order of impacts nor the parts they came in change a bit of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.sufficient_statistics.compensated_addition import add_to_sums, use_vectors
from ifrfit.physics.compiled_incidence import read_only
from ifrfit.physics.compiling import compiled

Array = NDArray[np.float64]
Place = NDArray[np.int32]
Number = TypeVar("Number", float, Array)

N, S_1, S_X, S_XX, S_Z, S_ZX, S_ZZ = range(7)  # z = r/s: named as moments of x and z under the weight w s^2
SUMS = 7
_LANES = 16


def about_zero(sums: Array, middles: Array) -> Array:
    """The sums with x = 1/tau itself, (..., bins, `SUMS`); `middles` are the places that x is taken off."""
    x = middles
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
        A sum is both together; after a merge the high part is the sum to rounding.
    """

    high: Array
    low: Array

    @classmethod
    def nothing(cls, groups: int, bins: int) -> Moments:
        """Of no impacts."""
        shape = (groups, bins, SUMS)
        return cls(np.zeros(shape), np.zeros(shape))

    def add(self, group: int, place: Place, w: Array, s: Array, r: Array, x: Array) -> None:
        """Add impacts of a group, (n,) each: interval, weight, slope, value less offset, and x."""
        use_vectors()
        terms = map(read_only, (w, s, r, x))
        compiled(_accumulate)(self.high[group], self.low[group], read_only(place), *terms)

    def add_values(
        self, group: int, place: Place, sigma: Array, s: Array, value: Array, offset: Array, x: Array
    ) -> None:
        """As `add`, with weights of sigma^-2: interval, sigma, slope, value, offset, and x, (n,) each."""
        use_vectors()
        terms = map(read_only, (sigma, s, value, offset, x))
        compiled(_accumulate_values)(self.high[group], self.low[group], read_only(place), *terms)

    def add_direct(self, group: int, sigma: Array, s: Array, r: Array) -> None:
        """Add impacts whose values are a constant times the slope: all in one interval, where x is zero.

        Weights are sigma^-2.
        """
        high, low = self.high[group, 0], self.low[group, 0]
        high[N] += sigma.size
        ends = [each[sigma.size // _LANES * _LANES :] for each in (sigma, s, r)]
        ends[0] = 1.0 / (ends[0] * ends[0])
        sums, lows = compiled(_direct)(*map(read_only, (sigma, s, r)))
        for place, (of, a, b) in enumerate(((S_1, 1, 1), (S_Z, 1, 2), (S_ZZ, 2, 2))):
            rest = (ends[0] * ends[a]) * ends[b]
            found = compiled(_of_lanes)(sums[place], lows[place], rest)
            merged = ExactSum(float(high[of]), float(low[of])).merge(ExactSum(*found))
            high[of], low[of] = merged.high, merged.low

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
        lanes = compiled(_exact_sum)(read_only(values))
        return self.merge(ExactSum(*compiled(_of_lanes)(*lanes, values[values.size // _LANES * _LANES :])))

    def add_squares(self, values: Array) -> ExactSum:
        """With the squares of some more numbers."""
        rest = values[values.size // _LANES * _LANES :]
        lanes = compiled(_exact_squares)(read_only(values))
        return self.merge(ExactSum(*compiled(_of_lanes)(*lanes, rest * rest)))

    @classmethod
    def of_equal(cls, value: float, count: int) -> ExactSum:
        """Of a number so many times."""
        return cls(*_of_equal(value, count))

    def merge(self, other: ExactSum) -> ExactSum:
        """The sum of both."""
        # an addend may come with more in its low part than its high part has in its last digit
        high, low = _two_sum(self.high, other.high)
        return ExactSum(*_two_sum(high, low + (self.low + other.low)))


@lru_cache(maxsize=64)  # the same sigma stands in every batch
def _of_equal(value: float, count: int) -> tuple[float, float]:
    high = value * count
    return high, float(Fraction(value) * count - Fraction(high))


def _two_sum(a: Number, b: Number) -> tuple[Number, Number]:
    """The rounded sum and what rounding left, exactly."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def _exact_sum(values: Array) -> tuple[Array, Array]:
    # what rounding leaves is added up beside: small as it is, its own rounding is of second order
    high, low = np.zeros(_LANES), np.zeros(_LANES)
    whole = values.size // _LANES * _LANES
    for first in range(0, whole, _LANES):
        for k in range(_LANES):  # next to one another, so that the processor takes them together
            total = high[k] + values[first + k]
            part = total - high[k]
            low[k] += (high[k] - (total - part)) + (values[first + k] - part)
            high[k] = total
    return high, low


def _of_lanes(high: Array, low: Array, others: Array) -> tuple[float, float]:
    """The sum of lanes, and of numbers beside them."""
    sum_, rest = 0.0, 0.0
    for i in range(_LANES + others.size):
        term = high[i] if i < _LANES else others[i - _LANES]
        total = sum_ + term
        part = total - sum_
        rest += (sum_ - (total - part)) + (term - part)
        sum_ = total
    for k in range(_LANES):
        rest += low[k]
    return sum_, rest


def _exact_squares(values: Array) -> tuple[Array, Array]:
    high, low = np.zeros(_LANES), np.zeros(_LANES)
    whole = values.size // _LANES * _LANES
    for first in range(0, whole, _LANES):
        for k in range(_LANES):
            term = values[first + k] * values[first + k]
            total = high[k] + term
            part = total - high[k]
            low[k] += (high[k] - (total - part)) + (term - part)
            high[k] = total
    return high, low


def _direct(sigma: Array, s: Array, r: Array) -> tuple[Array, Array]:
    """Sums of w s^2, w s r and w r^2, (3, lanes), but for the last rows."""
    high, low = np.zeros((3, _LANES)), np.zeros((3, _LANES))
    whole = sigma.size // _LANES * _LANES
    for first in range(0, whole, _LANES):
        for k in range(_LANES):
            i = first + k
            w = 1.0 / (sigma[i] * sigma[i])
            ws = w * s[i]
            one, two, three = ws * s[i], ws * r[i], w * r[i] * r[i]
            total = high[0, k] + one
            part = total - high[0, k]
            low[0, k] += (high[0, k] - (total - part)) + (one - part)
            high[0, k] = total
            total = high[1, k] + two
            part = total - high[1, k]
            low[1, k] += (high[1, k] - (total - part)) + (two - part)
            high[1, k] = total
            total = high[2, k] + three
            part = total - high[2, k]
            low[2, k] += (high[2, k] - (total - part)) + (three - part)
            high[2, k] = total
    return high, low


def _accumulate(high: Array, low: Array, place: Place, w: Array, s: Array, r: Array, x: Array) -> None:
    sums, rests = high.reshape(-1), low.reshape(-1)
    for i in range(w.size):
        first = np.int64(place[i]) * SUMS
        ws = w[i] * s[i]
        one, z = ws * s[i], ws * r[i]
        sums[first] += 1.0
        add_to_sums(sums, rests, first + 1, (one, one * x[i], one * x[i] * x[i], z))
        add_to_sums(sums, rests, first + 5, (z * x[i], w[i] * r[i] * r[i]))


def _accumulate_values(
    high: Array, low: Array, place: Place, sigma: Array, s: Array, value: Array, offset: Array, x: Array
) -> None:
    sums, rests = high.reshape(-1), low.reshape(-1)
    for i in range(sigma.size):
        first = np.int64(place[i]) * SUMS
        w, r = 1.0 / (sigma[i] * sigma[i]), value[i] - offset[i]
        ws = w * s[i]
        one, z = ws * s[i], ws * r
        sums[first] += 1.0
        add_to_sums(sums, rests, first + 1, (one, one * x[i], one * x[i] * x[i], z))
        add_to_sums(sums, rests, first + 5, (z * x[i], w * r * r))
