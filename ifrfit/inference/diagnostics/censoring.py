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

from ifrfit.inference.diagnostics.thresholds import FACTS, REFUTED, TIMES_FITTED
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
_NARROWEST, _WIDEST = 0.5, 8.0  # times the noise of the fit


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

    Returns
    -------
    Fact or None
        None where the law with errors that are cut off describes no observable better.
    """
    best = max(_looks(problem, found), key=lambda look: look.gain, default=None)
    if best is None:
        return None
    p = min(1.0, TIMES_FITTED * 2.0 * len(problem.rows.names) * math.exp(-0.5 * best.gain))
    if p >= REFUTED:
        return None
    side = "above" if best.sign > 0.0 else "below"
    says = (
        f"no value of {best.observable} lies {side} {best.end:.4g}, where the law and its noise would have "
        f"some {best.missing:.0f} (p = {p_text(p)}, by errors that are cut off there): "
        "values look left out for their size, and the constants are off by as much as they miss. Give all"
    )
    figures = {"observable": best.observable, "end": best.end, "missing": best.missing, "p": p}
    return Fact(False, says, figures, FACTS["truncation"])


@dataclass(frozen=True)
class _Look:
    """One end of an observable: the fall of -2 log likelihood with a cut there, and how many it takes."""

    observable: str
    sign: float
    end: float
    gain: float
    missing: float


def _looks(problem: Problem, found: LeastSquaresFit) -> Iterator[_Look]:
    value, fitted = problem.rows.value, problem.predict(found.optimum.theta)
    for name in problem.rows.names:
        own = problem.rows.rows_of(name)
        if own.size < _FEWEST:
            continue
        for sign in (1.0, -1.0):
            end = sign * float((sign * value[own]).max()) + sign * 0.5 * resolution(value[own])
            inside = special.log_ndtr(sign * (end - fitted[own]) / found.sigma[own])
            if float(inside.sum()) < math.log(_SUSPICIOUS):
                gain, missing = _cut(problem, found, own, sign, end)
                yield _Look(name, sign, end, gain, missing)


def _cut(
    problem: Problem, found: LeastSquaresFit, own: Index, sign: float, end: float
) -> tuple[float, float]:
    """Fall of -2 log likelihood where errors of some rows are cut off at an end, and how many are beyond it.

    Scoring steps in the constants, and the noise that solves its own equation beside them; where they do not
    come to rest the largest fall that was met counts, which is too small.
    """
    value, free = problem.rows.value, problem.parameters.free
    groups = tuple(problem.noise_groups().values())
    lower, upper = problem.parameters.bounds()
    theta = found.optimum.theta.copy()
    sigma = _at_best(found.sigma, value - problem.predict(theta), groups)
    first, gain, missing = _deviance(value - problem.predict(theta), sigma), 0.0, 0.0
    cut = np.zeros(value.size, dtype=bool)
    cut[own] = True
    before = math.inf
    for _ in range(_STEPS):
        fitted = problem.predict(theta)
        residual = value - fitted
        alpha = np.where(cut, sign * (end - fitted) / sigma, np.inf)
        inside = special.log_ndtr(alpha)
        mills = np.where(
            cut, np.exp(-0.5 * np.where(cut, alpha, 0.0) ** 2 - inside) / math.sqrt(2.0 * math.pi), 0.0
        )
        deviance = _deviance(residual, sigma) + 2.0 * float(inside.sum())
        if first - deviance > gain:
            gain, missing = first - deviance, float(np.expm1(-inside[own]).sum())
        if abs(before - deviance) < _AT_REST:
            break
        before = deviance
        pull = mills * np.where(cut, alpha, 0.0)
        weight = np.maximum(1.0 - pull - mills**2, _LEAST_WEIGHT) / sigma**2
        jacobian = problem.jacobian(theta)[:, free]
        root = np.sqrt(weight)
        shifted = (residual + sign * sigma * mills) / sigma**2
        step = np.linalg.lstsq(jacobian * root[:, None], shifted / root, rcond=1e-10)[0]
        theta[free] = np.clip(theta[free] + step, lower[free], upper[free])
        residual = value - problem.predict(theta)
        for rows in groups:
            left = max(rows.size - float(pull[rows].sum()), 0.1 * rows.size)
            square = float(((residual[rows] / found.sigma[rows]) ** 2).sum()) / left
            sigma[rows] = found.sigma[rows] * min(max(math.sqrt(square), _NARROWEST), _WIDEST)
    dof = value.size - float(found.gaussian.leverage.sum())
    return (gain * dof / value.size if groups else gain), missing


def _at_best(sigma: Array, residual: Array, groups: tuple[Index, ...]) -> Array:
    """Standard uncertainty of each row, an unknown noise at the largest likelihood."""
    best = sigma.copy()
    for rows in groups:
        best[rows] *= max(float(np.sqrt(((residual[rows] / sigma[rows]) ** 2).mean())), _NARROWEST)
    return best


def _deviance(residual: Array, sigma: Array) -> float:
    return float(((residual / sigma) ** 2 + 2.0 * np.log(sigma)).sum())
