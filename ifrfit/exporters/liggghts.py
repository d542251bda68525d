"""Target liggghts: ``fix property/global`` for ``gran model hertz tangential history``.

Forces as in the documentation of ``gran model hertz``: k_n = 4/3 Y* sqrt(R* d), k_t = 8 G* sqrt(R* d), both
damped by 2 sqrt(5/6) times the share of critical damping times sqrt(S m*). Checks of the code on its
input: 0.05 < coefficientRestitution <= 1, 0 <= poissonsRatio <= 0.5, 5e6 <= youngsModulus <= 1e9 in SI units.
Slip and torque are taken at R less half the overlap, so that soft spheres turn less than rigid ones.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import HASH, Comments, Conditions, Translation
from ifrfit.exporters.soft_sphere import (
    POISSON,
    integrated,
    nearest,
    only_solid_sphere,
    positive_restitution,
    stiffness_ratio,
)
from ifrfit.exporters.spring_dashpot import SpringDashpot, log_decrement


@dataclass(frozen=True)
class Liggghts:
    """Hertz and Mindlin with history."""

    name: str = "liggghts"
    title: str = "LIGGGHTS"
    comments: Comments = HASH
    takes: frozenset[str] = frozenset()

    def translate(self, constants: ExportedConstants, at: Conditions) -> Translation:
        """e_n and mu as they are; the Poisson ratio whose stiffness ratio comes closest."""
        only_solid_sphere(constants, self.title)
        positive_restitution(constants, self.title, 0.05)

        def contact(nu: float) -> SpringDashpot:
            share = log_decrement(constants.e_n)
            ratio = 1.5 * stiffness_ratio(nu)  # over the coefficient of d^1.5, which is 2/3 of the slope
            return SpringDashpot(
                1.5,
                math.sqrt(5.0) * share,
                ratio,
                2.0 * math.sqrt(5.0 / 6.0) * share * math.sqrt(ratio),
                constants.mu,
                slider="spring",
            )

        nu = nearest(contact, constants, *POISSON)
        e, mu = constants.e_n, constants.mu
        return integrated(
            constants,
            contact(nu),
            lines=[
                "# sphere: atom type 1; wall: atom type 2",
                "fix youngs all property/global youngsModulus peratomtype 1e9 1e9",
                f"fix poisson all property/global poissonsRatio peratomtype {nu:.6g} {nu:.6g}",
                f"fix rest all property/global coefficientRestitution peratomtypepair 2 {e:.10g} {e:.10g} "
                f"{e:.10g} {e:.10g}",
                f"fix fric all property/global coefficientFriction peratomtypepair 2 {mu:.10g} {mu:.10g} "
                f"{mu:.10g} {mu:.10g}",
                "pair_style gran model hertz tangential history",
                "pair_coeff * *",
                "# the wall: put your own in the place of zplane 0.0",
                "fix wall all wall/gran model hertz tangential history primitive type 2 zplane 0.0",
            ],
            law="Hertz's spring and a dashpot along the normal; Mindlin's spring without its unloading, a "
            "dashpot and Coulomb's slider along the wall.",
            mapping=[
                "coefficientRestitution = e_n, coefficientFriction = mu.",
                f"there is no place for {constants.closure.constant or 'a tangential restitution'}: of the "
                f"stiffness ratios that poissonsRatio from 0 to 0.5 allows, {nu:.3g} comes closest to the "
                "fitted curve in v_x/u; what remains is the residual below.",
                "youngsModulus = 1e9 Pa is numerical, not fitted, and the most that the code takes without "
                "hard_particles: it sets the duration of a contact and the overlap. Friction acts on an arm "
                "that "
                "is shorter by half the overlap, which is not in the residual: with a softer sphere or a "
                "faster impact keep the overlap below a hundredth of the radius.",
            ],
            holds="that the pair is one of sphere and wall; pairs of spheres are given the same constants.",
        )


EXPORTER = Liggghts()
