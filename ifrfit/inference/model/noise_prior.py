"""The proper prior of unknown noises: log-uniform between bounds that the data's own digits give."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.problem import Problem
from ifrfit.physics.observables import OBSERVABLES

Array = NDArray[np.float64]

_DECIMALS = 6  # finest resolution taken for a value that is written with more


def noise_label(group: str) -> str:
    """Name of the noise of a group; of the common factor where that is empty."""
    return f"noise[{group}]" if group else "noise"


def noise_bounds(problem: Problem) -> Mapping[str, tuple[float, float]]:
    """Bounds of the log-uniform prior of each unknown noise.

    From the resolution of the values (their last decimal, at most the sixth, over sqrt(12): what rounding
    alone leaves) to the natural scale of the observable: 1, or 90 degrees for an angle, or the largest value
    if that is larger. One common factor ("") has the bounds of sigma over the given sigma.

    Returns
    -------
    mapping
        "series/observable" to (lower, upper); "" where one factor is common to all.
    """
    if problem.noise == "known":
        return {}
    value = problem.rows.value
    found = {}
    for name, rows in problem.groups().items():
        unit = OBSERVABLES[name.rpartition("/")[2]].unit
        natural = max(90.0 if unit == "deg" else 1.0, float(np.abs(value[rows]).max()))
        found[name] = (_resolution(value[rows]) / math.sqrt(12.0), natural)
    if problem.noise == "unknown":
        return found | dict(problem.noise_bounds)
    groups = problem.groups()
    low = min(found[name][0] / float(problem.sigma[rows].max()) for name, rows in groups.items())
    high = max(found[name][1] / float(problem.sigma[rows].min()) for name, rows in groups.items())
    return {"": (low, high)} | dict(problem.noise_bounds)


def _resolution(value: Array) -> float:
    """The last decimal that any value is written with."""
    steps = 10.0 ** -np.arange(_DECIMALS)
    in_steps = value / steps[:, None]
    written = (np.abs(in_steps - np.round(in_steps)) < 1e-7).all(axis=1)
    return float(steps[np.argmax(written)]) if written.any() else float(10.0**-_DECIMALS)
