"""Readings in the units in which they were taken: velocities as such, not per incoming speed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import special

from ifrfit.inference.diagnostics.rounding_step import step_of_readings
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit

_PER_SPEED = ("v_x", "v_y", "v_n", "spin_x_after", "spin_y_after")
_DIGITS = 9  # of the largest, which a product of the speed and a ratio to it keeps


@dataclass(frozen=True)
class Readings:
    """What one observable was read as, and what the fit says of it.

    Attributes
    ----------
    observable : str
    words : str
        What the numbers are.
    rows : ndarray of int, (n,)
    value, fitted, sigma : ndarray, (n,)
    step : float
        In which they are written.
    """

    observable: str
    words: str
    rows: Index
    value: Array
    fitted: Array
    sigma: Array
    step: float

    def expected(self, at: float, half: float) -> float:
        """How many readings the law and its noise put within a distance of a number."""
        z = (np.array([[at + half], [at - half]]) - self.fitted) / self.sigma
        return float((special.ndtr(z[0]) - special.ndtr(z[1])).sum())


def without_last_bits(value: Array) -> Array:
    """Numbers without the rounding of products, by which equal ones differ."""
    largest = float(np.abs(value).max(initial=0.0))
    return value if largest == 0.0 else np.round(value, _DIGITS - int(np.ceil(np.log10(largest))))


def as_read(problem: Problem, found: LeastSquaresFit) -> Iterator[Readings]:
    """Each observable as it is fitted; velocities and spins of impacts of several speeds also as read.

    These have no steps of their own decimals, a spin was multiplied by the radius: the smallest difference of
    two of them is taken, which is no smaller than their step.
    """
    fitted, value, speed = problem.predict(found.optimum.theta), problem.rows.value, problem.speeds
    for name in problem.rows.names:
        own = problem.rows.rows_of(name)
        step = step_of_readings(problem, own)
        yield Readings(name, name, own, value[own], fitted[own], found.sigma[own], step)
        own = own[np.isfinite(speed[own])]
        if name in _PER_SPEED and own.size and np.ptp(speed[own]) > 0.0:
            u = speed[own]
            read = without_last_bits(value[own] * u)
            gaps = np.diff(np.unique(read))
            if gaps.size:
                words = f"{name} in m/s" if name.startswith("v_") else f"{name} as R omega in m/s"
                step = float(gaps.min())
                yield Readings(name, words, own, read, fitted[own] * u, found.sigma[own] * u, step)
