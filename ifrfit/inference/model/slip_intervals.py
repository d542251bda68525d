"""Intervals of the slip ratio tau, with the rows that lie in each."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_FINE = 4.0  # intervals, times the root of the number of rows: it balances sums against rows that are sorted
_MOST = 8192
_NARROW = 1e-6  # relative spread of 1 + tau below which intervals would lose their digits
_BLOCK = 32768  # rows at once, which stay in the cache


@dataclass(frozen=True)
class SlipIntervals:
    """Rows by intervals of tau, spread as angles are.

    Attributes
    ----------
    which : ndarray of uint16, (n,)
        Interval of each row; it never falls where tau rises.
    count : ndarray of int, (m,)
    edges : ndarray, (m + 1,)
        Ends of the intervals; those of the first and the last reach to 0 and to infinity.
    """

    which: NDArray[np.uint16]
    count: Index
    edges: Array

    @classmethod
    def of(cls, tau: Array) -> SlipIntervals | None:
        """Intervals between the lowest tau and the highest; None where one is 0 or infinite, or all agree.

        Parameters
        ----------
        tau : ndarray, (n,)
        """
        low, high = ends_of(tau)
        if not 0.0 < low <= high < np.inf or high - low < _NARROW * (1.0 + high):
            return None
        m = min(int(_FINE * math.sqrt(tau.size)), _MOST)
        # 1/(1 + tau) never rises with tau, rounded or not
        top = 1.0 / (1.0 + low)
        scale = m * (1.0 - 1e-9) / (top - 1.0 / (1.0 + high))
        which, count = np.empty(tau.size, dtype=np.uint16), np.zeros(m, dtype=np.intp)
        for first in range(0, tau.size, _BLOCK):
            at = slice(first, first + _BLOCK)
            place = tau[at] + 1.0
            np.divide(-scale, place, out=place)
            place += top * scale
            which[at] = here = place.astype(np.intp)
            count += np.bincount(here, minlength=m)
        edges = 1.0 / (top - np.arange(m + 1.0) / scale) - 1.0
        edges[0], edges[-1] = 0.0, np.inf
        return cls(which, count, edges)


def ends_of(tau: Array) -> tuple[float, float]:
    """The lowest and the highest; 0 of none."""
    return (float(tau[tau.argmin()]), float(tau[tau.argmax()])) if tau.size else (0.0, 0.0)
