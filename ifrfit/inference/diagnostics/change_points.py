"""Two change points: a run of impacts along the table in which one constant has another value.

Score tests of every run, by cumulative sums: what the other constants take of it is projected out.

References
----------
Levin & Kline (1985), Stat. Med. 4, 469, for one mean; Olshen et al. (2004), Biostatistics 5, 557.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ifrfit.inference.diagnostics.linear_mixture import Linearised
from ifrfit.inference.diagnostics.quadratic_forms import orthonormal
from ifrfit.inference.model.rows import Array, Index

_FEWEST = 3  # impacts in a run, and outside it
_MOST_ENDS = 200  # of runs; of more impacts several stand together
_FAINT = 1e-3  # share of the mean information of an impact, below which a run says nothing


@dataclass(frozen=True)
class Run:
    """The run of impacts that speaks most for another value of one constant.

    Attributes
    ----------
    column : int
        Of the slopes.
    first, last : int
        Impacts, in the order of the table; the last one is no more in it.
    chi2 : float
        Of the score test, of one degree of freedom at the noise of the fit.
    looks : int
        Runs that were tried.
    """

    column: int
    first: int
    last: int
    chi2: float
    looks: int


def best_runs(linear: Linearised, columns: Index) -> list[Run]:
    """The run whose score test is largest, of each of some constants (columns of the slopes), best first.

    None of them where there are too few impacts.
    """
    count = linear.first.size
    ends = np.unique(np.linspace(0, count, min(count, _MOST_ENDS) + 1).round().astype(np.intp))
    start, stop = np.triu_indices(ends.size, 1)
    inside = ends[stop] - ends[start]
    enough = (inside >= _FEWEST) & (count - inside >= _FEWEST)
    start, stop = start[enough], stop[enough]
    if not start.size:
        return []
    basis = orthonormal(linear.slopes)
    # at a kink, or on a bound, they are not at rest
    residual = linear.residual - basis @ (basis.T @ linear.residual)
    looks = start.size * columns.size
    best: list[Run] = []
    for column in columns.tolist():
        slope = linear.slopes[:, column]
        score, information = (_sums(linear, part, ends) for part in (slope * residual, slope**2))
        fitted = _sums(linear, slope[:, None] * basis, ends)
        own = information[stop] - information[start] - ((fitted[stop] - fitted[start]) ** 2).sum(axis=1)
        seen = own > _FAINT * max(float(information[-1]) / count, 1e-300)
        chi2 = np.where(seen, (score[stop] - score[start]) ** 2 / np.where(seen, own, 1.0), 0.0)
        place = int(np.argmax(chi2))
        first, last = int(ends[start[place]]), int(ends[stop[place]])
        best.append(Run(column, first, last, float(chi2[place]), looks))
    return sorted(best, key=lambda run: -run.chi2)


def run_of_largest_sum(gain: Array) -> tuple[int, int]:
    """Ends of the run whose sum is largest, the last not in it; `_FEWEST` or more are in it, and outside."""
    total = np.concatenate(([0.0], np.cumsum(gain)))
    count = gain.size
    best = -np.inf, 0, count
    lowest = 0
    for last in range(_FEWEST, count + 1):
        if total[last - _FEWEST] < total[lowest]:
            lowest = last - _FEWEST
        first = lowest
        if count - (last - first) < _FEWEST:  # of those that leave enough outside
            first = (
                last - count + _FEWEST + int(np.argmin(total[last - count + _FEWEST : last - _FEWEST + 1]))
            )
        best = max(best, (float(total[last] - total[first]), first, last))
    return best[1], best[2]


def _sums(linear: Linearised, of_rows: Array, ends: Index) -> Array:
    """Sums over the impacts before each end, (ends, ...)."""
    by_impact = np.add.reduceat(of_rows, linear.first, axis=0)
    total = np.concatenate((np.zeros((1, *by_impact.shape[1:])), np.cumsum(by_impact, axis=0)))
    return np.asarray(total[ends])
