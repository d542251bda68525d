"""Are errors independent? Residuals of neighbours that are alike say no: intervals are too short."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from ifrfit.inference.diagnostics.quadratic_forms import Array, orthonormal, ratio_exceeds
from ifrfit.inference.diagnostics.residuals import Residuals
from ifrfit.inference.diagnostics.thresholds import FACTS, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index, numbered
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact
from ifrfit.text import p_text

_FEWEST_STEPS = 7  # that differ from 0, from which an order is told
_AGAINST = 0.05  # share of steps against the order, of a table that was sorted but for a few rows
_FEWEST = 12  # rows of an observable below which no correlation is looked for
_MOST = 100_000  # beyond, sorting would take more than seconds
_REPEATED = 4  # rows an angle from which repeats tell errors from the law
_FEWEST_REPEATS = 10  # degrees of freedom of those
_TIED = 0.9  # share of different values of tau from which its order is one
_SUSPECT = 2.5  # standard deviations from which the exact p value is worked out
_EXACT = 600  # rows of an observable beyond which the normal approximation is exact enough
_LARGEST = 0.95  # correlation of neighbours that is taken for the factor
_FORGOTTEN = 1e-3  # correlation of far rows that counts for nothing


def is_sorted_by_values(problem: Problem) -> bool:
    """Whether the values of an observable rise or fall along each series, nearly without exception.

    Such a table was sorted by it. A drift does not look so: readings of noise s that drift by d from row to
    row take a step back with the probability Phi(-d/(s sqrt 2)), which is over 5 % for d up to 2.3 s.
    """
    for observable in range(len(problem.rows.names)):
        up = down = 0
        for rows in problem.groups().values():
            if problem.rows.which[rows[0]] != observable:
                continue
            steps = np.diff(problem.rows.value[rows[np.argsort(problem.rows.impacts[rows], kind="stable")]])
            up, down = up + int((steps > 0.0).sum()), down + int((steps < 0.0).sum())
        if up + down >= _FEWEST_STEPS and min(up, down) <= _AGAINST * (up + down):
            return True
    return False


@dataclass(frozen=True)
class _Order:
    """Rows of one observable in an order, and the pairs of neighbours within a series."""

    observable: str
    along: str
    rows: Index
    first: Index
    second: Index


def independence(
    problem: Problem,
    fit: LeastSquaresFit,
    residuals: Residuals,
    *,
    explained: bool,
    also: Array | None = None,
) -> Fact | None:
    """Test the correlation of neighbouring residuals, in the order of the table and of the angle.

    A table that was sorted by its values is tested along the angle alone.

    Tested is the sum of products of neighbours over the sum of squares (as by von Neumann), for each
    observable, with neighbours of one series; p values hold at any number of constants, and are multiplied by
    the number of tests. Where angles are repeated often, the scatter about the mean of each angle is tested
    in the place of residuals: a law that does not hold is then no reason.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquaresFit
    residuals : Residuals
    explained : bool
        Whether something else explains residuals that are alike, so that only repeats tell.
    also : ndarray, (n,), optional
        Change of the values along a slip, which is fitted besides.

    Returns
    -------
    Fact or None
        None where no neighbours are alike.

    References
    ----------
    von Neumann (1941), Ann. Math. Stat. 12, 367; Durbin & Watson (1950), Biometrika 37, 409.
    """
    jacobian = problem.free_jacobian(fit.optimum.theta)
    if also is not None:
        jacobian = np.column_stack((jacobian, also))
    own = orthonormal(jacobian / fit.sigma[:, None])
    r = residuals.standardised - own @ (own.T @ residuals.standardised)
    orders = list(_orders(problem))
    found: list[tuple[float, float, _Order]] = []
    for order in orders:
        groups = _repeats(problem, order.rows)
        if groups is None and explained:
            continue
        p, correlation = _correlation(order, own, r, groups)
        found.append((len(orders) * p, correlation, order))
    best = min(found, key=lambda one: one[0], default=None)
    if best is None or best[0] >= REFUTED:
        return None
    p, correlation, order = best
    factor, name = _factor(problem, fit, order, correlation)
    size = order.rows.size
    effective = size * (1.0 - correlation) / (1.0 + correlation)
    figures = {
        "p": p,
        "observable": order.observable,
        "along": order.along,
        "correlation": correlation,
        "factor": factor,
        "effective": effective,
    }
    says = (
        f"errors of {order.observable} are not independent: residuals of neighbours along the {order.along} "
        f"are alike (correlation {correlation:.2g}, p = {p_text(p)})"
    )
    short = f"intervals are too short by a factor of some {factor:.2g} ({name}), " if name else ""
    says += (
        f", or the law misses something smooth; {short}{size} rows count as {max(effective, 1.0):.0f}: look "
        "for what drifts, and give the mean of each run"
    )
    return Fact(False, says, figures, FACTS["independence"])


def _orders(problem: Problem) -> Iterator[_Order]:
    rows = problem.rows
    # where values were sorted by, neighbours are alike, whatever their errors
    is_sorted = is_sorted_by_values(problem)
    for name in rows.names:
        own = rows.rows_of(name)
        if not _FEWEST <= own.size <= _MOST:
            continue
        by_series = own[np.argsort(rows.series[own], kind="stable")]
        if not is_sorted:
            yield _pairs(problem, name, "table", by_series)
        tau = rows.tau[own]
        in_order = own[np.lexsort((tau, rows.series[own]))]
        distinct = numbered(rows.series[own], tau).max() + 1
        falling = own[np.lexsort((-tau, rows.series[own]))]
        is_that = any(np.array_equal(by_series, one) for one in (in_order, falling))
        if distinct >= _TIED * own.size and (is_sorted or not is_that):
            yield _pairs(problem, name, "angle", in_order)


def _pairs(problem: Problem, name: str, along: str, rows: Index) -> _Order:
    place = np.flatnonzero(np.diff(problem.rows.series[rows]) == 0)
    return _Order(name, along, rows, place, place + 1)


def _repeats(problem: Problem, rows: Index) -> Index | None:
    """Which rows repeat one another, where most are repeated often enough to tell errors from the law."""
    _, group = np.unique(problem.rows.setting[rows], return_inverse=True)
    count = int(group.max()) + 1
    often = rows.size >= _REPEATED * count and rows.size - count >= _FEWEST_REPEATS
    return group if often else None


def _correlation(order: _Order, own: Array, r: Array, groups: Index | None) -> tuple[float, float]:
    """p value of neighbours that are alike, one-sided, and their correlation."""
    basis, z = own[order.rows], r[order.rows]
    if groups is not None:  # the scatter about the mean of each angle
        means = np.zeros((z.size, int(groups.max()) + 1))
        means[np.arange(z.size), groups] = 1.0
        basis = means / np.sqrt(means.sum(axis=0))
        z = z - basis @ (basis.T @ z)
    if order.first.size < _FEWEST // 2 or not z.any():
        return 1.0, 0.0
    return neighbours_alike(order.first, order.second, basis, z)


def neighbours_alike(first: Index, second: Index, basis: Array, z: Array) -> tuple[float, float]:
    """Test residuals of neighbours for being alike, whatever constants were fitted.

    Parameters
    ----------
    first, second : ndarray of int
        Places of the neighbours.
    basis : ndarray, (n, k)
        Rows of an orthonormal basis of what was fitted.
    z : ndarray, (n,)
        Residuals, of independent standard normal errors up to a common factor.

    Returns
    -------
    p : float
        One-sided; 1 where nothing is suspicious.
    correlation : float
        Of neighbours, from 0 to 0.95.
    """
    found = float(z[first] @ z[second]) / float(z @ z)
    # of z'Bz/z'z with z = M e, M = 1 - Q Q' and B the mean of both shifts
    shifted = _shifted(first, second, basis)
    inner = basis.T @ shifted
    rest = z.size - float((basis**2).sum())
    mean = -float(np.trace(inner)) / rest
    square = 0.5 * first.size - 2.0 * float((shifted**2).sum()) + float((inner**2).sum())
    normal = (found - mean) / math.sqrt(max(2.0 * square / rest**2, 1e-300))
    correlation = float(np.clip((found - mean) / (first.size / z.size), 0.0, _LARGEST))
    if normal < _SUSPECT:
        return 1.0, correlation
    if z.size > _EXACT:
        return float(special.ndtr(-normal)), correlation
    return ratio_exceeds(_shifted(first, second, np.eye(z.size)), found, basis), correlation


def _shifted(first: Index, second: Index, columns: Array) -> Array:
    """B times columns."""
    out = np.zeros_like(columns)
    out[first] += 0.5 * columns[second]
    out[second] += 0.5 * columns[first]
    return out


def _factor(problem: Problem, fit: LeastSquaresFit, order: _Order, correlation: float) -> tuple[float, str]:
    """`lengthened`, with neighbours correlated, lag by lag less so."""
    series = problem.rows.series[order.rows]
    alike = []
    lag, weight = 1, correlation
    while weight > _FORGOTTEN and lag < order.rows.size:
        same = series[lag:] == series[:-lag]
        alike.append((order.rows[:-lag][same], order.rows[lag:][same], weight))
        lag, weight = lag + 1, weight * correlation
    return lengthened(problem, fit, alike)


def lengthened(
    problem: Problem, fit: LeastSquaresFit, alike: Sequence[tuple[Index, Index, float]]
) -> tuple[float, str]:
    """Largest ratio of a constant's sd with errors of rows correlated to its sd without, and that constant.

    1 and nothing where all are fixed.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquaresFit
    alike : sequence of (ndarray of int, (m,), ndarray of int, (m,), float)
        Pairs of rows, and the correlation of their errors.
    """
    free = problem.parameters.free
    if not free.any():
        return 1.0, ""
    columns = problem.jacobian(fit.optimum.theta)[:, free] / fit.sigma[:, None]
    information = columns.T @ columns
    covariance = np.linalg.pinv(information, rcond=1e-10, hermitian=True)
    inner = information.copy()
    for here, there, correlation in alike:
        product = columns[here].T @ columns[there]
        inner += correlation * (product + product.T)
    before, after = np.diag(covariance), np.diag(covariance @ inner @ covariance)
    seen = before > 0.0
    ratio = np.sqrt(np.maximum(np.where(seen, after / np.where(seen, before, 1.0), 0.0), 0.0))
    names = [name for name, is_free in zip(problem.parameters.names, free, strict=True) if is_free]
    top = int(np.argmax(ratio))
    return float(ratio[top]), names[top]
