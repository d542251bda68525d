"""Adhesion: the work of separation takes its part of the rebound, or all of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ifrfit.physics.angles import Array
from ifrfit.physics.effects.contact import Contact, ContactNumber, Impacts, known
from ifrfit.physics.effects.impact_state import Bounce, Outcome
from ifrfit.physics.effects.protocol import Criterion, Effect, Stage, Validity

# Dupre's work of adhesion per area, J/m^2
INTERFACE_ENERGY = ContactNumber("interface_energy", 0.0, 1e3, "J_m2")
# work of separation over (Gamma^5 R^4/E*^2)^(1/3): from contact at zero overlap to detachment at fixed
# displacement, the integral of the Johnson-Kendall-Roberts force (checked in the tests)
SEPARATION = 7.0922
_ATOMIC = 0.3e-9  # m, range of the surface force in Tabor's number
_JKR = 3.0  # Tabor's number above which the theory holds


def sticking_speed(contact: Contact, radius: Array) -> Array:
    """Normal speed below which an elastic sphere is captured, m/s.

    V_s = (2 W_s/m)^(1/2), W_s = 7.0922 (Gamma^5 R^4/E*^2)^(1/3).
    """
    # roots before products: at 1 nm the fourth power of R would cost digits
    cube = contact.number(INTERFACE_ENERGY) ** (5.0 / 3.0) * radius ** (4.0 / 3.0)
    work = SEPARATION * cube / known(contact.modulus) ** (2.0 / 3.0)
    return np.asarray(np.sqrt(2.0 * work / contact.masses(radius)))


def tabor(contact: Contact, radius: Array) -> Array:
    """Tabor's number (R Gamma^2/(E*^2 z0^3))^(1/3) with z0 = 0.3 nm."""
    energy = contact.number(INTERFACE_ENERGY) / known(contact.modulus)
    return np.asarray(radius ** (1.0 / 3.0) * energy ** (2.0 / 3.0) / _ATOMIC)


@dataclass(frozen=True)
class Adhesion(Effect):
    """Johnson-Kendall-Roberts adhesion as a loss of energy on separation.

    After plastic loading the work of separation is taken with the radius of unloading. That combination is
    our own engineering one, not the closed form of Thornton & Ning.
    """

    name: str = "adhesion"
    title: str = "adhesion"
    stage: Stage = "adhesion"
    cost_ns: float = 16.0
    numbers: tuple[ContactNumber, ...] = (INTERFACE_ENERGY,)
    source: str = (
        "Thornton & Ning (1998), Powder Technol. 99, 154; Johnson & Pollock (1994), "
        "J. Adhesion Sci. Technol. 8, 1323; with plasticity our own combination"
    )

    def lacks(self, contact: Contact, impacts: Impacts) -> str:
        """Mass, elastic constants and interface energy."""
        return contact.lacks("mass", "modulus", INTERFACE_ENERGY)

    def validity(self, contact: Contact, impacts: Impacts) -> Validity:
        """Remark where bodies are too small or too stiff for the theory."""
        number = float(np.min(tabor(contact, impacts.radius)))
        small = f"Tabor's number {number:.2g} is below 3: the theory of soft contacts is stretched"
        return Validity(True, small if 0.0 < number < _JKR else "")

    def criterion(self, contact: Contact, impacts: Impacts, outcome: Outcome, accuracy: float) -> Criterion:
        """Largest V_s/V of an impact that approaches; e_n falls by about half its square."""
        normal = impacts.normal_speed
        coming = normal > 0.0
        speed = sticking_speed(contact, impacts.radius)
        with np.errstate(over="ignore"):
            ratio = float(np.max(speed[coming] / normal[coming], initial=0.0))
        return Criterion("V_s/V", ratio, float(np.sqrt(2.0 * accuracy)))

    def apply(self, contact: Contact, impacts: Impacts, bounce: Bounce) -> Bounce:
        """Take the work of separation from the rebound; captured where nothing is left."""
        normal = impacts.normal_speed
        taken = bounce.unloading ** (2.0 / 3.0) * sticking_speed(contact, impacts.radius)
        given = bounce.e_n * normal
        left = np.sqrt(np.maximum(given - taken, 0.0)) * np.sqrt(given + taken)
        with np.errstate(divide="ignore", invalid="ignore"):
            e_n = np.where(normal > 0.0, np.minimum(left / normal, bounce.e_n), bounce.e_n)
        captured = (normal > 0.0) & (taken > 0.0) & (given <= taken)
        return replace(bounce, e_n=np.where(captured, 0.0, e_n), captured=bounce.captured | captured)
