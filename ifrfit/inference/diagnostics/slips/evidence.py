"""How much better a table without a slip is described: falls of -2 log likelihood, slip by slip."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from scipy import special

from ifrfit.inference.diagnostics.omitted_effects.effect_signatures import Direction
from ifrfit.inference.diagnostics.omitted_effects.score_tests import Score, ScoreTest, holm, scores
from ifrfit.inference.diagnostics.quadratic_forms import smooth_departure
from ifrfit.inference.diagnostics.slips.alternatives import Alternative, alternatives
from ifrfit.inference.diagnostics.slips.compared_fit import (
    MOST_SERIES,
    ComparedFit,
    Slip,
    careful_drop,
    is_decisive,
)
from ifrfit.inference.diagnostics.slips.nuisances import Nuisance, nuisances, of_series
from ifrfit.inference.diagnostics.slips.row_slips import missing_values, mixed_readings
from ifrfit.inference.diagnostics.slips.turned_readings import turned_readings
from ifrfit.inference.diagnostics.thresholds import DECISIVE, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import OBLIQUE, Array
from ifrfit.inference.optimize.least_squares import LeastSquaresFit

_INVISIBLE = 1e-3  # standard deviations by which a slip of the largest size moves a value at most
_LIMIT = 0.999  # share of the largest size searched from which a size counts as lying on it
_USUAL = 1e-3  # quantile of chi2 that a right table is not below
_FEWEST_OF_SERIES = 6  # rows of a series in which a slip of its own is looked for
_OF_SPINS = ("spin-scale", "inertia-factor")
WORTH_A_TRY = 0.05  # p below which other units of spins are tried, and look-alikes of what shows are fitted
_NOISIER = 0.05  # p of a series' scatter below which slips without a size are tried in it
_STEP = 1e-6  # of derivatives by constants and size
_AT_ONCE = 200_000  # rows up to which the slopes by all sizes are kept at once
_LITTLE = 0.1  # share of the values' scatter that is left, from which a law explains little


def tried(
    problem: Problem, fit: LeastSquaresFit, *, differ: bool = False, effects: bool = False
) -> list[Slip]:
    """Every slip that these rows could show.

    `differ` where series do not share constants, `effects` where any shows.
    """
    whole = ComparedFit.of(problem, fit)
    plain = problem.error_model.is_plain
    several = plain and 1 < len(problem.series) <= MOST_SERIES
    # single series are asked along the same slopes
    slopes = list(_sized(whole)) if several and len(problem.rows) <= _AT_ONCE else None
    far = effects or explains_little(whole)
    found = _of_size(whole, slopes or _sized(whole), far=far, effects=effects)
    if plain and not _usual(whole):
        measured = any(each.numerator == "spin" for each in problem.rows.observables)
        suspects = _OF_SPINS if measured else _OF_SPINS[:1]  # without spins J says nothing of their unit
        of_spins = any(each.p < WORTH_A_TRY for each in found if each.name in suspects)
        shifted = explains_little(whole)
        found += _unsized(whole, alternatives(problem, other_units=of_spins, shifted=shifted))
        found += missing_values(problem, fit)
        found += _mixed(whole)
    found += turned_readings(problem, fit)
    if several:
        found += _in_series(ComparedFit.by_series(problem, fit), slopes or _sized(whole), differ=differ)
        named = {slip.series for slip in found if slip.series and is_decisive(slip)}
        found = [slip for slip in found if not _is_of_series(problem, slip, named)]
    return found


def _usual(whole: ComparedFit) -> bool:
    """Whether chi2 leaves no room for a decisive alternative, which would have a chi2 of its own."""
    if not whole.problem.noise.is_known:
        return False
    chi2 = float(((whole.residual / whole.fit.sigma) ** 2).sum())
    return chi2 < DECISIVE + float(special.chdtri(whole.dof, 1.0 - _USUAL))


def _sized(whole: ComparedFit) -> Iterator[tuple[Nuisance, Array]]:
    """Slips with a size, each with the derivative of the values by it, one at a time."""
    fit = whole.fit
    fitted = {"angle-offset"} if fit.angle_offset is not None else set()
    every = (each for each in nuisances(whole.problem) if each.name not in fitted)
    return ((each, each.slope(fit.optimum.theta)) for each in every)


def _of_size(
    whole: ComparedFit, sized: Iterable[tuple[Nuisance, Array]], *, far: bool, effects: bool
) -> list[Slip]:
    """Score tests along the derivative by each size; those that matter are fitted, `far` sizes as well.

    Where one shows, or `effects` do, those that may be its look-alikes are fitted, too: a fall to first order
    does not compare with that of a fit, whose noises are its own.
    """
    sigma = whole.fit.sigma
    # what moves no value even at its largest (the scale of speeds in angles) is but rounding
    every = ((each, slope / sigma) for each, slope in sized)
    every = ((each, along) for each, along in every if each.most * np.abs(along).max() > _INVISIBLE)
    best: dict[str, tuple[Nuisance, Score, float]] = {}
    for nuisance, score, p in _tested(whole, every, sigma):
        if nuisance.name not in best or score.drop > best[nuisance.name][1].drop:
            best[nuisance.name] = (nuisance, score, p)
    shows = effects or any(p < REFUTED for _, _, p in best.values())
    limit = WORTH_A_TRY if shows else REFUTED
    return [_slip(whole, *each, len(best) if far else 0, limit) for each in best.values()]


def _tested(
    whole: ComparedFit, sized: Iterable[tuple[Nuisance, Array]], sigma: Array
) -> Iterator[tuple[Nuisance, Score, float]]:
    """Score tests along derivatives in units of sigma, without their rows; p corrected for their number."""
    problem, nothing = whole.problem, np.empty(0)
    jacobian = problem.jacobian(whole.fit.optimum.theta) / sigma[:, None]
    known = problem.noise.is_known and problem.error_model.is_plain
    test = ScoreTest.of(jacobian, whole.residual / sigma, known=known)
    del jacobian  # of many rows it is large
    tested = []
    for nuisance, along in sized:
        one = test.score(Direction(nuisance.name, along, two_sided=True))
        if one is not None:
            of_all = replace(one.direction, change=nothing)
            tested.append((nuisance, replace(one, direction=of_all, weight=nothing)))
    corrected = holm([one.p for _, one in tested], [each.share for each, _ in tested])
    yield from ((*each, p) for each, p in zip(tested, corrected, strict=True))


def _slip(
    whole: ComparedFit, nuisance: Nuisance, score: Score, p: float, far: int = 0, limit: float = REFUTED
) -> Slip:
    """A slip as its score test has it; where p is below a limit, with its size fitted beside the constants.

    Of `far` tests, where that is not 0, those with sizes of their own are fitted from these, too.
    """
    low, high = nuisance.limits
    slip = Slip(
        nuisance.name,
        score.drop,
        p,
        score.strength,
        score.sd,
        nuisance.usual,
        nuisance.likely,
        series=nuisance.series,
        is_least=not low < score.strength < high,
    )
    beyond = nuisance.far if far else ()
    if p >= limit and not beyond:
        return slip
    drop, x = whole.with_size(nuisance.values, slip.size, nuisance.limits, beyond, nuisance.of_rows)
    theta, size = x[:-1], float(x[-1])
    if p >= REFUTED and beyond:
        after = whole.problem.rows.value - nuisance.values(theta[None, :], x[-1:])[0]
        of_fit = whole.p_of(after, far / nuisance.share)
        if of_fit < REFUTED:  # no line shows it
            p, slip = of_fit, replace(slip, sd=whole.sd_of(size, drop, after))
        elif p >= limit:
            return slip
    at = whole.problem.parameters.positions
    return replace(
        slip,
        drop=drop,
        # the score may see what a constant explains that was fixed, and is free here
        p=max(p, float(special.chdtrc(1, max(drop, 0.0)))),
        size=size,
        is_least=size <= _LIMIT * low or size >= _LIMIT * high,
        constant=nuisance.constant,
        middle=float(theta[at[nuisance.constant]].mean()) if nuisance.constant else 0.0,
        e_n=float(theta[at["e_n"][0]]),
        values=lambda x: nuisance.values(x[:, :-1], x[:, -1]),
        best=x,
    )


def _unsized(
    whole: ComparedFit, every: Iterable[Alternative], count: int = 1, share: float = 1.0
) -> list[Slip]:
    """Likelihood ratios of tables with other signs, angles or names; times `count`, dof times `share`."""
    before, misfit = whole.before, whole.misfit
    dof = share * whole.dof
    found = []
    for each in every:
        theta, after = whole.of_alternative(each)
        drop = whole.likelihood - float(misfit.likelihood(after))
        careful = max(careful_drop(misfit, before, after, dof), 0.0) if drop > 0.0 else 0.0
        ratio = min(1.0, count * math.exp(-0.5 * careful))
        slip = Slip(each.name, drop, ratio, observable=each.observable, series=each.series)
        if is_decisive(slip):  # each holds a table of its own
            slip = replace(slip, values=each.values, best=theta)
        found.append(slip)
    return found


def misfit_left(problem: Problem, fit: LeastSquaresFit, slip: Slip) -> float:
    """p value of what a slip that was fitted leaves: a smooth departure, a further slip, a prior missed.

    The departure is one of each observable, in tau or, of those that know no contact, in the angle; the
    scatter is its yardstick. Nothing is asked, which is 1, of single rows, of a drift, whose shape is a
    guess, and of another body in one series, which has constants of its own.
    """
    if slip.values is None or slip.constant or (slip.series and slip.name == "inertia-factor"):
        return 1.0
    whole = (ComparedFit.by_series if slip.series else ComparedFit.of)(problem, fit)
    # no wider than it has to be, and towards the inside of the domain
    step = np.where(slip.best > 0.0, -_STEP, _STEP)
    near = slip.values(np.vstack((slip.best, slip.best + np.diag(step))))
    after = problem.rows.value - near[0]
    sigma = whole.misfit.sigma(after)
    jacobian = np.nan_to_num((near[1:] - near[0]) / step[:, None] / sigma).T
    place = np.where(problem.rows.is_oblique, problem.rows.tau, problem.rows.gamma_deg)
    smooth = smooth_departure(list(problem.groups().values()), place, jacobian, after / sigma)
    theta = slip.best[: fit.optimum.theta.size]
    others = [
        Direction(each.name, each.slope(theta) / sigma, two_sided=True)
        for each in nuisances(problem)
        if slip.sd and not each.constant
    ]
    tested = scores(others, jacobian, after / sigma, known=False)
    pull = problem.parameters.prior_residuals(theta)
    p = [1.0 if smooth is None else smooth.p, float(special.chdtrc(max(pull.size, 1), pull @ pull))]
    return min(1.0, 3.0 * min([*p, *holm([one.p for one in tested])]))


def _mixed(whole: ComparedFit) -> list[Slip]:
    """Tables some rows of which are read in another way, where that is decisive."""
    found = []
    theta, little = whole.fit.optimum.theta, explains_little(whole)
    for other, rows, after, penalty in mixed_readings(whole.problem, whole.misfit, theta, little=little):
        drop = whole.likelihood - float(whole.misfit.likelihood(after)) - penalty
        # of two angles, or two signs, one suits many a value that goes with none
        chosen = other.name != "mixed-squared" and explains_little(whole, after)
        if drop <= DECISIVE or chosen:
            continue
        careful = careful_drop(whole.misfit, whole.before, after, whole.dof) - penalty
        if careful > DECISIVE:
            ratio, named = math.exp(-0.5 * careful), tuple(rows.tolist())
            found.append(Slip(other.name, drop, ratio, observable=other.observable, rows=named))
    return found


def _is_of_series(problem: Problem, slip: Slip, named: set[str]) -> bool:
    """Whether rows of another reading are those of a series that is named for a slip."""
    series = {problem.series[problem.rows.series[row]] for row in slip.rows}
    return slip.name.startswith("mixed-") and len(series) == 1 and series <= named


def _in_series(whole: ComparedFit, sized: Iterable[tuple[Nuisance, Array]], *, differ: bool) -> list[Slip]:
    """Slips in one of several series: those with a size by score tests, at the noise of each series.

    Those without are tried where the series do not share constants, one of them scatters more than the
    others, or the law explains little: in no other could a slip hide. p values are multiplied by the number
    of series.
    """
    problem = whole.problem
    count = np.bincount(problem.rows.series, minlength=len(problem.series))
    series = [number for number, rows in enumerate(count.tolist()) if rows >= _FEWEST_OF_SERIES]
    dof = np.maximum(count - problem.parameters.free.sum(), 0)
    known = problem.noise.is_known
    sigma = whole.fit.sigma if known else _sigma_by_series(whole)
    of_one = (
        (of_series(problem, each, number), np.where(problem.rows.series == number, slope / sigma, 0.0))
        for each, slope in sized
        if not each.constant
        for number in series
    )
    tested = sorted(_tested(whole, of_one, sigma), key=lambda one: problem.series.index(one[0].series))
    found = []
    for nuisance, score, p in tested:
        if not known:  # the noise of a series is known from its own rows
            own = max(dof[problem.series.index(nuisance.series)], 1)
            p = max(p, len(tested) * 2.0 * float(special.stdtr(own, -abs(score.strength / score.sd))))
        if p < REFUTED:
            found.append(_slip(whole, nuisance, score, p))
    differ = differ or explains_little(whole)
    for number in series:
        if differ or _scatters_more(whole, number):
            share = min(dof[number] / count[number] * len(problem.rows) / max(whole.dof, 1), 1.0)
            unsized = _unsized(whole, alternatives(problem, number), len(series), share)
            found += [slip for slip in unsized if is_decisive(slip)]
    return found


def _sigma_by_series(whole: ComparedFit) -> Array:
    """Standard uncertainty of each row from the scatter of its series and observable, (n,)."""
    fit, sigma = whole.fit, whole.fit.sigma.copy()
    for rows in whole.problem.groups().values():
        dof = max(rows.size - float(fit.gaussian.leverage[rows].sum()), 1.0)
        square = float(((whole.residual[rows] / fit.sigma[rows]) ** 2).sum()) / dof
        sigma[rows] *= math.sqrt(max(square, 1e-12))
    return sigma


def explains_little(whole: ComparedFit, left: Array | None = None) -> bool:
    """Whether residuals of an observable that knows the closure scatter nearly as its values do.

    These are those of the fit, or those that are `left` by something else.
    """
    rows, residual = whole.problem.rows, whole.residual if left is None else left
    for observable in rows.observables:
        own = rows.rows_of(observable.name)
        if observable.kind in OBLIQUE and own.size:
            about_mean = rows.value[own] - rows.value[own].mean()
            if float(residual[own] @ residual[own]) > _LITTLE * float(about_mean @ about_mean):
                return True
    return False


def _scatters_more(whole: ComparedFit, number: int) -> bool:
    """Whether a series scatters more than the others in any observable, or than its sigma."""
    rows = whole.problem.rows
    square = (whole.residual / whole.fit.sigma) ** 2
    own = rows.series == number
    free = 1.0 - whole.fit.gaussian.leverage
    for which in range(len(rows.names)):
        of = rows.which == which
        here, there = of & own, of & ~own
        dof, rest = float(free[here].sum()), float(free[there].sum())
        if dof < 1.0:
            continue
        if whole.problem.noise.is_known:
            p = float(special.chdtrc(dof, square[here].sum()))
        elif rest < 1.0 or square[there].sum() <= 0.0:
            continue
        else:
            p = float(special.fdtrc(dof, rest, square[here].sum() / dof / (square[there].sum() / rest)))
        if p < _NOISIER:
            return True
    return False
