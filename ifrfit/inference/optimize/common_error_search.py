"""Least squares over errors that rows have in common: the search for the best of them.

At given common errors the question is an ordinary one, whose fit is handed in (`FitAtCommon`); see
`ifrfit.inference.optimize.generalised_least_squares` for steps and for the partitions that prove an optimum.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, ClassVar, Protocol, TypeVar

import numpy as np

from ifrfit.errors import UsageError
from ifrfit.inference.model.common_errors import CommonErrorFit
from ifrfit.inference.model.common_likelihood import CommonLikelihood, refuse_beside
from ifrfit.inference.model.error_model import PLAIN
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.generalised_least_squares import (
    common_at,
    common_step,
    local_minima,
    outlying,
    partitions,
)
from ifrfit.inference.optimize.optimum import Array, Optimum
from ifrfit.inference.optimize.piecewise import NEAR
from ifrfit.inference.optimize.solve import solve

_COMMON_STEPS = 60  # over common errors
_COMMON_CONVERGED = 1e-8  # of them, in sd
_SIMPLEXES = 0.3, 0.03, 0.03, 0.03  # of a common error, by which searches without slopes begin
_SAME_SIGMA = 1e-6  # relative difference of two that are one
_MOST_TRIED = 250  # places of it for each
_RESTED = 1e-6  # of common errors and of the objective, between all places of its simplex
_OTHER_STARTS = 3
_COARSELY = 1e-3  # the same, where several ends of a search are compared
_SAME_STEP = 1e-2  # of two first steps that lead the same way
_SAME_COMMON = 1e-2  # sd of common errors at two ends of a search that are one
_HALVINGS = 12
_SMALLEST_SHARE, _SHRINKS = 1.0 / 16.0, 0.9  # of a step


class FitAtNoise(Protocol):
    """What the search needs of a fit; that of least squares has more, which it keeps."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def optimum(self) -> Optimum:
        """Over the constants, at the common errors."""
        ...

    @property
    def sigma(self) -> Array:
        """Independent errors, (n,)."""
        ...

    @property
    def change(self) -> float:
        """Last relative change of the noise."""
        ...

    @property
    def common(self) -> CommonErrorFit | None:
        """The common errors themselves."""
        ...


Fit = TypeVar("Fit", bound=FitAtNoise)
FitCovariant = TypeVar("FitCovariant", bound=FitAtNoise, covariant=True)


class FitAtCommon(Protocol[FitCovariant]):
    """What fits a problem at given common errors."""

    def __call__(
        self,
        problem: Problem,
        value: Array,
        start: Array | None = None,
        sigma: Array | None = None,
        *,
        proven: bool = True,
    ) -> FitCovariant:
        """The fit at the errors `value`, (r,), from a start and sigma of a neighbouring fit."""
        ...


def with_common_errors(
    problem: Problem, fit_at: FitAtCommon[Fit], start: Array | None = None, *, proven: bool = True
) -> Fit:
    """Fit under errors that rows have in common: the fit at the best of them, and what that adds to it.

    At given ones the question is an ordinary one, of which the optimum over the constants is certified (where
    the closure has a certificate). Over the common errors it is proven where these move values alone, and
    sigma and the least of every partition are known (`partitions`): the optimum is the least of all. Else it
    is searched: downhill from none at all, and from where each other local minimum would have them.
    """
    reason = refuse_beside(problem)
    if reason:
        raise UsageError(reason)
    assert problem.common is not None
    nothing = np.zeros(len(problem.common))
    first = fit_at(problem, nothing, start, proven=proven)
    known = local_minima(partitions(problem, first.sigma, nothing))[:_OTHER_STARTS]
    if known and _has_exact_partitions(problem):
        fit = fit_at(problem, common_at(problem, first.sigma, known[0].theta))
        return replace(fit, optimum=_with_partitions(problem, fit, []))
    places = [first.optimum.theta, *(theta for _, theta in first.optimum.minima[1 : 1 + _OTHER_STARTS])]
    found: list[tuple[float, Fit]] = []
    steps: list[Array] = []
    for theta in (*places, *(each.theta for each in known)):
        loadings = CommonLikelihood(problem, nothing).loadings(theta[None])[0]
        step = common_step(problem.at_common(nothing), first.sigma, theta, loadings, nothing)
        if any(np.abs(step - other).max() < _SAME_STEP for other in steps):
            continue
        steps.append(step)
        fit, objective = _descended(problem, fit_at, first, step, _COARSELY)
        if all(not _is_same(fit, other) for _, other in found):
            found.append((objective, fit))
    (best, fit), *others = sorted(found, key=lambda pair: pair[0])
    rises = [(objective - best, each.optimum.theta) for objective, each in others]
    assert fit.common is not None
    value = fit.common.value
    at_best = problem.at_common(value)
    step = common_step(at_best, fit.sigma, fit.optimum.theta, fit.common.loadings, value)
    fit, _ = _descended(problem, fit_at, fit, step, _COMMON_CONVERGED)
    if problem.common.turns_angles:
        fit = _below_kinks(problem, fit_at, fit)
    return replace(fit, optimum=_with_partitions(problem, fit, rises))


