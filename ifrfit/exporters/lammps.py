"""Target lammps: ``pair_coeff`` and ``fix wall/gran`` of the styles granular, hertz/material with mindlin.

Forces as in the documentation of ``pair_style granular``: F_n = 4/3 E* sqrt(R* d) d + eta_n w with
eta_n = -2 sqrt(5/6) ln e/sqrt(pi^2 + ln^2 e) sqrt(3/2 k_nd m) (``damping coeff_restitution``), and
k_t = 8 G* sqrt(R* d), eta_t = x_gamma eta_n (``tangential mindlin NULL x_gamma mu``).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import HASH, Comments, Conditions, Translation
from ifrfit.exporters.soft_sphere import (
    MODULUS,
    POISSON,
    integrated,
    nearest,
    only_solid_sphere,
    positive_restitution,
    stiffness_ratio,
)
from ifrfit.exporters.spring_dashpot import SpringDashpot, log_decrement


@dataclass(frozen=True)
class Lammps:
    """Package GRANULAR."""

    name: str = "lammps"
    title: str = "LAMMPS"
    comments: Comments = HASH
    takes: frozenset[str] = frozenset()

    def translate(self, constants: ExportedConstants, at: Conditions) -> Translation:
        """e_n and mu as they are; the Poisson ratio whose stiffness ratio comes closest."""
        only_solid_sphere(constants, self.title)
        positive_restitution(constants, self.title)
        nu = nearest(lambda x: contact(constants, x), constants, *POISSON)
        material = (
            f"hertz/material 1e7 {constants.e_n:.10g} {nu:.6g} tangential mindlin NULL 1.0 "
            f"{constants.mu:.10g} damping coeff_restitution"
        )
        return integrated(
            constants,
            contact(constants, nu),
            lines=[
                "pair_style granular",
                f"pair_coeff * * {material}",
                "# the wall: put your own plane in the place of zplane 0.0 NULL",
                f"fix wall all wall/gran granular {material} zplane 0.0 NULL",
            ],
            law="Hertz's spring and a dashpot along the normal; Mindlin's spring without its unloading, a "
            "dashpot and Coulomb's slider along the wall.",
            mapping=[
                "e of hertz/material with damping coeff_restitution = e_n, mu of tangential mindlin = mu.",
                f"there is no place for {constants.closure.constant or 'a tangential restitution'}: of the "
                f"stiffness ratios that nu from 0 to 0.5 allows, nu = {nu:.3g} comes closest to the fitted "
                "curve in v_x/u; what remains is the residual below.",
                f"{MODULUS}.",
            ],
            holds="that the pair is one of sphere and wall; pairs of spheres are given the same constants.",
        )


def contact(constants: ExportedConstants, nu: float) -> SpringDashpot:
    """The law of the exported text."""
    damping = math.sqrt(5.0) * log_decrement(constants.e_n)
    return SpringDashpot(1.5, damping, 1.5 * stiffness_ratio(nu), damping, constants.mu)


EXPORTER = Lammps()
