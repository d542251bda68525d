"""The step to which readings were rounded: a decimal, or 2, 5 or 25 of one, as scales are divided."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ifrfit.inference.model.noise import in_steps, resolution
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Index, numbered

_ACCIDENT = 0.05  # chance that readings of the last decimal are all multiples, below which it is none
_FEW = 256  # values that are looked at before all are
_MOST_STEPS = 2.0**53  # whole numbers that a float tells apart


def rounding_step(value: Array, setting: Sequence[Array], series: Index) -> float:
    """The largest step of which all readings are multiples, or their last decimal where that may be chance.

    Of readings that are rounded to their last decimal, and scatter in each series about one value with a
    density that falls to both sides, each one that is not the most frequent number is a multiple of m
    decimals with probability 1/m at most: as many as m numbers between lie nearer to it. Those of a law
    that goes with the angle are spread further. n of them are with m^-n; readings that are alike in setting
    and value count as one, as they may be copies.

    Parameters
    ----------
    value : ndarray, (n,)
    setting : sequence of ndarray, (n,) each
        Readings that are alike in all of these are of one setting.
    series : ndarray of int, (n,)

    Returns
    -------
    float
        In the unit of the values.
    """
    decimal = resolution(value)
    multiple = _common_multiple(value, decimal)
    if multiple < 2 or not in_steps(value, multiple * decimal):
        return decimal
    different = np.unique(numbered(*setting, value), return_index=True)[1]
    value, series = value[different], series[different]
    _, first, count = np.unique(numbered(series, value), return_index=True, return_counts=True)
    most_frequent = np.zeros(series.max() + 1, dtype=np.intp)
    np.maximum.at(most_frequent, series[first], count)
    telling = different.size - int(most_frequent.sum())
    return multiple * decimal if -telling * math.log(multiple) < math.log(_ACCIDENT) else decimal


def step_of_readings(problem: Problem, own: Index) -> float:
    """The step to which some rows of one observable were rounded."""
    rows, i = problem.rows, problem.rows.incidence
    setting = [each[own] for each in (rows.gamma_deg, i.spin_x, i.spin_y)]
    return rounding_step(rows.value[own], setting, rows.series[own])


def _common_multiple(value: Array, decimal: float) -> int:
    """The largest number of decimals of which all values are multiples; 0 where all are 0."""
    count = np.rint(np.abs(value) / decimal)
    if count.max(initial=0.0) >= _MOST_STEPS:
        return 1
    found = 0
    for part in (count[:_FEW], count):  # few tell mostly that there is none
        found = int(np.gcd.reduce(part.astype(np.int64), initial=found))
        if found == 1:
            break
    return found
