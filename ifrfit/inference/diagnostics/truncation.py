"""Readings left out for their value: an end of an observable that is too sharp, or none beyond one that is known.

Of discarded readings nothing stands in the table but an end
that is too sharp: the law with normal errors cut off at the outermost reading c, of density
phi((y - f)/s)/(s Phi((c - f)/s)), describes such readings better. Without a cut 2 sum -log Phi at the true
constants is distributed as chi2 of 2, whatever the sample; with constants and noise fitted its tail is twice
as large (1,200 tables of beta and e_n, sigma known and not), and counted four times. An end at e_n = 1 is
known beforehand: the likelihood ratio is then exceeded with less than its inverse, whatever the law (Markov),
and with constants and noise fitted 0.2 to 0.28 times as often, wherever the end is (20 to 300 readings).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import special

from ifrfit.inference.diagnostics.rounding_step import step_of_readings
from ifrfit.inference.diagnostics.slips.refit import Misfit
from ifrfit.inference.diagnostics.thresholds import FACTS, MOST_MISSING, REFUTED, TIMES_FITTED, TIMES_GIVEN
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Index
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
                whole, _ = _descent(problem, found, groups, sigma)
            deviance, missing = _descent(problem, found, groups, sigma, own, sign, end)
            dof = own.size - float(found.gaussian.leverage[own].sum())
            yield _Look(
                name, sign, end, (whole - deviance) * dof / own.size, missing, missing / own.size, given
            )


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


def _descent(
    problem: Problem,
    found: LeastSquaresFit,
    groups: tuple[Index, ...],
    noise: Array,
    own: Index = _NO_ROWS,
    sign: float = 1.0,
    end: float = math.inf,
) -> tuple[float, float]:
    """Least -2 log likelihood where errors of own rows are cut off at an end, and how many are beyond it.

    Scoring steps in the constants, and the noise that solves its own equation beside them; where they do not
    come to rest the least that was met counts.
    """
    value, free = problem.rows.value, problem.parameters.free
    lower, upper = problem.parameters.bounds()
    theta, sigma = found.optimum.theta.copy(), noise.copy()
    least, missing, before = math.inf, 0.0, math.inf
    alpha = np.full(value.size, np.inf)
    for _ in range(_STEPS):
        fitted = problem.predict(theta)
        residual = value - fitted
        alpha[own] = sign * (end - fitted[own]) / sigma[own]
        inside, mills = special.log_ndtr(alpha), _mills(alpha)
        deviance = float(((residual / sigma) ** 2 + 2.0 * np.log(sigma) + 2.0 * inside).sum())
        if deviance < least:
            least, missing = deviance, float(np.expm1(-inside).sum())
        if abs(before - deviance) < _AT_REST:
            break
        before = deviance
        pull = mills * np.where(np.isfinite(alpha), alpha, 0.0)
        weight = np.maximum(1.0 - pull - mills**2, _LEAST_WEIGHT) / sigma**2
        jacobian = problem.jacobian(theta)[:, free]
        root = np.sqrt(weight)
        shifted = (residual + sign * sigma * mills) / sigma**2
        step = np.linalg.lstsq(jacobian * root[:, None], shifted / root, rcond=1e-10)[0]
        theta[free] = np.clip(theta[free] + step, lower[free], upper[free])
        residual = value - problem.predict(theta)
        for rows in groups:
            left = max(rows.size - float(pull[rows].sum()), 0.1 * rows.size)
            square = float(((residual[rows] / noise[rows]) ** 2).sum()) / left
            sigma[rows] = noise[rows] * min(max(math.sqrt(square), _NARROWEST), _WIDEST)
    return least, missing


def _mills(alpha: Array) -> Array:
    """Normal density over the distribution below, 0 where nothing is cut off."""
    finite = np.where(np.isfinite(alpha), alpha, 0.0)
    return np.where(
        np.isfinite(alpha),
        np.exp(-0.5 * finite**2 - special.log_ndtr(finite)) / math.sqrt(2.0 * math.pi),
        0.0,
    )
