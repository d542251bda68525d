"""Laws e_n(v) whose one constant follows from the e_n that a fit with a constant one finds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ifrfit.inference.diagnostics.omitted_effects.effect_predictions import Array
from ifrfit.physics.effects.plasticity import restitution as after_yield
from ifrfit.physics.effects.viscoelastic import restitution as after_dissipation

_GRID = 4000  # places of a law's number, to invert it to 1e-6
_BINS = 64  # of log speed, for the mean
_HALVINGS = 40

LawOfSpeed = Callable[[Array], Array]


def dissipating(e_n: float) -> LawOfSpeed:
    """Viscoelastic e_n by V/V_0, through e_n at 1."""
    x = _inverse(after_dissipation, np.geomspace(1e4, 1e-8, _GRID), e_n)
    return lambda ratio: after_dissipation(x * ratio**0.2)


def yielding(e_n: float) -> LawOfSpeed:
    """Elastic-plastic e_n by V/V_0, through e_n at 1."""
    r = _inverse(after_yield, np.geomspace(1e-8, 1.0, _GRID), e_n)
    return lambda ratio: after_yield(r / ratio)


LAWS = {"viscoelastic": dissipating, "plasticity": yielding}


def _inverse(law: LawOfSpeed, number: Array, e_n: float) -> float:
    """Number at which a law gives e_n; numbers in the order of rising e_n."""
    return float(np.exp(np.interp(e_n, law(number), np.log(number))))


def reference_speed(law: LawOfSpeed, e_n: float, speed: Array, weight: Array) -> float:
    """V_0 at which the law has the mean e_n: the constant that would be fitted to it.

    Parameters
    ----------
    law : callable
        Of V/V_0, through e_n at 1, falling.
    e_n : float
    speed, weight : ndarray, (n,)
        Normal speeds, positive; how much each row says of e_n.
    """
    logs = np.log(speed)
    low, high = float(logs.min()), float(logs.max())
    if low == high or not weight.any():
        return float(np.exp(logs.mean()))
    mass, edges = np.histogram(logs, _BINS, weights=weight)
    middle = 0.5 * (edges[1:] + edges[:-1])
    for _ in range(_HALVINGS):
        half = 0.5 * (low + high)
        if float(mass @ (law(np.exp(middle - half)) - e_n)) < 0.0:
            low = half
        else:
            high = half
    return float(np.exp(0.5 * (low + high)))
