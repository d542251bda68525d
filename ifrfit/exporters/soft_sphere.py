"""What exporters to discrete-element codes share: searches of their numbers, and sentences."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

from scipy.optimize import brentq, minimize_scalar

from ifrfit.errors import UsageError
from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import Translation
from ifrfit.exporters.spring_dashpot import STEPS, SpringDashpot, impact, misfit, response
from ifrfit.physics.angles import Incidence

SCALE_FREE = "at all speeds, for the law has no speed of its own"
POISSON = (0.0, 0.5)  # of solids that are not auxetic: what LIGGGHTS takes, too


def only_solid_sphere(constants: ExportedConstants, title: str) -> None:
    """Refuse an inertia factor that a code has built in otherwise.

    Raises
    ------
    UsageError
        For J other than 2/5.
    """
    if abs(constants.inertia_factor - 0.4) > 1e-9:
        raise UsageError(
            f"{title} moves solid spheres, J = 2/5, and the fit has J = {constants.inertia_factor:g}: a "
            "sphere "
            "of that code would rebound otherwise. Take --to python or c."
        )


def positive_restitution(constants: ExportedConstants, title: str, least: float = 0.0) -> None:
    """Refuse a normal restitution that the code would stop at.

    Raises
    ------
    UsageError
        For e_n at or below `least`, or above 1.
    """
    if not least < constants.e_n <= 1.0:
        raise UsageError(
            f"{title} takes a normal restitution above {least:g} and at most 1, and the fit has "
            f"e_n = {constants.e_n:g}: the code would stop."
        )


def nearest(
    make: Callable[[float], SpringDashpot], constants: ExportedConstants, low: float, high: float
) -> float:
    """The number between two ends whose rebounds come closest to the fitted curve in v_x/u."""
    steps = 16
    tried = [low + (high - low) * i / steps for i in range(steps + 1)]
    best = min(range(steps + 1), key=lambda i: misfit(make(tried[i]), constants))
    found = minimize_scalar(
        lambda x: misfit(make(float(x)), constants),
        bounds=(tried[max(best - 1, 0)], tried[min(best + 1, steps)]),
        method="bounded",
        options={"xatol": 1e-4 * (high - low)},
    )
    candidates = (tried[best], float(found.x))
    return min(candidates, key=lambda x: misfit(make(x), constants))


def restitution_input(make: Callable[[float], SpringDashpot], e_n: float, j: float) -> float:
    """The number to give so that the integrated impact has the restitution e_n; nan where none does."""
    import numpy as np

    def excess(given: float) -> float:
        return impact(make(given), np.array([0.1]), j, STEPS)[0] - e_n

    if abs(excess(1.0)) < 1e-6:
        return 1.0
    low = 1e-6
    return math.nan if excess(low) > 0.0 else float(brentq(excess, low, 1.0, xtol=1e-9))


def integrated(
    constants: ExportedConstants,
    contact: SpringDashpot,
    *,
    lines: list[str],
    law: str,
    mapping: list[str],
    holds: str,
) -> Translation:
    """A translation whose law is integrated."""
    return Translation(
        lines=lines,
        law=law,
        mapping=mapping,
        holds=f"{SCALE_FREE}, and at the angles of the residual below; {holds}"
        f"{_time_step_words(contact, constants.inertia_factor)}",
        response=partial(response, contact, constants.inertia_factor, STEPS),
        how="integrated",
    )


def _time_step_words(contact: SpringDashpot, inertia_factor: float) -> str:
    """How much of the law is that of its time step, where that is more than rounding to a thousandth.

    A dashpot along the wall that is stronger than the slider as a contact begins writes into the spring what
    the first step makes of it.
    """
    import numpy as np

    incidence = Incidence.of(np.arange(2.0, 89.0, 2.0), degrees=True)
    steps = STEPS // 4, STEPS
    coarse, fine = (response(contact, inertia_factor, n, incidence).v_x for n in steps)
    change = float(np.max(np.abs(fine - coarse)))
    if change < 1e-3:
        return ""
    return (
        f" The law itself depends on the time step: with {steps[0]} or {steps[1]} of a contact v_x/u "
        f"changes by up to {change:.2g}."
    )


def stiffness_ratio(nu: float) -> float:
    """Tangential over normal stiffness of like materials, khat = 2 (1 - nu)/(2 - nu)."""
    return 2.0 * (1.0 - nu) / (2.0 - nu)
