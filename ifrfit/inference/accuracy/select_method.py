"""The posterior as exactly as requested: by quadrature, by chains, or by whichever of them can."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

from ifrfit.errors import UsageError
from ifrfit.inference.accuracy.request import Effort, Request
from ifrfit.inference.estimations import least_squares_estimation, posterior_estimation, sample_estimation
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares
from ifrfit.inference.posterior import ExactPosterior, QuadraturePosterior, integrate, log_evidence
from ifrfit.inference.posterior.adaptive_quadrature import GridTooLargeError
from ifrfit.inference.posterior.integral_layout import no_grid
from ifrfit.inference.posterior.integrators import sampled_posterior
from ifrfit.inference.posterior.transition_quadrature import transition_posterior
from ifrfit.inference.result.estimation import Estimation
from ifrfit.inference.result.types import Fact

UNASKED = "Whether the series share their constants was not asked: the time was over."

_OTHERS = 1e-2  # tolerance of the evidence of other questions where time counts

Progress = Callable[[int, int], None]

LADDER = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8)
_GROWTH = 4.0  # of the time from one tolerance to the next, where it has not been seen to grow faster

_NEAR = 1.5  # factor within which a tolerance is as good as the asked one

Integrate = Callable[..., Any]


def as_requested(
    problem: Problem,
    optimum: LeastSquaresFit,
    request: Request,
    methods: Collection[str] = ("exact", "mcmc"),
    *,
    seed: int = 0,
    workers: int = 1,
    keep: Path | None = None,
    progress: Progress | None = None,
) -> Estimation:
    """The posterior by quadrature where it can do the problem, else by chains.

    Where there is no grid, or one that would fill the memory, and chains are not asked for, importance
    sampling takes its place.
    Where there are both, and time is too short for either, least squares stand as they are; but not where
    true angles are integrated out, which least squares do not know. Else the coarsest tolerance, or a few
    steps, are worked out however long they take.

    Parameters
    ----------
    problem : Problem
    optimum : LeastSquaresFit
    request : Request
    methods : collection of str
        exact, mcmc, or both.
    seed, workers, keep, progress
        Of chains.

    Raises
    ------
    UsageError
        For an accuracy that chains do not come to; where quadrature alone is asked for, and cannot.
    """
    must = len(methods) == 1 or problem.error_model.integrates
    unsuitable = no_grid(problem) if "exact" in methods else ""
    if unsuitable and "mcmc" not in methods:
        return _exact(problem, optimum, sampled_posterior(problem, optimum, seed), request)
    if "exact" in methods and not unsuitable:
        if request.accuracy is not None:
            plain = transition_posterior(problem, request.accuracy, optimum)
            if plain is not None:  # in milliseconds, whatever the budget
                return _exact(problem, optimum, plain, request)
        try:
            posterior = refine(problem, optimum, request, must=must)
        except GridTooLargeError as refusal:
            if "mcmc" not in methods:
                return _exact(problem, optimum, sampled_posterior(problem, optimum, seed), request)
            unsuitable = str(refusal)
        except UsageError as refusal:
            if "mcmc" not in methods:
                raise
            unsuitable = str(refusal)
        else:
            if posterior is not None:
                return _exact(problem, optimum, posterior, request)
            return _with_effort(
                least_squares_estimation(optimum), request, "too short for the exact posterior"
            )
    from ifrfit.inference import mcmc
    from ifrfit.inference.accuracy import mcmc_accuracy as of_chains
    from ifrfit.inference.mcmc.stopping import is_met
    from ifrfit.inference.model.log_posterior import Density

    of_chains.check_reachable(request, unsuitable)
    # of the refusal what it is about, without the remedy
    about = unsuitable.partition(". ")[0].partition(": ")[0].rstrip(".")
    why = f"exact is out of the question: {about}" if unsuitable else ""
    coordinates = mcmc.Coordinates(Density(problem))
    most = mcmc.MAX_STEPS
    if coordinates.dimensions:
        steps = of_chains.steps_within(coordinates, mcmc.fresh(coordinates, optimum, seed), request)
        if steps < of_chains.FIRST and not must:
            why = f"{why}, and too short for chains".removeprefix(", and ")
            return _with_effort(least_squares_estimation(optimum), request, why)
        most = max(steps, of_chains.FEWEST)
    halt = of_chains.halting(request, is_met)
    sample = mcmc.sample(
        problem, optimum, seed, max_steps=most, workers=workers, keep=keep, progress=progress, halt=halt
    )
    error = of_chains.standard_error(sample.evidence)
    reached = error if math.isfinite(error) else None
    found = sample_estimation(sample, optimum)
    return _with_effort(found, request, why, steps=sample.chains.steps, reached=reached)


def _exact(
    problem: Problem, optimum: LeastSquaresFit, posterior: ExactPosterior, request: Request
) -> Estimation:
    if request.budget is None:
        found = posterior_estimation(problem, optimum, posterior, log_evidence)
    else:
        try:
            found = posterior_estimation(problem, optimum, posterior, lambda other: _evidence(other, request))
        except TimeoutError:
            found = posterior_estimation(problem, optimum, posterior, None)
            found = replace(found, warnings=(*found.warnings, UNASKED))
    return _with_effort(found, request, "", tolerance=posterior.tolerance, reached=posterior.error)


def _evidence(problem: Problem, request: Request) -> float:
    """The log evidence of another question, while there is time for it.

    Raises
    ------
    TimeoutError
        If there is no time for it.
    """
    if request.over:
        raise TimeoutError
    if no_grid(problem):
        return sampled_posterior(problem, least_squares(problem)).log_evidence
    found = integrate(problem, _OTHERS, over=lambda: request.over)
    if found.error_evidence > _OTHERS:
        raise TimeoutError
    return found.log_evidence


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
    fact = Fact(False, effort.missed, figures, converged.threshold)
    return replace(found, effort=effort, diagnostics={**found.diagnostics, "converged": fact})


def refine(
    problem: Problem,
    start: LeastSquaresFit,
    request: Request,
    integrate: Integrate = integrate,
    *,
    must: bool = False,
) -> QuadraturePosterior | None:
    """Integrate the posterior as exactly as asked, or as the budget allows.

    With a budget the tolerance goes down in steps, as long as the next one, foreseen from the last ones,
    fits into what is left; a step that takes longer than foreseen is cut short. Where a tolerance is not
    reached the next one is tried all the same: it begins with finer rules, which come through where coarse
    ones get stuck.

    Parameters
    ----------
    problem : Problem
    start : LeastSquaresFit
    request : Request
    integrate : callable
        As `ifrfit.inference.posterior.adaptive_quadrature`.
    must : bool
        Whether the coarsest tolerance is worked out however long it takes.

    Returns
    -------
    Posterior or None
        The one with the least error; None where the budget ended before any error was small.

    Raises
    ------
    UsageError, DataError
        As `integrate`; a grid too large for memory only where the coarsest tolerance needs it.
    """
    best: QuadraturePosterior | None = None
    latest: QuadraturePosterior | None = None
    last = before = 0.0
    for tolerance in ladder(request.accuracy, request.budget is not None):
        if latest is not None and (_enough(latest, request) or foreseen(latest, last, before) > request.left):
            break
        first = must and best is None
        if request.over and not first:
            break
        begin = request.clock()
        try:
            latest = integrate(problem, tolerance, start, over=None if first else lambda: request.over)
        except TimeoutError:
            break
        except GridTooLargeError:  # a first grid grows as its tolerance falls
            if best is None:
                raise
            break
        last, before = request.clock() - begin, last
        is_better = best is None or latest.error <= best.error
        if not is_better and not latest.converged:
            break
        best = latest if is_better else best
    if best is None or (request.budget is not None and not must and best.error > LADDER[0]):
        return None
    if request.accuracy is not None and _enough(best, request):
        return replace(best, tolerance=max(best.tolerance, request.accuracy))
    return best


def ladder(accuracy: float | None, from_the_top: bool) -> tuple[float, ...]:
    """Tolerances from coarse to fine: to the asked accuracy, and further where it is not reached there."""
    if accuracy is None:
        return LADDER
    coarser = tuple(tolerance for tolerance in LADDER if tolerance > _NEAR * accuracy)
    finer = tuple(tolerance for tolerance in LADDER if tolerance < accuracy / _NEAR)
    return (*(coarser if from_the_top else ()), accuracy, *finer)


def foreseen(found: QuadraturePosterior, last: float, before: float) -> float:
    """Seconds that the next tolerance will take.

    Parameters
    ----------
    found : QuadraturePosterior
        The last one.
    last, before : float
        Seconds that it took, and the one before; 0 where there was none.
    """
    if not found.converged:  # it was given up, which takes longest
        return last
    return last * max(_GROWTH, last / before if before > 0.0 else 0.0)


def _enough(found: QuadraturePosterior, request: Request) -> bool:
    return request.accuracy is not None and max(found.error, found.error_evidence) <= request.accuracy