def _below_kinks(problem: Problem, fit_at: FitAtCommon[Fit], fit: Fit) -> Fit:
    """The fit at the least objective about another, by a search that needs no slopes.

    Common errors that turn angles move impacts across the transition: there the objective has kinks, on which
    steps along slopes come to rest. The search takes sigma as the fit has it; where sigma follows from the
    fit, it is searched again at that of the new one, nearby, until they agree.
    """
    from scipy.optimize import minimize

    assert fit.common is not None
    plain = replace(problem, error_model=PLAIN)
    for size in _SIMPLEXES:
        start, sigma, theta = fit.common.value, fit.sigma, fit.optimum.theta

        def objective(value: Array, sigma: Array = sigma, theta: Array = theta) -> float:
            at_value = solve(plain.at_common(value), sigma, theta, proven=False)
            return at_value.objective + float(value @ value)

        options: Any = {
            "initial_simplex": np.vstack((start, start + size * np.eye(start.size))),
            "xatol": _RESTED,
            "fatol": _RESTED,
            "maxfev": _MOST_TRIED * start.size,
            "adaptive": True,
        }
        lowest = minimize(objective, start, method="Nelder-Mead", options=options)
        if lowest.fun >= objective(start):
            break
        fit = fit_at(problem, lowest.x, theta, sigma)
        assert fit.common is not None
        if np.abs(np.log(fit.sigma / sigma)).max() < _SAME_SIGMA:
            break
    return fit


def _has_exact_partitions(problem: Problem) -> bool:
    """Whether rows are linear in the common errors, and their covariance is known."""
    moves_values = problem.common is not None and not problem.common.turns_angles
    return moves_values and problem.noise.is_known and problem.error_model.is_plain


def _with_partitions(problem: Problem, fit: FitAtNoise, others: list[tuple[float, Array]]) -> Optimum:
    """The optimum over constants and common errors, with its other minima, and its proof where there is one.

    `others` are ends of the search: how far they lie higher, and theta.
    """
    assert problem.common is not None
    assert fit.common is not None
    objective = fit.optimum.objective + fit.common.square
    every = partitions(problem, fit.sigma, fit.common.value)
    least = min((each.objective for each in every), default=0.0)
    gap = max(0.0, objective - least) if every and _has_exact_partitions(problem) else None
    beside = [(each.objective - least, each.theta) for each in local_minima(every)[1:]]
    rises = sorted((*others, *beside), key=lambda pair: pair[0])
    minima = [(objective, fit.optimum.theta)]
    minima += [(objective + rise, theta) for rise, theta in rises if rise <= NEAR]
    method = "at the best common errors" + ("" if gap is not None else ", which are searched")
    return replace(
        fit.optimum,
        objective=objective,
        gap=gap,
        minima=tuple(minima),
        extremes=tuple(each.theta for each in outlying(problem, every)) if every else fit.optimum.extremes,
        method=f"{fit.optimum.method}, {method}",
    )


def _is_same(one: FitAtNoise, other: FitAtNoise) -> bool:
    assert one.common is not None
    assert other.common is not None
    return bool(np.abs(one.common.value - other.common.value).max() < _SAME_COMMON)


def _descended(
    problem: Problem, fit_at: FitAtCommon[Fit], first: Fit, step: Array, tolerance: float
) -> tuple[Fit, float]:
    """The fit at the nearest minimum over the common errors, from a fit and one step on; and its objective.

    Where sigma is known, each step makes the objective smaller. Else steps are halved while they do not
    shrink, and the objective is chi2 at the noise of the first fit.
    """
    is_known = problem.noise.is_known and problem.error_model.is_plain
    assert first.common is not None
    value, fit = first.common.value, first
    objective = math.inf  # the first step leads to where another minimum may be
    near = None if problem.closure.bilinear else first.optimum.theta
    size, share = math.inf, 1.0
    for _ in range(_COMMON_STEPS):
        if not is_known:
            share = max(_SMALLEST_SHARE, 0.5 * share) if np.linalg.norm(step) > _SHRINKS * size else share
        moved, other, lower = value, fit, objective
        for _ in range(_HALVINGS):
            moved = value + share * step
            other = fit_at(problem, moved, near, fit.sigma)
            lower = _objective_at(problem, other, first.sigma)
            if not is_known or lower <= objective:
                break
            share *= 0.5
        else:
            break  # on a kink: no step leads further down
        size = float(np.linalg.norm(step))
        value, fit, objective = moved, other, lower
        if is_known:
            share = 1.0
        assert fit.common is not None
        step = common_step(problem.at_common(value), fit.sigma, fit.optimum.theta, fit.common.loadings, value)
        if np.linalg.norm(step) < tolerance:
            return fit, objective
    unconverged = max(fit.change, float(np.linalg.norm(step))) if not is_known else fit.change
    return replace(fit, change=unconverged), objective


def _objective_at(problem: Problem, fit: FitAtNoise, sigma: Array) -> float:
    """chi2 with priors and common errors; where sigma is not known at that of another fit."""
    assert fit.common is not None
    if problem.noise.is_known and problem.error_model.is_plain:
        return fit.optimum.objective + fit.common.square
    there = problem.at_common(fit.common.value)
    z = there.residual(fit.optimum.theta) / sigma
    prior = problem.parameters.prior_residuals(fit.optimum.theta)
    return float(z @ z + prior @ prior) + fit.common.square
