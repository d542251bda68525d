"""Ends of a constant's own domain that cut what groups say, once in each of them.

A group whose e_t may be -1 has a posterior that ends there, and whatever is correlated with e_t moves along.
In one group that is knowledge; over n groups it counts n times, as bounds of the user's do
(`repeated_priors`). Groups that the end leaves open count as limits (`limits`), and are not among these;
where they are many, what the others say near the end is skewed.
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
from ifrfit.campaign.population.columns import column
from ifrfit.campaign.population.coordinate import Coordinate
from ifrfit.campaign.population.group_likelihood import MU
from ifrfit.campaign.population.limits import Limits
from ifrfit.campaign.population.repeated_priors import HALF_WIDTHS, SHIFT
from ifrfit.inference.model.parameters import Parameter

Array = NDArray[np.float64]

# shares of groups with limits that move nothing, and from which on they move as much as they can: that much,
# in sd of a group; and how far groups have to be shrunk, as those that are alike are
_FEW_LIMITS, _MANY_LIMITS, _BY_LIMITS, _ALIKE = 0.1, 0.3, 0.55, 0.3
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
    failed = np.array([bool(row[FAILURE]) for row in rows])
    for each in (parameter for parameter in parameters if parameter.fixed is None):
        low, high = (np.where(failed, np.nan, column(rows, f"{each.name}_{end}68")) for end in ("lo", "hi"))
        for end, default in zip(
            (each.lower, each.upper), each.passive or (each.lower, each.upper), strict=True
        ):
            is_own = end == default and math.isfinite(end)
            found.append(MovedByEnd(each.name, end, _moved(low, high, end) if is_own else {}))
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


def cuts_of_limits(
    name: str, by: Coordinate, limits: Limits, pooled: int, shrinkage: float
) -> tuple[CutByEnd, ...]:
    """Ends near which so many groups give limits that they may move the population of groups that are alike.

    Limits are groups that chance carried over the line, so that their neighbours lie near the end, too, where
    what they say is far from normal. 140 random campaigns in which e_t was low by more the more limits there
    were (docs/campaigns.md) are where the size is from.

    Parameters
    ----------
    name : str
        The constant.
    by : Coordinate
    limits : Limits
    pooled : int
        Groups that determine it.
    shrinkage : float
        Of the median group.
    """
    found = []
    for side, end in ((-1.0, by.lower), (1.0, by.upper)):
        count = round(float(limits.count[limits.side == side].sum()))
        share = count / max(pooled + limits.groups, 1)
        if math.isfinite(end) and share >= _FEW_LIMITS and shrinkage >= _ALIKE:
            shift = _BY_LIMITS * min(share / _MANY_LIMITS, 1.0) * math.sqrt(pooled)
            found.append(CutByEnd(name, end, count, shift))
    return tuple(found)


def _moved(low: Array, high: Array, end: float) -> dict[int, float]:
    """By how many of its sd an end moves what a row says, whose 68 % interval is given, where it does."""
    with np.errstate(invalid="ignore"):  # open on both sides
        away, half = np.abs(end - 0.5 * (low + high)), 0.5 * (high - low)
    near = np.flatnonzero((half > 0.0) & (away < HALF_WIDTHS * half))
    shifts = np.interp(away[near] / half[near], *_of_cut_laws())
    return dict(zip(near.tolist(), shifts.tolist(), strict=True))


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
