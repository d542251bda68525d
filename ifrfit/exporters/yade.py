"""Target yade: ``ViscElMat(tc, en, et, frictionAngle)``.

In ``Ip2_ViscElMat_ViscElMat_ViscElPhys`` (after Pournin 2001) k_n = m_R (pi^2 + ln^2 en)/tc^2,
c_n = -2 m_R ln en/tc, k_s = 2/7 m_R (pi^2 + ln^2 et)/tc^2, c_s = -4/7 m_R ln et/tc, with m_R = m/2 also where
one body is a wall (its mass 0 counts as that of the sphere). The sphere at a wall moves with all of m, so a
wall gives back more than en. The normal force never attracts, and the shear dashpot acts in sticking only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ifrfit.errors import UsageError
from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import HASH, Comments, Conditions, Translation
from ifrfit.exporters.soft_sphere import integrated, nearest, only_solid_sphere, restitution_input
from ifrfit.exporters.spring_dashpot import SpringDashpot

_LEAST = 1e-3


@dataclass(frozen=True)
class Yade:
    """Linear viscoelastic spheres."""

    name: str = "yade"
    title: str = "YADE"
    comments: Comments = HASH
    takes: frozenset[str] = frozenset()

    def translate(self, constants: ExportedConstants, at: Conditions) -> Translation:
        """en and et by integration of the law at a wall."""
        only_solid_sphere(constants, self.title)
        j, mu = constants.inertia_factor, constants.mu
        en = restitution_input(lambda e: contact(e, 0.5, mu), constants.e_n, j)
        if math.isnan(en):
            raise UsageError(f"No en of YADE gives e_n = {constants.e_n:g} at a wall: the least is above it.")
        et = nearest(lambda x: contact(en, x, mu), constants, _LEAST, 1.0)
        return integrated(
            constants,
            contact(en, et, mu),
            lines=[
                "from math import atan",
                "",
                "# tc: yours, seconds. A material each, for sphere and wall alike: YADE takes their mean.",
                f"contact = dict(tc=1e-5, en={en:.10g}, et={et:.10g}, frictionAngle=atan({mu:.10g}))",
                "sphereMaterial = O.materials.append(ViscElMat(density=2500, label='sphere', **contact))",
                "wallMaterial = O.materials.append(ViscElMat(density=2500, label='wall', **contact))",
                "# engines: Ip2_ViscElMat_ViscElMat_ViscElPhys() and Law2_ScGeom_ViscElPhys_Basic()",
            ],
            law="linear springs and dashpots along the normal and along the wall, and Coulomb's slider.",
            mapping=[
                f"en = {en:.6g} gives the rebound e_n = {constants.e_n:.6g} at a wall, where the code "
                "takes half "
                "the mass of the sphere; between two spheres en is what comes back, so use other "
                "materials there.",
                f"et = {et:.6g}, above 0 and at most 1, comes closest to the fitted curve in v_x/u; the "
                "slip is "
                "reversed, as by a positive beta of ifrfit.",
                "frictionAngle = atan(mu); tc and density are numerical. Friction acts on an arm that is "
                "shorter "
                "by half the overlap (0.45 u_n tc at most), which is not in the residual: take tc so short "
                "that the overlap stays below a hundredth of the radius.",
            ],
            holds="that one body is a wall of mass 0.",
        )


def contact(en: float, et: float, mu: float) -> SpringDashpot:
    """The law at a wall, in units of the normal spring."""
    normal = math.pi**2 + math.log(en) ** 2
    # with m = 1 and k_n = 1 the collision time is sqrt(normal/2)
    time = math.sqrt(0.5 * normal)
    k_t = 2.0 / 7.0 * (math.pi**2 + math.log(et) ** 2) / normal
    c_t = -2.0 / 7.0 * math.log(et) / time
    return SpringDashpot(1.0, -math.log(en) / time, k_t, c_t, mu, slider="spring", clamped=True)


EXPORTER = Yade()
