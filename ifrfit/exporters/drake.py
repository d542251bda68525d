"""Target drake: ``hunt_crossley_dissipation`` and friction of the proximity properties.

Point contact in Drake is f = k x (1 + d x') along the normal, never attracting, after Hunt and Crossley, and
Coulomb's friction that at most stops the contact point, regularised below the stiction tolerance. One impact
of this law loses the same share of its speed whatever stiffness and mass: with w = d u_n,

    w (1 + e) = ln((1 + w)/(1 - e w)),

from the integral of v dv/(1 + d v) = -(k/m) x dx between approach and rebound, where x is 0. So d follows
from e at one speed. A pair of two bodies with the same d has this d, with the same mu this mu, and of two
like stiffnesses half.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy.optimize import brentq

from ifrfit.errors import UsageError
from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import IN_XML, Comments, Conditions, Response, Translation
from ifrfit.exporters.soft_sphere import positive_restitution
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closures import get_closure
from ifrfit.physics.rebound import rebound_of

_STIFFNESS = 2e6  # N/m, numerical


@dataclass(frozen=True)
class Drake:
    """Compliant point contact, at one speed."""

    name: str = "drake"
    title: str = "Drake"
    comments: Comments = IN_XML
    takes: frozenset[str] = frozenset({"speed"})

    def translate(self, constants: ExportedConstants, at: Conditions) -> Translation:
        """Dissipation from the integral of an impact; friction as it is."""
        if at.speed is None:
            raise UsageError(
                "Drake's rebound depends on the speed, and its dissipation is found at one: name the normal "
                "speed of approach with --speed M_S."
            )
        positive_restitution(constants, self.title)
        w, speed = reduced_dissipation(constants.e_n), at.speed
        slower, faster = restitution(0.5 * w), restitution(2.0 * w)
        d, mu = w / speed, constants.mu

        def response(incidence: Incidence) -> Response:
            # friction that at most stops the contact point is Brach's closure
            after = rebound_of(incidence, get_closure("f"), constants.e_n, 0.0, mu, constants.inertia_factor)
            return Response(after.v_n, after.v_x, after.beta)

        return Translation(
            lines=[
                "<!-- within collision, of the sphere and of the wall alike -->",
                "<drake:proximity_properties>",
                f"  <drake:point_contact_stiffness>{_STIFFNESS:g}</drake:point_contact_stiffness>",
                f"  <drake:hunt_crossley_dissipation>{d:.10g}</drake:hunt_crossley_dissipation>",
                f"  <drake:mu_dynamic>{mu:.10g}</drake:mu_dynamic>",
                f"  <drake:mu_static>{mu:.10g}</drake:mu_static>",
                "</drake:proximity_properties>",
            ],
            law="f = k x (1 + d v) along the normal (Hunt and Crossley), and Coulomb friction that at most "
            "stops the contact point.",
            mapping=[
                f"hunt_crossley_dissipation d = {d:.6g} s/m gives e_n = {constants.e_n:.6g} at {speed:g} "
                "m/s, "
                f"from the integral of the law; {slower:.4g} at half that normal speed, {faster:.4g} at "
                "twice.",
                f"mu_dynamic = mu_static = mu; there is no place for {constants.closure.constant or 'beta'}: "
                "contacts that stick stop the contact point.",
                "point_contact_stiffness is numerical: no rebound depends on it, but for the time step. A "
                "contact lasts about pi sqrt(m/k), where k is half of the value here.",
            ],
            holds=f"at the normal speed {speed:g} m/s, of a sphere of any mass and J as the fit has it, "
            "without gravity, with contact_model point: for time_step 0, or one that is much shorter than a "
            "contact. A "
            "discrete one damps more, and the approximation sap does not read the dissipation: take lagged.",
            response=response,
        )


def excess(w: float, e: float) -> float:
    """Left less right side of the equation of an impact; positive where e w is too small."""
    return w * (1.0 + e) - math.log1p(w) + math.log1p(-e * w)


def reduced_dissipation(e: float) -> float:
    """d times the speed of approach, which makes the restitution e (0 < e <= 1)."""
    if 1.0 - e < 1e-5:  # the equation loses its digits; to the first order e = 1 - 2 w/3
        return 1.5 * (1.0 - e)
    most = (1.0 - 1e-15) / e
    if excess(most, e) > 0.0:  # 1 - e w is below the digits of a number
        return most
    return float(brentq(excess, 1e-6, most, args=(e,), xtol=1e-14))


def restitution(w: float) -> float:
    """Restitution for the product of dissipation and speed."""
    if w < 1.5e-5:
        return 1.0 - 2.0 * w / 3.0
    most = min(1.0, (1.0 - 1e-15) / w)
    if excess(w, most) > 0.0:
        return most
    return float(brentq(lambda e: excess(w, e), 0.0, most, xtol=1e-12))


EXPORTER = Drake()
