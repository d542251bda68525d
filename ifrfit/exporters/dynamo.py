"""Target dynamo: a ``RoughWall`` and a ``HardSphere`` with ``TangentialElasticity``.

Its documentation: TangentialElasticity lies in [-1, 1]; 1 is no tangential interaction, -1 a complete
reversal of the surface velocity. So it is minus the beta of ifrfit, and there is no friction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ifrfit.errors import UsageError
from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import IN_XML, Comments, Conditions, Response, Translation
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closure import rotational_share


@dataclass(frozen=True)
class Dynamo:
    """Rough hard spheres: one beta at every impact."""

    name: str = "dynamo"
    title: str = "DynamO"
    comments: Comments = IN_XML
    takes: frozenset[str] = frozenset({"angle"})

    def translate(self, constants: ExportedConstants, at: Conditions) -> Translation:
        """Elasticity and TangentialElasticity, of little slip or at an angle."""
        if at.angle is None:
            beta, where = constants.sticking_restitution, "in sticking"
        else:
            beta = float(constants.beta(math.tan(math.radians(at.angle))))
            where = f"at {at.angle:g} degrees without spin"
        if not -1.0 <= beta <= 1.0:
            raise UsageError(
                f"DynamO takes a TangentialElasticity in [-1, 1], and the fit has beta = {beta:.4g} {where}."
            )
        tangential = -beta

        def response(incidence: Incidence) -> Response:
            k = rotational_share(constants.inertia_factor) * (1.0 + beta)
            return Response(
                constants.e_n * incidence.cosine,
                incidence.sine - k * incidence.slip_x,
                np.full_like(incidence.sine, beta),
            )

        numbers = f'Elasticity="{constants.e_n:.10g}" TangentialElasticity="{tangential:.10g}"'
        return Translation(
            lines=[
                "<!-- of the wall, within Locals; Radius is that of the sphere -->",
                f'<Local Type="RoughWall" Name="Wall" {numbers} Radius="0.5" Render="0">',
                '  <IDRange Type="All"/>',
                '  <Norm x="0" y="0" z="1"/>',
                '  <Origin x="0" y="0" z="0"/>',
                "</Local>",
            ],
            law="V_t = TangentialElasticity U_t at every impact, without friction.",
            mapping=[
                "Elasticity = e_n.",
                f"TangentialElasticity = {tangential:.6g} = -beta {where}: 1 leaves the slip, -1 "
                "reverses it.",
                "there is no place for mu: sliding is lost. Asked for an angle, it matches there.",
            ],
            holds=f"at all speeds; exact {where} and off elsewhere as the residual says. Spheres need a "
            "Species "
            "with inertia.",
            response=response,
        )


EXPORTER = Dynamo()
