"""Readings left out for their value: an end of an observable that is too sharp, or none beyond a known end.

Of discarded readings nothing stands in the table but an end that is too sharp: the law with normal errors
cut off at the outermost reading c, of density phi((y - f)/s)/(s Phi((c - f)/s)), describes such readings
better. Without a cut 2 sum -log Phi at the true constants is distributed as chi2 of 2, whatever the sample;
with constants and noise fitted its tail is twice as large (1,200 tables of beta and e_n, sigma known and
not), and counted four times.

Readings of e_n above 1 are discarded, and those of v_n and e_n below 0: these ends are known beforehand. The
likelihood ratio is then exceeded with less than its inverse, whatever the law (Markov), and with constants
and noise fitted 0.2 to 0.28 times as often, wherever the end is (20 to 300 readings). Where readings end at
0 the mean of those left lies above the law by s phi(f/s)/Phi(f/s), most where the law is least: so a camera
that is turned feigns it, constants that differ, a law of the angle. They are held against it by their falls
of -2 log likelihood, and so is a noise that grows with the value, of which none is left at the end.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import special

from ifrfit.data.readings_below_zero import has_sign
from ifrfit.inference.diagnostics.rounding_step import step_of_readings
from ifrfit.inference.diagnostics.slips.refit import Misfit
from ifrfit.inference.diagnostics.thresholds import (
    ALIKE,
    BESIDE,
    FACTS,
    MOST_MISSING,
    MOVES,
    REFUTED,
    TIMES_FITTED,
    TIMES_GIVEN,
)
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Bool, Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact
from ifrfit.text import p_text

_FEWEST = 12  # readings among which a missing end is looked for
_SUSPICIOUS = 0.2  # p of the outermost reading from which no cut is looked for
_STEPS = 60
_AT_REST = 1e-4  # of -2 log likelihood
_LEAST_WEIGHT = 0.1  # of a reading's information, where a cut takes most of it
_NARROWEST, _WIDEST = 0.5, 8.0  # times the noise without a cut
_NO_ROWS = np.empty(0, dtype=np.intp)
_FEWEST_OF_NOISE = 3  # rows from which a noise is taken
_SHARES = (0.01, 0.03, 0.1, 0.3)  # of the largest noise that is left where the law is 0
_DEGREE = 3  # of curves that normal scores may follow
_BESIDE = 2.5  # sd by which readings lie off the law, away from an end that then is no cut


def truncation(problem: Problem, found: LeastSquaresFit) -> Fact | None:
    """Look for an end of an observable that is too sharp: readings beyond it were discarded.

    The noise of an observable that is looked at is taken from its own rows, whatever is known of it: a sigma
    that is too large would leave room beyond both ends. An end is none of a cut where the law does not run
    through the readings beside it. Where many times as many would be missing as are there, errors are skewed,
    of which an exponential law is the limit of normal ones that are cut off.

    Returns
    -------
    Fact or None
        None where the law with errors that are cut off describes no observable better.
    """
    looks = list(_looks(problem, found))
    ends = 2 * len(problem.rows.names)
    best = min(looks, key=lambda look: look.p(ends), default=None)
    if best is None:
        return None
    p = best.p(ends)
    if p >= REFUTED or any(look.share > MOST_MISSING and look.p(ends) < REFUTED for look in looks):
        return None
    side = "above" if best.sign > 0.0 else "below"
    end = 1.0 if best.given else best.end
    says = (
        f"no value of {best.observable} lies {side} {end:.4g}, where the law and its noise would have "
        f"some {best.missing:.0f} (p = {p_text(p)}, by errors that are cut off there): "
        "values look left out for their size, or errors are skewed. If left out, the constants are off by "
        "as much as they miss: give all"
    )
    drop = -2.0 * math.log(max(p, 1e-300))  # of -2 log likelihood, less what the looks are worth
    figures = {"observable": best.observable, "end": best.end, "missing": best.missing, "p": p, "drop": drop}
    return Fact(False, says, figures, FACTS["truncation"])


@dataclass(frozen=True)
class _Look:
    """One end of an observable: the fall of -2 log likelihood with a cut there, and how many it takes.

    `share` is their number over that of the readings, `given` whether the end was known beforehand.
    """

    observable: str
    sign: float
    end: float
    gain: float
    missing: float
    share: float
    given: bool = False

    def p(self, looks: int) -> float:
        """Of the fall, where so many ends were looked at."""
        if self.given:
            return min(1.0, TIMES_GIVEN * math.exp(-0.5 * self.gain))
        return min(1.0, TIMES_FITTED * looks * math.exp(-0.5 * self.gain))


def truncation_at_zero(problem: Problem, found: LeastSquaresFit) -> Fact | None:
    """Look for readings that end at 0 where noise would carry some of them below it.

    Asked of observables that are never negative and whose readings have a sign (`has_sign`), the noise taken
    from their own rows. No finding is an end that moves no constant by a quarter of its standard deviation,
    nor one that a noise growing with the value describes as well.

    Returns
    -------
    Fact or None
        None where the law with errors that are cut off at 0 describes no observable better. Its figure
        ``drop`` is the fall of -2 log likelihood at the noise of the problem, as those of slips are.
    """
    if not problem.error_model.is_plain:
        return None
    signed = [each.name for each in problem.rows.observables if has_sign(each)]
    ends = [cut for name in signed if (cut := _cut_at_zero(problem, found, name)) is not None]
    best = max(ends, key=lambda cut: cut.gain, default=None)
    if best is None:
        return None
    p = min(1.0, len(signed) * TIMES_GIVEN * math.exp(-0.5 * best.gain))
    if p >= REFUTED or best.moves < MOVES or best.missing > MOST_MISSING * best.rows.size:
        return None
    if best.gain <= _growing_noise(problem, found, best.rows) + ALIKE or not _describes(problem, best):
        return None
    figures = {
        "observable": best.observable,
        "end": 0.0,
        "missing": best.missing,
        "p": p,
        "drop": _drop(problem, found, best.rows),
        "value": best.value,
        "constant": best.constant,
    }
    says = (
        f"no value of {best.observable} lies below 0, where the law and its noise would have some "
        f"{best.missing:.0f} (p = {p_text(p)}, by errors that are cut off there): readings below 0 look left "
        f"out, or errors are skewed. If left out, {best.constant} is some {best.value:.3g} rather than "
        f"{best.fitted:.3g}. Give them too, they are fitted as they are, with their sigma if it is known; or "
        "leave out whole settings, those at which noise reaches 0"
    )
    return Fact(False, says, figures, FACTS["truncation"])


@dataclass(frozen=True)
class _CutAtZero:
    """An observable whose readings end at 0: the fall of -2 log likelihood with a cut there, what it moves.

    `scores`, (n,), are the readings as standard normal errors, by the distribution that is cut off, and
    `moves` is the largest change of a constant in its standard deviation, of which `fitted` becomes `value`.
    """

    observable: str
    rows: Index
    scores: Array
    gain: float
    missing: float
    moves: float
    constant: str
    fitted: float
    value: float


def _drop(problem: Problem, found: LeastSquaresFit, own: Index) -> float:
    """Fall of -2 log likelihood with own rows cut off at 0, at the noise of the problem, as slips have it."""
    groups = tuple(problem.noise_groups().values())
    sigma = Misfit.of(problem).sigma(problem.residual(found.optimum.theta))
    whole, cut = (_descent(problem, found, groups, sigma, rows, -1.0) for rows in (_NO_ROWS, own))
    return whole.deviance - cut.deviance


def _cut_at_zero(problem: Problem, found: LeastSquaresFit, name: str) -> _CutAtZero | None:
    own = problem.rows.rows_of(name)
    value, fitted = problem.rows.value, problem.predict(found.optimum.theta)
    if own.size < _FEWEST or bool((value[own] < 0.0).any()):
        return None
    groups = _noises(problem, own)
    sigma = Misfit(found.sigma, groups).sigma(value - fitted)
    if float(special.log_ndtr(fitted[own] / sigma[own]).sum()) >= math.log(_SUSPICIOUS):
        return None
    whole, cut = _descent(problem, found, groups, sigma), _descent(problem, found, groups, sigma, own, -1.0)
    dof = own.size - float(found.gaussian.leverage[own].sum())
    free = np.flatnonzero(problem.parameters.free)
    change = np.abs(cut.theta - whole.theta)[free] / np.maximum(found.gaussian.theta_sd[free], 1e-300)
    at = int(free[np.argmax(change)]) if free.size else 0
    return _CutAtZero(
        observable=name,
        rows=own,
        scores=_normal_scores(value[own] - problem.predict(cut.theta)[own], cut.sigma[own], cut.alpha[own]),
        gain=(whole.deviance - cut.deviance) * dof / own.size,
        missing=cut.missing,
        moves=float(change.max(initial=0.0)),
        constant=problem.parameters.names[at],
        fitted=float(whole.theta[at]),
        value=float(cut.theta[at]),
    )


def _normal_scores(residual: Array, sigma: Array, alpha: Array) -> Array:
    """Errors cut off at -alpha sigma as standard normal ones."""
    beyond = special.log_ndtr(-residual / sigma) - special.log_ndtr(alpha)
    return np.asarray(-special.ndtri(np.clip(np.exp(beyond), 1e-15, 1.0 - 1e-15)))


def _describes(problem: Problem, cut: _CutAtZero) -> bool:
    """Whether errors that are cut off at 0 are all that the readings show.

    Their normal scores neither follow the angle, the speed or the series, in mean or square, nor are they
    skewed or outlying: other laws, noises and kinds of impacts end above 0 as well.
    """
    from scipy import stats

    scores = cut.scores
    p = [float(stats.jarque_bera(scores).pvalue)]
    of_square = (scores**2 - 1.0) / math.sqrt(2.0)
    for trend in _trends(problem, cut.rows):
        free = np.linalg.matrix_rank(trend)
        basis = np.linalg.svd(trend, full_matrices=False)[0][:, :free]
        p += [float(special.chdtrc(free, float(((basis.T @ z) ** 2).sum()))) for z in (scores, of_square)]
    return min(p) * len(p) > BESIDE


def _trends(problem: Problem, own: Index) -> Iterator[Array]:
    """Curves over what the law of an observable may depend on, (n, k) each."""
    rows = problem.rows
    for place in (rows.gamma_deg[own], problem.speeds[own]):
        if np.isfinite(place).all() and np.ptp(place) > 0.0:
            rank = np.searchsorted(np.sort(place), place, side="left") / place.size
            yield np.asarray(np.polynomial.legendre.legvander(2.0 * rank - 1.0, _DEGREE)[:, 1:], dtype=float)
    series = rows.series[own]
    if np.unique(series).size > 1:
        yield (series[:, None] == np.unique(series)).astype(np.float64)


def _growing_noise(problem: Problem, found: LeastSquaresFit, own: Index) -> float:
    """Fall of -2 log likelihood with a noise of own rows that grows with the law, as its square root too."""
    value, fitted = problem.rows.value, problem.predict(found.optimum.theta)
    groups = _noises(problem, own)
    known = Misfit(found.sigma, groups).sigma(value - fitted)
    whole = _descent(problem, found, groups, known).deviance
    size = np.abs(fitted[own]) / max(float(np.abs(fitted[own]).max()), 1e-300)
    best = whole
    for share in _SHARES:
        for power in (0.5, 1.0):
            base = known.copy()
            base[own] *= (share + (1.0 - share) * size) ** power
            sigma = Misfit(base, groups).sigma(value - fitted)
            best = min(best, _descent(problem, found, groups, sigma).deviance)
    return whole - best


def _looks(problem: Problem, found: LeastSquaresFit) -> Iterator[_Look]:
    value, fitted = problem.rows.value, problem.predict(found.optimum.theta)
    for name in problem.rows.names:
        own = problem.rows.rows_of(name)
        if own.size < _FEWEST:
            continue
        groups = _noises(problem, own)
        sigma = Misfit(found.sigma, groups).sigma(value - fitted)
        z = (value - fitted)[own] / sigma[own]
        step, whole = step_of_readings(problem, own), math.nan
        for sign, given in ((1.0, False), (-1.0, False), (1.0, True)):
            end = sign * float((sign * value[own]).max()) + sign * 0.5 * step
            if given:  # readings of e_n above 1 are those that one discards
                if name != "e_n" or end > 1.0 + step:
                    continue
                end = 1.0 + 0.5 * step
            alpha = sign * (end - fitted[own]) / sigma[own]
            if float(special.log_ndtr(alpha).sum()) >= math.log(_SUSPICIOUS):
                continue
            near = _mills(alpha)
            if sign * float(near @ z) < -_BESIDE * float(np.linalg.norm(near)):
                continue
            if math.isnan(whole):
                whole = _descent(problem, found, groups, sigma).deviance
            cut = _descent(problem, found, groups, sigma, own, sign, end)
            dof = own.size - float(found.gaussian.leverage[own].sum())
            gain = (whole - cut.deviance) * dof / own.size
            yield _Look(name, sign, end, gain, cut.missing, cut.missing / own.size, given)


def _noises(problem: Problem, own: Index) -> tuple[Index, ...]:
    """Rows of each noise that is taken from them: of those that are looked at, and what is unknown else."""
    looked_at = np.zeros(len(problem.rows), dtype=bool)
    looked_at[own] = True
    known = np.ones_like(looked_at)
    parts = []
    for rows in problem.noise_groups().values():
        known[rows] = False
        parts += [rows[looked_at[rows]], rows[~looked_at[rows]]]
    parts.insert(0, own[known[own]])
    return tuple(rows for rows in parts if rows.size >= _FEWEST_OF_NOISE)


@dataclass(frozen=True)
class _Descent:
    """Least -2 log likelihood that was met, how many readings it misses, and where it lies.

    `alpha` is the distance of the end from the law in the noise, infinite where there is none.
    """

    deviance: float
    missing: float
    theta: Array
    sigma: Array
    alpha: Array


def _descent(
    problem: Problem,
    found: LeastSquaresFit,
    groups: tuple[Index, ...],
    noise: Array,
    own: Index = _NO_ROWS,
    sign: float = 1.0,
    end: float = 0.0,
) -> _Descent:
    """Least -2 log likelihood where errors of own rows are cut off at an end, and how many are beyond it.

    Scoring steps in the constants, and the noise that solves its own equation beside them; where they do not
    come to rest the least that was met counts.
    """
    value, free = problem.rows.value, problem.parameters.free
    lower, upper = problem.parameters.bounds()
    theta, sigma = found.optimum.theta.copy(), noise.copy()
    best, before = _Descent(math.inf, 0.0, theta, sigma, sigma), math.inf
    alpha = np.full(value.size, np.inf)
    for _ in range(_STEPS):
        fitted = problem.predict(theta)
        residual = value - fitted
        alpha[own] = sign * (end - fitted[own]) / sigma[own]
        inside, mills = special.log_ndtr(alpha), _mills(alpha)
        deviance = float(((residual / sigma) ** 2 + 2.0 * np.log(sigma) + 2.0 * inside).sum())
        if deviance < best.deviance:
            best = _Descent(
                deviance, float(np.expm1(-inside).sum()), theta.copy(), sigma.copy(), alpha.copy()
            )
        if abs(before - deviance) < _AT_REST:
            break
        before = deviance
        pull = mills * np.where(np.isfinite(alpha), alpha, 0.0)
        weight = np.maximum(1.0 - pull - mills**2, _LEAST_WEIGHT) / sigma**2
        root = np.sqrt(weight)
        shifted = (residual + sign * sigma * mills) / sigma**2
        theta = _step_within(
            theta, problem.jacobian(theta) * root[:, None], shifted / root, free, lower, upper
        )
        residual = value - problem.predict(theta)
        for rows in groups:
            left = max(rows.size - float(pull[rows].sum()), 0.1 * rows.size)
            square = float(((residual[rows] / noise[rows]) ** 2).sum()) / left
            sigma[rows] = noise[rows] * min(max(math.sqrt(square), _NARROWEST), _WIDEST)
    return best


def _step_within(
    theta: Array, jacobian: Array, residual: Array, free: Bool, lower: Array, upper: Array
) -> Array:
    """Theta after a step of linear least squares: constants that it leads beyond a bound stay on that."""
    found, moving = theta.copy(), free.copy()
    for _ in range(theta.size):
        step = np.linalg.lstsq(
            jacobian[:, moving], residual - jacobian @ np.where(moving, 0.0, found - theta), rcond=1e-10
        )[0]
        found[moving] = theta[moving] + step
        beyond = moving & ((found < lower) | (found > upper))
        found = np.clip(found, lower, upper)
        moving &= ~beyond
        if not beyond.any() or not moving.any():
            break
    return found


def _mills(alpha: Array) -> Array:
    """Normal density over the distribution below, 0 where nothing is cut off."""
    finite = np.where(np.isfinite(alpha), alpha, 0.0)
    return np.where(
        np.isfinite(alpha),
        np.exp(-0.5 * finite**2 - special.log_ndtr(finite)) / math.sqrt(2.0 * math.pi),
        0.0,
    )
