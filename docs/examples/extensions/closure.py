"""A closure with a constant of its own: of a full reversal of the contact's velocity, the share g_rip."""

from ifrfit.physics.closure import Closure, ClosureConstant, rotational_share
from ifrfit.physics.impulse_laws import Coefficients


def _grip(j: float) -> Coefficients:
    return Coefficients(0.0, 0.0, 0.0, 2.0 * rotational_share(j))


GRIP = Closure(
    name="grip",
    title="GRIP",
    law=_grip,
    source="made up: k = min(2 g J/(1 + J), kappa/tau)",
    own=ClosureConstant(
        name="g_rip",
        latex=r"\Gamma",
        help="grip, from 0 (frictionless) to 1 (full reversal)",
        domain=lambda j: (0.0, 1.0),
    ),
)
