"""Target chrono: ``ChContactMaterialNSC`` with its restitution and friction.

Chrono's non-smooth contacts are a complementarity problem on the friction cone, projected onto it as by
Anitescu and Tasora (``Project`` of its contact constraint), with the approach e u_n added to the normal
speed. On the cone impulse and velocity are orthogonal, so that a contact that slides gains mu times its
slip along the normal: the impulse per mass is p = ((1 + e) u_n + mu |U_t|)/(1 + mu^2 (1 + 1/J)), not (1 +
e) u_n. What sticks stops.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ifrfit.errors import UsageError
from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import SLASHES, Comments, Conditions, Response, Translation
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closure import rotational_share

_LEAST_BOUNCE = 0.15  # m/s, the system's minimum bounce speed by default


@dataclass(frozen=True)
class Chrono:
    """Non-smooth contacts."""

    name: str = "chrono"
    title: str = "Chrono"
    comments: Comments = SLASHES
    takes: frozenset[str] = frozenset({"speed"})

    def translate(self, constants: ExportedConstants, at: Conditions) -> Translation:
        """e_n and mu as they are, and what the cone makes of sliding."""
        if at.speed is not None and constants.e_n * at.speed <= _LEAST_BOUNCE:
            raise UsageError(
                f"--speed {at.speed:g}: Chrono lets nothing bounce off below {_LEAST_BOUNCE:g} m/s by "
                "default, and "
                f"e_n = {constants.e_n:g} gives {constants.e_n * at.speed:.3g} m/s. Name a higher speed, or "
                "none and lower the system's minimum bounce speed."
            )
        e, mu, share = constants.e_n, constants.mu, rotational_share(constants.inertia_factor)

        def response(incidence: Incidence) -> Response:
            slip = np.abs(incidence.slip_x)
            slides = share * slip > mu * (1.0 + e) * incidence.cosine
            sliding = ((1.0 + e) * incidence.cosine + mu * slip) / (1.0 + mu**2 / share)
            normal = np.where(slides, sliding, (1.0 + e) * incidence.cosine)
            push = np.where(slides, np.copysign(mu * sliding, incidence.slip_x), share * incidence.slip_x)
            after = incidence.slip_x - push / share
            return Response(normal - incidence.cosine, incidence.sine - push, -after / incidence.slip_x)

        return Translation(
            lines=[
                "// of sphere and wall alike: the pair takes the lesser of the two values",
                "auto material = chrono_types::make_shared<ChContactMaterialNSC>();",
                f"material->SetRestitution({e:.10g});",
                f"material->SetFriction({mu:.10g});",
            ],
            law="v_n = e u_n and Coulomb friction that at most stops the contact point; in sliding the "
            "friction cone adds mu times the slip that is left to v_n.",
            mapping=[
                "restitution = e_n, friction = mu.",
                f"there is no place for {constants.closure.constant or 'beta'}: contacts that stick stop "
                "the contact point.",
                "in sliding v_n = e u_n + mu |V_t| comes back, which grows with angle, spin and mu: see the "
                "residual of e_n.",
            ],
            holds="for ChSystemNSC with a solver of the cone complementarity problem (PSOR, "
            "Barzilai-Borwein, APGD) "
            "run until it converges, where e_n u_n is above the system's minimum bounce speed, "
            f"{_LEAST_BOUNCE:g} m/s by default; J is that of your body.",
            response=response,
        )


EXPORTER = Chrono()
