"""Readings that were clipped or discarded for their value: censored, and truncated samples.

Clipped readings pile up at one end of an observable. Of discarded ones nothing stands in the table but an end
that is too sharp: the law with normal errors cut off at the outermost reading c, of density
phi((y - f)/s)/(s Phi((c - f)/s)), describes such readings better. Without a cut 2 sum -log Phi at the true
constants is distributed as chi2 of 2, whatever the sample; with constants and noise fitted its tail is twice
as large (1,200 tables of beta and e_n, sigma known and not), and counted four times.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import special

from ifrfit.inference.diagnostics.thresholds import FACTS, MOST_MISSING, REFUTED, TIMES_FITTED
from ifrfit.inference.model.noise import resolution
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact
from ifrfit.text import p_text

_FEWEST_ALIKE = 3  # readings of one value that pile up
_MORE = 2.0  # times as many as of any value that is no end
_RESOLVED = 2.0  # steps by which the other readings scatter
_FEWEST = 12  # readings among which a missing end is looked for
_SUSPICIOUS = 0.2  # p of the outermost reading from which no cut is looked for
_STEPS = 60
_AT_REST = 1e-4  # of -2 log likelihood
_LEAST_WEIGHT = 0.1  # of a reading's information, where a cut takes most of it
_NARROWEST, _WIDEST = 0.5, 8.0  # times the noise without a cut
_FEWEST_OF_NOISE = 3  # rows from which a noise is taken
_BESIDE = 2.5  # sd by which readings lie off the law, away from an end that then is no cut


def censoring(problem: Problem, found: LeastSquaresFit) -> Fact | None:
    """Look for readings that pile up at the largest or smallest value of their observable.

    The number of readings that rounding and noise put into the cell of the outermost one is taken as Poisson
    distributed.

    Returns
    -------
    Fact or None
        None where none do.
    """
    fitted, value, looks = (
        problem.predict(found.optimum.theta),
        problem.rows.value,
        2 * len(problem.rows.names),
    )
    for name in problem.rows.names:
        own = problem.rows.rows_of(name)
        step = resolution(value[own])
        given, counts = np.unique(value[own], return_counts=True)
        elsewhere = int(counts[1:-1].max(initial=1))
        for end, word in ((-1, "largest"), (0, "smallest")):
            at, count = float(given[end]), int(counts[end])
            rest = own[value[own] != at]
            if count < _FEWEST_ALIKE or count <= _MORE * elsewhere or not rest.size:
                continue
            if float(np.sqrt(((value - fitted)[rest] ** 2).mean())) < _RESOLVED * step:
                continue
            upper = special.ndtr((at + 0.5 * step - fitted[own]) / found.sigma[own])
            lower = special.ndtr((at - 0.5 * step - fitted[own]) / found.sigma[own])
            p = min(1.0, looks * float(special.gammainc(count - 1, float((upper - lower).sum()))))
            if p < REFUTED:
                says = (
                    f"{count} of {own.size} values of {name} are {at:g} exactly, the {word} of all "
                    f"(p = {p_text(p)} by rounding and noise): values beyond look clipped, and the constants "
                    "are off by as much as they miss. Give them as they were read"
                )
                figures = {"observable": name, "value": at, "n": count, "p": p}
                return Fact(False, says, figures, FACTS["censoring"])
    return None


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
    best = max(looks, key=lambda look: look.gain, default=None)
    if best is None:
        return None
    p = best.p(ends)
    if p >= REFUTED or any(look.share > MOST_MISSING and look.p(ends) < REFUTED for look in looks):
        return None
    side = "above" if best.sign > 0.0 else "below"
    says = (
        f"no value of {best.observable} lies {side} {best.end:.4g}, where the law and its noise would have "
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

    `share` is their number over that of the readings.
    """

    observable: str
    sign: float
    end: float
    gain: float
    missing: float
    share: float

    def p(self, looks: int) -> float:
        """Of the fall, where so many ends were looked at."""
        return min(1.0, TIMES_FITTED * looks * math.exp(-0.5 * self.gain))


@dataclass(frozen=True)
class _Cut:
    """Rows of which none lies beyond `end`, above it for a `sign` of 1."""

    rows: Index
    sign: float
    end: float


def _looks(problem: Problem, found: LeastSquaresFit) -> Iterator[_Look]:
    value, fitted = problem.rows.value, problem.predict(found.optimum.theta)
    for name in problem.rows.names:
        own = problem.rows.rows_of(name)
        if own.size < _FEWEST:
            continue
        groups = _noises(problem, own)
        sigma = _at_best(found.sigma, value - fitted, groups)
        z = (value - fitted)[own] / sigma[own]
        for sign in (1.0, -1.0):
            end = sign * float((sign * value[own]).max()) + sign * 0.5 * resolution(value[own])
            alpha = sign * (end - fitted[own]) / sigma[own]
            if float(special.log_ndtr(alpha).sum()) >= math.log(_SUSPICIOUS):
                continue
            near = _mills(alpha)
            if sign * float(near @ z) < -_BESIDE * float(np.linalg.norm(near)):
                continue
            whole, _ = _descent(problem, found, groups, sigma)
            deviance, missing = _descent(problem, found, groups, sigma, _Cut(own, sign, end))
            dof = own.size - float(found.gaussian.leverage[own].sum())
            yield _Look(name, sign, end, (whole - deviance) * dof / own.size, missing, missing / own.size)


def _noises(problem: Problem, own: Index) -> tuple[Index, ...]:
    """Rows of each noise that is taken from them: of those that are looked at, and what is unknown else."""
    unknown = tuple(problem.noise_groups().values())
    parts = [np.setdiff1d(own, np.concatenate([np.empty(0, dtype=np.intp), *unknown]))]
    for rows in unknown:
        parts += [np.intersect1d(own, rows), np.setdiff1d(rows, own)]
    return tuple(rows for rows in parts if rows.size >= _FEWEST_OF_NOISE)


def _descent(
    problem: Problem,
    found: LeastSquaresFit,
    groups: tuple[Index, ...],
    noise: Array,
    cut: _Cut | None = None,
) -> tuple[float, float]:
    """Least -2 log likelihood where errors of some rows are cut off at an end, and how many are beyond it.

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
        if cut is not None:
            alpha[cut.rows] = cut.sign * (cut.end - fitted[cut.rows]) / sigma[cut.rows]
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
        shifted = (residual + (0.0 if cut is None else cut.sign) * sigma * mills) / sigma**2
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


def _at_best(sigma: Array, residual: Array, groups: tuple[Index, ...]) -> Array:
    """Standard uncertainty of each row, a noise that is taken from its rows at the largest likelihood."""
    best = sigma.copy()
    for rows in groups:
        size = float(np.sqrt(((residual[rows] / sigma[rows]) ** 2).mean()))
        best[rows] *= size if size > 0.0 else 1.0
    return best
