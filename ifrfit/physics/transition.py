"""Where sticking turns into sliding, in closed form."""

from __future__ import annotations

import math

from ifrfit.physics.closure import Closure


def transition_tau(closure: Closure, c: float, kappa: float, inertia_factor: float = 0.4) -> float:
    """Slip ratio |U_t|/U_n up to which impacts stick: kappa/b (IFR: kappa/J, 5/2 kappa for a sphere).

    With tangential compliance it is the one from which on they slip throughout.
    """
    bound = float(closure.law(inertia_factor).bound(c))
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

    Examples
    --------
    >>> import ifrfit
    >>> [round(angle, 2) for angle in ifrfit.transition_angles(1.0)]
    [45.0]
    >>> ifrfit.transition_angles(1.0, spin_y=1.0)
    (0.0,)
    """
    if not math.isfinite(tau) or tau < 0.0:
        return ()
    # all divided by n^2 = 1 + tau^2, and squares kept as products: nothing overflows, underflows or cancels
    n = math.hypot(1.0, tau)
    p, spin, lateral = tau / n, math.hypot(spin_x, spin_y) / n, abs(spin_x) / n / n
    if spin > 1.0:
        return ()
    reach = p * math.sqrt((1.0 - spin) * (1.0 + spin))
    if reach < lateral:
        return ()
    half, root = spin_y / n / n, math.sqrt(reach - lateral) * math.sqrt(reach + lateral)
    first = -half - math.copysign(root, half)
    second = (spin - p) / first * (spin + p) if first != 0.0 else 0.0
    # rounding may lift the sine of an angle at 90 degrees over 1
    sines = [min(abs(s), 1.0) for s in (first, second) if 0.0 <= s <= 1.0 + 1e-15]
    return tuple(sorted({_degrees(s, tau, spin_x, spin_y) for s in sines}))


def _degrees(sine: float, tau: float, spin_x: float, spin_y: float) -> float:
    """Angle of a sine; near 90 degrees from the cosine |U_t|/tau, because there the sine says little."""
    if math.sqrt((1.0 - sine) * (1.0 + sine)) >= tau:
        return math.degrees(math.asin(sine))
    return math.degrees(math.atan2(sine, math.hypot(sine + spin_y, spin_x) / tau))
