"""A slip of the hand that was tried, and the fit that it is compared with: -2 log likelihood at its best."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy import special

from ifrfit.inference.diagnostics.omitted_effects.score_tests import Score
from ifrfit.inference.diagnostics.slips.alternatives import Alternative
from ifrfit.inference.diagnostics.slips.nuisances import Flaw, Sized, nuisances, readings
from ifrfit.inference.diagnostics.slips.refit import (
    Misfit,
    Values,
    best_start,
    in_parts,
    refitted,
    search,
    spread,
    starts,
)
from ifrfit.inference.diagnostics.thresholds import DECISIVE, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit

LARGEST = 4.5  # prior standard deviations of a size
_FIXED = 0.2  # by which a constant that was fixed may be off
_EXACT = 600.0  # logarithm by which squares fall where nothing is left of them, far from what numbers hold
_ROOM = 25.0  # of -2 log likelihood by which the searched optimum of a decisive slip may lie above its own
MOST_SERIES = 12  # beyond, none is looked for in single series
_ROWS_OF_SEARCH = 4000  # of many, by which the constants of a changed table are looked for at first
_OFFSETS = np.linspace(-4.0, 4.0, 17)  # degrees, from which offsets of series are looked for


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
    likely : tuple of float
        Sizes that the prior is centred at.
    observable : str
        Whose values it is in; empty where it is in none.
    series : str
        The one series it is in; empty where it is in all.
    rows : tuple of int
        Single rows that it is in.
    is_least : bool
        Whether the size ended on the limit of what is searched.
    constant : str
        That changes in the course of the table; empty for another slip.
    middle : float
        Its mean.
    e_n : float
        Of the first series, with a slip that was fitted; nan else.
    values : callable, optional
        Of a slip that was fitted: from constants and size, (m, q), to the value of each row, (m, n).
    best : ndarray, (q,)
        Where they lie nearest.
    """

    name: str
    drop: float
    p: float
    size: float = 0.0
    sd: float = 0.0
    usual: float = math.inf
    likely: tuple[float, ...] = (0.0,)
    observable: str = ""
    series: str = ""
    rows: tuple[int, ...] = ()
    is_least: bool = False
    constant: str = ""
    middle: float = 0.0
    e_n: float = math.nan
    values: Values | None = field(default=None, repr=False, compare=False)
    best: Array = field(default_factory=lambda: np.empty(0), repr=False, compare=False)

    @property
    def rank(self) -> float:
        """Fall of -2 log likelihood less what the prior of the size takes: by it causes compare."""
        return self.drop - self.unlikely**2 / (self.usual**2 + self.sd**2)

    @property
    def log_bayes_factor(self) -> float:
        """Of the law with a size of this prior over the law without, by Laplace's approximation."""
        return 0.5 * self.rank + math.log(self.sd / math.hypot(self.usual, self.sd))

    @property
    def unlikely(self) -> float:
        """Distance of the size from the nearest likely one."""
        return min(abs(self.size - each) for each in self.likely)


def is_decisive(slip: Slip) -> bool:
    """Whether the evidence suffices to name a slip, and its size is one that a slip has."""
    if not has_likely_size(slip):
        return False
    # impacts would cross the wall or its normal, or the law is missed by so much that no angle mends it
    if slip.name == "angle-offset" and slip.is_least:
        return False
    return slip.p < (REFUTED if slip.sd or slip.rows else math.exp(-0.5 * DECISIVE))


def has_likely_size(slip: Slip) -> bool:
    """Whether the size of a slip is one that a slip has."""
    return slip.unlikely <= LARGEST * math.hypot(slip.usual, slip.sd)


