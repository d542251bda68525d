"""The impulse of a bilinear closure as three numbers, for programs that evaluate it themselves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from ifrfit.errors import UsageError
from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import Response, Translation
from ifrfit.physics.angles import Incidence
from ifrfit.physics.impulse_laws import Coefficients


@dataclass(frozen=True)
class ImpulseTerms:
    """k = a + min(b, kappa U_n/|U_t|)."""

    a: float
    b: float
    kappa: float


def impulse_terms(constants: ExportedConstants, target: str) -> ImpulseTerms:
    """The three numbers of a closure.

    Raises
    ------
    UsageError
        For a closure whose law is not bilinear.
    """
    law = constants.closure.law(constants.inertia_factor)
    if not isinstance(law, Coefficients):
        raise UsageError(
            f"The law of closure {constants.closure.title} is no formula of a line, and target "
            f"{target} writes such formulas only: take --to json for the constants, or fit closure fr or ifr."
        )
    own = constants.own
    return ImpulseTerms(law.a0 + law.a1 * own, law.b0 + law.b1 * own, constants.mu * (1.0 + constants.e_n))


def evaluated(constants: ExportedConstants, terms: ImpulseTerms, incidence: Incidence) -> Response:
    """Rebounds, with spin about y, by the arithmetic of the exported functions, from their numbers alone."""
    slip = incidence.slip_x
    k = terms.a + np.minimum(terms.b, terms.kappa * incidence.cosine / np.abs(slip))
    push = k * slip
    v_x, spin_y = incidence.sine - push, incidence.spin_y - push / constants.inertia_factor
    return Response(constants.e_n * incidence.cosine, v_x, -(v_x + spin_y) / slip)


_WALL_WORDS = (
    "a, b and kappa = mu (1 + e_n) follow from the constants; velocities in any unit, spins as R omega in "
    "the "
    "same; u_n > 0 is the approach, x and y lie in the wall, positive spin_y is back-spin to a motion along "
    "x, spin_x is minus the right-handed one."
)
_LAW_WORDS = (
    "that of the closure, k = a + min(b, kappa U_n/|U_t|); the tangential impulse per mass is -k U_t."
)
_EVERYWHERE = "at all angles, spins and speeds; outside those of the data it is an extrapolation."


def wall_function(constants: ExportedConstants, target: str, template: str) -> Translation:
    """A function of the closure in a language: its template filled in, numbers to the last bit.

    Raises
    ------
    UsageError
        For a closure whose law is not bilinear.
    """
    terms = impulse_terms(constants, target)
    numbers = {
        "e_n": constants.e_n,
        "a": terms.a,
        "b": terms.b,
        "kappa": terms.kappa,
        "j": constants.inertia_factor,
    }
    return Translation(
        lines=template.format(**numbers).rstrip("\n").split("\n"),
        law=_LAW_WORDS,
        mapping=(_WALL_WORDS,),
        holds=_EVERYWHERE,
        response=partial(evaluated, constants, terms),
    )
