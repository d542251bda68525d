"""The compliance number chi, and the Poisson ratio behind it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ifrfit.physics.angles import Array

LEAST_RATIO, LARGEST_RATIO = 2.0 / 3.0, 1.0  # tangential over normal stiffness at nu = 0.5 and at nu = 0


def stiffness_ratio(nu: ArrayLike) -> Array:
    """Tangential over normal stiffness of a contact of like materials, 2 (1 - nu)/(2 - nu)."""
    nu = np.asarray(nu, dtype=float)
    return np.asarray(2.0 * (1.0 - nu) / (2.0 - nu))


def chi_of(nu: ArrayLike, inertia_factor: float = 0.4) -> Array:
    """Compliance number chi = khat (1 + 1/J)/2, where khat is the stiffness ratio.

    Parameters
    ----------
    nu : array_like
        Poisson ratio of sphere and wall, 0 to 0.5.
    inertia_factor : float
        J = I/(m R^2); 2/5 gives 7 (1 - nu)/(2 (2 - nu)).

    Returns
    -------
    ndarray

    Notes
    -----
    Maw, Barber & Fawcett (1976), Wear 38, 101. Unlike materials have khat = 4 G*/E*, with
    1/G* = sum of (2 - nu)/G and 1/E* = sum of (1 - nu^2)/E.
    """
    return np.asarray(0.5 * stiffness_ratio(nu) * (1.0 + 1.0 / inertia_factor))


def poisson_ratio(chi: ArrayLike, inertia_factor: float = 0.4) -> Array:
    """Poisson ratio of a sphere and a wall of one material that have this chi: the inverse of `chi_of`."""
    khat = 2.0 * np.asarray(chi, dtype=float) * inertia_factor / (1.0 + inertia_factor)
    return np.asarray(2.0 * (1.0 - khat) / (2.0 - khat))
