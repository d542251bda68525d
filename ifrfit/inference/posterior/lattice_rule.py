"""Evenly spread points in a unit cube: a rank-1 lattice sequence with a random shift.

Eq. (17) of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Generating vector of an extensible lattice in base 2, order-2 weights, up to 2^20 points: Cools, Kuo &
# Nuyens (2006), SIAM J. Sci. Comput. 28, 2162
_GENERATOR = np.array(
    [1, 182667, 469891, 498753, 110745, 446247, 250185, 118627, 245333, 283199,
     408519, 391023, 246327, 126539, 399185, 461527, 300343, 69681, 516695, 436179,
     106383, 238523, 413283, 70841, 47719, 300129, 113029, 123925, 410745, 211325,
     17489, 511893, 40767, 186077, 519471, 255369, 101819, 243573, 66189, 152143]
)  # fmt: skip
_INSIDE = 2.0**-40  # from the faces of the cube


def lattice(n: int, shift: Array, *, finer: bool = False) -> Array:
    """Points of the shifted lattice, (n, d).

    Averages over them are unbiased over uniform shifts, and for smooth integrands their error falls nearly as
    1/n, where that of random points falls as 1/sqrt(n).

    Parameters
    ----------
    n : int
        A power of 2.
    shift : ndarray, (d,)
        Uniform between 0 and 1; of at most 40 dimensions.
    finer : bool
        Give the other half of the lattice of 2 n points with this shift.
    """
    generator = _GENERATOR[: shift.size]
    steps = np.arange(n)[:, None] + (0.5 if finer else 0.0)
    return np.asarray(np.clip((steps * generator / n + shift) % 1.0, _INSIDE, 1.0 - _INSIDE))
