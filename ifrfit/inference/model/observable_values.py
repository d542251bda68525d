"""Values of observables at many constants at once, and whether e_n enters beside the impulse factor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ifrfit.physics.angles import Incidence
from ifrfit.physics.observables import Observable

Array = NDArray[np.float64]


def by_impulse(observable: Observable, i: Incidence, k: Array, e_n: Array, j: float) -> Array:
    """Value of an oblique observable at impulse factors k; all arrays broadcast.

    Raises
    ------
    ValueError
        For an observable that is not oblique.
    """
    if observable.by_impulse is not None:
        return observable.by_impulse(i, k, e_n, j)
    if observable.linear is None:
        raise ValueError(f"{observable.name} is no oblique observable")
    offset, slope = observable.linear(i, j)
    return np.asarray(scale_factor(observable.scale, e_n) * (offset + slope * k))


def scale_factor(scale: str, e_n: Array) -> Array:
    """Factor of tangential observables that depends on e_n alone."""
    if scale == "impulse":
        return np.asarray(1.0 / (1.0 + e_n))
    if scale == "rebound":
        return np.asarray(1.0 / np.maximum(e_n, 1e-300))
    return np.asarray(1.0)


def ties_e_n(observable: Observable) -> bool:
    """Whether the value sees e_n together with the impulse factor."""
    if observable.kind == "tangential":
        return observable.scale != "one"
    return observable.kind == "curved" and not observable.without_e_n
