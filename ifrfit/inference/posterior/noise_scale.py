"""The likelihood of rows that share one unknown sigma, with that sigma integrated out; and of known sigma.

Eq. (5) of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

Array = NDArray[np.float64]

_SAFE = 1e-17  # tail of the incomplete gamma function that no result feels
_TERMS = 200  # of series and fractions, in tails that are rarely met
_LOG_2PI = math.log(2.0 * math.pi)


@dataclass(frozen=True)
class NoiseScale:
    """Rows that share one unknown sigma: n of them, with sigma log-uniform between bounds, eq. (5)."""

    n: float
    lower: float
    upper: float

    def log_likelihood(self, square: Array) -> Array:
        """Log of the likelihood of a sum of squared residuals, sigma integrated out.

        The integral of sigma^-n exp(-q/(2 sigma^2)) over d sigma/sigma is an incomplete gamma function.
        """
        half = 0.5 * self.n
        q = np.maximum(0.5 * square, np.finfo(float).tiny)
        return np.asarray(self.log_constant - half * math.log(2.0) - half * np.log(q) + self._log_inside(q))

    @property
    def log_constant(self) -> float:
        """Log of that likelihood over Q^(-n/2), where the bounds cut nothing off."""
        half = 0.5 * self.n
        constant = float(special.gammaln(half)) - half * (_LOG_2PI - math.log(2.0))
        return constant - math.log(2.0 * self.span)

    def keeps_all(self, least: float, most: float) -> bool:
        """Whether the bounds cut nothing off at sums of squares between these."""
        half = 0.5 * self.n
        top, bottom = 0.5 * least / self.lower**2, 0.5 * most / self.upper**2
        return bool(top > special.gammainccinv(half, _SAFE) and bottom < special.gammaincinv(half, _SAFE))

    @property
    def span(self) -> float:
        """Log of the ratio of the bounds."""
        return math.log(self.upper / self.lower)

    def _log_inside(self, q: Array) -> Array:
        """Log of the share of the gamma law of w = q/sigma^2 that lies between the bounds."""
        half = 0.5 * self.n
        enough = float(special.gammainccinv(half, _SAFE))
        little = float(special.gammaincinv(half, _SAFE))
        out = np.zeros(q.shape)
        top, bottom = q / self.lower**2, q / self.upper**2
        cut = (top < enough) | (bottom > little)
        if cut.any():
            out[cut] = _log_gamma_share(half, bottom[cut], top[cut])
        return out

    def density(self, log_sigma: Array, square: Array) -> Array:
        """Density of the logarithm of sigma, between the bounds, given the sum of squares."""
        given = self.log_likelihood(square) + 0.5 * self.n * _LOG_2PI + math.log(self.span)
        inverse = np.exp(-2.0 * log_sigma)
        return np.asarray(np.exp(-self.n * log_sigma - 0.5 * square * inverse - given))

    def draw(self, square: Array, rng: np.random.Generator) -> Array:
        """One sigma for each sum of squares."""
        half = 0.5 * self.n
        q = np.maximum(0.5 * square, np.finfo(float).tiny)
        bottom, top = q / self.upper**2, q / self.lower**2
        w = rng.standard_gamma(half, q.shape)
        out = (w < bottom) | (w > top)
        if out.any():
            w[out] = _gamma_between(half, bottom[out], top[out], rng.random(int(out.sum())))
        return np.asarray(np.sqrt(q / np.clip(w, bottom, top)))


@dataclass(frozen=True)
class KnownScale:
    """Rows of known sigma beside others of unknown one: n of them, their squares over sigma."""

    n: int

    def log_likelihood(self, square: Array) -> Array:
        """Log of the likelihood of a weighted sum of squared residuals, but for the log of the weights."""
        return np.asarray(-0.5 * square - 0.5 * self.n * _LOG_2PI)


Scale = NoiseScale | KnownScale


def _gamma_between(a: float, low: Array, high: Array, p: Array) -> Array:
    """Quantiles p of the gamma law cut off at both ends, from the tail in which the digits are."""
    upper = low > a
    share_low, share_high = (
        np.where(upper, special.gammaincc(a, end), special.gammainc(a, end)) for end in (low, high)
    )
    share = share_low + p * (share_high - share_low)
    found = np.where(upper, special.gammainccinv(a, share), special.gammaincinv(a, share))
    # where the shares are below all numbers, an exponential law from the end that is next to the mode
    end = np.maximum(np.where(upper, low, high), np.finfo(float).tiny)
    with np.errstate(divide="ignore"):
        near_end = end + np.log1p(-p) / ((a - 1.0) / end - 1.0)
    return np.asarray(np.where(share > 0.0, found, near_end))


def _log_gamma_share(a: float, low: Array, high: Array) -> Array:
    """Log of P(a, high) - P(a, low), from the tail in which the digits are."""
    low, high = np.broadcast_arrays(np.asarray(low, dtype=float), np.asarray(high, dtype=float))
    upper = low > a  # both in the upper tail: complements keep their digits
    share = np.empty(low.shape)
    share[upper] = special.gammaincc(a, low[upper]) - special.gammaincc(a, high[upper])
    share[~upper] = special.gammainc(a, high[~upper]) - special.gammainc(a, low[~upper])
    out = np.log(np.maximum(share, 1e-290))
    lost = share <= 1e-290
    if lost.any():
        far, side = (low[lost], high[lost]), upper[lost]
        larger, smaller = (_log_tail(a, np.where(side, *ends), side) for ends in (far, far[::-1]))
        out[lost] = larger + np.log1p(-np.exp(np.minimum(smaller - larger, -1e-16)))
    return np.asarray(out)


def _log_tail(a: float, x: Array, upper: NDArray[np.bool_]) -> Array:
    """Log of P(a, x), or of its complement where `upper`, far outside where they are below all numbers.

    By the power series, and by the continued fraction, of the incomplete gamma functions: Abramowitz & Stegun
    (1964), 6.5.29 and 6.5.31.
    """
    x = np.maximum(x, np.finfo(float).tiny)
    inside, outside = np.minimum(x, a), np.maximum(x, a + 1.0)  # where each of the two holds
    series, term = np.ones_like(x), np.ones_like(x)
    for k in range(1, _TERMS):
        term = term * inside / (a + k)
        series = series + term
    fraction = outside + 2.0 * _TERMS + 1.0 - a
    for k in range(_TERMS, 0, -1):
        fraction = outside + 2.0 * k - 1.0 - a - k * (k - a) / fraction
    power = a * np.log(x) - x
    log_series = power - special.gammaln(a + 1.0) + np.log(series)
    return np.asarray(np.where(upper, power - special.gammaln(a) - np.log(fraction), log_series))
