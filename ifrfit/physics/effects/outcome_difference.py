"""How far two outcomes of the same impacts lie apart, observable by observable."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ifrfit.physics.angles import Array
from ifrfit.physics.effects.impact_state import Outcome
from ifrfit.physics.observables import OBSERVABLES


def differences(one: Outcome, two: Outcome, mu: Array, observables: Sequence[str]) -> dict[str, float]:
    """Largest difference of each observable, angles in radians.

    Parameters
    ----------
    one, two : Outcome
        Of the same impacts.
    mu : ndarray
        Friction of each impact.
    observables : sequence of str
        Names in the common schema.

    Returns
    -------
    dict of str to float
        Infinite where a value exists in one of them only. At grazing incidence, where nothing approaches
        the wall, restitution is not compared.
    """
    return {name: _largest(name, one, two, mu) for name in observables}


def _largest(name: str, one: Outcome, two: Outcome, mu: Array) -> float:
    observable = OBSERVABLES[name]
    first, second = (np.asarray(observable.value(outcome, mu)) for outcome in (one, two))
    gap = np.abs(first - second)
    if observable.unit == "deg":
        gap = np.radians(np.minimum(gap, 360.0 - gap))
    undefined = np.isnan(first) & np.isnan(second)
    gap = np.where(undefined, 0.0, np.where(np.isnan(gap), math.inf, gap))
    if name == "e_n":
        gap = np.where(one.incidence.cosine > 0.0, gap, 0.0)
    return float(np.max(gap, initial=0.0))
