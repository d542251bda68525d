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
    edges,
    middles,
)
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
    sums: Array, observable: str, inertia_factor: float, span: tuple[float, float] = (0.0, 0.0)
) -> CondensedRows:
    """The rows that stand for the impacts of one group.

    Parameters
    ----------
    sums : ndarray, (bins, 7)
        Of the group; intervals whose impacts stand for themselves are zero.
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
    x, weight, z, scatter = _two_places(own, seen, sums.shape[0])
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


def _two_places(own: Array, seen: Index, bins: int) -> tuple[Array, Array, Array, Array]:
    """Places 1/tau, weights and values of two impacts an interval, (k, 2), and the scatter left, (k,)."""
    total = own[:, S_1]
    middle = middles(bins)[seen]
    mean, z = own[:, S_X] / total, own[:, S_Z] / total
    spread = np.maximum(own[:, S_XX] / total - mean**2, 0.0)
    spread = np.where(spread > np.maximum((_ONE_PLACE * middle) ** 2, 1e-15 * mean**2), spread, 0.0)
    deviation = np.sqrt(spread)
    tau = edges(bins)
    with np.errstate(divide="ignore"):
        low, high = 1.0 / tau[seen + 1] - middle, 1.0 / tau[seen] - middle
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
