"""Target mercurydpm: ``setCollisionTimeAndNormalAndTangentialRestitutionCoefficient``.

In ``SlidingFrictionSpecies`` k_t = 2/7 k_n (pi^2 + ln^2 beta)/(pi^2 + ln^2 eps) and the tangential dashpot
makes half a period of the tangential spring last as long as the contact: without sliding the slip is
reversed, V_t = -beta U_t, beta from 0 to 1. The mass argument is that of two equal spheres, so a wall
takes twice the mass of the sphere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ifrfit.errors import UsageError
from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import SLASHES, Comments, Conditions, Translation
from ifrfit.exporters.soft_sphere import integrated, nearest, only_solid_sphere, positive_restitution
from ifrfit.exporters.spring_dashpot import SpringDashpot, log_decrement


@dataclass(frozen=True)
class MercuryDpm:
    """Species LinearViscoelasticSlidingFrictionSpecies."""

    name: str = "mercurydpm"
    title: str = "MercuryDPM"
    comments: Comments = SLASHES
    takes: frozenset[str] = frozenset()

    def translate(self, constants: ExportedConstants, at: Conditions) -> Translation:
        """Constants to arguments."""
        only_solid_sphere(constants, self.title)
        positive_restitution(constants, self.title)
        beta = sticking_reversal(constants, self.title)
        return integrated(
            constants,
            linear_contact(constants.e_n, beta, constants.mu),
            lines=[
                "// collisionTime: yours, seconds; particleMass: of one sphere. At a wall the mass "
                "counts twice.",
                "auto contact = speciesHandler.getMixedObject(particleSpecies, wallSpecies);",
                "contact->setCollisionTimeAndNormalAndTangentialRestitutionCoefficient("
                f"collisionTime, {constants.e_n:.10g}, {beta:.10g}, 2.0 * particleMass);",
                f"contact->setSlidingFrictionCoefficient({constants.mu:.10g});",
            ],
            law="linear springs and dashpots along the normal and along the wall, and Coulomb's slider.",
            mapping=[
                "eps = e_n, sliding friction = mu.",
                f"beta = {beta:.6g} is the fitted restitution of the contact point in sticking, or, of a "
                "closure with partial slip, comes closest to the curve; positive where the slip is reversed, "
                "which is the sign of ifrfit's beta.",
                "collisionTime is numerical: no rebound of a single impact depends on it.",
            ],
            holds="that the pair is one of sphere and wall.",
        )


def sticking_reversal(constants: ExportedConstants, title: str) -> float:
    """Restitution of the contact point in sticking, for codes that take it between 0 and 1.

    Raises
    ------
    UsageError
        For one that is 0 or less, or above 1.
    """
    if not constants.closure.bilinear:  # its restitution changes with the slip all the way down to none
        return nearest(lambda x: linear_contact(constants.e_n, x, constants.mu), constants, 1e-3, 1.0)
    beta = constants.sticking_restitution
    if not 0.0 < beta <= 1.0 + 1e-12:
        raise UsageError(
            f"{title} takes a tangential restitution above 0 and at most 1, by which the slip is "
            "reversed, and "
            f"the fit has {beta:.4g} in sticking: the code has no such contact. Take --to dynamo, python "
            "or c."
        )
    return min(beta, 1.0)


def linear_contact(e_n: float, beta: float, mu: float) -> SpringDashpot:
    """The law of the species."""
    tangential = (math.pi**2 + math.log(beta) ** 2) / (math.pi**2 + math.log(e_n) ** 2)
    k_t = 2.0 / 7.0 * tangential
    return SpringDashpot(
        1.0, 2.0 * log_decrement(e_n), k_t, 2.0 * log_decrement(beta) * math.sqrt(2.0 / 7.0 * k_t), mu
    )


EXPORTER = MercuryDpm()
