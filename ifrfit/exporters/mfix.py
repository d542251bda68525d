"""Target mfix: the Hertzian collision model of MFiX-DEM at walls.

In the code's set-up of Hertzian collisions k_n = 4/3 sqrt(R) E* and k_t = 8 sqrt(R) G*; the dashpots have
eta_n = 2 sqrt(k_n m) |ln en|/sqrt(pi^2 + ln^2 en), and eta_t likewise with k_t, 2/7 m and et; both act with
d^(1/4). It stops at a DES_ET_WALL_INPUT outside 0 to 1, and takes tangential restitutions in this model only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ifrfit.errors import UsageError
from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import EXCLAMATION, Comments, Conditions, Translation
from ifrfit.exporters.soft_sphere import (
    POISSON,
    integrated,
    nearest,
    only_solid_sphere,
    restitution_input,
    stiffness_ratio,
)
from ifrfit.exporters.spring_dashpot import SpringDashpot, log_decrement

_LEAST = 1e-3


@dataclass(frozen=True)
class Mfix:
    """Keywords of mfix.dat."""

    name: str = "mfix"
    title: str = "MFiX"
    comments: Comments = EXCLAMATION
    takes: frozenset[str] = frozenset()

    def translate(self, constants: ExportedConstants, at: Conditions) -> Translation:
        """Restitutions by integration of the law at a wall."""
        only_solid_sphere(constants, self.title)
        j, mu = constants.inertia_factor, constants.mu
        en = restitution_input(lambda e: contact(e, 0.5, 0.3, mu), constants.e_n, j)
        if math.isnan(en):
            raise UsageError(
                f"No DES_EN_WALL_INPUT of MFiX gives e_n = {constants.e_n:g}: the least is above it."
            )
        nu, et = 0.3, 0.5
        for _ in range(3):  # one after the other: the curve has one valley
            et = nearest(lambda x: contact(en, x, nu, mu), constants, _LEAST, 1.0)  # noqa: B023
            nu = nearest(lambda x: contact(en, et, x, mu), constants, *POISSON)  # noqa: B023
        return integrated(
            constants,
            contact(en, et, nu, mu),
            lines=[
                "  DES_COLL_MODEL = 'HERTZIAN'",
                f"  DES_EN_WALL_INPUT(1) = {en:.10g}",
                f"  DES_ET_WALL_INPUT(1) = {et:.10g}",
                f"  MEW_W = {mu:.10g}",
                f"  E_YOUNG(1) = 1.0d7  V_POISSON(1) = {nu:.6g}",
                f"  EW_YOUNG = 1.0d7  VW_POISSON = {nu:.6g}",
                "  ! pairs of spheres are another contact: DES_EN_INPUT, DES_ET_INPUT and MEW are yours "
                "to set",
            ],
            law="Hertz's spring and a dashpot along the normal; a spring that grows with the contact, a "
            "dashpot and "
            "Coulomb's slider along the wall.",
            mapping=[
                f"DES_EN_WALL_INPUT = {en:.6g} gives the rebound e_n = {constants.e_n:.6g}: the code's "
                "dashpot is "
                "that of a linear contact, which damps a Hertzian one less.",
                f"DES_ET_WALL_INPUT = {et:.6g}, 0 to 1, and V_POISSON = {nu:.3g} come closest to the "
                "fitted curve in "
                "v_x/u; MEW_W = mu.",
                "E_YOUNG is numerical: no rebound of one impact depends on it.",
            ],
            holds="at walls.",
        )


def contact(en: float, et: float, nu: float, mu: float) -> SpringDashpot:
    """The law of the keywords."""
    k_t = 1.5 * stiffness_ratio(nu)
    return SpringDashpot(
        1.5, 2.0 * log_decrement(en), k_t, 2.0 * math.sqrt(2.0 / 7.0 * k_t) * log_decrement(et), mu
    )


EXPORTER = Mfix()
