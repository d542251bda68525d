"""Target openfoam: ``standardWallInteraction`` of type rebound.

There ``e`` is the normal restitution and ``mu`` the lost fraction of the tangential velocity of the centre,
U -= (1 + e) U_n n; U -= mu U_t: no Coulomb friction, and parcels have no spin.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ifrfit.errors import UsageError
from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import SLASHES, Comments, Conditions, Response, Translation
from ifrfit.physics.angles import Incidence


@dataclass(frozen=True)
class OpenFoam:
    """Lagrangian clouds."""

    name: str = "openfoam"
    title: str = "OpenFOAM"
    comments: Comments = SLASHES
    takes: frozenset[str] = frozenset({"angle"})

    def translate(self, constants: ExportedConstants, at: Conditions) -> Translation:
        """The fraction that is lost at an angle."""
        if at.angle is None:
            raise UsageError(
                "OpenFOAM's mu is the fraction of the tangential velocity that an impact takes away, not "
                "Coulomb's friction, and depends on the angle: name the angle with --angle DEG."
            )
        incidence = Incidence.of([at.angle], degrees=True)
        lost = 1.0 - float(constants.rebound(incidence).v_x[0] / incidence.sine[0])
        spin = math.tan(math.radians(at.angle))

        def response(incidence: Incidence) -> Response:
            return Response(constants.e_n * incidence.cosine, (1.0 - lost) * incidence.sine)

        return Translation(
            lines=[
                "patchInteractionModel standardWallInteraction;",
                "standardWallInteractionCoeffs",
                "{",
                "    type    rebound;",
                f"    e       {constants.e_n:.10g};",
                f"    mu      {lost:.10g};  // lost fraction of the tangential velocity at {at.angle:g} "
                "degrees",
                "}",
            ],
            law="v_n = e u_n and v_t = (1 - mu) u_t of the centre; parcels have no spin.",
            mapping=[
                "e = e_n.",
                f"mu = {lost:.6g} = 1 - v_x/u_x at {at.angle:g} degrees (|U_t|/U_n = {spin:.4g}): it is "
                "not the "
                f"Coulomb friction {constants.mu:.4g} of the fit.",
            ],
            holds=f"exact at {at.angle:g} degrees without spin, at all speeds; off elsewhere as the "
            "residual says.",
            response=response,
        )


EXPORTER = OpenFoam()
