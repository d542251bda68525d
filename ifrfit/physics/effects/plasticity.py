"""Elastic, perfectly plastic normal restitution: 1 up to the yield speed, falling beyond."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ifrfit.physics.angles import Array
from ifrfit.physics.effects.contact import Contact, ContactNumber, Impacts, known
from ifrfit.physics.effects.impact_state import Bounce, Outcome
from ifrfit.physics.effects.protocol import Criterion, Effect, Stage, Validity

# contact pressure at which the softer body yields, Pa; materials may state it
LIMITING_PRESSURE = ContactNumber("limiting_pressure", 1.0, 1e13, "GPa")
_QUASI_STATIC = 1e-3  # rho V^2/p_y beyond which plastic flow is not quasi-static, Johnson (1985)


def yield_speed(contact: Contact, radius: Array) -> Array:
    """Normal speed at which the softer body begins to yield, m/s.

    V_y = (pi/2E*)^2 (8 pi R^3/15 m)^(1/2) p_y^(5/2): Hertz' impact whose pressure just reaches p_y.
    """
    size = np.sqrt(8.0 * math.pi * radius**3 / (15.0 * contact.masses(radius)))
    return np.asarray(
        (0.5 * math.pi / known(contact.modulus)) ** 2 * size * contact.number(LIMITING_PRESSURE) ** 2.5
    )


def restitution(ratio: Array) -> Array:
    """Restitution at ratio = V_y/V; 1 where it is 1 or more.

    Notes
    -----
    Thornton (1997), J. Appl. Mech. 64, 383: e = (6 sqrt(3)/5)^(1/2) (1 - r^2/6)^(1/2)
    [r/(r + 2 sqrt(6/5 - r^2/5))]^(1/4).
    """
    r = np.minimum(ratio, 1.0)
    tail = r / (r + 2.0 * np.sqrt(1.2 - 0.2 * r**2))
    e = math.sqrt(1.2 * math.sqrt(3.0)) * np.sqrt(1.0 - r**2 / 6.0) * tail**0.25
    return np.asarray(np.where(ratio >= 1.0, 1.0, np.minimum(e, 1.0)))


def unloading_radius(ratio: Array) -> Array:
    """R_p/R at ratio = V_y/V: the flattened contact unloads with a larger radius of curvature.

    Notes
    -----
    Thornton (1997): R_p/R = [(1 + 2f)/3]^(3/2)/f with f = F/F_y = sqrt(6/5 - r^2/5)/r.
    """
    # f = g/r with g -> 1.095 as r -> 0: [(r + 2g)/3]^(3/2)/(g sqrt(r)) does not overflow
    r = np.clip(ratio, 1e-300, 1.0)
    g = np.sqrt(1.2 - 0.2 * r**2)
    return np.asarray(np.where(ratio >= 1.0, 1.0, ((r + 2.0 * g) / 3.0) ** 1.5 / (g * np.sqrt(r))))


@dataclass(frozen=True)
class Plasticity(Effect):
    """Yield of the contact: Hertz up to the limiting pressure, constant pressure beyond, Hertz back."""

    name: str = "plasticity"
    title: str = "plasticity"
    stage: Stage = "normal"
    replaces: Literal["e_n"] = "e_n"
    cost_ns: float = 22.0
    numbers: tuple[ContactNumber, ...] = (LIMITING_PRESSURE,)
    source: str = "Thornton (1997), J. Appl. Mech. 64, 383; Thornton & Ning (1998), Powder Technol. 99, 154"

    def lacks(self, contact: Contact, impacts: Impacts) -> str:
        """Mass, elastic constants and limiting pressure."""
        return contact.lacks("mass", "modulus", LIMITING_PRESSURE)

    def validity(self, contact: Contact, impacts: Impacts) -> Validity:
        """Remark where the flow is not quasi-static any more."""
        density = contact.masses(impacts.radius) / (4.0 / 3.0 * math.pi * impacts.radius**3)
        number = float(np.max(density * impacts.normal_speed**2)) / contact.number(LIMITING_PRESSURE)
        fast = f"rho V^2/p_y = {number:.2g} exceeds 1e-3: plastic flow is not quasi-static"
        return Validity(True, fast if number > _QUASI_STATIC else "")

    def ratio(self, contact: Contact, impacts: Impacts) -> Array:
        """V_y/V, infinite at rest."""
        with np.errstate(divide="ignore", over="ignore"):
            return np.asarray(yield_speed(contact, impacts.radius) / impacts.normal_speed)

    def criterion(self, contact: Contact, impacts: Impacts, outcome: Outcome, accuracy: float) -> Criterion:
        """Largest V/V_y."""
        speed = impacts.normal_speed / yield_speed(contact, impacts.radius)
        return Criterion("V/V_y", float(np.max(speed)), 1.0)

    def apply(self, contact: Contact, impacts: Impacts, bounce: Bounce) -> Bounce:
        """Put e_n(V) in the place of the constant, and keep the radius of unloading for adhesion."""
        ratio = self.ratio(contact, impacts)
        return replace(bounce, e_n=restitution(ratio), unloading=unloading_radius(ratio))
