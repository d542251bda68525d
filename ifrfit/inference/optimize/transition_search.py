"""Certified least squares in c and kappa, by intervals of tau whose rows are looked at only where it matters.

Rows are put into intervals of tau, not sorted. The six sums of each interval bound chi2 from below wherever the
transition lies within it; rows are sorted, and cells made of them, in the few intervals whose bound does not
lie above a value that is met. Section 6 of docs/theory/certificate.md has the proof. What the sums leave in
doubt, and what has more unknowns, is for `branch_and_bound.minimise`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ifrfit.inference.optimize.branch_and_bound import branch_over, optimum_of
from ifrfit.inference.optimize.parameter_group import ParameterGroup
from ifrfit.inference.optimize.piecewise import NEAR, Array, PiecewiseOptimum, Transition
from ifrfit.inference.optimize.solved_cells import DOUBT
from ifrfit.inference.optimize.transition_cells import (
    CC,
    ONE,
    C,
    Index,
    TransitionCells,
    cell_quadratics,
    lowest_anywhere,
    lowest_on_wall,
    row_products,
    size_of_terms,
    value_at,
)
from ifrfit.physics.impulse_laws import Coefficients

_FEW = 400  # rows that are sorted at once
_FINE = 8.0  # intervals, times the root of the number of rows: it balances sums against rows that are sorted
_MOST_BINS = 8192
_BLOCK = 16384  # rows at once, which stay in the cache
_FIRST = 8  # cells that are solved to get a first value
_SAMPLE = 256  # rows that tell what is typical
_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class ImpulseRows:
    """Weighted measurements of the impulse factor k: residual = v - u k.

    Attributes
    ----------
    tau, u, v : ndarray, (n,)
        Slip ratio, slope over sigma, value less offset over sigma.
    law : Coefficients
    domain : (float, float)
        Of c.
    prior : (float, float) or None
        Mean and sd of an auxiliary measurement of c.
    """

    tau: Array
    u: Array
    v: Array
    law: Coefficients
    domain: tuple[float, float]
    prior: tuple[float, float] | None = None

    @classmethod
    def of(cls, group: ParameterGroup) -> ImpulseRows | None:
        """The rows of a group whose chi2 is one in c and kappa, but for what e_n alone decides; else None."""
        e_n, own, mu = group.e_n, group.c, group.mu
        plain = mu.fixed is None and mu.prior is None and mu.lower == 0.0 and math.isinf(mu.upper)
        if not (plain and own.fixed is None and math.isfinite(own.lower) and math.isfinite(own.upper)):
            return None
        if e_n.fixed is not None and e_n.prior is not None:
            return None
        scale = {"one": 1.0}
        if e_n.fixed is not None and e_n.fixed > 0.0:
            scale |= {"impulse": 1.0 / (1.0 + e_n.fixed), "rebound": 1.0 / e_n.fixed}
        parts, rows = [], group.rows
        for observable, at, incidence in rows.by_observable:
            if observable.kind == "normal":
                continue
            if observable.kind != "tangential" or observable.scale not in scale or observable.linear is None:
                return None
            factor = scale[observable.scale]
            offset, slope = observable.linear(incidence, group.inertia_factor)
            here = slice(None) if at.size == len(rows) else at
            weight = group.weight[here]
            v = rows.value[here] - (offset if factor == 1.0 else offset * factor)
            v *= weight
            slope = slope * weight
            parts.append((rows.tau[here], slope if factor == 1.0 else slope * factor, v))
        if not parts:
            return None
        joined = parts[0] if len(parts) == 1 else tuple(map(np.concatenate, zip(*parts, strict=True)))
        return cls(*joined, group.coefficients, (own.lower, own.upper), own.prior)

    def centred(self) -> tuple[ImpulseRows, float]:
        """The same in c less the middle of its domain, and k less a typical value: sums keep more digits."""
        step = max(1, self.tau.size // _SAMPLE)
        u, v = self.u[::step], self.v[::step]
        square, law = float(u @ u), self.law
        middle, c = (float(u @ v) / square if square > 0.0 else 0.0), 0.5 * (self.domain[0] + self.domain[1])
        prior = None if self.prior is None else (self.prior[0] - c, self.prior[1])
        shifted = Coefficients(law.a0 + law.a1 * c - middle, law.a1, law.b0 + law.b1 * c, law.b1)
        domain = self.domain[0] - c, self.domain[1] - c
        return ImpulseRows(self.tau, self.u, self.v - middle * self.u, shifted, domain, prior), c

    def chi2(self, c: float, kappa: float) -> float:
        """The sum of squares and the square of the prior, from the rows themselves."""
        a, b = self.law.a0 + self.law.a1 * c, self.law.b0 + self.law.b1 * c
        total = 0.0
        for at in self.blocks():
            k = kappa / self.tau[at]
            np.minimum(k, b, out=k)
            k += a
            k *= self.u[at]
            k -= self.v[at]
            total += float(k @ k)
        return total if self.prior is None else total + ((c - self.prior[0]) / self.prior[1]) ** 2

    def blocks(self) -> Iterator[slice]:
        """Parts of the rows."""
        for start in range(0, self.tau.size, _BLOCK):
            yield slice(start, start + _BLOCK)

    def quadratics(self, below: Array, above: Array) -> Array:
        """Coefficients of chi2, prior included, where some rows stick and others slide."""
        form = cell_quadratics(below, above, self.law)
        if self.prior is not None:
            mean, sd = self.prior
            form[CC] += 1.0 / sd**2
            form[C] += mean / sd**2
            form[ONE] += (mean / sd) ** 2
        return form

    def size(self, below: Array, above: Array) -> Array:
        """Of the terms that make up chi2 at c = kappa = 0 in each cell."""
        prior = 0.0 if self.prior is None else (self.prior[0] / self.prior[1]) ** 2
        return size_of_terms(below, above, self.law) + prior


def transition_optimum(rows: ImpulseRows) -> PiecewiseOptimum | None:
    """The global minimum in (c, kappa) with its proof; None where rounding leaves a doubt.

    Parameters
    ----------
    rows : ImpulseRows
    """
    if rows.tau.size == 0 or not (rows.tau.min() > 0.0 and rows.tau.max() < np.inf):
        return None
    rows, center = rows.centred()
    cells = _all_cells(rows) if rows.tau.size <= _FEW else _cells_by_bins(rows)
    if cells is None:
        return None
    transition = Transition(_KAPPA, 0.0, np.array([rows.law.b1, 0.0]), rows.law.b0)
    found = branch_over(cells, _FIRST, count_minima=True).member(0)
    slack = DOUBT * max(1.0, abs(found.value))
    if not found.errors[found.best] <= slack or (found.bounds < found.value - slack).any():
        return None
    if not cells.knows_c[found.cells[found.values <= found.value + NEAR]].all():
        return None  # a valley without end: where in it the point lies is for the general code to say
    chi2 = rows.chi2(*found.point.tolist())
    return optimum_of(transition, cells, found, chi2, rows.tau.size).moved(np.array([center, 0.0]), 0.0)


_KAPPA = np.array([0.0, 1.0])


def _rounding(depth: float) -> float:
    """Relative error of sums so many terms deep."""
    return 4.0 * _EPS * max(16.0, math.sqrt(depth))


def _all_cells(rows: ImpulseRows) -> TransitionCells:
    """The cells of all rows."""
    order = rows.tau.argsort()
    nothing = np.zeros((6, 1))
    return _cells_of(rows, order, nothing, nothing, (0.0, np.inf), 0, float(rows.tau.size))


def _cells_of(
    rows: ImpulseRows,
    order: Index,
    below: Array,
    above: Array,
    ends: tuple[float, float],
    n_below: int,
    depth: float,
) -> TransitionCells:
    """Cells of some rows, in ascending order of tau, between sums of those that stick and those that slide."""
    tau = rows.tau[order]
    terms = row_products(rows.u[order], rows.v[order], 1.0 / tau)
    n = tau.size
    sums = np.empty((2, 6, n + 1))
    sums[0] = below
    sums[1] = above
    sums[0, :, 1:] += terms.cumsum(axis=1)
    # not as what is left of all: where x is large the difference would lose its digits
    sums[1, :, -2::-1] += terms[:, ::-1].cumsum(axis=1)
    low, high = np.empty(n + 1), np.empty(n + 1)
    low[0], high[-1] = ends
    low[1:] = high[:-1] = tau
    n_stick = np.arange(n_below, n_below + n + 1)
    change = high > low
    if not change.all():  # rows of equal tau change together
        sums, low, high, n_stick = sums[:, :, change], low[change], high[change], n_stick[change]
    form, size = rows.quadratics(sums[0], sums[1]), rows.size(sums[0], sums[1])
    return TransitionCells(form, n_stick, low, high, rows.law, rows.domain, size, _rounding(depth))


@dataclass(frozen=True)
class _Bins:
    """Rows by intervals of tau.

    Attributes
    ----------
    which : ndarray of int, (n,)
        Interval of each row; it never falls where tau rises.
    count : ndarray of int, (m,)
    sums : ndarray, (6, m)
    edges : ndarray, (m + 1,)
        Ends of the intervals; those of the first and the last reach to 0 and to infinity.
    """

    which: Index
    count: Index
    sums: Array
    edges: Array

    @classmethod
    def of(cls, rows: ImpulseRows) -> _Bins:
        m = min(int(_FINE * math.sqrt(rows.tau.size)), _MOST_BINS)
        # 1/(1 + tau) is spread as angles are, and never rises with tau, rounded or not
        top, bottom = 1.0 / (1.0 + float(rows.tau.min())), 1.0 / (1.0 + float(rows.tau.max()))
        scale = m * (1.0 - 4.0 * _EPS) / max(top - bottom, _EPS)
        which = np.empty(rows.tau.size, dtype=np.intp)
        count, sums = np.zeros(m, dtype=np.intp), np.zeros((6, m))
        for at in rows.blocks():
            tau, u, v = rows.tau[at], rows.u[at], rows.v[at]
            place = tau + 1.0
            np.divide(-scale, place, out=place)
            place += top * scale
            np.clip(place, 0.0, m - 1, out=place)
            own = which[at]
            own[:] = place
            count += np.bincount(own, minlength=m)
            for total, terms in zip(sums, row_products(u, v, 1.0 / tau), strict=True):
                total += np.bincount(own, terms, m)
        edges = 1.0 / (top - np.arange(m + 1.0) / scale) - 1.0
        edges[0], edges[-1] = 0.0, np.inf
        return cls(which, count, sums, edges)


def _cells_by_bins(rows: ImpulseRows) -> TransitionCells | None:
    """The cells of the intervals that may hold a minimum; None where these hold most of the rows."""
    bins = _Bins.of(rows)
    m = bins.count.size
    below, above = np.zeros((6, m + 1)), np.zeros((6, m + 1))
    np.cumsum(bins.sums, axis=1, out=below[:, 1:])
    np.cumsum(bins.sums[:, ::-1], axis=1, out=above[:, m - 1 :: -1])
    depth = float(m + bins.count.max())
    law, bounds = rows.law, _lowest_in_bins(rows, bins, below, above, depth)
    # the transition on an edge between intervals: a value that is met
    form, tau = rows.quadratics(below[:, 1:-1], above[:, 1:-1]), bins.edges[1:-1]
    c = lowest_on_wall(form, tau, law, rows.domain)
    met = float(value_at(form, c, tau * (law.b0 + law.b1 * c)).min())
    chosen = bounds <= met + NEAR
    if bins.count[chosen].sum() > max(0.5 * rows.tau.size, _FEW):
        return _all_cells(rows)
    inner = np.flatnonzero(chosen[bins.which])
    inner = inner[rows.tau[inner].argsort()]
    starts = np.flatnonzero(chosen & ~np.concatenate(([False], chosen[:-1])))
    stops = np.flatnonzero(chosen & ~np.concatenate((chosen[1:], [False]))) + 1
    sticking = np.concatenate(([0], bins.count.cumsum()))
    pieces, first = [], 0
    for start, stop in zip(starts.tolist(), stops.tolist(), strict=True):
        n_below = int(sticking[start])
        last = first + int(sticking[stop]) - n_below
        ends = float(bins.edges[start]), float(bins.edges[stop])
        sums = below[:, start, None], above[:, stop, None]
        pieces.append(_cells_of(rows, inner[first:last], *sums, ends, n_below, depth + last - first))
        first = last
    return _joined(pieces)


def _lowest_in_bins(rows: ImpulseRows, bins: _Bins, below: Array, above: Array, depth: float) -> Array:
    """Lower bound of chi2 with the transition in each interval, eq. (17) of certificate.md, (m,)."""
    law, rounding = rows.law, _rounding(depth)
    parts = below[:, :-1], above[:, 1:]
    outside, doubtful = lowest_anywhere(rows.quadratics(*parts), rows.size(*parts), rounding)
    np.maximum(outside, 0.0, out=outside)
    outside[doubtful] = 0.0
    steepest = max(abs(law.b0 + law.b1 * c) for c in rows.domain)
    uu, uv, vv = bins.sums[:3]
    along = np.divide(uv * uv, uu, out=np.zeros_like(uu), where=uu > 0.0)
    sticking = np.sqrt(np.maximum(vv - along - rounding * (vv + along), 0.0))
    # the edges are where rounding may have put a row to either side
    width = (1.0 - bins.edges[:-1] / bins.edges[1:]) * (1.0 + 1e-9) + 1e-12
    return np.asarray(outside + np.maximum(sticking - steepest * width * np.sqrt(uu), 0.0) ** 2)


def _joined(pieces: list[TransitionCells]) -> TransitionCells:
    """Runs of cells, with a void between one and the next."""
    if len(pieces) == 1:
        return pieces[0]
    one = pieces[0]
    forms, sticks, lows, highs, sizes = [], [], [], [], []
    for each in pieces:
        forms += [each.form, np.zeros((6, 1))]
        sticks += [each.n_stick, np.array([-1])]
        lows += [each.low, np.zeros(1)]
        highs += [each.high, np.full(1, np.inf)]
        sizes += [each.size, np.zeros(1)]
    return TransitionCells(
        np.concatenate(forms[:-1], axis=1),
        np.concatenate(sticks[:-1]),
        np.concatenate(lows[:-1]),
        np.concatenate(highs[:-1]),
        one.law,
        one.domain,
        np.concatenate(sizes[:-1]),
        max(each.rounding for each in pieces),
    )
