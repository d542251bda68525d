"""Slips in some rows alone: two kinds of reading in one column, and numbers for 'not measured'."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import special

from ifrfit.inference.diagnostics.rounding_step import step_of_readings
from ifrfit.inference.diagnostics.slips.alternatives import SPEEDS
from ifrfit.inference.diagnostics.slips.compared_fit import Slip
from ifrfit.inference.diagnostics.slips.refit import (
    Misfit,
    best_start,
    in_parts,
    refitted,
    spread,
    starts,
    without_nan,
)
from ifrfit.inference.diagnostics.thresholds import REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import OBLIQUE, Array, Bool, Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.physics.angles import Incidence

_FEWEST_OF_KIND = 3  # rows of either reading
_MOST_SHARE = 0.6  # of the rows that may be meant in the other way
_STARTS = 6  # places in the domain from which constants and choice are searched
_IMPACTS_OF_STARTS = 2000  # by which the division to begin with is found
_ROUNDS = 8
_GAIN = 4.0  # in chi2, by which the other reading of an impact has to be the better one
# by which it may be the worse one, where it is the more likely one: hardly an angle is below 1.6
_LOSS = -4.0
_TALL = 1.5  # size from which a fraction may be in percent
_FRACTIONS = ("v_x", "beta_cm", "e_n", "beta", "mu_app")
_FEWEST_LEFT = 6  # rows of the observable beside them
_REPEATED = 3  # rows of one number from which it may stand for "not measured"
_NEIGHBOUR = 1.5  # steps of the readings up to which two of them are neighbours
_USUAL = 5.0  # times the median distance of neighbours up to which one is one of these
_COMFORTABLE = 0.01  # p of one mean of all rows, once some are read in the other way
_ROWS_OF_ZEROS = 0.5  # share of an observable's rows that may stand for "not measured"


@dataclass(frozen=True)
class OtherReading:
    """Another reading: what its rows then are, and which rows could be meant so.

    `observable` is empty where angles of incidence or spins before impact are; `factor` is the slope of the
    given value in the one that is meant, `spin` the two spins before impact over those given.
    """

    name: str
    observable: str
    possible: Bool
    value: Array
    gamma: Array
    factor: float | Array = 1.0
    spin: tuple[float, float] = (1.0, 1.0)
    most: float = _MOST_SHARE
    gain: float = _GAIN  # in chi2, by which it is the better one

    def change_of_unit(self, at: Bool) -> float:
        """What it adds to -2 log likelihood where some rows are read so."""
        return 2.0 * float(np.log(np.broadcast_to(self.factor, at.shape)[at]).sum())

    def of_rows(self, rows: Index) -> OtherReading:
        """The same for some of the rows."""
        factor = self.factor if isinstance(self.factor, float) else self.factor[rows]
        possible, value, gamma = self.possible[rows], self.value[rows], self.gamma[rows]
        return replace(self, possible=possible, value=value, gamma=gamma, factor=factor)


def mixed_readings(
    problem: Problem, misfit: Misfit, theta: Array, *, little: bool = True
) -> Iterator[tuple[OtherReading, Index, Array, float]]:
    """Choose between two readings impact by impact, and fit the constants, in turns.

    This is the classification likelihood. Where there is but normal scatter the choice takes less than
    2 log 2 an impact off -2 log likelihood: a split at its middle leaves 1 - 2/pi of the variance, which is
    1.01.

    Parameters
    ----------
    problem : Problem
    misfit : Misfit
    theta : ndarray, (p,)
        Constants of the fit.
    little : bool
        Whether the law explains little: else only what could hide beside it is looked for.

    Yields
    ------
    reading : OtherReading
    rows : ndarray of int
        Those of the other reading.
    residual : ndarray, (n,)
        With constants at their best, in units of what is meant.
    penalty : float
        Of -2 log likelihood: the choice between two readings, 2 log 2 an impact, and the change of unit.
    """
    for reading in (*_hidden(problem), *(_readings(problem) if little else ())):
        found = _classified(problem, misfit, theta, reading)
        if found is not None:
            yield reading, *found


def _hidden(problem: Problem) -> Iterator[OtherReading]:
    """Those that leave the law much to explain: spins before impact, and e_n, which is one number."""
    rows = problem.rows
    value, gamma, i = rows.value, rows.gamma_deg, rows.incidence
    for axis, spin, turned in (("y", i.spin_y, (1.0, -1.0)), ("x", i.spin_x, (-1.0, 1.0))):
        spinning = (spin != 0.0) & rows.is_oblique
        if np.unique(rows.impacts[spinning]).size >= _FEWEST_OF_KIND:
            sizes = bool((spin[spinning] > 0.0).all() or (spin[spinning] < 0.0).all())
            name = f"{'size' if sizes else 'mixed-sign'}-of-spin-{axis}-before"
            yield OtherReading(
                name, "", spinning, value, gamma, spin=turned, most=1.0 if sizes else _MOST_SHARE
            )
    for name in SPEEDS:
        own = rows.which == rows.names.index(name) if name in rows.names else np.zeros(len(rows), dtype=bool)
        if own.any() and bool((value[own] > 0.0).all()):
            root = np.sqrt(np.where(own, value, 1.0))
            gain = 2.0 * float(np.log(2.0 * np.median(root[own])))
            yield OtherReading("mixed-squared", name, own, root, gamma, 2.0 * root, gain=gain)


def _readings(problem: Problem) -> Iterator[OtherReading]:
    rows = problem.rows
    value, gamma = rows.value, rows.gamma_deg
    for observable in rows.observables:
        own = rows.which == rows.names.index(observable.name)
        if observable.low < 0.0 and observable.kind in OBLIQUE:
            yield OtherReading("mixed-sign", observable.name, own, -value, gamma)
        if observable.name in _FRACTIONS and int((np.abs(value[own]) > _TALL).sum()) >= _FEWEST_OF_KIND:
            yield OtherReading("mixed-percent", observable.name, own, value / 100.0, gamma, 100.0)
    if rows.has_angle.any():
        yield OtherReading("mixed-angle-from-wall", "", rows.has_angle, value, 90.0 - gamma)
        small = rows.has_angle & (gamma <= 0.5 * math.pi)
        if int(small.sum()) >= _FEWEST_OF_KIND:
            yield OtherReading(
                "mixed-angle-in-radians",
                "",
                small,
                value,
                np.where(small, np.degrees(gamma), gamma),
                gain=_LOSS,
            )


def _read(problem: Problem, reading: OtherReading, at: Bool) -> Problem:
    """The question with some rows read in the other way."""
    rows = problem.rows
    value = np.where(at, reading.value, rows.value)
    if reading.observable:
        return replace(problem, rows=replace(rows, value=value))
    gamma = np.clip(np.where(at, reading.gamma, rows.gamma_deg), 0.0, 90.0)
    spins = zip(reading.spin, (rows.incidence.spin_x, rows.incidence.spin_y), strict=True)
    incidence = Incidence.of(gamma, *(np.where(at, by * spin, spin) for by, spin in spins), degrees=True)
    return replace(
        problem, rows=replace(rows, incidence=incidence, tau=incidence.tau, gamma_deg=gamma, value=value)
    )


def _classified(
    problem: Problem, misfit: Misfit, theta: Array, reading: OtherReading
) -> tuple[Index, Array, float] | None:
    """The best division of the rows, from several starts; None where few or most are meant so."""
    whole = _Choice(problem, misfit, reading)
    if (some := _spread_impacts(problem)) is None:
        tried = [whole.divided(start) for start in whole.starts(theta)]
    else:  # of many impacts some tell from where to begin
        part = replace(problem, rows=problem.rows.take(some))
        few = _Choice(part, misfit.of_rows(some), reading.of_rows(some))
        every = few.starts(theta)
        divisions = [few.divided(start) for start in every]
        nearest = min(range(len(every)), key=lambda number: divisions[number].far)
        tried = [whole.divided(divisions[nearest].theta)]
        if not np.array_equal(every[nearest], theta):
            tried.insert(0, whole.divided(theta))
    most = reading.most * len(problem.rows)
    kept = [one for one in tried if _FEWEST_OF_KIND <= one.at.sum() <= most]
    if not kept:
        return None
    best = min(kept, key=lambda one: one.far)
    at, residual = best.at, best.residual
    if reading.name == "mixed-squared" and _of_two_levels(residual, reading.possible, at):
        return None
    choices = np.unique(problem.rows.impacts[reading.possible]).size
    penalty = 2.0 * choices * math.log(2.0) + reading.change_of_unit(at)
    return np.flatnonzero(at), residual, penalty


def _of_two_levels(residual: Array, own: Bool, at: Bool) -> bool:
    """Whether what was read in two ways has two means all the same: e_n of two balls is no square."""
    one, other = residual[own & at], residual[own & ~at]
    if min(one.size, other.size) < _FEWEST_OF_KIND:
        return True
    dof = one.size + other.size - 2
    pooled = float((one.var() * one.size + other.var() * other.size) / dof)
    t = abs(float(one.mean() - other.mean())) / math.sqrt(pooled * (1.0 / one.size + 1.0 / other.size))
    return 2.0 * float(special.stdtr(dof, -t)) < _COMFORTABLE


def _spread_impacts(problem: Problem) -> Index | None:
    """Rows of some impacts, in step with no order that the table may have; None where there are few."""
    impacts = problem.rows.impacts
    count = int(impacts.max()) + 1
    if count < 2 * _IMPACTS_OF_STARTS:
        return None
    chosen = np.zeros(count, dtype=bool)
    chosen[spread(count, _IMPACTS_OF_STARTS)] = True
    return np.flatnonzero(chosen[impacts])


@dataclass(frozen=True)
class _Division:
    """Rows that are nearer in the other way, the constants, residuals, and -2 log likelihood with these."""

    at: Bool
    theta: Array
    residual: Array
    far: float


@dataclass(frozen=True)
class _Choice:
    """The choice between two readings of the rows of a problem."""

    problem: Problem
    misfit: Misfit
    reading: OtherReading

    @cached_property
    def other(self) -> Problem:
        """With every row that could be meant so read in the other way."""
        return _read(self.problem, self.reading, self.reading.possible)

    def residuals(self, theta: Array) -> tuple[Array, Array]:
        """Residuals of both readings, (..., n); far off where there is no value."""
        plain, read = (without_nan(each.residual(theta), 1e3) for each in (self.problem, self.other))
        return plain, read

    def nearer(self, theta: Array) -> Array:
        """Of both residuals the smaller one, (..., n)."""
        plain, read = self.residuals(theta)
        return np.where(np.abs(read) < np.abs(plain), read, plain)

    def starts(self, theta: Array) -> Array:
        """Places, all over the domain, that lie nearest, (m, p)."""
        every = starts(self.problem, theta)
        parts = in_parts(every, len(self.problem.rows))
        far = np.concatenate([self.misfit.likelihood(self.nearer(part)) for part in parts])
        return np.asarray(every[np.argsort(far)[:_STARTS]])

    def divided(self, theta: Array) -> _Division:
        """Rows and constants, each chosen at the others in turns, from a start."""
        problem, misfit, reading = self.problem, self.misfit, self.reading
        impacts = problem.rows.impacts
        sigma = misfit.sigma(self.nearer(theta[None])[0])
        at, residual = np.zeros(len(problem.rows), dtype=bool), problem.residual(theta)
        for _ in range(_ROUNDS):
            plain, read = self.residuals(theta)
            gain = np.where(reading.possible, (plain**2 - read**2) / sigma**2, 0.0)
            chosen = reading.possible & (np.bincount(impacts, gain) > reading.gain)[impacts]
            if np.array_equal(chosen, at):
                break
            at = chosen
            theta, residual = refitted(_read(problem, reading, at), misfit, theta)
            sigma = misfit.sigma(residual)
        far = float(misfit.likelihood(residual)) + reading.change_of_unit(at)
        return _Division(at, theta, residual, far)


def missing_values(problem: Problem, fit: LeastSquaresFit) -> list[Slip]:
    """Values of exactly 0, or of one number beyond all others, that lie far from what all other rows say."""
    found = []
    for name in problem.rows.names:
        own = problem.rows.rows_of(name)
        given, count = np.unique(problem.rows.value[own], return_counts=True)
        repeated = count >= _REPEATED
        repeated[1:-1] = False
        if given.size > 1:  # the neighbour of another reading by one step of these readings is a reading, too
            # and what is as close to the next one as these are to one another is an end of theirs
            usual = max(_NEIGHBOUR * step_of_readings(problem, own), _USUAL * np.median(np.diff(given)))
            repeated[[0, -1]] &= np.diff(given)[[0, -1]] > usual
        for code in given[(given == 0.0) | repeated].tolist():
            at = own[problem.rows.value[own] == code]
            if at.size > _ROWS_OF_ZEROS * own.size or own.size - at.size < _FEWEST_LEFT:
                continue
            far, p, drop = _far_from_rest(problem, fit, name, at)
            if far.size and (code == 0.0 or far.size >= _REPEATED):
                kind = "zero-for-missing" if code == 0.0 else "code-for-missing"
                found.append(Slip(kind, drop, p, observable=name, rows=tuple(far.tolist())))
    return found


def _far_from_rest(
    problem: Problem, fit: LeastSquaresFit, name: str, at: Index
) -> tuple[Index, float, float]:
    """Rows of one number that lie far from a fit without them, the largest p value of these, and chi2."""
    rows = problem.rows
    own = rows.rows_of(name)
    kept = np.delete(np.arange(len(rows)), at)
    part = problem.with_rows(kept)
    misfit = Misfit.of(part)
    start = best_start(
        lambda tried, some: part.with_rows(some).predict(tried),
        misfit,
        part.rows.value,
        starts(problem, fit.optimum.theta),
    )
    theta, left = refitted(part, misfit, start)
    sigma = misfit.sigma(left)[rows.which[kept] == rows.names.index(name)]
    # readings scatter by their rounding at least
    floor = step_of_readings(problem, own) / math.sqrt(12.0)
    z = problem.residual(theta)[at] / max(float(np.sqrt((sigma**2).mean())), floor)
    dof = max(sigma.size - theta.size, 1)
    far = np.abs(z) > -float(special.stdtrit(dof, 0.5 * REFUTED / own.size))
    least = float(np.abs(z[far]).min(initial=np.inf))
    return at[far], own.size * 2.0 * float(special.stdtr(dof, -least)), float((z**2).sum())
