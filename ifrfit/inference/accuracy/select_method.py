"""Pick method and settings for an asked accuracy or time, fit, and tell what was reached."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from ifrfit.errors import UsageError
from ifrfit.inference.accuracy.messages import missed, short
from ifrfit.inference.accuracy.request import Wanted
from ifrfit.inference.accuracy.tolerance_ladder import refine
from ifrfit.inference.accuracy.types import Effort
from ifrfit.inference.estimations import (
    chains_estimation,
    least_squares_estimation,
    posterior_estimation,
)
from ifrfit.inference.model.apply_error_model import with_error_model
from ifrfit.inference.model.error_model import ErrorModel
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquares
from ifrfit.inference.posterior import QuadraturePosterior, integrate
from ifrfit.inference.result.estimation import Estimation
from ifrfit.inference.result.types import Fact

UNASKED = "Whether the series share their constants was not asked: the time was over."

_OTHERS = 1e-2  # tolerance of the evidence of other questions where time counts

Progress = Callable[[int, int], None]


def problem_for(problem: Problem, error_model: ErrorModel, method: str | None) -> tuple[Problem, str]:
    """The problem under this scatter, and why the exact posterior does not know it; empty where it does.

    Raises
    ------
    UsageError, DataError
        As `with_error_model`.
    """
    try:
        return with_error_model(problem, error_model, method or "exact"), ""
    except UsageError as error:
        if method is not None:
            raise
        return with_error_model(problem, error_model, "mcmc"), str(error)


def estimation_with_effort(
    problem: Problem,
    optimum: LeastSquares,
    wanted: Wanted,
    unsuitable: str,
    *,
    seed: int = 0,
    workers: int = 1,
    progress: Progress | None = None,
) -> Estimation:
    """The posterior as exactly as asked, or as the time allows.

    The exact posterior where it can do the problem; else chains; least squares as they are where the budget
    is too short for either.

    Parameters
    ----------
    problem : Problem
    optimum : LeastSquares
    wanted : Wanted
    unsuitable : str
        Why not the exact posterior, where that is known already.
    seed : int
        Of chains.
    workers : int
        Processes of chains.
    progress : callable, optional
        Of chains.

    Raises
    ------
    UsageError
        Where the user insists on exact and the problem is not one for it, or for an accuracy that chains do
        not come to.
    """
    if wanted.method != "mcmc" and not unsuitable:
        # least squares do not know true angles that scatter, and are not what the user insists on
        must = wanted.method == "exact" or problem.error_model.integrates
        try:
            posterior = refine(problem, optimum, wanted, must=must)
        except UsageError as error:
            if wanted.method == "exact":
                raise
            unsuitable = str(error)
        else:
            if posterior is None:
                return _least_squares(optimum, wanted, "too short for the exact posterior")
            return _exact(problem, optimum, posterior, wanted)
    return _chains(problem, optimum, wanted, unsuitable, seed, workers, progress)


def _exact(
    problem: Problem, optimum: LeastSquares, posterior: QuadraturePosterior, wanted: Wanted
) -> Estimation:
    if wanted.budget is None:
        found = posterior_estimation(problem, optimum, posterior, integrate)
    else:
        try:
            found = posterior_estimation(problem, optimum, posterior, lambda other: _evidence(other, wanted))
        except TimeoutError:
            found = posterior_estimation(problem, optimum, posterior, None)
            found = replace(found, warnings=(*found.warnings, UNASKED))
    return _with_effort(found, wanted, "", tolerance=posterior.tolerance, reached=posterior.error)


def _evidence(problem: Problem, wanted: Wanted) -> QuadraturePosterior:
    """The posterior of another question, as exactly as its evidence needs.

    Raises
    ------
    TimeoutError
        If there is no time for it.
    """
    if wanted.over:
        raise TimeoutError
    found = integrate(problem, _OTHERS, over=lambda: wanted.over)
    if found.error_evidence > _OTHERS:
        raise TimeoutError
    return found


def _chains(
    problem: Problem,
    optimum: LeastSquares,
    wanted: Wanted,
    unsuitable: str,
    seed: int,
    workers: int,
    progress: Progress | None,
) -> Estimation:
    from ifrfit.inference import mcmc
    from ifrfit.inference.accuracy import mcmc_accuracy as of_chains
    from ifrfit.inference.mcmc.stopping import is_met
    from ifrfit.inference.model.log_posterior import Density

    of_chains.check_reachable(wanted, unsuitable)
    why = f"exact is out of the question: {short(unsuitable)}" if unsuitable else ""
    coordinates = mcmc.Coordinates(Density(problem))
    most = None
    if coordinates.dimensions:
        steps = of_chains.steps_within(coordinates, mcmc.fresh(coordinates, optimum, seed), wanted)
        short_of = steps < of_chains.FIRST and wanted.method is None
        if short_of and not problem.error_model.integrates:
            return _least_squares(optimum, wanted, f"{why}, and too short for chains".removeprefix(", and "))
        most = max(steps, of_chains.FEWEST)
    halt = of_chains.halting(wanted, is_met)
    found, drawn = chains_estimation(
        problem, optimum, seed=seed, max_steps=most, workers=workers, progress=progress, halt=halt
    )
    error = of_chains.standard_error(drawn.evidence)
    reached = error if math.isfinite(error) else None
    return _with_effort(found, wanted, why, steps=drawn.chains.steps, reached=reached)


def _least_squares(optimum: LeastSquares, wanted: Wanted, why: str) -> Estimation:
    return _with_effort(least_squares_estimation(optimum), wanted, why)


def _with_effort(
    found: Estimation,
    wanted: Wanted,
    why: str,
    *,
    tolerance: float | None = None,
    steps: int | None = None,
    reached: float | None = None,
) -> Estimation:
    """The estimation with its effort; not converged where the asked accuracy was not reached."""
    effort = Effort(
        wanted.accuracy, wanted.budget, found.method, tolerance, steps, reached, wanted.seconds, why
    )
    if effort.met:
        return replace(found, effort=effort)
    converged = found.diagnostics["converged"]
    figures = dict(converged.figures) | {"reached": reached, "asked": wanted.accuracy}
    fact = Fact(False, missed(effort), figures, converged.threshold)
    return replace(found, effort=effort, diagnostics={**found.diagnostics, "converged": fact})
