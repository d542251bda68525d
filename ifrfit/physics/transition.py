"""Where sticking turns into sliding, in closed form."""

from __future__ import annotations

import math

from ifrfit.physics.closures import Closure


def transition_tau(closure: Closure, c: float, kappa: float, inertia_factor: float = 0.4) -> float:
    """Slip ratio |U_t|/U_n up to which impacts stick: kappa/b (IFR: kappa/J, 5/2 kappa for a sphere)."""
    linear = closure.coefficients(inertia_factor)
    bound = linear.b0 + linear.b1 * c
    return kappa / bound if bound > 0.0 else math.inf


def transition_angles(tau: float, spin_x: float = 0.0, spin_y: float = 0.0) -> tuple[float, ...]:
    """Incidence angles at which |U_t|/U_n equals `tau`.

    Parameters
    ----------
    tau : float
        Transition value of the slip ratio, see `transition_tau`.
    spin_x, spin_y : float
        R omega/u before.

    Returns
    -------
    tuple of float
        None, one or two angles in degrees, ascending. Two occur with top-spin: sliding, sticking, sliding.

    Notes
    -----
    Roots S = sin(gamma) in [0, 1] of (1 + tau^2) S^2 + 2 s_y S + s_x^2 + s_y^2 - tau^2 = 0, which is
    Eq. (23) of Doménech-Carbó (2023) made explicit.
    """
    if not math.isfinite(tau) or tau < 0.0:
        return ()
    spin2 = spin_x * spin_x + spin_y * spin_y
    # divided by tau^2 where that is large, so that nothing overflows and no digits are lost
    scale = 1.0 / (1.0 + tau * tau)
    half, constant = spin_y * scale, (spin2 - tau * tau) * scale
    discriminant = half * half - constant
    if discriminant < 0.0:
        return ()
    root = math.sqrt(discriminant)
    first = -half - math.copysign(root, half)
    second = constant / first if first != 0.0 else 0.0
    sines = sorted({first, second})
    return tuple(math.degrees(math.asin(s)) for s in sines if 0.0 <= s <= 1.0)
