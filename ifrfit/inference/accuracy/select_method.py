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
from ifrfit.inference.model.apply_error_model import with_error_model
from ifrfit.inference.model.error_model import ErrorModel
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.posterior import QuadraturePosterior, integrate
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.method_results import with_chains, with_explored
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


def with_effort(
    result: FitResult, wanted: Wanted, cannot: str, *, workers: int = 1, progress: Progress | None = None
) -> FitResult:
    """Put the posterior in the place of the local picture, as exactly as asked, or as the time allows.

    The exact posterior where it can do the problem; else chains; least squares as they are where the budget
    is too short for either.

    Parameters
    ----------
    result : FitResult
        Of least squares.
    wanted : Wanted
    cannot : str
        Why not the exact posterior, where that is known already.
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
    if wanted.method != "mcmc" and not cannot:
        # least squares do not know true angles that scatter, and are not what the user insists on
        must = wanted.method == "exact" or result.problem.error_model.integrates
        try:
            posterior = refine(result.problem, result.least_squares, wanted, must=must)
        except UsageError as error:
            if wanted.method == "exact":
                raise
            cannot = str(error)
        else:
            if posterior is None:
                return _as_it_is(result, wanted, "too short for the exact posterior")
            return _with_exact(result, posterior, wanted)
    return _with_chains(result, wanted, cannot, workers, progress)


def _with_exact(result: FitResult, posterior: QuadraturePosterior, wanted: Wanted) -> FitResult:
    if wanted.budget is None:
        found = with_explored(result, posterior, integrate)
    else:
        try:
            found = with_explored(result, posterior, lambda problem: _evidence(problem, wanted))
        except TimeoutError:
            found = with_explored(result, posterior, None)
            found = replace(found, warnings=(*found.warnings, UNASKED))
    return _told(found, wanted, "exact", "", tolerance=posterior.tolerance, reached=posterior.error)


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


def _with_chains(
    result: FitResult, wanted: Wanted, cannot: str, workers: int, progress: Progress | None
) -> FitResult:
    from ifrfit.inference import mcmc
    from ifrfit.inference.accuracy import mcmc_accuracy as of_chains
    from ifrfit.inference.mcmc.stopping import is_met
    from ifrfit.inference.model.log_posterior import Density

    problem, start = result.problem, result.least_squares
    of_chains.check_reachable(wanted, cannot)
    why = f"exact is out of the question: {short(cannot)}" if cannot else ""
    coordinates = mcmc.Coordinates(Density(problem))
    most = None
    if coordinates.dimensions:
        steps = of_chains.steps_within(coordinates, mcmc.fresh(coordinates, start, result.seed), wanted)
        short_of = steps < of_chains.FIRST and wanted.method is None
        if short_of and not problem.error_model.integrates:
            return _as_it_is(result, wanted, f"{why}, and too short for chains".removeprefix(", and "))
        most = max(steps, of_chains.FEWEST)
    halt = of_chains.halting(wanted, is_met)
    found = with_chains(result, max_steps=most, workers=workers, progress=progress, halt=halt)
    drawn = found.sample
    error = of_chains.standard_error(drawn.evidence)
    reached = error if math.isfinite(error) else None
    return _told(found, wanted, "mcmc", why, steps=drawn.chains.steps, reached=reached)


def _as_it_is(result: FitResult, wanted: Wanted, why: str) -> FitResult:
    return _told(result, wanted, "lsq", why)


def _told(
    found: FitResult,
    wanted: Wanted,
    method: str,
    why: str,
    *,
    tolerance: float | None = None,
    steps: int | None = None,
    reached: float | None = None,
) -> FitResult:
    """The result with its effort; not converged where the asked accuracy was not reached."""
    effort = Effort(wanted.accuracy, wanted.budget, method, tolerance, steps, reached, wanted.seconds, why)
    if effort.met:
        return replace(found, effort=effort)
    converged = found.facts["converged"]
    figures = dict(converged.figures) | {"reached": reached, "asked": wanted.accuracy}
    fact = Fact(False, missed(effort), figures, converged.threshold)
    return replace(found, effort=effort, facts={**found.facts, "converged": fact})
