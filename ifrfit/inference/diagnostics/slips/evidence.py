"""How much better a table without a slip is described: falls of -2 log likelihood, slip by slip."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from ifrfit.inference.diagnostics.omitted_effects.effect_signatures import Direction
from ifrfit.inference.diagnostics.omitted_effects.score_tests import Score, holm, scores
from ifrfit.inference.diagnostics.slips.alternatives import alternatives
from ifrfit.inference.diagnostics.slips.nuisances import Nuisance, Sized, direction_of, nuisances
from ifrfit.inference.diagnostics.slips.refit import Misfit, best_start, search, starts
from ifrfit.inference.diagnostics.thresholds import DECISIVE, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array
from ifrfit.inference.optimize.least_squares import LeastSquaresFit

_FEWEST = 3  # degrees of freedom below which no slip is looked for
_ROWS_OF_ZEROS = 0.5  # share of an observable's rows that may stand for "not measured"
_LARGEST = 4.5  # prior standard deviations of a size
_LIMIT = 0.999  # share of the largest size searched from which a size counts as lying on it
_USUAL = 1e-3  # quantile of chi2 that a right table is not below


@dataclass(frozen=True)
class Slip:
    """A slip that was tried.

    Attributes
    ----------
    name : str
    drop : float
        Fall of -2 log likelihood without it, constants at their best.
    p : float
        Of a slip with a size the p value, corrected for their number; else the likelihood ratio that is left
        without the row that speaks most for it.
    size, sd : float
        Of a slip with a size; 0 else.
    usual : float
        Prior standard deviation of the size.
    observable : str
        Whose values it is in; empty where it is in none.
    rows : tuple of int
        Single rows that it is in.
    is_least : bool
        Whether the size ended on the limit of what is searched.
    """

    name: str
    drop: float
    p: float
    size: float = 0.0
    sd: float = 0.0
    usual: float = math.inf
    observable: str = ""
    rows: tuple[int, ...] = ()
    is_least: bool = False

    @property
    def rank(self) -> float:
        """Fall of -2 log likelihood less what the prior of the size takes: by it causes compare."""
        return self.drop - (self.size / self.usual) ** 2


def degrees_of_freedom(problem: Problem, fit: LeastSquaresFit) -> int:
    """Rows less constants."""
    return len(problem.rows) - round(float(fit.gaussian.leverage.sum()))


def too_few(problem: Problem, fit: LeastSquaresFit) -> bool:
    """Whether too few rows are left beside the constants to tell anything."""
    return degrees_of_freedom(problem, fit) < _FEWEST


def tried(problem: Problem, fit: LeastSquaresFit) -> list[Slip]:
    """Every slip that these rows could show, with its evidence."""
    residual = problem.rows.value - problem.predict(fit.optimum.theta)
    found = _sized(problem, fit, residual)
    if problem.error_model.is_plain and not _usual(problem, fit, residual):
        found += _unsized(problem, fit)
        found += _zeros(problem, fit)
    return found


def is_decisive(slip: Slip) -> bool:
    """Whether the evidence suffices to name a slip, and its size is one that a slip has."""
    if abs(slip.size) > _LARGEST * slip.usual:
        return False
    return slip.p < (REFUTED if slip.sd or slip.rows else math.exp(-0.5 * DECISIVE))


def _usual(problem: Problem, fit: LeastSquaresFit, residual: Array) -> bool:
    """Whether chi2 leaves no room for a decisive alternative, which would have a chi2 of its own."""
    if not problem.noise.is_known:
        return False
    chi2 = float(((residual / fit.sigma) ** 2).sum())
    return chi2 < DECISIVE + float(special.chdtri(degrees_of_freedom(problem, fit), 1.0 - _USUAL))


def _sized(problem: Problem, fit: LeastSquaresFit, residual: Array) -> list[Slip]:
    """Score tests along the derivative by each size; those that matter are fitted."""
    theta, known = fit.optimum.theta, problem.noise.is_known and problem.error_model.is_plain
    fitted = {"angle-offset"} if fit.angle_offset is not None else set()
    sized = [each for each in nuisances(problem) if each.name not in fitted]
    every = [(each, _over_sigma(direction_of(problem, each, theta), fit)) for each in sized]
    jacobian = problem.jacobian(theta) / fit.sigma[:, None]
    tested = scores([direction for _, direction in every], jacobian, residual / fit.sigma, known=known)
    best: dict[str, tuple[Score, float]] = {}
    for score, p in zip(tested, holm([one.p for one in tested]), strict=True):
        if score.direction.name not in best or score.drop > best[score.direction.name][0].drop:
            best[score.direction.name] = (score, p)
    found = []
    for score, p in best.values():
        nuisance = next(each for each, direction in every if direction is score.direction)
        slip = Slip(nuisance.name, score.drop, p, score.strength, score.sd, nuisance.usual)
        found.append(_fitted(problem, fit, nuisance, slip) if p < REFUTED else slip)
    return found


def _over_sigma(direction: Direction, fit: LeastSquaresFit) -> Direction:
    return replace(direction, change=direction.change / fit.sigma)


def _fitted(problem: Problem, fit: LeastSquaresFit, nuisance: Nuisance, slip: Slip) -> Slip:
    """The slip with its size fitted beside the constants."""
    drop, size = _with_size(problem, fit, nuisance.values, slip.size, (-nuisance.most, nuisance.most))
    # the score may see what a constant explains that was fixed, and is free here
    p = max(slip.p, float(special.chdtrc(1, max(drop, 0.0))))
    return replace(slip, drop=drop, p=p, size=size, is_least=abs(size) >= _LIMIT * nuisance.most)


def drop_of_effect(problem: Problem, fit: LeastSquaresFit, score: Score) -> float:
    """Fall of -2 log likelihood with an effect along its direction, fitted as a slip is."""
    change, least = score.direction.change * fit.sigma, -math.inf if score.direction.two_sided else 0.0

    def values(theta: Array, size: float) -> Array:
        return problem.predict(theta) + size * change

    return _with_size(problem, fit, values, score.strength, (least, math.inf))[0]


def _with_size(
    problem: Problem, fit: LeastSquaresFit, model: Sized, size: float, limits: tuple[float, float]
) -> tuple[float, float]:
    """Fall of -2 log likelihood and size; all constants are free, fixed ones too, as in the score tests."""
    misfit, value = Misfit(fit.sigma, ()), problem.rows.value
    if not problem.noise.is_known and problem.error_model.is_plain:
        misfit = Misfit.of(problem)
    lower, upper = problem.parameters.bounds()

    def values(x: Array) -> Array:
        return np.array([model(each[:-1], float(each[-1])) for each in x])

    start = np.append(fit.optimum.theta, np.clip(size, *limits))
    bounds = (np.append(lower, limits[0]), np.append(upper, limits[1]))
    free = np.ones(start.size, dtype=bool)
    x, after = search(values, misfit, value, start, bounds, free)
    free[-1] = False
    none, before = search(values, misfit, value, np.append(start[:-1], 0.0), bounds, free)
    drop = float(misfit.likelihood(before) - misfit.likelihood(after))
    if drop < 0.0:  # the step of first order has led astray
        x, after = search(values, misfit, value, none, bounds, np.ones(start.size, dtype=bool))
        drop = float(misfit.likelihood(before) - misfit.likelihood(after))
    return drop, float(x[-1])


def _unsized(problem: Problem, fit: LeastSquaresFit) -> list[Slip]:
    """Likelihood ratios of tables with other signs, angles or names."""
    theta, lower_upper = fit.optimum.theta, problem.parameters.bounds()
    misfit, free = Misfit.of(problem), np.ones(theta.size, dtype=bool)
    _, before = search(problem.predict, misfit, problem.rows.value, theta, lower_upper, free)
    dof = degrees_of_freedom(problem, fit)
    places = starts(problem, theta)
    found = []
    for each in alternatives(problem):
        other, value = each.problem, each.problem.rows.value
        own = replace(misfit, base=misfit.base * each.unit)
        start = best_start(other.predict, own, value, places)
        _, after = search(other.predict, own, value, start, lower_upper, free)
        after = after / each.unit
        drop = float(misfit.likelihood(before) - misfit.likelihood(after))
        ratio = math.exp(-0.5 * max(_careful_drop(misfit, before, after, dof), 0.0))
        found.append(Slip(each.name, drop, ratio, observable=each.observable))
    return found


def _careful_drop(misfit: Misfit, before: Array, after: Array, dof: int) -> float:
    """Fall of -2 log likelihood, without the row that speaks most for it, so that no outlier is a slip.

    Noises that are estimated count with the degrees of freedom that are left; where sigma is given and the
    scatter is larger, the scatter is the yardstick.
    """
    size = before.size
    sigma = misfit.sigma(after)
    row = int(np.argmax((before**2 - after**2) / sigma**2))
    rest = misfit.without(row)
    with np.errstate(invalid="ignore"):
        fall = float(rest.likelihood(before) - rest.likelihood(after))
    if misfit.groups:
        fall *= dof / size
    if not misfit.known.size:
        return fall
    base = sigma.copy()
    base[row] = np.inf
    scattered = Misfit(base, (np.delete(np.arange(size), row),))
    return min(fall, float(scattered.likelihood(before) - scattered.likelihood(after)) * dof / size)


def _zeros(problem: Problem, fit: LeastSquaresFit) -> list[Slip]:
    """Values of exactly 0 that lie far from what all other rows say."""
    rows = problem.rows
    zero = rows.value == 0.0
    found = []
    for name in rows.names:
        own = rows.rows_of(name)
        at = own[zero[own]]
        if not 0 < at.size <= _ROWS_OF_ZEROS * own.size or own.size - at.size < 2 * _FEWEST:
            continue
        kept = np.setdiff1d(np.arange(len(rows)), at)
        part = problem.with_rows(kept)
        theta = fit.optimum.theta
        misfit, free = Misfit.of(part), np.ones(theta.size, dtype=bool)
        start = best_start(part.predict, misfit, part.rows.value, starts(problem, theta))
        x, after = search(part.predict, misfit, part.rows.value, start, problem.parameters.bounds(), free)
        sigma = misfit.sigma(after)[rows.which[kept] == rows.names.index(name)]
        z = problem.predict(x)[at] / float(np.sqrt((sigma**2).mean()))
        dof = max(sigma.size - theta.size, 1)
        far = at[np.abs(z) > -float(special.stdtrit(dof, 0.5 * REFUTED / own.size))]
        if far.size:
            p = (
                own.size
                * 2.0
                * float(special.stdtr(dof, -np.abs(z).min(initial=np.inf, where=np.isin(at, far))))
            )
            found.append(
                Slip("zero-for-missing", float((z**2).sum()), p, observable=name, rows=tuple(far.tolist()))
            )
    return found
