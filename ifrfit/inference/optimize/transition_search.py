"""Certified least squares in c and kappa, by intervals of tau whose rows are sorted only where it matters.

Rows are put into intervals of tau, not sorted. The six sums of each interval bound chi2 from below wherever
the transition lies within it; rows are sorted, and cells made of them, in the few intervals whose bound does
not lie above a value that is met. Section 7 of docs/theory/certificate.md has the proof. What the sums leave
in doubt is summed again about the best point that was met; what is in doubt then, and what has more unknowns,
is for `branch_and_bound.minimise`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ifrfit.inference.model.slip_intervals import SlipIntervals, ends_of
from ifrfit.inference.optimize.branch_and_bound import optimum_of
from ifrfit.inference.optimize.impulse_rows import ImpulseRows
from ifrfit.inference.optimize.impulse_sums import ImpulseSums, rounding_of
from ifrfit.inference.optimize.parameter_group import (
    Constants,
    GroupOptimum,
    ParameterGroup,
    restitution_optimum,
)
from ifrfit.inference.optimize.piecewise import NEAR, Array, PiecewiseOptimum
from ifrfit.inference.optimize.solved_cells import DOUBT, SolvedCells
from ifrfit.inference.optimize.transition_cells import (
    N_BELOW,
    UU,
    UV,
    VV,
    TransitionCells,
    lowest_anywhere,
    lowest_on_wall,
    value_at,
)

_FEW = 2000  # rows that are sorted at once


def optimum_in_c_and_kappa(group: ParameterGroup) -> GroupOptimum | None:
    """Optimum where e_n is known, or found apart, so that c and kappa alone are left; None elsewhere."""
    rows = ImpulseRows.of(group)
    optimum = None if rows is None else transition_optimum(rows)
    if optimum is None:
        return None
    e_n, objective = restitution_optimum(group)
    unit = 1.0 + e_n

    def constants(t: list[float]) -> Constants:
        c, kappa = t
        return e_n, c, kappa / unit

    minima = tuple((value + objective, constants(t.tolist())) for value, t in optimum.optima)
    extremes = [constants(t) for t in optimum.extremes.tolist()]
    extremes += unlimited(group, optimum, minima[0][1])
    return GroupOptimum(minima[0][1], optimum.chi2 + objective, optimum.gap, minima, tuple(extremes))


def unlimited(group: ParameterGroup, optimum: PiecewiseOptimum, best: Constants) -> list[Constants]:
    """Constants to which no oblique row sets a limit: infinite."""
    (e_n, c, mu), found = best, []
    if optimum.all_stick and group.mu.fixed is None:
        found.append((e_n, c, math.inf))
    if optimum.all_slide and group.coefficients.a1 == 0.0 and group.c.fixed is None:
        found.append((e_n, math.inf, mu))  # a constant that shows in sticking only
    return found


def least_chi2(group: ParameterGroup) -> float | None:
    """Certified least value where c and kappa alone are left, determined or not; None elsewhere."""
    rows = ImpulseRows.of(group)
    solved = None if rows is None else _Solved.of(rows)
    return None if solved is None else solved.chi2 + restitution_optimum(group)[1]


def transition_optimum(rows: ImpulseRows) -> PiecewiseOptimum | None:
    """The global minimum in (c, kappa) with its proof; None where rounding leaves a doubt.

    None, too, where the rows leave a valley without end: where in it the point lies the general code says.

    Parameters
    ----------
    rows : ImpulseRows
    """
    solved = _Solved.of(rows)
    if solved is None:
        return None
    found, law = solved.found, rows.law
    if not solved.cells.determine(found.cells[found.near]):
        return None

    def transition(points: Array) -> tuple[Array, Array]:
        c, kappa = points.T
        return kappa, law.b0 + law.b1 * c

    return optimum_of(transition, solved.cells, found, solved.chi2, rows.tau.size)


class _Solved(NamedTuple):
    """Cells of rows, those that are solved, with points in c and kappa themselves, and the least value."""

    cells: TransitionCells
    found: SolvedCells
    chi2: float

    @classmethod
    def of(cls, rows: ImpulseRows) -> _Solved | None:
        """None where rounding leaves a doubt."""
        intervals = rows.slip_intervals if rows.tau.size > _FEW else None
        low, high = (0.0, 0.0) if intervals is not None else ends_of(rows.tau)
        if intervals is None and not 0.0 < low <= high < np.inf:
            return None
        sums = ImpulseSums.of(rows)
        for again in (True, False):
            if intervals is None:
                cells, is_sure = sums.all_cells(), True
            else:
                cells, is_sure = _cells_by_bins(sums, _Bins.of(sums, intervals))
            found = cells.solved((sums.c, sums.kappa))
            c, kappa = found.point.tolist()
            slack = DOUBT * max(1.0, abs(found.value))
            if is_sure and found.errors[found.best] <= slack and found.lowest_bound >= found.value - slack:
                return cls(cells, found, rows.chi2(c, kappa))
            if again and math.isfinite(found.value):
                sums = sums.about(c, kappa)
        return None


class _Bins(NamedTuple):
    """Sums over the rows of each of m intervals: the products of `ImpulseSums`, (6 or 9, m)."""

    intervals: SlipIntervals
    sums: Array

    @classmethod
    def of(cls, own: ImpulseSums, intervals: SlipIntervals) -> _Bins:
        """One pass over the rows."""
        m, alike = intervals.count.size, own.rows.alike
        sums = np.zeros((own.width, m))
        places = [i for i in range(own.width) if alike is None or i not in own.squares]
        for at in own.rows.blocks():
            here, tau = intervals.which[at].astype(np.intp), own.rows.tau[at]
            if alike is None:
                # a term at a time in the same memory: of new memory a page costs more than the sum over it
                products = own.products(at, tau, [np.empty(tau.size)] * own.width)
            else:
                products = own.products_alike(at, tau)
            for number, term in zip(places, products, strict=True):
                sums[number] += np.bincount(here, term, m)
        if alike is not None:
            sums[list(own.squares)] = intervals.count
            sums *= alike.weight
        return cls(intervals, sums)


def _cells_by_bins(own: ImpulseSums, bins: _Bins) -> tuple[TransitionCells, bool]:
    """The cells of the intervals that may hold a minimum within `NEAR` of the best; whether that is sure.

    Of values without errors the sums may keep no digit, and no interval may hold what was met: then the cells
    are those of the interval with the lowest bound, and all is to be summed again about what they say.
    """
    m = bins.intervals.count.size
    outside = np.zeros((9, m + 1))  # below and above each edge
    np.cumsum(bins.sums[:N_BELOW], axis=1, out=outside[:N_BELOW, 1:])
    np.cumsum(bins.sums[own.above, ::-1], axis=1, out=outside[N_BELOW:, m - 1 :: -1])
    depth = float(m + bins.intervals.count.max())
    # the transition on an edge between intervals: a value that is met
    form, tau = own.quadratics(outside[:, 1:-1])[0], bins.intervals.edges[1:-1]
    met = float(value_at(form, *lowest_on_wall(form, tau, own.law, own.domain, own.kappa)).min())
    lowest = _lowest_in_bins(own, bins, outside, depth)
    chosen = lowest <= met + NEAR
    is_sure = bool(chosen.any())
    chosen[lowest.argmin()] = True
    change = np.zeros(m + 2, dtype=bool)
    change[1:-1] = chosen
    ends = (change[1:] != change[:-1]).nonzero()[0].tolist()
    runs = list(zip(ends[::2], ends[1::2], strict=True))
    inner = ((bins.intervals.which >= ends[0]) & (bins.intervals.which < ends[-1])).nonzero()[0]
    if len(runs) > 1:
        inner = inner[chosen[bins.intervals.which[inner]]]
    inner = inner[own.rows.tau[inner].argsort()]
    sticking = np.concatenate(([0], bins.intervals.count.cumsum()))
    pieces, first = [], 0
    for start, stop in runs:
        n_below = int(sticking[start])
        last = first + int(sticking[stop]) - n_below
        around = np.concatenate((outside[:N_BELOW, start], outside[N_BELOW:, stop]))
        walls = float(bins.intervals.edges[start]), float(bins.intervals.edges[stop])
        pieces.append(own.cells(inner[first:last], around, walls, n_below, depth + last - first))
        first = last
    return TransitionCells.joined(pieces), is_sure


def _lowest_in_bins(own: ImpulseSums, bins: _Bins, outside: Array, depth: float) -> Array:
    """Lower bound of chi2 with the transition in each interval, eq. (17) of certificate.md, (m,)."""
    rounding, law = rounding_of(depth), own.rows.law
    sums = np.concatenate((outside[:N_BELOW, :-1], outside[N_BELOW:, 1:]))
    least, doubtful = lowest_anywhere(*own.quadratics(sums), rounding)
    least = np.where(doubtful, 0.0, np.maximum(least, 0.0))
    steepest = max(abs(law.b0 + law.b1 * c) for c in own.rows.domain)
    uu, uv, vv = bins.sums[UU], bins.sums[UV], bins.sums[VV]
    along = np.divide(uv * uv, uu, out=np.zeros_like(uu), where=uu > 0.0)
    sticking = np.sqrt(np.maximum(vv - along - rounding * (vv + along), 0.0))
    # a little more than the interval: rounding may have put a row to either side of an edge
    width = (1.0 - bins.intervals.edges[:-1] / bins.intervals.edges[1:]) * (1.0 + 1e-9) + 1e-9
    return np.asarray(least + np.maximum(sticking - steepest * width * np.sqrt(uu), 0.0) ** 2)
