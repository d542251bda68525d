"""What effects are computed from: the body, the wall, what lies between them, and the impacts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.physics.angles import Array, Incidence
from ifrfit.physics.closure import Closure

SOLID = 0.4  # I/(m R^2) of a homogeneous sphere, the only body whose contact is taken as Hertzian here

# what bodies and fluid give is called so
_CALLED = {
    "mass": "mass (sphere.mass_g, or a material)",
    "modulus": "elastic constants (of both materials)",
    "stiffness_ratio": "Poisson's ratios (of both materials), or constants.chi",
    "fluid": "the table [fluid]",
}


@dataclass(frozen=True)
class Fluid:
    """The ambient fluid.

    Attributes
    ----------
    name : str
    viscosity : float
        Dynamic, Pa s.
    mean_free_path : float or None
        Of a gas, m; None for a liquid.
    """

    name: str
    viscosity: float
    mean_free_path: float | None = None


@dataclass(frozen=True)
class ContactNumber:
    """A number that an effect takes from the table ``[contact]`` of a scene, where it is unknown by default.

    Attributes
    ----------
    name : str
        In `Contact.numbers`.
    low, high : float
        What is possible, in SI units; included.
    unit : str
        The usual one, which ends the key in a scene, of `ifrfit.physics.units.UNITS`; any other of the same
        dimension will do there. Empty for a pure number.
    """

    name: str
    low: float
    high: float
    unit: str = ""

    @property
    def key(self) -> str:
        """Key of a scene that gives it."""
        return f"contact.{self.name}_{self.unit}" if self.unit else f"contact.{self.name}"


@dataclass(frozen=True)
class Contact:
    """A sphere on a wall, in SI units; None where a number is not known.

    Attributes
    ----------
    inertia_factor : float
        J = I/(m R^2).
    density : float or None
        Of a homogeneous sphere, kg/m^3; used where `mass` is None.
    mass : float or None
        kg.
    modulus : float or None
        E* = [(1 - nu1^2)/E1 + (1 - nu2^2)/E2]^-1, Pa.
    stiffness_ratio : float or None
        Tangential over normal contact stiffness, 4 G*/E*; 2(1 - nu)/(2 - nu) for similar materials.
    fluid : Fluid or None
    numbers : mapping of str to float
        Name of a `ContactNumber` of an effect to its value, of those that are known.
    """

    inertia_factor: float = SOLID
    density: float | None = None
    mass: float | None = None
    modulus: float | None = None
    stiffness_ratio: float | None = None
    fluid: Fluid | None = None
    numbers: Mapping[str, float] = field(default_factory=dict)

    def with_numbers(self, **numbers: float | None) -> Contact:
        """The same with some `numbers` changed; None makes one unknown."""
        both = {**self.numbers, **numbers}
        return replace(self, numbers={name: value for name, value in both.items() if value is not None})

    def number(self, which: ContactNumber) -> float:
        """A number that an effect has checked to be there.

        Raises
        ------
        ValueError
            If it is not: `lacks` was not asked.
        """
        return known(self.numbers.get(which.name))

    def masses(self, radius: Array) -> Array:
        """Mass of spheres of these radii, kg.

        Raises
        ------
        ValueError
            If neither mass nor density is known; `lacks` tells beforehand.
        """
        if self.mass is not None:
            return np.full_like(radius, self.mass)
        return 4.0 / 3.0 * math.pi * known(self.density) * radius**3

    def lacks(self, *needed: str | ContactNumber, hertzian: bool = True) -> str:
        """Say what is not known of the numbers an effect needs; empty if nothing is missing.

        Parameters
        ----------
        *needed : str or ContactNumber
            Attributes, ``mass`` standing for mass or density, and numbers of effects.
        hertzian : bool
            Whether the effect rests on Hertz contact, which only a homogeneous sphere is taken to have.
        """
        if hertzian and not math.isclose(self.inertia_factor, SOLID, rel_tol=1e-9):
            return "not a homogeneous sphere, so not taken as a Hertz contact"
        absent = [each for each in needed if not self._has(each)]
        called = [_CALLED[each] if isinstance(each, str) else each.key for each in absent]
        return "not given: " + ", ".join(called) if called else ""

    def _has(self, needed: str | ContactNumber) -> bool:
        if isinstance(needed, ContactNumber):
            return needed.name in self.numbers
        if needed == "mass":
            return self.mass is not None or self.density is not None
        return getattr(self, needed) is not None


def known(value: float | None) -> float:
    """A number that the effect has checked to be there.

    Raises
    ------
    ValueError
        If it is not: `Contact.lacks` was not asked.
    """
    if value is None:
        raise ValueError("an effect was applied without a number that it needs")
    return value


@dataclass(frozen=True)
class Impacts:
    """Impacts before they happen; all arrays of one shape.

    Attributes
    ----------
    incidence : Incidence
        Angle, spins and slip per incoming speed.
    speed : ndarray
        Incoming speed u, m/s.
    radius : ndarray
        m.
    closure : Closure
    e_n : ndarray
        Constant normal restitution; 1 where it is to be computed.
    constant : ndarray or None
        The closure's own constant; None where tangential compliance takes its place.
    mu : ndarray
    chi : ndarray or None
        Compliance ratio; None where it follows from the materials.
    """

    incidence: Incidence
    speed: Array
    radius: Array
    closure: Closure
    e_n: Array
    constant: Array | None
    mu: Array
    chi: Array | None = None

    @property
    def normal_speed(self) -> Array:
        """V = u cos(gamma), m/s."""
        return self.speed * self.incidence.cosine

    def take(self, rows: NDArray[np.intp]) -> Impacts:
        """These impacts only; arrays must have one dimension."""
        own: dict[str, Any] = {n: a[rows] for n, a in vars(self).items() if isinstance(a, np.ndarray)}
        incidence = self.incidence.take(rows)
        return replace(self, incidence=incidence, **own)
