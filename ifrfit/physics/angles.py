"""Sines and cosines of incidence angles without lost digits, and the incoming state built from them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ifrfit.errors import UsageError

Array = NDArray[np.float64]


def real_array(name: str, given: ArrayLike | None) -> Array:
    """Numbers that a caller gave, as an array.

    Raises
    ------
    UsageError
        For what is no real number, nor an array of them.
    """
    try:
        if given is None or np.iscomplexobj(given):
            raise TypeError
        return np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        shown = " ".join(repr(given).split())
        raise UsageError(f"{name}: {shown:.60} is no number, nor an array of them: give numbers.") from None


def check_incidence(gamma: Array, *, degrees: bool) -> None:
    """Refuse incidence angles outside 0 to 90 degrees; nan is none.

    Raises
    ------
    UsageError
        With the first of them.
    """
    outside = (gamma < 0.0) | (gamma > (90.0 if degrees else 0.5 * np.pi))
    if outside.any():
        end = "90 degrees from the normal" if degrees else "pi/2 from the normal; degrees need degrees=True"
        raise UsageError(f"gamma {gamma[outside].flat[0]:.9g}: incidence angles lie between 0 and {end}.")


def sincos(gamma: ArrayLike, *, degrees: bool = False) -> tuple[Array, Array]:
    """Sine and cosine of the incidence angle.

    Parameters
    ----------
    gamma : array_like
        Angle from the wall's normal, radians (degrees if ``degrees``).
    degrees : bool
        In degrees the results are exact at 0, 30, 60 and 90, and keep all digits near 90, because
        90 - gamma is exact there while pi/2 is not.

    Returns
    -------
    sine, cosine : ndarray
        Of the shape of `gamma`.
    """
    gamma = np.asarray(gamma, dtype=float)
    if not degrees:
        return np.sin(gamma), np.cos(gamma)
    steep = gamma > 45.0
    small = np.where(steep, 90.0 - gamma, gamma)
    radians = np.radians(small)
    sine = np.where(small == 30.0, 0.5, np.sin(radians))
    cosine = np.where(small == 45.0, sine, np.cos(radians))
    return np.where(steep, cosine, sine), np.where(steep, sine, cosine)


def make_read_only(state: object) -> None:
    """Make the arrays of a dataclass read-only."""
    for value in vars(state).values():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False


@dataclass(frozen=True)
class Incidence:
    """The state before impact, per incoming speed u; all arrays of one shape.

    Attributes
    ----------
    sine, cosine : ndarray
        Of the incidence angle; ``cosine`` is U_n/u.
    spin_x, spin_y : ndarray
        R omega_x/u and R omega_y/u in the paper's signs (positive spin_y is back-spin).
    slip_x, slip_y : ndarray
        Tangential velocity of the contact point, (U_x, U_y)/u.
    """

    sine: Array
    cosine: Array
    spin_x: Array
    spin_y: Array
    slip_x: Array
    slip_y: Array

    def __post_init__(self) -> None:
        make_read_only(self)

    @classmethod
    def of(
        cls, gamma: ArrayLike, spin_x: ArrayLike = 0.0, spin_y: ArrayLike = 0.0, *, degrees: bool = False
    ) -> Incidence:
        """Build the state from angle and spins, which broadcast against one another."""
        sine, cosine = sincos(gamma, degrees=degrees)
        parts = np.broadcast_arrays(
            sine, cosine, np.asarray(spin_x, dtype=float), np.asarray(spin_y, dtype=float)
        )
        # copies: the caller's arrays stay his own
        sine, cosine, s_x, s_y = (np.array(part) for part in parts)
        return cls(sine, cosine, s_x, s_y, sine + s_y, s_x)

    def map(self, of: Callable[[Array], Array]) -> Incidence:
        """The same with each of its arrays changed."""
        own = self.sine, self.cosine, self.spin_x, self.spin_y, self.slip_x, self.slip_y
        return Incidence(*map(of, own))

    def take(self, rows: NDArray[np.intp] | slice) -> Incidence:
        """These impacts only, along the last axis."""
        return self.map(lambda part: part[..., rows])

    def lazily(self, rows: NDArray[np.intp] | slice) -> Incidence:
        """The same as `take`, but each array is taken when it is asked for: an observable needs few."""
        return _Lazily(self, rows)

    @cached_property
    def slip(self) -> Array:
        """|U_t|/u."""
        return np.asarray(np.hypot(self.slip_x, self.slip_y))

    @property
    def tau(self) -> Array:
        """|U_t|/U_n, infinite at grazing incidence: what decides between sticking and sliding."""
        slip = self.slip
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            ratio = slip / self.cosine
        # 0/0: no slip and no normal approach; the impulse is zero either way, so it counts as sticking
        return np.where(slip == 0.0, 0.0, ratio)


class _Lazily(Incidence):
    """Some impacts of others."""

    def __init__(self, of: Incidence, rows: NDArray[np.intp] | slice) -> None:
        self.__dict__.update(_of=of, _rows=rows)

    def __getattr__(self, name: str) -> Array:
        """Look for what is not there yet: one of the arrays."""
        if name not in _ARRAYS:
            raise AttributeError(name)
        found: Array = getattr(self._of, name)[..., self._rows]
        self.__dict__[name] = found
        return found


_ARRAYS = tuple(each.name for each in fields(Incidence))
