"""Is a series a second reading of the impacts of another? Then it brings in no errors of its own."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy import special

from ifrfit.data.observations import word_of
from ifrfit.inference.diagnostics.independence import lengthened, neighbours_alike
from ifrfit.inference.diagnostics.quadratic_forms import natural_spline, orthonormal, smooth_departure
from ifrfit.inference.diagnostics.residuals import Residuals, exclude_name
from ifrfit.inference.diagnostics.thresholds import BESIDE, FACTS, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import OBLIQUE, Array, Index, numbered
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact
from ifrfit.text import joined, p_text

_FEWEST = 8  # pairs of impacts
_MOST = 2_000  # rows of an observable in a series, beyond which distances of all pairs take long
_MOST_PAIRS = 200  # of series that are compared
_UNITS = (1.0, 0.02, 0.02, 0.02)  # degrees, shares of the speed, spins R omega/u: what a reading may be off
_FAR = 3.0  # of these units, beyond which two impacts are not one
_MOST_ALIKE = 0.9  # share of the places of two tables within that, from which these tell the pairs
_PLACE = 1e-6  # of a unit, that places among impacts of one setting differ by
_REPEATED = 4  # pairs an angle from which their means stand for the law
_FEWEST_REPEATS = 10  # degrees of freedom of those
_SORTED = 0.05  # share of steps against the order, of repeats that were sorted but for a few
_FEWEST_STEPS = 3  # from which an order is told
_NEIGHBOURS = (-2, -1, 1, 2)  # along the angle, whose mean stands for what both series miss
_FEWEST_DOF = 3  # degrees of freedom
_LEAST = 1e-300  # p
_MOST_NAMED = 3  # pairs


@dataclass(frozen=True)
class Pairs:
    """Rows of one observable in two series that may be of the same impacts, in the order of the angle.

    Attributes
    ----------
    observable : str
    first, second : ndarray of int, (n,)
    along : ndarray, (n,)
        What the order is of: tau, or the angle of readings of e_n.
    """

    observable: str
    first: Index
    second: Index
    along: Array


@dataclass(frozen=True)
class Alike:
    """What the residuals of pairs say: one-sided p, also without one pair, and correlation."""

    pairs: Pairs
    p: float
    correlation: float


@dataclass(frozen=True)
class _Found:
    """Two series whose errors are alike, by their numbers; p of all tests of all series."""

    one: int
    other: int
    p: float
    alike: tuple[Alike, ...]


def second_readings(problem: Problem, fit: LeastSquaresFit, residuals: Residuals) -> Fact | None:
    """Test whether errors of two series go together, impact by impact.

    Impacts of two series or files are paired one to one: those in the same place of two tables of one
    length, as readings of an angle may cross, where nine in ten of these lie within 3 degrees (6 % of the
    speed, spins of 0.06); else those whose incidence is nearest to each other, within as much. For each
    observable the residual of one series is regressed on that of the other; beside it stand the
    directions of the constants in each series, a natural spline in tau, and the mean residual of the four
    neighbours along the angle in the other series: what both miss of the law is no error that both share.
    Where angles are repeated often, means of the angles take the place of both. Student's t of the
    coefficient is exact for independent Gaussian errors of one series, whatever those of the other.
    Normal scores of several observables are added (Stouffer). p counts times the number of tests.

    Not looked at: series of more than 2,000 rows of an observable, more than 200 pairs of series, and fits
    with errors in common that were stated.

    Returns
    -------
    Fact or None
        None where no errors go together.
    """
    readings = _readings(problem)
    compared = list(itertools.combinations(range(len(readings)), 2))
    if not compared or len(compared) > _MOST_PAIRS or problem.common is not None:
        return None
    jacobian = problem.free_jacobian(fit.optimum.theta) / fit.sigma[:, None]
    found = []
    for one, other in compared:
        every = [
            errors_alike(problem.rows.setting, jacobian, residuals.standardised, pairs)
            for pairs in _pairs(problem, readings[one], readings[other])
        ]
        tests = list(_tests([alike for alike in every if alike is not None]))
        if tests:
            p, alike = min(tests, key=lambda test: test[0])
            found.append(_Found(one, other, len(compared) * len(tests) * p, alike))
    found = [each for each in found if each.p < REFUTED]
    if not found:
        return None
    return _fact(problem, fit, readings, min(found, key=lambda each: each.p))


def _readings(problem: Problem) -> list[Index]:
    """Rows of each series of each file."""
    source, _ = pd.factorize(problem.observations.table["source"])
    number, _ = pd.factorize(source * len(problem.series) + problem.rows.series)  # as they first occur
    order = np.argsort(number, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(number[order])) + 1)


def _pairs(problem: Problem, one: Index, other: Index) -> Iterator[Pairs]:
    """Pairs of each observable that two series have."""
    for number in range(len(problem.rows.names)):
        first, second = (own[problem.rows.which[own] == number] for own in (one, other))
        if min(first.size, second.size) < _FEWEST or max(first.size, second.size) > _MOST:
            continue
        at = _incidence(problem, first, second)
        by_place = first.size == second.size and _go_along(at)
        # values that were sorted at one setting go together by their ranks alone
        within = _FAR if by_place else _PLACE
        values = problem.rows.value[first], problem.rows.value[second]
        if any(_is_sorted(value, each, within) for value, each in zip(values, at, strict=True)):
            by_place, within = False, _PLACE
            if any(_is_sorted(value, each, within) for value, each in zip(values, at, strict=True)):
                continue
        if not by_place:
            i, j = _nearest(at)
            first, second = first[i], second[j]
        yield _in_order(problem, number, first, second)


def _incidence(problem: Problem, first: Index, second: Index) -> tuple[Array, Array]:
    """Angle, log speed and spins of rows of two series, (n, 4) each, in units of what readings are off."""
    rows, speed = problem.rows, problem.speeds
    known = bool(np.isfinite(speed[first]).all() and np.isfinite(speed[second]).all())
    log_speed = np.log(np.maximum(speed, 1e-300)) if known else np.zeros(len(rows))
    columns = np.column_stack((rows.gamma_deg, log_speed, rows.incidence.spin_x, rows.incidence.spin_y))
    return columns[first] / _UNITS, columns[second] / _UNITS


def _go_along(at: tuple[Array, Array]) -> bool:
    """Whether impacts in the same places of two tables have nearly the same incidence, but for a few."""
    return float((np.abs(at[0] - at[1]) <= _FAR).all(axis=1).mean()) >= _MOST_ALIKE


def _is_sorted(value: Array, at: Array, within: float) -> bool:
    """Whether values rise, or fall, from row to row of nearly one incidence."""
    steps = np.diff(value)[(np.abs(np.diff(at, axis=0)) <= within).all(axis=1)]
    up, down = int((steps > 0.0).sum()), int((steps < 0.0).sum())
    return up + down >= _FEWEST_STEPS and min(up, down) <= _SORTED * (up + down)


def _nearest(at: tuple[Array, Array]) -> tuple[Index, Index]:
    """Places of impacts that are nearest to each other; those of one setting are paired in their order."""
    one, other = (np.column_stack((each, _PLACE * _place(each))) for each in at)
    distance, along = np.zeros((2, len(one), len(other)))
    for x, y in zip(one.T, other.T, strict=True):
        if np.ptp(np.concatenate((x, y))) > 0.0:
            np.abs(np.subtract(x[:, None], y, out=along), out=along)
            np.maximum(distance, along, out=distance)
    to_other, to_one = distance.argmin(axis=1), distance.argmin(axis=0)
    i = np.arange(len(one))
    i = i[(to_one[to_other] == i) & (distance[i, to_other] <= _FAR)]
    return i, to_other[i]


def _place(at: Array) -> Array:
    """Place of each row among those of its setting, in their order, from 0."""
    setting = numbered(*at.T)
    order = np.argsort(setting, kind="stable")
    start = np.concatenate(([0], np.cumsum(np.bincount(setting))))
    place = np.empty(len(at))
    place[order] = np.arange(len(at)) - start[setting[order]]
    return place


def _in_order(problem: Problem, number: int, first: Index, second: Index) -> Pairs:
    observable = problem.rows.observables[number]
    along = problem.rows.tau if observable.kind in OBLIQUE else problem.rows.gamma_deg
    order = np.argsort(along[first], kind="stable")
    return Pairs(observable.name, first[order], second[order], along[first[order]])


def errors_alike(setting: Index, jacobian: Array, z: Array, pairs: Pairs) -> Alike | None:
    """Test the residuals of pairs for going together; None where they are too few, or the law fails for both.

    Parameters
    ----------
    setting : ndarray of int
        Of each row: rows of one number have the same incidence.
    jacobian : ndarray, (n, k)
        Of the values over sigma, by the free constants.
    z : ndarray, (n,)
        Residuals over sigma.
    pairs : Pairs
    """
    first, second, n = pairs.first, pairs.second, pairs.first.size
    if n < _FEWEST:
        return None
    means = _means(setting, pairs)
    smooth = means
    if smooth is None:
        spline = natural_spline(pairs.along) if np.isfinite(pairs.along).all() else None
        smooth = np.column_stack((np.ones(n), spline)) if spline is not None else np.ones((n, 1))
    own = orthonormal(np.column_stack((jacobian[second], smooth)))
    other = z[second] - own @ (own.T @ z[second])
    columns = [jacobian[first], smooth]
    if means is None:
        columns.append(_mean_of_neighbours(other)[:, None])
    basis = orthonormal(np.column_stack(columns))
    u, w = (x - basis @ (basis.T @ x) for x in (z[first], other))
    free = 1.0 - (basis**2).sum(axis=1)
    p, correlation = _p_of(u, w, n - basis.shape[1] - 1)
    if p >= BESIDE:
        return Alike(pairs, p, correlation)
    if means is None and _law_fails(
        jacobian[first] + jacobian[second], smooth, z[first] + z[second], pairs.along
    ):
        return None
    # without the pair that speaks most: a row of its own takes it up
    most = int(np.argmax(u * w / np.maximum(free, 0.1)))
    alone = np.zeros((n, 1))
    alone[most] = 1.0
    basis = orthonormal(np.column_stack((basis, alone)))
    u, w = (x - basis @ (basis.T @ x) for x in (u, w))
    without, _ = _p_of(u, w, n - basis.shape[1] - 1)
    return Alike(pairs, p if without < BESIDE else max(p, without), correlation)


def _law_fails(jacobian: Array, smooth: Array, mean: Array, along: Array) -> bool:
    """Whether means of pairs, which are independent errors in second readings too, depart from the law.

    By a smooth curve, or by neighbours that are alike beside one.
    """
    departure = smooth_departure([np.arange(mean.size)], along, jacobian, mean)
    basis = orthonormal(np.column_stack((jacobian, smooth)))
    left = mean - basis @ (basis.T @ mean)
    places = np.arange(mean.size)
    alike, _ = neighbours_alike(places[:-1], places[1:], basis, left)
    return alike < BESIDE or (departure is not None and departure.p < BESIDE)


def _p_of(u: Array, w: Array, dof: int) -> tuple[float, float]:
    """One-sided p of Student's t, and the correlation."""
    size = float(u @ u) * float(w @ w)
    if dof < _FEWEST_DOF or size <= 0.0:
        return 1.0, 0.0
    r = float(np.clip(float(u @ w) / math.sqrt(size), -1.0, 1.0))
    t = r * math.sqrt(dof / max(1.0 - r * r, 1e-15))
    return float(special.stdtr(dof, -t)), r


