"""What effects are computed from: the body, the wall, what lies between them, and the impacts."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.physics.angles import Array, Incidence
from ifrfit.physics.closure import Closure

SOLID = 0.4  # I/(m R^2) of a homogeneous sphere, the only body whose contact is taken as Hertzian here

# what a number is called, and the key of a scene that gives it
_CALLED = {
    "mass": "mass (sphere.mass_g, or a material)",
    "modulus": "elastic constants (of both materials)",
    "stiffness_ratio": "Poisson's ratios (of both materials), or constants.chi",
    "limiting_pressure": "contact.limiting_pressure_GPa",
    "interface_energy": "contact.interface_energy_J_m2",
    "dissipation_time": "contact.dissipation_time_us",
    "rolling_friction": "contact.rolling_friction",
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
    limiting_pressure : float or None
        Contact pressure at which the softer body yields, Pa.
    interface_energy : float or None
        Dupre's work of adhesion per area, J/m^2.
    dissipation_time : float or None
        A of the viscoelastic Hertz law, s.
    rolling_friction : float or None
        Coefficient mu_r of the resisting couple, 1.
    fluid : Fluid or None
    """

    inertia_factor: float = SOLID
    density: float | None = None
    mass: float | None = None
    modulus: float | None = None
    stiffness_ratio: float | None = None
    limiting_pressure: float | None = None
    interface_energy: float | None = None
    dissipation_time: float | None = None
    rolling_friction: float | None = None
    fluid: Fluid | None = None

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

    def lacks(self, *names: str, hertzian: bool = True) -> str:
        """Say what is not known of the numbers an effect needs; empty if nothing is missing.

        Parameters
        ----------
        *names : str
            Attributes, ``mass`` standing for mass or density.
        hertzian : bool
            Whether the effect rests on Hertz contact, which only a homogeneous sphere is taken to have.
        """
        if hertzian and not math.isclose(self.inertia_factor, SOLID, rel_tol=1e-9):
            return "not a homogeneous sphere, so not taken as a Hertz contact"
        absent = [name for name in names if not self._has(name)]
        return "not given: " + ", ".join(_CALLED[name] for name in absent) if absent else ""

    def _has(self, name: str) -> bool:
        if name == "mass":
            return self.mass is not None or self.density is not None
        return getattr(self, name) is not None


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
        parts: dict[str, Any] = {
            field.name: getattr(self, field.name)[rows]
            for field in fields(self)
            if isinstance(getattr(self, field.name), np.ndarray)
        }
        incidence = Incidence(*(getattr(self.incidence, field.name)[rows] for field in fields(Incidence)))
        return replace(self, incidence=incidence, **parts)
