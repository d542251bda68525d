"""The posterior as exactly as requested: by quadrature, by chains, or by whichever of them can."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from ifrfit.errors import UsageError
from ifrfit.inference.accuracy.messages import missed, short
from ifrfit.inference.accuracy.request import Request
from ifrfit.inference.accuracy.tolerance_ladder import refine
from ifrfit.inference.accuracy.types import Effort
from ifrfit.inference.estimations import (
    chains_estimation,
    least_squares_estimation,
    posterior_estimation,
)
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.posterior import QuadraturePosterior, integrate
from ifrfit.inference.result.estimation import Estimation
from ifrfit.inference.result.types import Fact

UNASKED = "Whether the series share their constants was not asked: the time was over."

_OTHERS = 1e-2  # tolerance of the evidence of other questions where time counts

Progress = Callable[[int, int], None]


def exact_as_requested(problem: Problem, optimum: LeastSquaresFit, request: Request) -> Estimation:
    """The posterior by quadrature; the coarsest tolerance is worked out however long it takes.

    Raises
    ------
    UsageError, DataError
        If the problem is not one for the quadrature.
    """
    posterior = refine(problem, optimum, request, must=True)
    assert posterior is not None
    return _exact(problem, optimum, posterior, request)


def chains_as_requested(
    problem: Problem,
    optimum: LeastSquaresFit,
    request: Request,
    unsuitable: str = "",
    *,
    seed: int = 0,
    workers: int = 1,
    progress: Progress | None = None,
    fewest: bool = True,
) -> Estimation:
    """The posterior by Markov chains until their standard errors are small enough, or the time is over.

    Parameters
    ----------
    problem : Problem
    optimum : LeastSquaresFit
    request : Request
    unsuitable : str
        Why not by quadrature, where that was tried.
    seed, workers, progress
        Of the chains.
    fewest : bool
        Whether some steps are walked however long they take; else least squares stand as they are where the
        time is too short for chains.

    Raises
    ------
    UsageError
        For an accuracy that chains do not come to.
    """
    from ifrfit.inference import mcmc
    from ifrfit.inference.accuracy import mcmc_accuracy as of_chains
    from ifrfit.inference.mcmc.stopping import is_met
    from ifrfit.inference.model.log_posterior import Density

    of_chains.check_reachable(request, unsuitable)
    why = f"exact is out of the question: {short(unsuitable)}" if unsuitable else ""
    coordinates = mcmc.Coordinates(Density(problem))
    most = None
    if coordinates.dimensions:
        steps = of_chains.steps_within(coordinates, mcmc.fresh(coordinates, optimum, seed), request)
        if steps < of_chains.FIRST and not fewest:
            why = f"{why}, and too short for chains".removeprefix(", and ")
            return _with_effort(least_squares_estimation(optimum), request, why)
        most = max(steps, of_chains.FEWEST)
    halt = of_chains.halting(request, is_met)
    found, sample = chains_estimation(
        problem, optimum, seed=seed, max_steps=most, workers=workers, progress=progress, halt=halt
    )
    error = of_chains.standard_error(sample.evidence)
    reached = error if math.isfinite(error) else None
    return _with_effort(found, request, why, steps=sample.chains.steps, reached=reached)


def picked_as_requested(
    problem: Problem,
    optimum: LeastSquaresFit,
    request: Request,
    unsuitable: str = "",
    *,
    seed: int = 0,
    workers: int = 1,
    progress: Progress | None = None,
) -> Estimation:
    """By quadrature where it can do the problem; else by chains; least squares where time is too short.

    Parameters
    ----------
    problem : Problem
    optimum : LeastSquaresFit
    request : Request
    unsuitable : str
        Why not by quadrature, where that is known already.
    seed, workers, progress
        Of chains.

    Raises
    ------
    UsageError
        For an accuracy that chains do not come to.
    """
    # least squares do not know true angles that scatter
    must = problem.error_model.integrates
    if not unsuitable:
        try:
            posterior = refine(problem, optimum, request, must=must)
        except UsageError as error:
            unsuitable = str(error)
        else:
            if posterior is None:
                why = "too short for the exact posterior"
                return _with_effort(least_squares_estimation(optimum), request, why)
            return _exact(problem, optimum, posterior, request)
    return chains_as_requested(
        problem,
        optimum,
        request,
        unsuitable,
        seed=seed,
        workers=workers,
        progress=progress,
        fewest=must,
    )


def _exact(
    problem: Problem, optimum: LeastSquaresFit, posterior: QuadraturePosterior, request: Request
) -> Estimation:
    if request.budget is None:
        found = posterior_estimation(problem, optimum, posterior, integrate)
    else:
        try:
            found = posterior_estimation(problem, optimum, posterior, lambda other: _evidence(other, request))
        except TimeoutError:
            found = posterior_estimation(problem, optimum, posterior, None)
            found = replace(found, warnings=(*found.warnings, UNASKED))
    return _with_effort(found, request, "", tolerance=posterior.tolerance, reached=posterior.error)


def _evidence(problem: Problem, request: Request) -> QuadraturePosterior:
    """The posterior of another question, as exactly as its evidence needs.

    Raises
    ------
    TimeoutError
        If there is no time for it.
    """
    if request.over:
        raise TimeoutError
    found = integrate(problem, _OTHERS, over=lambda: request.over)
    if found.error_evidence > _OTHERS:
        raise TimeoutError
    return found


def _with_effort(
    found: Estimation,
    request: Request,
    why: str,
    *,
    tolerance: float | None = None,
    steps: int | None = None,
    reached: float | None = None,
) -> Estimation:
    """The estimation with its effort; not converged where the requested accuracy was not reached."""
    asked = request.accuracy, request.budget
    effort = Effort(*asked, found.method, tolerance, steps, reached, request.seconds, why)
    if effort.met:
        return replace(found, effort=effort)
    converged = found.diagnostics["converged"]
    figures = dict(converged.figures) | {"reached": reached, "asked": request.accuracy}
    fact = Fact(False, missed(effort), figures, converged.threshold)
    return replace(found, effort=effort, diagnostics={**found.diagnostics, "converged": fact})