@dataclass(frozen=True)
class ComparedFit:
    """A fit as slips are compared with it: by one kind of likelihood, all constants at their best.

    Attributes
    ----------
    problem : Problem
    fit : LeastSquaresFit
    misfit : Misfit
    """

    problem: Problem
    fit: LeastSquaresFit
    misfit: Misfit

    @classmethod
    def of(cls, problem: Problem, fit: LeastSquaresFit) -> ComparedFit:
        """With the noise of the problem; of other errors the weights at the fit stand for a known sigma."""
        plain = problem.error_model.is_plain
        return cls(problem, fit, Misfit.of(problem) if plain else Misfit(fit.sigma, ()))

    @classmethod
    def by_series(cls, problem: Problem, fit: LeastSquaresFit) -> ComparedFit:
        """With an unknown noise of each series: one of several that is off is no reason for a common one."""
        given = problem.noise.is_given
        groups = tuple(rows for rows in problem.groups().values() if not given[rows].all())
        return cls(problem, fit, Misfit(problem.noise.base, groups))

    @cached_property
    def residual(self) -> Array:
        """Residuals of the fit, (n,)."""
        return self.problem.residual(self.fit.optimum.theta)

    @cached_property
    def dof(self) -> int:
        """Rows less constants."""
        return len(self.problem.rows) - round(float(self.fit.gaussian.leverage.sum()))

    @cached_property
    def before(self) -> Array:
        """Residuals of the table as it stands, (n,); fixed constants are free, too, as in the score tests."""
        return refitted(self.problem, self.misfit, self.fit.optimum.theta)[1]

    @cached_property
    def likelihood(self) -> float:
        """Minus twice the log likelihood of `before`."""
        return float(self.misfit.likelihood(self.before))

    def with_size(
        self,
        model: Sized,
        size: float,
        limits: tuple[float, float],
        likely: tuple[float, ...] = (),
        of_rows: Callable[[Index], Sized] | None = None,
    ) -> tuple[float, Array]:
        """Fall of -2 log likelihood with a size beside the constants, and the constants with the size.

        Priors of the user take part in the search, fixed constants as wide ones, and what it moves away from
        them counts against it. At sizes that are `likely` the constants are looked for all over the domain,
        by some rows: `of_rows` is the model of these, where not all values have to be computed for them.
        """
        problem, theta = self.problem, self.fit.optimum.theta
        fixed = ~problem.parameters.free

        def known(theta: Array) -> Array:
            moved = (theta[..., fixed] - problem.parameters.fixed[fixed]) / _FIXED
            return np.concatenate((problem.parameters.prior_residuals(theta), moved), axis=-1)

        lower, upper = problem.parameters.bounds()
        bounds = (np.append(lower, limits[0]), np.append(upper, limits[1]))
        before = known(theta)
        value = np.append(problem.rows.value, np.zeros(before.size))
        misfit = Misfit(np.append(self.misfit.base, np.ones(before.size)), self.misfit.groups)

        def values(x: Array) -> Array:
            return np.concatenate((model(x[:, :-1], x[:, -1]), known(x[:, :-1])), axis=1)

        def searched(start: Array) -> tuple[float, Array]:
            x, after = search(values, misfit, value, start, bounds)
            far, moved = after[: value.size - before.size], after[value.size - before.size :]
            drop = self.likelihood - float(self.misfit.likelihood(far))
            return drop - max(float(moved @ moved - before @ before), 0.0), x

        best = searched(np.append(theta, float(np.clip(size, *limits))))
        if best[0] < 0.0:  # a start of first order may lead astray
            best = max(best, searched(np.append(theta, 0.0)), key=lambda each: each[0])
        if likely:
            tried = [np.column_stack((self._places, np.full(len(self._places), one))) for one in likely]

            def of_some(x: Array, rows: Index) -> Array:
                if of_rows is not None:
                    return of_rows(rows)(x[:, :-1], x[:, -1])
                parts = in_parts(x, problem.rows.value.size)
                return np.concatenate([model(part[:, :-1], part[:, -1])[:, rows] for part in parts])

            place = best_start(of_some, self.misfit, problem.rows.value, np.concatenate(tried))
            best = max(best, searched(place), key=lambda each: each[0])
        return best

    def of_alternative(self, each: Alternative) -> tuple[Array, Array]:
        """Its constants, and its residuals in the unit of the given values."""
        misfit, value, bounds = self.misfit, self.problem.rows.value, self.problem.parameters.bounds()
        start = best_start(each.values_of_rows, misfit, value, self._places)
        target = self.likelihood - DECISIVE + _ROOM
        near = value.size >= 2 * _ROWS_OF_SEARCH and not each.ranked.size
        if near:  # some of many rows tell nearly where it is
            some = spread(value.size, _ROWS_OF_SEARCH)
            start, _ = search(each.of_rows(some).values, misfit.of_rows(some), value[some], start, bounds)
        return search(each.values, misfit, value, start, bounds, target, near=near)

    def sd_of(self, size: float, drop: float, after: Array) -> float:
        """Standard deviation of a fitted size that takes so much off -2 log likelihood, and leaves residuals.

        The square of size over sd is what weighted squares fall by: rows of known sigma in units of that, and
        those of unknown noises, whose part of the fall is a logarithm, in units of the scatter that is left.
        """
        known, groups = self.misfit.known, self.misfit.groups
        if not groups:
            return abs(size) / math.sqrt(drop)
        square = (self.before[known] ** 2 - after[known] ** 2) / self.misfit.base[known] ** 2
        of_known, count = float(square.sum()), sum(rows.size for rows in groups)
        share = self.dof / self.problem.rows.value.size
        of_unknown = share * count * math.expm1(min((drop - of_known) / count, _EXACT))
        return abs(size) / math.sqrt(max(of_known + of_unknown, share * drop))

    def p_of(self, after: Array, count: float) -> float:
        """p value of what leaves these residuals, times a number of tests."""
        careful = max(careful_drop(self.misfit, self.before, after, self.dof), 0.0)
        return min(1.0, count * float(special.chdtrc(1, careful)))

    @cached_property
    def _places(self) -> Array:
        return starts(self.problem, self.fit.optimum.theta)


