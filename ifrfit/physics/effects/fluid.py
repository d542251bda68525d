"""Ambient fluid: the film between sphere and wall takes its part of the rebound."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ifrfit.physics.angles import Array
from ifrfit.physics.effects.contact import Contact, Impacts, known
from ifrfit.physics.effects.impact_state import Bounce, Outcome
from ifrfit.physics.effects.protocol import Criterion, Effect, Stage, Validity

DECAY = 35.0  # of e/e_dry = exp(-35/St), Legendre, Daniel & Guiraud (2005)
NO_REBOUND = 10.0  # Stokes number up to which nothing rebounds, Joseph et al. (2001)
_TANGENTIAL = 1000.0  # below it lubrication lowers the friction too, Joseph & Hunt (2004)


def stokes(contact: Contact, impacts: Impacts) -> Array:
    """Impact Stokes number m V/(6 pi eta R^2): rho D V/(9 eta) for a homogeneous sphere."""
    viscosity = known(contact.fluid.viscosity if contact.fluid else None)
    drag = 6.0 * math.pi * viscosity * impacts.radius**2
    return np.asarray(contact.masses(impacts.radius) * impacts.normal_speed / drag)


def wet_over_dry(number: Array) -> Array:
    """e/e_dry at a Stokes number: exp(-35/St), and 0 up to St = 10."""
    return np.where(number > NO_REBOUND, np.exp(-DECAY / np.maximum(number, NO_REBOUND)), 0.0)


@dataclass(frozen=True)
class AmbientFluid(Effect):
    """A sphere that falls through a liquid: normal restitution only, by the law found in experiments.

    The dry restitution and the friction of the contact are left as they are; mu must be that of the wet
    contact.
    """

    name: str = "fluid"
    title: str = "fluid"
    stage: Stage = "fluid"
    cost_ns: float = 11.0
    source: str = (
        "Legendre, Daniel & Guiraud (2005), Phys. Fluids 17, 097105; Joseph, Zenit, Hunt & Rosenwinkel "
        "(2001), J. Fluid Mech. 433, 329; Gondret, Lance & Petit (2002), Phys. Fluids 14, 643"
    )

    def lacks(self, contact: Contact, impacts: Impacts) -> str:
        """Fluid and mass."""
        return contact.lacks("fluid", "mass", hertzian=False)

    def validity(self, contact: Contact, impacts: Impacts) -> Validity:
        """Not in a gas: the film ends at the mean free path, and the law overstates the loss."""
        if contact.fluid is not None and contact.fluid.mean_free_path is not None:
            path = contact.fluid.mean_free_path * 1e9
            return Validity(
                False,
                "the law is that of spheres in liquids; in a gas the film ends at the mean free path "
                f"({path:.3g} nm), so the loss is at most this",
            )
        low = float(np.min(stokes(contact, impacts)))
        slippery = "lubrication lowers the friction as well: mu must be that of the wet contact"
        return Validity(True, slippery if low < _TANGENTIAL else "")

    def criterion(self, contact: Contact, impacts: Impacts, outcome: Outcome, accuracy: float) -> Criterion:
        """Smallest Stokes number of an impact that approaches; e_n falls by about 35/St of itself."""
        coming = impacts.normal_speed > 0.0
        number = stokes(contact, impacts)[coming]
        return Criterion("St", float(np.min(number, initial=np.inf)), DECAY / accuracy, above=False)

    def apply(self, contact: Contact, impacts: Impacts, bounce: Bounce) -> Bounce:
        """Damp the rebound; captured where the film leaves none."""
        out = bounce.done
        number = stokes(contact, impacts)
        factor = np.where(impacts.normal_speed > 0.0, wet_over_dry(number), 1.0)
        damped = replace(
            out, e_n=out.e_n * factor, v_n=out.v_n * factor, captured=out.captured | (factor == 0.0)
        )
        return replace(bounce, outcome=damped)