def _means(setting: Index, pairs: Pairs) -> Array | None:
    """Which setting each pair is of, (n, m), where most are repeated often enough to tell errors of them."""
    number = np.unique(setting[pairs.first], return_inverse=True)[1]
    count, n = int(number.max()) + 1, number.size
    if n < _REPEATED * count or n - count < _FEWEST_REPEATS:
        return None
    return np.asarray(number[:, None] == np.arange(count), dtype=float)


def _mean_of_neighbours(z: Array) -> Array:
    """Mean of the four neighbours of each in the order, (n,); of fewer at the ends."""
    total, count = np.zeros(z.size), np.zeros(z.size)
    for lag in _NEIGHBOURS:
        to, of = (slice(lag, None), slice(None, -lag)) if lag > 0 else (slice(None, lag), slice(-lag, None))
        total[to] += z[of]
        count[to] += 1.0
    return total / count


def _tests(way: Sequence[Alike]) -> Iterator[tuple[float, tuple[Alike, ...]]]:
    """p of each observable, and of several together, with what it is of."""
    for one in way:
        yield one.p, (one,)
    if len(way) > 1:
        score = -float(special.ndtri([max(one.p, _LEAST) for one in way]).sum()) / math.sqrt(len(way))
        yield float(special.ndtr(-score)), tuple(way)


