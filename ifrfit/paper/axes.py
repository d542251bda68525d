"""What stands on the axes of a figure: a function of the incidence angle across, an observable up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.physics import OBSERVABLES

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Abscissa:
    """The horizontal axis.

    Attributes
    ----------
    label : str
        With its unit.
    low, high : float
    ticks : tuple of float
    grid : ndarray
        Where curves are computed, in x.
    gamma : callable
        x to the incidence angle in degrees.
    of_gamma : callable
        The incidence angle in degrees to x.
    logarithmic : bool
    spin : bool
        x is the lateral spin R omega_x/u at one angle, not a function of the angle.
    """

    label: str
    low: float
    high: float
    ticks: tuple[float, ...]
    grid: Array
    gamma: Callable[[Array], Array]
    of_gamma: Callable[[Array], Array]
    logarithmic: bool = False
    spin: bool = False

    def inside(self, gamma: float) -> float:
        """An angle in degrees as x, not beyond the ends of the axis."""
        return float(np.clip(self.of_gamma(np.asarray(gamma, dtype=float)), self.low, self.high))

    def with_points(self, x: Array) -> Abscissa:
        """The same axis, wide enough for points that lie beyond its ends."""
        if not x.size or (x.min() >= self.low and x.max() <= self.high):
            return self
        low, high = min(self.low, float(x.min())), max(self.high, 1.03 * float(x.max()))
        space = np.geomspace if self.logarithmic else np.linspace
        return replace(self, low=low, high=high, grid=np.asarray(space(max(low, 1e-3), high, self.grid.size)))


@dataclass(frozen=True)
class Ordinate:
    """The vertical axis: an observable, or minus it.

    Attributes
    ----------
    observable : str
    low, high : float
        At least this range is shown.
    sign : float
        -1 where the source plots the negative.
    label : str
        With its unit; from the observable where empty.
    """

    observable: str
    low: float
    high: float
    sign: float = 1.0
    name: str = ""

    @property
    def in_degrees(self) -> bool:
        """Whether it is an angle."""
        return OBSERVABLES[self.observable].unit == "deg"

    @property
    def label(self) -> str:
        """Words, symbol and unit."""
        known = OBSERVABLES[self.observable]
        symbol = known.symbol if self.sign > 0 else f"$-${known.symbol}"
        return f"{self.name or known.meaning}\n{symbol} ({known.unit_text})"


def _tangent(gamma: Array) -> Array:
    return np.tan(np.radians(np.minimum(gamma, 89.999)))


def _angle(tangent: Array) -> Array:
    return np.degrees(np.arctan(tangent))


def _same(x: Array) -> Array:
    return x


_DEGREES = np.concatenate([[0.01], np.arange(1.0, 90.0), [89.99]])
_EVERY_15 = tuple(float(x) for x in range(0, 91, 15))

INCIDENCE = Abscissa("incidence angle γ (deg)", 0.0, 90.0, _EVERY_15, _DEGREES, _same, _same)
# lambda is defined at both ends
FROM_NORMAL = replace(INCIDENCE, grid=np.arange(0.0, 91.0))
CONTACT = replace(INCIDENCE, label="contact angle before ψ$_{\\mathrm{before}}$ = γ (deg)")
RATIO = Abscissa(
    "velocity ratio $U_t/U_n$ = tan γ (–)",
    0.0,
    2.6,
    (0.0, 0.5, 1.0, 1.5, 2.0, 2.5),
    np.linspace(0.01, 2.6, 131),
    _angle,
    _tangent,
)
TANGENT = Abscissa(
    "tan γ (–), logarithmic",
    0.06,
    15.0,
    (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0),
    np.geomspace(0.06, 15.0, 121),
    _angle,
    _tangent,
    logarithmic=True,
)
LATERAL_SPIN = Abscissa(
    "lateral spin before $R\\omega_x/u$ (–)",
    0.0,
    1.0,
    (0.0, 0.2, 0.4, 0.6, 0.8, 1.0),
    np.linspace(0.0, 1.0, 101),
    lambda x: np.full_like(x, 45.0),
    _same,
    spin=True,
)
