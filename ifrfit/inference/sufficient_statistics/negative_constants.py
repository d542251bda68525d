"""Readings of a stream that are negative on the whole: a sign, or an axis, the other way round.

The sums of a pass hold the constant that goes with the slopes of v_n, e_n or mu in each series. Values that
were left out below zero count with those used: of a column of the other sign what is used is but the rest
that noise leaves above zero, or near it.
"""

from __future__ import annotations

import math

import numpy as np

from ifrfit.data.readings_below_zero import ON_THE_WHOLE, has_sign, no_noise
from ifrfit.errors import DataError
from ifrfit.inference.sufficient_statistics.accumulated import Accumulated, Array
from ifrfit.inference.sufficient_statistics.moments import S_1, S_Z, S_ZZ, N
from ifrfit.physics.observables import OBSERVABLES

_SHARE = 0.1  # of a series' readings, from which those left out may turn the sign of the others
_OF_SUMS = [N, S_Z, S_1, S_ZZ]


def refuse_negative(of: Accumulated) -> None:
    """Refuse a series whose constant, by all readings of an observable, is far below zero.

    Where sigma is not stated one reading scatters about the law as all do, so that readings of a wrong sign
    in a part of a series widen the standard error.

    Raises
    ------
    DataError
        With the first reading that was left out, or else the constant, and the series.
    """
    for group in range(len(of.groups)):
        name, series = of.observable_of(group), of.series[of.series_of(group)]
        if OBSERVABLES[name].linear is not None or not has_sign(OBSERVABLES[name]):
            continue
        used = of.sums[group][:, _OF_SUMS].sum(axis=0)
        left_out = np.array(of.tally.below.get(name, {}).get(series, (0.0, 0.0, 0.0, 0.0)))
        whole = used + left_out
        # one cell, however far, refuses no series that is positive
        told = used[1] < 0.0 or left_out[0] >= _SHARE * whole[0]
        if told and _is_negative(whole, known=of.weighted):
            raise DataError(_said(of, name, series, float(whole[1] / whole[2])))


def _is_negative(sums: Array, *, known: bool) -> bool:
    """Whether the constant lies so many standard errors below zero that its sign is wrong."""
    count, along, square, of_values = (float(each) for each in sums)
    if square <= 0.0 or along >= 0.0:
        return False
    if known:
        return along < ON_THE_WHOLE * math.sqrt(square)
    left = max(of_values - along**2 / square, 0.0) / max(count - 1.0, 1.0)
    return count > 1.0 and along < ON_THE_WHOLE * math.sqrt(square * left)


def _said(of: Accumulated, name: str, series: str, constant: float) -> str:
    """The sentence that is said of a table in memory."""
    few = f" of series {series}" if len(of.series) > 1 else ""
    first = of.tally.places.get(f"{name} impossible", [])
    place = f"{first[0]}, column {name}" if first and not few else f"{of.stream.path}, column {name}{few}"
    values = f"the constant of all its readings, {constant:.3g},"
    return f"{place}: {no_noise(OBSERVABLES[name]).format(values)}"
