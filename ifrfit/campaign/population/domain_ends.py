"""Ends of a constant's own domain that cut what groups say, once in each of them.

A group whose e_t may be -1 has a posterior that ends there, and whatever is correlated with e_t moves along.
In one group that is knowledge; over n groups it counts n times, as bounds of the user's do
(`repeated_priors`). Groups that the end leaves open count as limits (`limits`), and are not among these.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ifrfit.campaign.group_fit import FAILURE, KAPPA, correlation_column
from ifrfit.campaign.population.group_likelihood import MU
from ifrfit.campaign.population.repeated_priors import HALF_WIDTHS, SHIFT
from ifrfit.inference.model.parameters import Parameter

Array = NDArray[np.float64]

_MOST = 1.0  # sd: nearer to the end the distance tells little


@dataclass(frozen=True)
class CutByEnd:
    """An end that may move the population of a constant.

    Attributes
    ----------
    constant : str
        Whose end it is: of the population itself, or of another constant.
    end : float
    groups : int
        That it cuts.
    shift : float
        By how much the median group may be off, in its standard errors, by what the end moves in the groups:
        the constant itself, as a normal law that is cut off there, and others by their correlation with it.
    """

    constant: str
    end: float
    groups: int
    shift: float


class MovedByEnd(NamedTuple):
    """By how many sd an end of a domain moves what groups say of its constant, by the number of the row."""

    constant: str
    end: float
    shifts: Mapping[int, float]


def moved_by_ends(
    rows: Sequence[Mapping[str, Any]], parameters: Sequence[Parameter]
) -> tuple[MovedByEnd, ...]:
    """What each end of the domains moves.

    Parameters
    ----------
    rows : sequence of mapping
        Of the campaign's table, see `ifrfit.campaign.group_fit.fit_group`.
    parameters : sequence of Parameter
    """
    found = []
    for each in (parameter for parameter in parameters if parameter.fixed is None):
        for is_upper in (False, True):
            moved = {number: _moved(row, each, is_upper=is_upper) for number, row in enumerate(rows)}
            shifts = {number: shift for number, shift in moved.items() if shift is not None}
            found.append(MovedByEnd(each.name, each.upper if is_upper else each.lower, shifts))
    return tuple(found)


def cuts_of(
    name: str,
    pooled: NDArray[np.intp],
    rows: Sequence[Mapping[str, Any]],
    ends: Sequence[MovedByEnd],
) -> tuple[CutByEnd, ...]:
    """Which ends may move the population of a constant by more than a quarter of its standard error.

    Parameters
    ----------
    name : str
        The constant, or kappa.
    pooled : ndarray of int, (n,)
        Rows that are members.
    rows : sequence of mapping
    ends : sequence of MovedByEnd
        Of these rows.
    """
    found = []
    members = set(pooled.tolist())
    for constant, end, every in ends:
        # those that count as limits are not cut: their likelihood goes on to the end
        shifts = {number: shift for number, shift in every.items() if number in members}
        if constant == name:
            total = sum(shifts.values())
        else:
            pair = correlation_column(constant, MU if name == KAPPA else name)
            total = sum(abs(rows[number].get(pair) or 0.0) * shift for number, shift in shifts.items())
        shift = total / math.sqrt(max(pooled.size, 1))
        if shift > SHIFT:
            found.append(CutByEnd(constant, end, len(shifts), shift))
    return tuple(found)


def _moved(row: Mapping[str, Any], parameter: Parameter, *, is_upper: bool) -> float | None:
    """By how many of its sd an end of the default domain moves what a group says; None where by nothing."""
    end, default = (
        (of[1] if is_upper else of[0])
        for of in (
            (parameter.lower, parameter.upper),
            parameter.passive or (parameter.lower, parameter.upper),
        )
    )
    low, high = row.get(f"{parameter.name}_lo68"), row.get(f"{parameter.name}_hi68")
    if row[FAILURE] or low is None or high is None or end != default or not math.isfinite(end):
        return None
    away, half = abs(end - 0.5 * (low + high)), 0.5 * (high - low)
    return (
        float(np.interp(away / half, *_of_cut_laws())) if half > 0.0 and away < HALF_WIDTHS * half else None
    )


@cache
def _of_cut_laws() -> tuple[Array, Array]:
    """Distance of the middle of the 68 % interval from the end, in half widths, and the mean moved in sd.

    Of normal laws cut off at an end that lies from 4 sd below their mean to 4 above it, `_MOST` at most.
    """
    beyond = np.linspace(-4.0, 4.0, 81)
    left = special.ndtr(beyond)
    low, high = (beyond - special.ndtri((1.0 - p) * left) for p in (0.16, 0.84))
    mills = np.exp(-0.5 * beyond**2) / math.sqrt(2.0 * math.pi) / left
    sd = np.sqrt(1.0 - mills * (mills + beyond))
    return (high + low) / (high - low), np.minimum(mills / sd, _MOST)
