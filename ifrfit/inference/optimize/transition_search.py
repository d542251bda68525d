"""Certified least squares in c and kappa, by intervals of tau whose rows are sorted only where it matters.

Rows are put into intervals of tau, not sorted. The six sums of each interval bound chi2 from below wherever
the transition lies within it; rows are sorted, and cells made of them, in the few intervals whose bound does
not lie above a value that is met. Section 7 of docs/theory/certificate.md has the proof. What the sums leave
in doubt, and what has more unknowns, is for `branch_and_bound.minimise`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ifrfit.inference.model.rows import Rows
from ifrfit.inference.optimize.branch_and_bound import branch_over, optimum_of
from ifrfit.inference.optimize.parameter_group import (
    Constants,
    GroupOptimum,
    ParameterGroup,
    direct_sums,
    is_separable,
    restitution_optimum,
)
from ifrfit.inference.optimize.piecewise import NEAR, Array, PiecewiseOptimum, Transition
from ifrfit.inference.optimize.solved_cells import DOUBT, SolvedCells
from ifrfit.inference.optimize.transition_cells import (
    CC,
    KK,
    N_BELOW,
    ONE,
    UU,
    UV,
    VV,
    C,
    Index,
    K,
    TransitionCells,
    lowest_anywhere,
    lowest_on_wall,
    quadratic_matrix,
    row_products,
    value_at,
)
from ifrfit.physics.impulse_laws import Coefficients
from ifrfit.physics.observable import Observable

_FEW = 2000  # rows that are sorted at once
_FINE = 8.0  # intervals, times the root of the number of rows: it balances sums against rows that are sorted
_MOST_BINS = 8192
_NARROW = 1e-6  # relative spread of 1 + tau below which intervals would lose their digits
_BLOCK = 16384  # rows at once, which stay in the cache
_FIRST = 64  # cells that are solved to get a first value
_SAMPLE = 256  # rows that tell what is typical
_EPS = float(np.finfo(float).eps)
_KAPPA = np.array([0.0, 1.0])


@dataclass(frozen=True)
class ImpulseRows:
    """Weighted measurements of the impulse factor k, made from the rows of a group as they are asked for.

    The residual of a row is v - u k, with u its slope and v its value less its offset, over sigma.

    Attributes
    ----------
    rows : Rows
    weight : ndarray, (n,)
        1/sigma.
    inertia_factor : float
    parts : tuple of (Observable, float)
        Observables that measure k, and what their slope and offset are multiplied by.
    law : Coefficients
    domain : (float, float)
        Of c.
    direct : ndarray, (6,)
        What measures c or kappa on its own adds to the coefficients of chi2: priors, and values of mu.
    """

    rows: Rows
    weight: Array
    inertia_factor: float
    parts: tuple[tuple[Observable, float], ...]
    law: Coefficients
    domain: tuple[float, float]
    direct: Array

    @classmethod
    def of(cls, group: ParameterGroup) -> ImpulseRows | None:
        """The rows of a group whose chi2 is one in c and kappa, but for what e_n alone decides; else None."""
        e_n, own, mu = group.e_n, group.c, group.mu
        plain = mu.fixed is None and mu.lower == 0.0 and math.isinf(mu.upper)
        if not (plain and own.fixed is None and math.isfinite(own.lower) and math.isfinite(own.upper)):
            return None
        if e_n.fixed is None and not is_separable(group):
            return None
        if e_n.fixed is not None and e_n.prior is not None:
            return None
        scale = {"one": 1.0}
        if e_n.fixed is not None and e_n.fixed > 0.0:
            scale |= {"impulse": 1.0 / (1.0 + e_n.fixed), "rebound": 1.0 / e_n.fixed}
        parts, rows = [], group.rows
        for observable in rows.measured:
            if observable.kind in ("normal", "friction"):
                continue  # e_n is known or found apart, and with it values of mu are values of kappa
            if observable.kind != "tangential" or observable.scale not in scale:
                return None
            parts.append((observable, scale[observable.scale]))
        if not parts:
            return None
        domain = own.lower, own.upper
        return cls(
            rows,
            group.weight,
            group.inertia_factor,
            tuple(parts),
            group.coefficients,
            domain,
            _direct_coefficients(group),
        )

    @cached_property
    def places(self) -> Index | None:
        """Rows that measure k; None for all."""
        if len(self.parts) == len(self.rows.measured):
            return None
        kept = [observable.name for observable, _ in self.parts]
        return np.flatnonzero(self.rows.is_any_of(kept))

    @cached_property
    def tau(self) -> Array:
        """Slip ratios, (n,)."""
        return self.rows.tau if self.places is None else self.rows.tau[self.places]

    def blocks(self) -> Iterator[slice]:
        """Parts of the rows."""
        for start in range(0, self.tau.size, _BLOCK):
            yield slice(start, start + _BLOCK)

    def of_places(self, at: slice | Index) -> tuple[Array, Array]:
        """u and v of some of the rows."""
        at = at if self.places is None else self.places[at]
        incidence = self.rows.incidence.map(lambda part: part[..., at])
        weight, value = self.weight[at], self.rows.value[at]
        u, v = np.empty((2, weight.size))
        which = None if len(self.parts) == 1 else self.rows.which[at]
        for observable, factor in self.parts:
            assert observable.linear is not None
            offset, slope = observable.linear(incidence, self.inertia_factor)
            if factor != 1.0:
                offset, slope = factor * offset, factor * slope
            if which is None:
                u, v = slope, np.subtract(value, offset, out=v)
            else:
                here = which == self.rows.names.index(observable.name)
                u[here], v[here] = slope[here], (value - offset)[here]
        v *= weight
        return u * weight, v

    def chi2(self, c: float, kappa: float) -> float:
        """The sum of squares, from the rows themselves."""
        a, b = self.law.a0 + self.law.a1 * c, self.law.b0 + self.law.b1 * c
        total = 0.0
        for at in self.blocks():
            u, v = self.of_places(at)
            k = kappa / self.tau[at]
            np.minimum(k, b, out=k)
            k += a
            k *= u
            k -= v
            total += float(k @ k)
        return total + max(0.0, float(value_at(self.direct, c, kappa)))


def _direct_coefficients(group: ParameterGroup) -> Array:
    """Coefficients of chi2 of what measures c or kappa on its own, (6,)."""
    made = np.zeros(6)
    if group.c.prior is not None:
        made[CC], made[C], made[ONE] = direct_sums(group.c, np.zeros(0), np.zeros(0))
    if group.e_n.fixed is not None and (group.mu.prior is not None or group.rows.measures("friction")):
        at, unit = group.rows.of_kind("friction"), 1.0 + group.e_n.fixed
        weight = group.weight[at]
        square, product, rest = direct_sums(group.mu, weight, weight * group.rows.value[at])
        made[KK], made[K] = square / unit**2, product / unit
        made[ONE] += rest
    return made


@dataclass(frozen=True)
class _Sums:
    """How sums are taken of rows: in c less the middle of its domain, and k less a typical value.

    So they keep more digits.

    Attributes
    ----------
    rows : ImpulseRows
    c, k : float
        What is taken off.
    """

    rows: ImpulseRows
    c: float
    k: float

    @classmethod
    def of(cls, rows: ImpulseRows) -> _Sums:
        n = rows.tau.size
        u, v = rows.of_places(slice(None, None, max(1, n // _SAMPLE)))
        square = float(u @ u)
        return cls(
            rows, 0.5 * (rows.domain[0] + rows.domain[1]), float(u @ v) / square if square > 0.0 else 0.0
        )

    @cached_property
    def law(self) -> Coefficients:
        """Of what is left of k."""
        law = self.rows.law
        return Coefficients(law.a0 + law.a1 * self.c - self.k, law.a1, law.b0 + law.b1 * self.c, law.b1)

    @cached_property
    def domain(self) -> tuple[float, float]:
        """Of what is left of c."""
        return self.rows.domain[0] - self.c, self.rows.domain[1] - self.c

    @cached_property
    def matrix(self) -> Array:
        """See `quadratic_matrix`."""
        return quadratic_matrix(self.law)

    @cached_property
    def direct(self) -> Array:
        """`ImpulseRows.direct` in what is left of c."""
        made = self.rows.direct.copy()
        made[ONE] = value_at(made, self.c, 0.0)
        made[C] -= made[CC] * self.c
        return made

    def products(self, at: slice | Index, out: Array) -> Array:
        """Products of some of the rows, (6, n)."""
        u, v = self.rows.of_places(at)
        v -= self.k * u
        row_products(u, v, 1.0 / self.rows.tau[at], out)
        return out

    def quadratics(self, sums: Array) -> tuple[Array, Array]:
        """Coefficients of chi2, prior included, and the size of its terms, from sums (9, m)."""
        form = self.matrix @ sums
        size = np.abs(self.matrix[ONE]) @ np.abs(sums)
        if self.rows.direct.any():
            form += self.direct[:, None]
            size += np.abs(self.direct[ONE])
        return form, size

    def cells(
        self, order: Index, outside: Array, ends: tuple[float, float], n_below: int, depth: float
    ) -> TransitionCells:
        """Cells of some rows, in ascending order of tau.

        Parameters
        ----------
        order : ndarray of int, (n,)
        outside : ndarray, (9,)
            Sums over the rows below, which stick, and over those above.
        ends : (float, float)
            Slip ratios between which the transition lies.
        n_below : int
            Rows below.
        depth : float
            Terms in a sum.
        """
        tau, n = self.rows.tau[order], order.size
        terms = self.products(order, np.empty((6, n)))
        sums = np.empty((9, n + 1))
        sums[:] = outside[:, None]
        sums[:N_BELOW, 1:] += terms[:N_BELOW].cumsum(axis=1)
        # not as what is left of all: where x is large the difference would lose its digits
        sums[N_BELOW:, -2::-1] += terms[:, ::-1].cumsum(axis=1)
        low, high = np.empty(n + 1), np.empty(n + 1)
        low[0], high[-1] = ends
        low[1:] = high[:-1] = tau
        n_stick = np.arange(n_below, n_below + n + 1)
        change = high > low
        if not change.all():  # rows of equal tau change together
            sums, low, high, n_stick = sums[:, change], low[change], high[change], n_stick[change]
        return TransitionCells(
            *self.quadratics(sums), n_stick, low, high, self.law, self.domain, _rounding(depth)
        )

    def all_cells(self) -> TransitionCells:
        """The cells of all rows."""
        order = self.rows.tau.argsort()
        return self.cells(order, np.zeros(9), (0.0, np.inf), 0, float(order.size))


def optimum_in_c_and_kappa(group: ParameterGroup) -> GroupOptimum | None:
    """Optimum where e_n is known, or found apart, so that c and kappa alone are left; None elsewhere."""
    rows = ImpulseRows.of(group)
    optimum = None if rows is None else transition_optimum(rows)
    if optimum is None:
        return None
    e_n, objective = restitution_optimum(group)
    unit = 1.0 + e_n
    minima = tuple((value + objective, (e_n, t[0], t[1] / unit)) for value, t in optimum.optima)
    extremes = [(e_n, t[0], t[1] / unit) for t in optimum.extremes]
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
    found, law = solved.found, solved.cells.law
    if not solved.cells.determine(found.cells[found.values <= found.value + NEAR]):
        return None
    transition = Transition(_KAPPA, 0.0, np.array([law.b1, 0.0]), law.b0)
    optimum = optimum_of(transition, solved.cells, found, solved.chi2, rows.tau.size)
    return optimum.moved(np.array([solved.sums.c, 0.0]), 0.0)


@dataclass(frozen=True)
class _Solved:
    """Cells of rows, those that are solved, and the least value."""

    sums: _Sums
    cells: TransitionCells
    found: SolvedCells
    chi2: float

    @classmethod
    def of(cls, rows: ImpulseRows) -> _Solved | None:
        """None where rounding leaves a doubt."""
        low, high = float(rows.tau.min(initial=np.inf)), float(rows.tau.max(initial=0.0))
        if not 0.0 < low <= high < np.inf:
            return None
        sums = _Sums.of(rows)
        if rows.tau.size <= _FEW or high - low < _NARROW * (1.0 + high):
            cells = sums.all_cells()
        else:
            cells = _cells_by_bins(sums, _Bins.of(sums, low, high))
        found = branch_over(cells, _FIRST, count_minima=True).member(0)
        slack = DOUBT * max(1.0, abs(found.value))
        if not found.errors[found.best] <= slack or (found.bounds < found.value - slack).any():
            return None
        c, kappa = found.point.tolist()
        return cls(sums, cells, found, rows.chi2(c + sums.c, kappa))


def _rounding(depth: float) -> float:
    """Relative error of sums so many terms deep."""
    return 4.0 * _EPS * max(16.0, math.sqrt(depth))


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
    def of(cls, own: _Sums, low: float, high: float) -> _Bins:
        """Intervals between the lowest tau and the highest."""
        tau = own.rows.tau
        m = min(int(_FINE * math.sqrt(tau.size)), _MOST_BINS)
        # 1/(1 + tau) is spread as angles are, and never rises with tau, rounded or not
        top = 1.0 / (1.0 + low)
        scale = m * (1.0 - 1e-9) / (top - 1.0 / (1.0 + high))
        which = np.empty(tau.size, dtype=np.intp)
        count, sums = np.zeros(m, dtype=np.intp), np.zeros((6, m))
        buffer = np.empty((6, min(_BLOCK, tau.size)))
        for at in own.rows.blocks():
            place = tau[at] + 1.0
            np.divide(-scale, place, out=place)
            place += top * scale
            here = which[at]
            here[:] = place
            count += np.bincount(here, minlength=m)
            for total, terms in zip(sums, own.products(at, buffer[:, : place.size]), strict=True):
                total += np.bincount(here, terms, m)
        edges = 1.0 / (top - np.arange(m + 1.0) / scale) - 1.0
        edges[0], edges[-1] = 0.0, np.inf
        return cls(which, count, sums, edges)


def _cells_by_bins(own: _Sums, bins: _Bins) -> TransitionCells:
    """The cells of the intervals that may hold a minimum within `NEAR` of the best."""
    m, law = bins.count.size, own.law
    outside = np.zeros((9, m + 1))  # below and above each edge
    np.cumsum(bins.sums[:N_BELOW], axis=1, out=outside[:N_BELOW, 1:])
    np.cumsum(bins.sums[:, ::-1], axis=1, out=outside[N_BELOW:, m - 1 :: -1])
    depth = float(m + bins.count.max())
    # the transition on an edge between intervals: a value that is met
    form, tau = own.quadratics(outside[:, 1:-1])[0], bins.edges[1:-1]
    c = lowest_on_wall(form, tau, law, own.domain)
    met = float(value_at(form, c, tau * (law.b0 + law.b1 * c)).min())
    chosen = _lowest_in_bins(own, bins, outside, depth) <= met + NEAR
    inner = np.flatnonzero(chosen[bins.which])
    inner = inner[own.rows.tau[inner].argsort()]
    change = np.diff(chosen, prepend=False, append=False)
    ends = np.flatnonzero(change).reshape(-1, 2)
    sticking = np.concatenate(([0], bins.count.cumsum()))
    pieces, first = [], 0
    for start, stop in ends.tolist():
        n_below = int(sticking[start])
        last = first + int(sticking[stop]) - n_below
        around = np.concatenate((outside[:N_BELOW, start], outside[N_BELOW:, stop]))
        walls = float(bins.edges[start]), float(bins.edges[stop])
        pieces.append(own.cells(inner[first:last], around, walls, n_below, depth + last - first))
        first = last
    return TransitionCells.joined(pieces)


def _lowest_in_bins(own: _Sums, bins: _Bins, outside: Array, depth: float) -> Array:
    """Lower bound of chi2 with the transition in each interval, eq. (17) of certificate.md, (m,)."""
    rounding, law = _rounding(depth), own.rows.law
    sums = np.concatenate((outside[:N_BELOW, :-1], outside[N_BELOW:, 1:]))
    least, doubtful = lowest_anywhere(*own.quadratics(sums), rounding)
    least = np.where(doubtful, 0.0, np.maximum(least, 0.0))
    steepest = max(abs(law.b0 + law.b1 * c) for c in own.rows.domain)
    uu, uv, vv = bins.sums[UU], bins.sums[UV], bins.sums[VV]
    along = np.divide(uv * uv, uu, out=np.zeros_like(uu), where=uu > 0.0)
    sticking = np.sqrt(np.maximum(vv - along - rounding * (vv + along), 0.0))
    # a little more than the interval: rounding may have put a row to either side of an edge
    width = (1.0 - bins.edges[:-1] / bins.edges[1:]) * (1.0 + 1e-9) + 1e-9
    return np.asarray(least + np.maximum(sticking - steepest * width * np.sqrt(uu), 0.0) ** 2)
