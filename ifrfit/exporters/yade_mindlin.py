"""Target yade-mindlin: ``Ip2_FrictMat_FrictMat_MindlinPhys`` with ``betan`` and ``betas``.

As YADE 2023.02a has it: k_n = 2 E* sqrt(R* d), k_s = 8 G* sqrt(R* d), dashpots 2 betan sqrt(m k_n) and
2 betas sqrt(m k_s), at a wall with the whole mass of the sphere. The spring along the wall keeps its force
while its stiffness changes; the normal force never attracts, and the dashpot along the wall acts in sticking
only. ``en`` and ``es`` stand for the same ratios by a fit of Thornton, Cummins & Cleary (2013), Powder
Technol. 233, 30, which near 1 gives back less than is asked for (0.979 of 0.99). Given both, ``en`` and
``betan`` (``es`` and ``betas``) make the code throw; ``es`` above 1 or below 0 it takes without a word, and
for 0 it computes nan.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize

from ifrfit.errors import UsageError
from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import HASH, Comments, Conditions, Translation
from ifrfit.exporters.soft_sphere import (
    POISSON,
    integrated,
    only_solid_sphere,
    stiffness_ratio,
)
from ifrfit.exporters.spring_dashpot import Array, SpringDashpot, impact, misfit

_LEAST = 0.01  # of e_n: a sphere that leaves more slowly takes as long as many contacts
_MOST_DAMPING = 8.0  # more than e_n = 0.01 needs, and as good as no reversal of the slip
_POISSON_TRIED = tuple(np.linspace(*POISSON, 6).tolist())
_DAMPINGS_TRIED = (0.0, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0)
# Eq. (B7) of Thornton et al., from en^1 to en^10
_THORNTON = (
    -6.918798, -16.41105, 146.8049, -796.4559, 2928.711, -7206.864, 11494.29, -11342.18, 6276.757, -1489.915,
)  # fmt: skip


@dataclass(frozen=True)
class YadeMindlin:
    """Hertz and Mindlin without slip, damped."""

    name: str = "yade-mindlin"
    title: str = "YADE MindlinPhys"
    comments: Comments = HASH
    takes: frozenset[str] = frozenset()

    def translate(self, constants: ExportedConstants, at: Conditions) -> Translation:
        """The damping ratios and the Poisson ratio whose integrated impacts come closest."""
        only_solid_sphere(constants, self.title)
        if constants.e_n < _LEAST:
            raise UsageError(
                f"YADE's damping ratio grows without end as e_n goes to 0, and the fit has e_n = "
                f"{constants.e_n:g}: from {_LEAST:g} on it is exported. Take --to python or c."
            )
        e_n, mu = constants.e_n, constants.mu
        betan = normal_damping(e_n)
        nu, betas = _nearest(betan, constants)
        back = normal_restitution(thornton_damping(e_n))
        return integrated(
            constants,
            contact(nu, betan, betas, mu),
            lines=[
                "from math import atan",
                "",
                "# young and density: yours. A material each, for sphere and wall alike.",
                f"contact = dict(young=1e11, poisson={nu:.6g}, frictionAngle=atan({mu:.10g}))",
                "sphereMaterial = O.materials.append(FrictMat(density=2500, label='sphere', **contact))",
                "wallMaterial = O.materials.append(FrictMat(density=2500, label='wall', **contact))",
                f"contactPhysics = Ip2_FrictMat_FrictMat_MindlinPhys(betan={betan:.10g}, betas={betas:.10g})",
                "# engines: contactPhysics and Law2_ScGeom_MindlinPhys_Mindlin()",
            ],
            law="Hertz's spring and a dashpot along the normal; Mindlin's spring without slip, a dashpot and "
            "Coulomb's slider along the wall.",
            mapping=[
                f"betan = {betan:.6g} gives the rebound e_n = {e_n:.6g}. The code's own en = {e_n:.6g} would "
                f"give {back:.4g}, so it is left out; beside betan it makes the code stop.",
                f"betas = {betas:.6g}, 0 or more, and poisson = {nu:.3g}, from 0 to 0.5, come closest to the "
                "fitted curve in v_x/u. They reverse the slip, as a positive beta of ifrfit, or stop it: es "
                "of the code, between 0 and 1, is another name of betas, and no tangential restitution.",
                "frictionAngle = atan(mu), of which a pair has the smaller one. young = 1e11 Pa is "
                "numerical: it sets the duration of a contact and the overlap. Friction acts on an arm that "
                "is shorter by half the overlap, which is not in the residual: with a softer sphere or a "
                "faster impact keep the overlap below a hundredth of the radius.",
            ],
            holds="that the wall is not dynamic; pairs of spheres are given the same constants.",
        )


def contact(nu: float, betan: float, betas: float, mu: float) -> SpringDashpot:
    """The law in units of the coefficient of d^1.5, which is 2/3 of the slope."""
    ratio = 1.5 * stiffness_ratio(nu)
    return SpringDashpot(
        1.5, 2.0 * betan * math.sqrt(1.5), ratio, 2.0 * betas * math.sqrt(ratio), mu,
        slider="spring", clamped=True, keeps="force",
    )  # fmt: skip


def normal_restitution(betan: float) -> float:
    """What comes back head-on."""
    return impact(contact(0.0, betan, 0.0, 0.0), np.zeros(1), 0.4)[0]


def normal_damping(e_n: float) -> float:
    """The ratio betan whose integrated impact has the restitution e_n, from 0.01 to 1."""
    if e_n >= normal_restitution(0.0):  # 1, but for the step
        return 0.0
    return float(brentq(lambda x: normal_restitution(x) - e_n, 0.0, _MOST_DAMPING, xtol=1e-9))


def thornton_damping(e: float) -> float:
    """The ratio that the code takes for en or es, 0 < e <= 1."""
    if e == 1.0:
        return 0.0
    alpha = sum(h * e**power for power, h in enumerate(_THORNTON, 1))
    return math.sqrt(1.0 / (1.0 - (1.0 + e) ** 2 * math.exp(alpha)) - 1.0)


def _nearest(betan: float, constants: ExportedConstants) -> tuple[float, float]:
    """Poisson ratio and betas whose rebounds come closest to the fitted curve in v_x/u."""

    def miss(given: Array) -> float:
        nu, betas = given.tolist()
        return misfit(contact(nu, betan, betas, constants.mu), constants)

    tried = [np.array([nu, betas]) for nu in _POISSON_TRIED for betas in _DAMPINGS_TRIED]
    best = min(tried, key=miss)
    options: Any = {"xatol": 1e-4, "fatol": 1e-9, "maxfev": 100}
    found = minimize(
        miss,
        best,
        method="Nelder-Mead",
        bounds=[POISSON, (0.0, _MOST_DAMPING)],
        options=options,
    )
    nu, betas = min((best, np.asarray(found.x)), key=miss).tolist()
    return nu, betas


EXPORTER = YadeMindlin()
