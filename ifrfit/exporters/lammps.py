"""Target lammps: ``pair_coeff`` and ``fix wall/gran`` of the styles granular, hertz/material with mindlin.

Forces as in the documentation of ``pair_style granular``: F_n = 4/3 E* sqrt(R* d) d + eta_n w with
eta_n = -2 sqrt(5/6) ln e/sqrt(pi^2 + ln^2 e) sqrt(3/2 k_nd m) (``damping coeff_restitution``), and a
tangential spring k_t sqrt(R* d) with eta_t = x_gamma eta_n (``tangential mindlin k_t x_gamma mu``). With NULL
for k_t the spring is that of the Poisson ratio, 8 G*; here it is free, which comes closer. x_gamma is 0: the
dashpot is stronger than slider and spring as a contact begins, and what it then writes into the spring grows
without limit as the time step shrinks (with d^(-1/4) of the first overlap), in LAMMPS as in its law.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import HASH, Comments, Conditions, Translation
from ifrfit.exporters.soft_sphere import integrated, nearest, only_solid_sphere, positive_restitution
from ifrfit.exporters.spring_dashpot import SpringDashpot, log_decrement

_MODULUS, _POISSON = 1e7, 0.3  # numerical: Pa, and what makes E* of it
_RATIOS = (0.05, 3.0)  # of the springs; like materials have 1 to 1.5


@dataclass(frozen=True)
class Lammps:
    """Package GRANULAR."""

    name: str = "lammps"
    title: str = "LAMMPS"
    comments: Comments = HASH
    takes: frozenset[str] = frozenset()

    def translate(self, constants: ExportedConstants, at: Conditions) -> Translation:
        """e_n and mu as they are; the ratio of the springs that comes closest."""
        only_solid_sphere(constants, self.title)
        positive_restitution(constants, self.title)
        ratio = nearest(lambda x: contact(constants, x), constants, *_RATIOS)
        k_t = ratio * 4.0 / 3.0 * _MODULUS / (2.0 * (1.0 - _POISSON**2))
        material = (
            f"hertz/material {_MODULUS:g} {constants.e_n:.10g} {_POISSON:g} tangential mindlin {k_t:.8g} 0.0 "
            f"{constants.mu:.10g} damping coeff_restitution"
        )
        return integrated(
            constants,
            contact(constants, ratio),
            lines=[
                "pair_style granular",
                f"pair_coeff * * {material}",
                "# the wall: put your own plane in the place of zplane 0.0 NULL",
                f"fix wall all wall/gran granular {material} zplane 0.0 NULL",
            ],
            law="Hertz's spring and a dashpot along the normal; a spring that grows with the contact and "
            "Coulomb's slider along the wall, without a dashpot (x_gamma = 0).",
            mapping=[
                "e of hertz/material with damping coeff_restitution = e_n, mu of tangential mindlin = mu.",
                f"there is no place for {constants.closure.constant or 'a tangential restitution'}: "
                f"k_t = {k_t:.6g} Pa, {ratio:.4g} times 4/3 E*, comes closest to the fitted curve in v_x/u; "
                "what remains is the residual below.",
                f"E = {_MODULUS:g} Pa and nu = {_POISSON:g} are numerical, not fitted: no rebound of one "
                "impact depends on E, if k_t changes with it in proportion.",
            ],
            holds="that the pair is one of sphere and wall; pairs of spheres are given the same constants.",
        )


def contact(constants: ExportedConstants, ratio: float) -> SpringDashpot:
    """The law of the exported text."""
    damping = math.sqrt(5.0) * log_decrement(constants.e_n)
    return SpringDashpot(1.5, damping, ratio, 0.0, constants.mu)


EXPORTER = Lammps()