def fitted_effect(problem: Problem, fit: LeastSquaresFit, score: Score, count: int) -> Score:
    """A score with the fall of -2 log likelihood of its effect, and its size, fitted as a slip is.

    Where the test of first order saw nothing of an effect that is no line, the fit makes it, times `count`.
    """
    direction, whole = score.direction, ComparedFit.of(problem, fit)
    change, least = direction.change * fit.sigma, -math.inf if direction.two_sided else 0.0

    def along(theta: Array, size: Array) -> Array:
        return problem.predict(theta) + size[:, None] * change

    values = direction.values or along
    limits = (least, math.inf)
    drop, x = whole.with_size(values, score.strength, limits, direction.likely, direction.of_rows)
    if drop <= 0.0 or (score.p < REFUTED and direction.values is None):
        return replace(score, drop=drop)
    size = float(x[-1])
    after = problem.rows.value - values(x[None, :-1], x[-1:])[0]
    sd = whole.sd_of(size, drop, after)
    if score.p < REFUTED:
        return replace(score, drop=drop, strength=size, sd=sd)
    p = whole.p_of(after, count)
    moved = ((whole.before - after) / fit.sigma) ** 2
    return replace(score, p=p, drop=drop, strength=size, sd=sd, weight=moved / moved.sum(), chi2=None)


def careful_drop(misfit: Misfit, before: Array, after: Array, dof: float) -> float:
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


def offsets_by_series(problem: Problem, fit: LeastSquaresFit) -> tuple[float, Array] | None:
    """Fit offsets of the angles of each series, beside constants that all share.

    Returns
    -------
    drop : float
        Fall of -2 log likelihood with them.
    size : ndarray, (n_series,)
        Degrees by which the true angles exceed the given ones. None, both, without angles, or where one is no
        slip.
    """
    count = len(problem.series)
    named = [each for each in nuisances(problem) if each.name == "angle-offset"]
    plain = problem.error_model.is_plain and fit.angle_offset is None
    if not named or not plain or not 1 < count <= MOST_SERIES:
        return None
    whole, offset = ComparedFit.of(problem, fit), named[0]
    lower, upper = problem.parameters.bounds()
    ends = (np.full(count, end) for end in offset.limits)
    bounds = tuple(np.append(*both) for both in zip((lower, upper), ends, strict=True))

    def values(x: Array) -> Array:
        by_row = x[:, lower.size :][:, problem.rows.series]
        return readings(problem, x[:, : lower.size], Flaw(offset=by_row))

    x, after = search(
        values,
        whole.misfit,
        problem.rows.value,
        np.append(fit.optimum.theta, _nearest_offsets(problem, fit)),
        (bounds[0], bounds[1]),
    )
    drop = whole.likelihood - float(whole.misfit.likelihood(after))
    size = x[lower.size :]
    return (drop, size) if np.abs(size).max() <= LARGEST * offset.usual else None


def _nearest_offsets(problem: Problem, fit: LeastSquaresFit) -> Array:
    """Of a few offsets of the angles the best of each series, at the constants of a fit."""
    far = []
    for offset in _OFFSETS.tolist():
        residual = problem.rows.value - readings(problem, fit.optimum.theta, Flaw(offset=offset))
        square = np.nan_to_num((residual / fit.sigma) ** 2, nan=1e6)
        far.append(np.bincount(problem.rows.series, square, len(problem.series)))
    return np.asarray(_OFFSETS[np.argmin(far, axis=0)])
