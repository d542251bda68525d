"""Viscoelastic normal restitution: it falls with the speed from 1 at rest."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ifrfit.physics.angles import Array
from ifrfit.physics.effects.contact import Contact, ContactNumber, Impacts, known
from ifrfit.physics.effects.impact_state import Bounce, Outcome
from ifrfit.physics.effects.protocol import Criterion, Effect, Stage, Validity

# A of the viscoelastic Hertz law, s
DISSIPATION_TIME = ContactNumber("dissipation_time", 0.0, 1e3, "us")
_FIRST = (
    1.153449  # 1 - e = 1.153449 x for small x, exactly sqrt(pi) Gamma(3/5)/(2^(1/5) 5^(2/5) Gamma(21/10))
)
_CHECKED = 2.0  # the approximant was compared with the equation of motion up to this x


def restitution(x: Array) -> Array:
    """Restitution of a viscoelastic sphere at x = (3/2) A (rho_H/m)^(2/5) V^(1/5).

    Parameters
    ----------
    x : ndarray
        From 0.

    Returns
    -------
    ndarray
        Within 5e-5 of the equation of motion at x = 0.1, 2e-3 at 0.5, 8e-3 at 2.

    Notes
    -----
    Padé [1/4] in sqrt(x), Müller & Pöschel (2011), PRE 84, 021302.
    """
    y = np.sqrt(np.minimum(x, 1e60))
    above = 1.0 + 0.501086 * y
    return np.asarray(above / (above + y**2 * (1.153450 + y * (0.577977 + y * 0.532178))))


@dataclass(frozen=True)
class Viscoelastic(Effect):
    """Hertz contact with a dissipative force in proportion to the rate of deformation."""

    name: str = "viscoelastic"
    title: str = "viscoelasticity"
    stage: Stage = "normal"
    replaces: Literal["e_n"] = "e_n"
    cost_ns: float = 12.0
    numbers: tuple[ContactNumber, ...] = (DISSIPATION_TIME,)
    source: str = (
        "Brilliantov, Spahn, Hertzsch & Pöschel (1996), PRE 53, 5382; Müller & Pöschel (2011), PRE 84, 021302"
    )

    def lacks(self, contact: Contact, impacts: Impacts) -> str:
        """Mass, elastic constants and dissipation time."""
        return contact.lacks("mass", "modulus", DISSIPATION_TIME)

    def validity(self, contact: Contact, impacts: Impacts) -> Validity:
        """Remark beyond the range in which the approximant was checked."""
        x = float(np.max(self.number(contact, impacts)))
        beyond = f"x = {x:.2g} lies beyond 2, up to which the approximant was checked"
        return Validity(True, beyond if x > _CHECKED else "")

    def number(self, contact: Contact, impacts: Impacts) -> Array:
        """x of each impact."""
        stiffness = 4.0 / 3.0 * known(contact.modulus) * np.sqrt(impacts.radius)
        time = 1.5 * contact.number(DISSIPATION_TIME)
        return np.asarray(
            time * (stiffness / contact.masses(impacts.radius)) ** 0.4 * impacts.normal_speed**0.2
        )

    def criterion(self, contact: Contact, impacts: Impacts, outcome: Outcome, accuracy: float) -> Criterion:
        """Largest x; 1 - e is about 1.15 x."""
        return Criterion("x", float(np.max(self.number(contact, impacts))), accuracy / _FIRST)

    def apply(self, contact: Contact, impacts: Impacts, bounce: Bounce) -> Bounce:
        """Put e_n(V) in the place of the constant."""
        return replace(bounce, e_n=restitution(self.number(contact, impacts)))