def _fact(problem: Problem, fit: LeastSquaresFit, readings: Sequence[Index], found: _Found) -> Fact:
    named = sorted(found.alike, key=lambda each: each.p)
    telling = [each for each in named if each.p < BESIDE] or named[:1]
    correlations = {each.pairs.observable: each.correlation for each in telling}
    factor, constant = lengthened(
        problem, fit, [(each.pairs.first, each.pairs.second, each.correlation) for each in telling]
    )
    one, other = (_called(problem, readings, number) for number in (found.one, found.other))
    pairs = telling[0].pairs
    some = [f"{exclude_name(problem, int(i))} and {exclude_name(problem, int(j))}"
            for i, j in zip(pairs.first[:_MOST_NAMED], pairs.second[:_MOST_NAMED], strict=True)]  # fmt: skip
    keep = _remedy(problem, readings, found)
    short = f", and intervals are too short by a factor of some {factor:.2g} ({constant})" if constant else ""
    more = " and so on" if pairs.first.size > _MOST_NAMED else ""
    size = joined([f"{r:.2g} in {name}" for name, r in correlations.items()])
    says = (
        f"{other} looks like a second reading of the impacts of {one}: errors of {pairs.first.size} pairs of "
        f"the same incidence go together (correlation {size}, p = {p_text(found.p)}; "
        f"{word_of(problem.observations.sources)}s {'; '.join(some)}{more}), while independent impacts share "
        f"none. Both count in full{short}: give the mean of the two readings, or keep one ({keep}), "
        "or state what they share (covariance= in Python). If they are impacts of their own, they share an "
        "error of each setting, as of the angle that was set"
    )
    figures = {
        "p": found.p,
        "series": [one, other],
        "n": pairs.first.size,
        "correlations": correlations,
        "factor": factor,
    }
    return Fact(False, says, figures, FACTS["second_readings"])


def _called(problem: Problem, readings: Sequence[Index], number: int) -> str:
    """A series by its name, and its file where several series or files are of that name."""
    row = int(readings[number][0])
    series = problem.series[problem.rows.series[row]]
    source = str(problem.observations.table["source"].iat[row])
    alike = sum(problem.rows.series[rows[0]] == problem.rows.series[row] for rows in readings)
    return series if alike == 1 else f"{series} in {source}"


def _remedy(problem: Problem, readings: Sequence[Index], found: _Found) -> str:
    """How to leave the second reading out."""
    numbers = [int(problem.rows.series[rows[0]]) for rows in readings]
    kept = [number for place, number in enumerate(numbers) if place != found.other]
    if numbers[found.other] in kept:
        return f"leave {problem.observations.table['source'].iat[int(readings[found.other][0])]} out"
    return " ".join(f"--series {problem.series[number]}" for number in dict.fromkeys(kept))
