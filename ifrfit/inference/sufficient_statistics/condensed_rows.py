"""Few rows in the place of many: every quadratic that the sums of an interval decide, they decide likewise.

The impacts of an interval of tau are replaced by two, whose weights, places and values have the same sums
(`moments`), and what their values scatter about the line between these by one pair of rows for each series
and observable. As long as no transition lies within an interval, nothing that a fit can ask tells them apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.sufficient_statistics.moments import (
    S_1,
    S_X,
    S_XX,
    S_Z,
    S_ZX,
    S_ZZ,
    N,
)
from ifrfit.inference.sufficient_statistics.tau_intervals import Intervals
from ifrfit.physics.angles import Incidence
from ifrfit.physics.observables import OBSERVABLES

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Bool = NDArray[np.bool_]

_ONE_PLACE = 1e-13  # spread of 1/tau, over itself, below which it is rounding


@dataclass(frozen=True)
class CondensedRows:
    """Rows that stand for many impacts; (m,) each.

    Attributes
    ----------
    gamma_deg : ndarray
        Without spin.
    value, sigma : ndarray
        In the observable of the group; the weight is sigma^-2.
    count : ndarray
        Measurements that each stands for.
    is_scatter : ndarray of bool
        Whether a row is one of the pair that carries the scatter within intervals.
    """

    gamma_deg: Array
    value: Array
    sigma: Array
    count: Array
    is_scatter: Bool


def condensed_rows(
    sums: Array,
    intervals: Intervals,
    observable: str,
    inertia_factor: float,
    span: tuple[float, float] = (0.0, 0.0),
) -> CondensedRows:
    """The rows that stand for the impacts of one group.

    Parameters
    ----------
    sums : ndarray, (bins, 7)
        Of the group; intervals whose impacts stand for themselves are zero.
    intervals : Intervals
    observable : str
    inertia_factor : float
    span : (float, float)
        Least and largest angle of the impacts, degrees: between them stand values that know no transition.
    """
    seen = np.flatnonzero(sums[:, N] > 0)
    own = sums[seen]
    # impacts without slip know nothing of the constants: their values are scatter
    known = own[:, S_1] > 0.0
    pure = float(own[~known, S_ZZ].sum())
    lost = float(own[~known, N].sum())
    seen, own = seen[known], own[known]
    tau = intervals.edges
    with np.errstate(divide="ignore"):
        ends = 1.0 / tau[seen + 1], 1.0 / tau[seen]
    x, weight, z, scatter = _two_places(own, intervals.middles[seen], *ends)
    count = weight / own[:, S_1, None] * own[:, N, None]
    keep = weight > 0.0
    x, weight, z, count = x[keep], weight[keep], z[keep], count[keep]
    pure += float(scatter.sum())
    is_scatter = np.zeros(x.size, dtype=bool)
    if x.size and pure > 0.0:
        heaviest = int(weight.argmax())
        half = np.sqrt(pure / weight[heaviest])
        x, weight, z, count = (np.append(part, part[heaviest]) for part in (x, weight, z, count))
        both = [heaviest, x.size - 1]
        weight[both] *= 0.5
        count[both] = 0.5 * (count[both] + lost)
        z[both] += [half, -half]
        is_scatter = np.zeros(x.size, dtype=bool)
        is_scatter[both] = True
    return _measured(x, weight, z, count, is_scatter, observable, inertia_factor, span)


def condensed_groups(
    sums: Array,
    observable: str,
    inertia_factor: float,
    ends: tuple[float, float],
    span: tuple[float, float] = (0.0, 0.0),
) -> tuple[CondensedRows, Index]:
    """The rows that stand for groups of impacts on one side of a transition, each with a scatter of its own.

    Parameters
    ----------
    sums : ndarray, (groups, 7)
        With x = 1/tau itself.
    observable, inertia_factor, span
        As `condensed_rows`.
    ends : (float, float)
        Least and largest 1/tau of that side.

    Returns
    -------
    rows : CondensedRows
    group : ndarray of int, (m,)
        Of each row.
    """
    seen = np.flatnonzero(sums[:, S_1] > 0.0)
    own = sums[seen]
    low, high = (np.full(seen.size, end) for end in ends)
    x, weight, z, scatter = _two_places(own, np.zeros(seen.size), low, high)
    count = weight / own[:, S_1, None] * own[:, N, None]
    # the heavier of both is parted, one above and one below, so far as the scatter takes
    first = np.arange(seen.size), weight.argmax(axis=1)
    half = np.sqrt(scatter / weight[first])
    x, weight, z, count = (np.column_stack((each, each[first])) for each in (x, weight, z, count))
    for each in (weight, count):
        each[first] *= 0.5
        each[:, 2] = each[first]
    z[first] += half
    z[:, 2] -= half
    keep = weight > 0.0
    is_scatter = np.zeros(int(keep.sum()), dtype=bool)
    rows = _measured(
        x[keep], weight[keep], z[keep], count[keep], is_scatter, observable, inertia_factor, span
    )
    return rows, np.broadcast_to(seen[:, None], keep.shape)[keep]


def _measured(
    x: Array,
    weight: Array,
    z: Array,
    count: Array,
    is_scatter: Bool,
    observable: str,
    inertia_factor: float,
    span: tuple[float, float],
) -> CondensedRows:
    """Values of an observable at places 1/tau."""
    kind = OBSERVABLES[observable]
    if kind.linear is None:
        gamma = np.linspace(*span, x.size)
        slope = np.ones(x.size)
        if kind.by_e_n is not None:
            slope = kind.by_e_n(Incidence.of(gamma, degrees=True))
        return CondensedRows(gamma, slope * z, slope / np.sqrt(weight), count, is_scatter)
    gamma = np.degrees(np.arctan2(1.0, x))
    offset, slope = kind.linear(Incidence.of(gamma, degrees=True), inertia_factor)
    return CondensedRows(gamma, offset + slope * z, np.abs(slope) / np.sqrt(weight), count, is_scatter)


def _two_places(
    own: Array, middle: Array, lowest: Array, highest: Array
) -> tuple[Array, Array, Array, Array]:
    """Places 1/tau, weights and values of two impacts an interval, (k, 2), and the scatter left, (k,).

    The sums are about `middle`; `lowest` and `highest` are the ends of 1/tau, (k,) each.
    """
    total = own[:, S_1]
    mean, z = own[:, S_X] / total, own[:, S_Z] / total
    spread = np.maximum(own[:, S_XX] / total - mean**2, 0.0)
    spread = np.where(spread > np.maximum((_ONE_PLACE * middle) ** 2, 1e-15 * mean**2), spread, 0.0)
    deviation = np.sqrt(spread)
    low, high = lowest - middle, highest - middle
    # where the two do not fit about the mean, one stands so far out as the interval goes on that side
    up, down = deviation.copy(), deviation.copy()
    short = mean - down < low
    up[short] = spread[short] / np.maximum(mean[short] - low[short], 1e-300)
    down[short] = mean[short] - low[short]
    tall = mean + up > high
    down[tall] = spread[tall] / np.maximum(high[tall] - mean[tall], 1e-300)
    up[tall] = high[tall] - mean[tall]
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.where(spread > 0.0, (own[:, S_ZX] / total - mean * z) / spread, 0.0)
        share = np.where(spread > 0.0, down / (up + down), 1.0)
    places = np.column_stack((middle + (mean + up), middle + (mean - down)))
    weight = np.column_stack((share * total, (1.0 - share) * total))
    values = np.column_stack((z + slope * up, z - slope * down))
    scatter = own[:, S_ZZ] - total * (z**2 + slope**2 * spread)
    return places, weight, values, np.maximum(scatter, 0.0)
