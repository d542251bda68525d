"""The impact of one sphere on a wall by the springs, dashpots and slider of a discrete-element code.

Lengths and times are such that mass, coefficient of the normal spring and speed of approach are 1. The laws
have no scale of their own, so the rebound depends on the slip ratio tau = |U_t|/U_n alone, not on the speed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import Response
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closure import rotational_share

Array = NDArray[np.float64]

STEPS = 4000  # of the duration of an elastic contact
COARSE_STEPS = 500  # for searches
_DURATION = {1.0: math.pi, 1.5: 3.2181}  # of an elastic contact in these units: linear and Hertz's


@dataclass(frozen=True)
class SpringDashpot:
    """Forces of a contact at the overlap d, closing at the speed w, with tangential stretch s and slip V.

    F_n = d^p + c_n d^q w and F_t = -(k_t d^(p - 1) s + c_t d^q V), at most mu |F_n|; q is (p - 1)/2.
    Where the spring keeps its force, k_t d^(p - 1) s is the integral of k_t d^(p - 1) ds instead.

    Attributes
    ----------
    exponent : float
        p: 1 (linear) or 1.5 (Hertz).
    c_n, k_t, c_t : float
    mu : float
    slider : {"force", "spring"}
        What the friction bounds: the whole tangential force, or the spring, which then acts alone.
    clamped : bool
        Whether the normal force never attracts.
    keeps : {"stretch", "force"}
        What of the spring along the wall stays as it is while its stiffness changes with the overlap.
    """

    exponent: float
    c_n: float
    k_t: float
    c_t: float
    mu: float
    slider: Literal["force", "spring"] = "force"
    clamped: bool = False
    keeps: Literal["stretch", "force"] = "stretch"


def impact(
    contact: SpringDashpot, tau: Array, inertia_factor: float, steps: int = STEPS
) -> tuple[float, Array]:
    """Normal restitution, and the slip after in units of the speed of approach.

    Parameters
    ----------
    contact : SpringDashpot
    tau : ndarray, (n,)
        Slip before over speed of approach.
    inertia_factor : float
        J = I/(m R^2).
    steps : int
        Of the duration of an elastic contact.

    Returns
    -------
    e_n : float
    slip : ndarray, (n,)

    Notes
    -----
    Leapfrog, as the codes step themselves: drift with the speed at half a step, forces there, two half kicks.
    The contact ends where the overlap does, at a share of the last step.
    """
    power = contact.exponent - 1.0
    h = _DURATION[contact.exponent] / steps
    mobility = 1.0 / rotational_share(inertia_factor)
    d, w = 0.0, 1.0
    pull_n, pull_t = 0.0, np.zeros_like(tau)
    slip, stretch, stiffness = tau.astype(float), np.zeros_like(tau), 0.0
    head_on = not tau.any()  # nothing slips then, and nothing pulls along the wall
    for _ in range(20 * steps):
        w_half = w + 0.5 * h * pull_n
        slip_half = slip if head_on else slip + 0.5 * h * pull_t
        before = d, w, slip
        d += h * w_half
        if d <= 0.0:
            share = before[0] / (before[0] - d)
            return -(w + share * h * pull_n), slip + share * h * pull_t
        softer, stiffness, damping = stiffness, d**power, d ** (0.5 * power)
        normal = stiffness * d + contact.c_n * damping * w_half
        if contact.clamped:
            normal = max(normal, 0.0)
        pull_n = -normal
        w = w_half + 0.5 * h * pull_n
        if head_on:
            continue
        if contact.keeps == "force":
            stretch = stretch * (softer / stiffness)
        stretch = stretch + h * slip_half
        force, stretch = _tangential(contact, normal, stiffness, damping, stretch, slip_half)
        pull_t = -mobility * force
        slip = slip_half + 0.5 * h * pull_t
    return 0.0, slip  # it does not leave the wall


def _tangential(
    contact: SpringDashpot, normal: float, stiffness: float, damping: float, stretch: Array, slip: Array
) -> tuple[Array, Array]:
    """Tangential force against the slip, and the stretch that the slider leaves."""
    k, c = contact.k_t * stiffness, contact.c_t * damping
    bound = contact.mu * abs(normal)
    spring, dashpot = k * stretch, c * slip
    if contact.slider == "spring":
        slides = np.abs(spring) > bound
        limited = np.copysign(bound, spring)
        return np.where(slides, limited, spring + dashpot), np.where(slides, limited / k, stretch)
    trial = spring + dashpot
    force = np.minimum(np.maximum(trial, -bound), bound)
    return force, np.where(force != trial, (force - dashpot) / k, stretch)


def response(contact: SpringDashpot, inertia_factor: float, steps: int, incidence: Incidence) -> Response:
    """Rebounds of any angles and spins; beta is nan where nothing slips.

    Springs, dashpots and slider act along the slip, whose direction no impact turns.
    """
    e_n, slip = impact(contact, incidence.tau, inertia_factor, steps)
    with np.errstate(invalid="ignore"):
        beta = -slip / incidence.tau
    push = rotational_share(inertia_factor) * np.where(incidence.slip == 0.0, 0.0, 1.0 + beta)
    return Response(e_n * incidence.cosine, incidence.sine - push * incidence.slip_x, beta)


def misfit(contact: SpringDashpot, constants: ExportedConstants) -> float:
    """Sum of squared deviations of v_x/u from the fitted curve, over angles without spin."""
    incidence = Incidence.of(np.arange(2.0, 89.0, 2.0), degrees=True)
    found = response(contact, constants.inertia_factor, COARSE_STEPS, incidence)
    return float(np.sum((found.v_x - constants.rebound(incidence).v_x) ** 2))


def log_decrement(e: float) -> float:
    """Share of critical damping of a linear contact with restitution e: -ln e/sqrt(pi^2 + ln^2 e)."""
    return 1.0 if e <= 0.0 else -math.log(e) / math.hypot(math.pi, math.log(e))
