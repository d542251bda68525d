"""How much better a table without a slip is described: falls of -2 log likelihood, slip by slip."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import special

from ifrfit.inference.diagnostics.omitted_effects.effect_signatures import Direction
from ifrfit.inference.diagnostics.omitted_effects.score_tests import Score, holm, scores
from ifrfit.inference.diagnostics.slips.alternatives import Alternative, Tables, alternatives
from ifrfit.inference.diagnostics.slips.flawed_readings import Flaw, readings
from ifrfit.inference.diagnostics.slips.mixed_readings import mixed_readings
from ifrfit.inference.diagnostics.slips.nuisances import Nuisance, Sized, directions_of, nuisances, of_series
from ifrfit.inference.diagnostics.slips.refit import Misfit, best_start, search, starts
from ifrfit.inference.diagnostics.thresholds import DECISIVE, REFUTED
from ifrfit.inference.model.noise import resolution
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import OBLIQUE, Array, Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit

_FEWEST = 3  # degrees of freedom below which no slip is looked for
_REPEATED = 3  # rows of one number from which it may stand for "not measured"
_NEIGHBOUR = 1.5  # steps of the readings up to which two of them are neighbours
_ROWS_OF_ZEROS = 0.5  # share of an observable's rows that may stand for "not measured"
_INVISIBLE = 1e-3  # standard deviations by which a slip of the largest size moves a value at most
_LARGEST = 4.5  # prior standard deviations of a size
_LIMIT = 0.999  # share of the largest size searched from which a size counts as lying on it
_USUAL = 1e-3  # quantile of chi2 that a right table is not below
_FEWEST_OF_SERIES = 6  # rows of a series in which a slip of its own is looked for
_MOST_SERIES = 12  # beyond, none is looked for in single series
_OF_SPINS = ("spin-scale", "inertia-factor")
_WORTH_A_TRY = 0.05  # p of the scale of spins below which other units of them are tried
_NOISIER = 0.05  # p of a series' scatter below which slips without a size are tried in it
_LITTLE = 0.1  # share of the values' scatter that is left, from which a law explains little
_AT_ONCE = 2_000_000  # numbers of values that are held for several tables
_PLACES = np.linspace(-4.0, 4.0, 17)  # degrees, from which offsets of series are looked for
_ROOM = 25.0  # of -2 log likelihood by which the searched optimum of a decisive slip may lie above its own


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

    @property
    def rank(self) -> float:
        """Fall of -2 log likelihood less what the prior of the size takes: by it causes compare."""
        return self.drop - self.unlikely**2 / (self.usual**2 + self.sd**2)

    @property
    def unlikely(self) -> float:
        """Distance of the size from the nearest likely one."""
        return min(abs(self.size - each) for each in self.likely)


@dataclass(frozen=True)
class Offsets:
    """Offsets of the angles of each series, beside constants that all share.

    Attributes
    ----------
    drop : float
        Fall of -2 log likelihood with them.
    size : ndarray, (n_series,)
        Degrees by which the true angles exceed the given ones.
    """

    drop: float
    size: Array


@dataclass(frozen=True)
class Fitted:
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
    def by_series(cls, problem: Problem, fit: LeastSquaresFit) -> Fitted:
        """With an unknown noise of each series: one of several that is off is no reason for a common one."""
        given = problem.noise.is_given
        groups = tuple(rows for rows in problem.groups().values() if not given[rows].all())
        return cls(problem, fit, Misfit(problem.noise.base, groups))

    @cached_property
    def before(self) -> Array:
        """Residuals of the table as it stands, (n,); fixed constants are free, too, as in the score tests."""
        problem, theta = self.problem, self.fit.optimum.theta
        _, residual = search(
            lambda x, _: problem.predict(x),
            self.misfit,
            problem.rows.value,
            theta[None],
            problem.parameters.bounds(),
            np.ones(theta.size, dtype=bool),
        )
        return np.asarray(residual[0])

    @cached_property
    def likelihood(self) -> float:
        """Minus twice the log likelihood of `before`."""
        return float(self.misfit.likelihood(self.before))

    def with_size(self, model: Sized, size: float, limits: tuple[float, float]) -> tuple[float, float, Array]:
        """Fall of -2 log likelihood with a size beside the constants, the size, and the constants.

        What it moves away from priors of the user counts against it.
        """
        problem, theta = self.problem, self.fit.optimum.theta
        known = problem.parameters.prior_residuals
        lower, upper = problem.parameters.bounds()
        bounds = (np.append(lower, limits[0]), np.append(upper, limits[1]))
        drop, found, constants = -math.inf, 0.0, theta
        # a start of first order may lead astray
        for start in (float(np.clip(size, *limits)), 0.0):
            if drop >= 0.0:
                break
            x, after = search(
                lambda x, _: model(x[0, :, :-1], x[0, :, -1])[None],
                self.misfit,
                problem.rows.value,
                np.append(theta, start)[None],
                bounds,
                np.ones(theta.size + 1, dtype=bool),
            )
            drop, found = self.likelihood - float(self.misfit.likelihood(after[0])), float(x[0, -1])
            constants = x[0, :-1]
            drop -= max(float((known(constants) ** 2).sum() - (known(theta) ** 2).sum()), 0.0)
        return drop, found, constants

    def of_alternatives(self, every: Sequence[Alternative]) -> Iterator[tuple[Alternative, Array]]:
        """Each with its residuals, in the unit of the given values."""
        problem, value = self.problem, self.problem.rows.value
        places = starts(problem, self.fit.optimum.theta)
        free = np.ones(places.shape[1], dtype=bool)
        many = max(1, _AT_ONCE // (len(places) * min(len(value), 60) + 5 * len(value)))
        for first in range(0, len(every), many):
            tables = Tables(problem, every[first : first + many])
            each = np.arange(len(tables.every))

            def at_rows(theta: Array, rows: Index, tables: Tables = tables, each: Index = each) -> Array:
                return tables.values(theta, each, rows)

            start = best_start(at_rows, self.misfit, value, places)
            _, after = search(
                tables.values,
                self.misfit,
                value,
                start,
                problem.parameters.bounds(),
                free,
                target=self.likelihood - DECISIVE + _ROOM,
            )
            yield from zip(tables.every, after, strict=True)


def offsets_by_series(problem: Problem, fit: LeastSquaresFit) -> Offsets | None:
    """Fit an offset of the angles of each series; None without angles, or where one is no slip."""
    count = len(problem.series)
    named = [each for each in nuisances(problem) if each.name == "angle-offset"]
    plain = problem.error_model.is_plain and fit.angle_offset is None
    if not named or not plain or not 1 < count <= _MOST_SERIES:
        return None
    whole, offset = Fitted(problem, fit, Misfit.of(problem)), named[0]
    lower, upper = problem.parameters.bounds()
    ends = (np.full(count, end) for end in offset.limits)
    bounds = tuple(np.append(*both) for both in zip((lower, upper), ends, strict=True))

    def values(x: Array, _: Index) -> Array:
        by_row = x[0, :, lower.size :][:, problem.rows.series]
        return readings(problem, x[0, :, : lower.size], Flaw(offset=by_row))[None]

    x, after = search(
        values,
        whole.misfit,
        problem.rows.value,
        np.append(fit.optimum.theta, _nearest_offsets(problem, fit))[None],
        (bounds[0], bounds[1]),
        np.ones(lower.size + count, dtype=bool),
    )
    drop = whole.likelihood - float(whole.misfit.likelihood(after[0]))
    size = x[0, lower.size :]
    return Offsets(drop, size) if np.abs(size).max() <= _LARGEST * offset.usual else None


def _nearest_offsets(problem: Problem, fit: LeastSquaresFit) -> Array:
    """Of a few offsets of the angles the best of each series, at the constants of a fit."""
    theta = np.tile(fit.optimum.theta, (_PLACES.size, 1))
    residual = problem.rows.value - readings(problem, theta, Flaw(offset=_PLACES[:, None]))
    square = np.nan_to_num((residual / fit.sigma) ** 2, nan=1e6)
    owners = problem.rows.series == np.arange(len(problem.series))[:, None]
    return np.asarray(_PLACES[np.argmin(square @ owners.T, axis=0)])


def degrees_of_freedom(problem: Problem, fit: LeastSquaresFit) -> int:
    """Rows less constants."""
    return len(problem.rows) - round(float(fit.gaussian.leverage.sum()))


def too_few(problem: Problem, fit: LeastSquaresFit) -> bool:
    """Whether too few rows are left beside the constants to tell anything."""
    return degrees_of_freedom(problem, fit) < _FEWEST


def tried(problem: Problem, fit: LeastSquaresFit, *, differ: bool = False) -> list[Slip]:
    """Every slip that these rows could show, `differ` where series do not share constants."""
    residual = problem.rows.value - problem.predict(fit.optimum.theta)
    plain = problem.error_model.is_plain
    # under other errors their weights at the fit stand for a known sigma
    misfit = Misfit.of(problem) if plain else Misfit(fit.sigma, ())
    whole = Fitted(problem, fit, misfit)
    sized = _sized(problem, fit)
    found = _of_size(whole, sized, residual)
    if plain and not _usual(problem, fit, residual):
        measured = any(each.numerator == "spin" for each in problem.rows.observables)
        suspects = _OF_SPINS if measured else _OF_SPINS[:1]  # without spins J says nothing of their unit
        of_spins = any(each.p < _WORTH_A_TRY for each in found if each.name in suspects)
        found += _unsized(whole, list(alternatives(problem, other_units=of_spins)))
        found += _zeros(problem, fit)
        if _explains_little(problem, residual):
            found += _mixed(whole)
    if plain and 1 < len(problem.series) <= _MOST_SERIES:
        found += _in_series(problem, fit, sized, residual, differ=differ)
        named = {slip.series for slip in found if slip.series and is_decisive(slip)}
        found = [slip for slip in found if not _is_of_series(problem, slip, named)]
    return found


def is_decisive(slip: Slip) -> bool:
    """Whether the evidence suffices to name a slip, and its size is one that a slip has."""
    if slip.unlikely > _LARGEST * math.hypot(slip.usual, slip.sd):
        return False
    return slip.p < (REFUTED if slip.sd or slip.rows else math.exp(-0.5 * DECISIVE))


def _usual(problem: Problem, fit: LeastSquaresFit, residual: Array) -> bool:
    """Whether chi2 leaves no room for a decisive alternative, which would have a chi2 of its own."""
    if not problem.noise.is_known:
        return False
    chi2 = float(((residual / fit.sigma) ** 2).sum())
    return chi2 < DECISIVE + float(special.chdtri(degrees_of_freedom(problem, fit), 1.0 - _USUAL))


def _sized(problem: Problem, fit: LeastSquaresFit) -> list[tuple[Nuisance, Direction]]:
    """Slips with a size, each with the derivative of the values by it."""
    fitted = {"angle-offset"} if fit.angle_offset is not None else set()
    sized = [each for each in nuisances(problem) if each.name not in fitted]
    return list(zip(sized, directions_of(problem, sized, fit.optimum.theta), strict=True))


def _of_size(whole: Fitted, sized: list[tuple[Nuisance, Direction]], residual: Array) -> list[Slip]:
    """Score tests along the derivative by each size; those that matter are fitted."""
    problem, fit = whole.problem, whole.fit
    known = problem.noise.is_known and problem.error_model.is_plain
    every = [(each, replace(one, change=one.change / fit.sigma)) for each, one in sized]
    # what moves no value even at its largest (the scale of speeds in angles) is but rounding
    every = [(each, one) for each, one in every if each.most * np.abs(one.change).max() > _INVISIBLE]
    jacobian = problem.jacobian(fit.optimum.theta) / fit.sigma[:, None]
    tested = scores([direction for _, direction in every], jacobian, residual / fit.sigma, known=known)
    best: dict[str, tuple[Score, float]] = {}
    for score, p in zip(tested, holm([one.p for one in tested]), strict=True):
        if score.direction.name not in best or score.drop > best[score.direction.name][0].drop:
            best[score.direction.name] = (score, p)
    found = []
    for score, p in best.values():
        nuisance = next(each for each, direction in every if direction is score.direction)
        slip = _slip(nuisance, score, p)
        found.append(_fitted(whole, nuisance, slip) if p < REFUTED else slip)
    return found


def _slip(nuisance: Nuisance, score: Score, p: float, series: str = "") -> Slip:
    """A slip as its score test has it."""
    return Slip(
        nuisance.name, score.drop, p, score.strength, score.sd, nuisance.usual, nuisance.likely, series=series
    )


def _fitted(whole: Fitted, nuisance: Nuisance, slip: Slip) -> Slip:
    """The slip with its size fitted beside the constants."""
    drop, size, theta = whole.with_size(nuisance.values, slip.size, nuisance.limits)
    # the score may see what a constant explains that was fixed, and is free here
    p = max(slip.p, float(special.chdtrc(1, max(drop, 0.0))))
    low, high = nuisance.limits
    is_least = size <= _LIMIT * low or size >= _LIMIT * high
    at = whole.problem.parameters.positions
    return replace(
        slip,
        drop=drop,
        p=p,
        size=size,
        is_least=is_least,
        constant=nuisance.constant,
        middle=float(theta[at[nuisance.constant]].mean()) if nuisance.constant else 0.0,
        e_n=float(theta[at["e_n"][0]]),
    )


def drop_of_effect(problem: Problem, fit: LeastSquaresFit, score: Score) -> float:
    """Fall of -2 log likelihood with an effect along its direction, fitted as a slip is."""
    change, least = score.direction.change * fit.sigma, -math.inf if score.direction.two_sided else 0.0
    misfit = Misfit.of(problem) if problem.error_model.is_plain else Misfit(fit.sigma, ())

    def along(theta: Array, size: Array) -> Array:
        return problem.predict(theta) + size[:, None] * change

    values = score.direction.values or along
    return Fitted(problem, fit, misfit).with_size(values, score.strength, (least, math.inf))[0]


def _unsized(whole: Fitted, every: list[Alternative], count: int = 1, share: float = 1.0) -> list[Slip]:
    """Likelihood ratios of tables with other signs, angles or names; times `count`, dof times `share`."""
    before, misfit = whole.before, whole.misfit
    dof = share * degrees_of_freedom(whole.problem, whole.fit)
    found = []
    for each, after in whole.of_alternatives(every):
        drop = whole.likelihood - float(misfit.likelihood(after))
        careful = max(_careful_drop(misfit, before, after, dof), 0.0) if drop > 0.0 else 0.0
        ratio = min(1.0, count * math.exp(-0.5 * careful))
        found.append(Slip(each.name, drop, ratio, observable=each.observable, series=each.series))
    return found


def _mixed(whole: Fitted) -> list[Slip]:
    """Tables some rows of which are read in another way, where that is decisive."""
    found = []
    dof = degrees_of_freedom(whole.problem, whole.fit)
    for each in mixed_readings(whole.problem, whole.misfit, whole.fit.optimum.theta):
        drop = whole.likelihood - float(whole.misfit.likelihood(each.residual)) - each.penalty
        if drop <= DECISIVE:
            continue
        careful = _careful_drop(whole.misfit, whole.before, each.residual, dof) - each.penalty
        if careful > DECISIVE:
            rows = tuple(each.rows.tolist())
            found.append(
                Slip(each.name, drop, math.exp(-0.5 * careful), observable=each.observable, rows=rows)
            )
    return found


def _is_of_series(problem: Problem, slip: Slip, named: set[str]) -> bool:
    """Whether rows of another reading are those of a series that is named for a slip."""
    series = {problem.series[problem.rows.series[row]] for row in slip.rows}
    return slip.name.startswith("mixed-") and len(series) == 1 and series <= named


def _in_series(
    problem: Problem,
    fit: LeastSquaresFit,
    sized: list[tuple[Nuisance, Direction]],
    residual: Array,
    *,
    differ: bool,
) -> list[Slip]:
    """Slips in one of several series: those with a size by score tests, at the noise of each series.

    Those without are tried where the series do not share constants, one of them scatters more than the
    others, or the law explains little: in no other could a slip hide. p values are multiplied by the number
    of series.
    """
    n = len(problem.rows)
    count = np.bincount(problem.rows.series, minlength=len(problem.series))
    series = [number for number, rows in enumerate(count.tolist()) if rows >= _FEWEST_OF_SERIES]
    sized = [(each, one) for each, one in sized if not each.constant]
    whole = Fitted.by_series(problem, fit)
    known = problem.noise.is_known
    sigma = fit.sigma if known else _sigma_by_series(problem, fit, residual)
    owners: list[tuple[Nuisance, int, Direction]] = []
    for number in series:
        own = problem.rows.series == number
        owners += [
            (each, number, replace(one, change=np.where(own, one.change, 0.0) / sigma)) for each, one in sized
        ]
    jacobian = problem.jacobian(fit.optimum.theta) / sigma[:, None]
    tested = scores([direction for *_, direction in owners], jacobian, residual / sigma, known=known)
    found = []
    for score, p in zip(tested, holm([one.p for one in tested]), strict=True):
        nuisance, number = next((each, i) for each, i, one in owners if one is score.direction)
        dof = count[number] - problem.parameters.free.sum()
        if not known:  # the noise of a series is known from its own rows
            t = score.strength / score.sd
            p = max(p, len(tested) * 2.0 * float(special.stdtr(max(dof, 1), -abs(t))))
        if p < REFUTED:
            slip = _slip(nuisance, score, p, problem.series[number])
            found.append(_fitted(whole, of_series(problem, nuisance, number), slip))
    differ = differ or _explains_little(problem, residual)
    for number in series:
        if differ or _scatters_more(problem, fit, residual, number):
            share = max(count[number] - problem.parameters.free.sum(), 0) / count[number]
            share *= n / max(degrees_of_freedom(problem, fit), 1)
            every = list(alternatives(problem, number))
            found += [
                slip for slip in _unsized(whole, every, len(series), min(share, 1.0)) if is_decisive(slip)
            ]
    return found


def _sigma_by_series(problem: Problem, fit: LeastSquaresFit, residual: Array) -> Array:
    """Standard uncertainty of each row from the scatter of its series and observable, (n,)."""
    sigma = fit.sigma.copy()
    for rows in problem.groups().values():
        dof = max(rows.size - float(fit.gaussian.leverage[rows].sum()), 1.0)
        square = float(((residual[rows] / fit.sigma[rows]) ** 2).sum()) / dof
        sigma[rows] *= math.sqrt(max(square, 1e-12))
    return sigma


def _explains_little(problem: Problem, residual: Array) -> bool:
    """Whether residuals of an observable that knows the closure scatter nearly as its values do."""
    for observable in problem.rows.observables:
        own = problem.rows.rows_of(observable.name)
        if observable.kind in OBLIQUE and own.size:
            about_mean = problem.rows.value[own] - problem.rows.value[own].mean()
            if float(residual[own] @ residual[own]) > _LITTLE * float(about_mean @ about_mean):
                return True
    return False


def _scatters_more(problem: Problem, fit: LeastSquaresFit, residual: Array, number: int) -> bool:
    """Whether a series scatters more than the others in any observable, or than its sigma."""
    square = (residual / fit.sigma) ** 2
    own = problem.rows.series == number
    free = 1.0 - fit.gaussian.leverage
    for which in range(len(problem.rows.names)):
        of = problem.rows.which == which
        here, there = of & own, of & ~own
        dof, rest = float(free[here].sum()), float(free[there].sum())
        if dof < 1.0:
            continue
        if problem.noise.is_known:
            p = float(special.chdtrc(dof, square[here].sum()))
        elif rest < 1.0 or square[there].sum() <= 0.0:
            continue
        else:
            p = float(special.fdtrc(dof, rest, square[here].sum() / dof / (square[there].sum() / rest)))
        if p < _NOISIER:
            return True
    return False


def _careful_drop(misfit: Misfit, before: Array, after: Array, dof: float) -> float:
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
    """Values of exactly 0, or of one number beyond all others, that lie far from what all other rows say."""
    found = []
    for name in problem.rows.names:
        own = problem.rows.rows_of(name)
        given, count = np.unique(problem.rows.value[own], return_counts=True)
        repeated = count >= _REPEATED
        repeated[1:-1] = False
        if given.size > 1:  # the neighbour of another reading by one step of these readings is a reading, too
            step = resolution(problem.rows.value[own])
            repeated[[0, -1]] &= np.diff(given)[[0, -1]] > _NEIGHBOUR * step
        for code in given[(given == 0.0) | repeated].tolist():
            at = own[problem.rows.value[own] == code]
            if at.size > _ROWS_OF_ZEROS * own.size or own.size - at.size < 2 * _FEWEST:
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
    kept = np.setdiff1d(np.arange(len(rows)), at)
    part = problem.with_rows(kept)
    theta = fit.optimum.theta
    misfit = Misfit.of(part)
    start = best_start(
        lambda tried, some: part.with_rows(some).predict(tried),
        misfit,
        part.rows.value,
        starts(problem, theta),
    )
    places, left = search(
        lambda x, _: part.predict(x),
        misfit,
        part.rows.value,
        start,
        problem.parameters.bounds(),
        np.ones(theta.size, dtype=bool),
    )
    sigma = misfit.sigma(left[0])[rows.which[kept] == rows.names.index(name)]
    # readings scatter by their rounding at least
    floor = resolution(rows.value[own]) / math.sqrt(12.0)
    z = (rows.value - problem.predict(places[0]))[at] / max(float(np.sqrt((sigma**2).mean())), floor)
    dof = max(sigma.size - theta.size, 1)
    far = np.abs(z) > -float(special.stdtrit(dof, 0.5 * REFUTED / own.size))
    least = float(np.abs(z[far]).min(initial=np.inf))
    return at[far], own.size * 2.0 * float(special.stdtr(dof, -least)), float((z**2).sum())
