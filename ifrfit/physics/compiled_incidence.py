"""The incoming state of very many impacts, with the same bits wherever a row stands and whoever computes it.

Sine and cosine are the polynomials of fdlibm (Sun Microsystems 1993, k_sin.c and k_cos.c: below one unit of
the last digit), written out so that they are computed for several rows at once by sums and products alone.
What numpy computes depends on the instructions that a machine has.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.physics.angles import Incidence
from ifrfit.physics.compiling import compiled

Array = NDArray[np.float64]
Index = NDArray[np.int32]

PARTS = 16  # of an interval of tau that is parted
_RADIANS = math.pi / 180.0
_S1, _S2, _S3 = -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04
_S4, _S5, _S6 = 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10
_C1, _C2, _C3 = 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05
_C4, _C5, _C6 = -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11


def incidence_of(gamma_deg: Array, spin_x: Array | None = None, spin_y: Array | None = None) -> Incidence:
    """The state before impact from angles in degrees and spins, (n,) each; None: no spin.

    The arrays become read-only.
    """
    sine, cosine = np.empty(gamma_deg.size), np.empty(gamma_deg.size)
    compiled(_sines_cosines)(read_only(gamma_deg), sine, cosine)
    if spin_x is None or spin_y is None:
        none = _zeros(gamma_deg.size)
        return Incidence(sine, cosine, none, none, sine, none)
    return Incidence(sine, cosine, spin_x, spin_y, sine + spin_y, spin_x)


@lru_cache(maxsize=4)
def _zeros(n: int) -> Array:
    found = np.zeros(n)
    found.flags.writeable = False
    return found


def intervals_of(
    incidence: Incidence, steps: int, middles: Array, first: Index, number: Index
) -> tuple[Index, Array]:
    """Interval of tau of each impact, and its 1/tau less that of the middle of the interval, (n,) each.

    Intervals are equal steps of tau/(1 + tau), some of which are parted. Without slip 1/tau is as in the
    middle of the first.

    Parameters
    ----------
    incidence : Incidence
    steps : int
    middles : ndarray, (intervals,)
        1/tau there.
    first, number : ndarray of int, (nodes,)
        Of the steps, and of what they are parted into: the first of the `PARTS` nodes, or -1, and else the
        number of the interval.
    """
    place = np.empty(incidence.sine.size, dtype=np.int32)
    x = np.empty(place.size)
    slip = incidence.slip_x, incidence.slip_y
    rows = tuple(map(read_only, (*slip, incidence.cosine, middles)))
    if first.size == steps:
        compiled(_equal_intervals)(*rows, place, x)
    else:
        compiled(_intervals)(*rows, steps, *map(read_only, (first, number)), place, x)
    return place, x


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """The array as compiled loops take it: in one piece and read-only, so that each is compiled once."""
    view = np.ascontiguousarray(array).view()
    view.flags.writeable = False
    return view


def _sines_cosines(gamma: Array, sine: Array, cosine: Array) -> None:
    for i in range(gamma.size):
        steep = gamma[i] > 45.0
        small = 90.0 - gamma[i] if steep else gamma[i]
        r = small * _RADIANS
        z = r * r
        s = r + z * r * (_S1 + z * (_S2 + z * (_S3 + z * (_S4 + z * (_S5 + z * _S6)))))
        half = 0.5 * z
        w = 1.0 - half
        c = w + (((1.0 - w) - half) + z * z * (_C1 + z * (_C2 + z * (_C3 + z * (_C4 + z * (_C5 + z * _C6))))))
        c = s if small == 45.0 else c  # tau is 1 there, exactly
        sine[i] = c if steep else s
        cosine[i] = s if steep else c


def _equal_intervals(
    slip_x: Array, slip_y: Array, cosine: Array, middles: Array, place: Index, x: Array
) -> None:
    bins = middles.size
    for i in range(slip_x.size):
        slip = math.sqrt(slip_x[i] * slip_x[i] + slip_y[i] * slip_y[i])
        slip = abs(slip_x[i]) if slip_y[i] == 0.0 else slip
        both = slip + cosine[i]
        share = slip / (both if both > 0.0 else 1.0)
        place[i] = min(np.int32(share * bins), np.int32(bins - 1))
        x[i] = cosine[i] / slip if slip > 0.0 else np.nan
    for i in range(slip_x.size):
        x[i] = x[i] - middles[place[i]] if x[i] == x[i] else 0.0


def _intervals(
    slip_x: Array,
    slip_y: Array,
    cosine: Array,
    middles: Array,
    steps: int,
    first: Index,
    number: Index,
    place: Index,
    x: Array,
) -> None:
    share = np.empty(slip_x.size)
    for i in range(slip_x.size):
        slip = math.sqrt(slip_x[i] * slip_x[i] + slip_y[i] * slip_y[i])
        slip = abs(slip_x[i]) if slip_y[i] == 0.0 else slip
        both = slip + cosine[i]
        share[i] = slip / (both if both > 0.0 else 1.0) * steps  # exactly so many steps
        place[i] = min(np.int32(share[i]), np.int32(steps - 1))
        x[i] = cosine[i] / slip if slip > 0.0 else np.nan
    for i in range(slip_x.size):
        node, rest = place[i], share[i] - place[i]
        while first[node] >= 0:
            rest = rest * PARTS
            part = min(np.int32(rest), np.int32(PARTS - 1))
            node, rest = first[node] + part, rest - part
        place[i] = number[node]
        x[i] = x[i] - middles[place[i]] if x[i] == x[i] else 0.0
