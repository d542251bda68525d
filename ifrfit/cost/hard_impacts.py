"""Impacts on which few digits are put to the test."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ifrfit.physics.angles import Array

_SEED = 7


@dataclass(frozen=True)
class Impact:
    """Impacts before they happen.

    Attributes
    ----------
    gamma_deg, spin_x, spin_y : ndarray, (n,)
        Incidence angle in degrees; R omega/u in the paper's signs.
    """

    gamma_deg: Array
    spin_x: Array
    spin_y: Array


Draw = Callable[[np.random.Generator, int, float], tuple[Array, Array, Array]]


def _free(low: float, high: float, spin: float) -> Draw:
    """Angles in a range (degrees), with spins of this size about both axes."""
    return lambda rng, n, kappa: (
        rng.uniform(low, high, n),
        spin * rng.standard_normal(n),
        spin * rng.standard_normal(n),
    )


def _rolling_on(share: float) -> Draw:
    """Top-spin that takes all but this share of the slip."""

    def draw(rng: np.random.Generator, n: int, kappa: float) -> tuple[Array, Array, Array]:
        gamma = rng.uniform(20.0, 70.0, n)
        left = share * rng.uniform(0.5, 1.0, n) * rng.choice([-1.0, 1.0], n)
        return gamma, np.zeros(n), -np.sin(np.radians(gamma)) * (1.0 - left)

    return draw


def _transition(distance: float) -> Draw:
    """IFR without spin at its transition, tau = (5/2) kappa, to this relative distance."""

    def draw(rng: np.random.Generator, n: int, kappa: float) -> tuple[Array, Array, Array]:
        tau = 2.5 * kappa * (1.0 + distance * rng.uniform(-1.0, 1.0, n))
        return np.degrees(np.arctan(tau)), np.zeros(n), np.zeros(n)

    return draw


# names are rows of a table at the terminal: at most 24 letters
_DRAWS: dict[str, Draw] = {
    "5 to 80 deg, spins 0.3": _free(5.0, 80.0, 0.3),
    "at the transition": _transition(1e-6),
    "normal, below 0.001 deg": _free(1e-6, 1e-3, 0.0),
    "grazing, from 89 deg": _free(89.0, 89.9, 0.0),
    "grazing, from 89.999 deg": _free(89.999, 89.9999, 0.0),
    "slip cancels to 1e-3": _rolling_on(1e-3),
    "slip cancels to 1e-6": _rolling_on(1e-6),
    "spins of 1e3": _free(5.0, 80.0, 1e3),
    "spins of 1e6": _free(5.0, 80.0, 1e6),
}
HARD = tuple(_DRAWS)


def hard_impacts(name: str, count: int, kappa: float) -> Impact:
    """So many impacts of one kind, the same on every call.

    Parameters
    ----------
    name : str
        One of `HARD`.
    count : int
    kappa : float
        mu (1 + e_n), which decides where the transition lies.
    """
    return Impact(*_DRAWS[name](np.random.default_rng(_SEED), count, kappa))
