"""What a method adds to the certified optimum that every fit starts from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ifrfit.inference.diagnostics.collect import at_bound
from ifrfit.inference.diagnostics.identifiability import identifiable
from ifrfit.inference.diagnostics.pooling import sharing
from ifrfit.inference.diagnostics.predictive_checks import predictive
from ifrfit.inference.diagnostics.quadrature_convergence import quadrature_convergence
from ifrfit.inference.distributions.protocol import Distribution
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.posterior import TOLERANCE, QuadraturePosterior, integrate
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Fact
from ifrfit.inference.summary.distribution_estimates import (
    DRAWS,
    constants_from_law,
    correlation_from_law,
    derived_from_law,
    noise_from_law,
    state_from_law,
)

if TYPE_CHECKING:
    from ifrfit.inference.mcmc import Evidence

COARSE = 1e-3  # tolerance where the scatter is not plain: every node costs all rows
_CHECKED = 300  # draws behind the posterior predictive checks


def with_posterior(result: FitResult, tolerance: float | None = None) -> FitResult:
    """Put the exact posterior in the place of the local picture; the facts about the optimum stay."""
    problem = result.problem
    if tolerance is None:
        tolerance = TOLERANCE if problem.error_model.is_plain else COARSE
    posterior = integrate(problem, start=result.least_squares, tolerance=tolerance)
    return with_explored(result, posterior, integrate)


def with_explored(
    result: FitResult,
    posterior: QuadraturePosterior,
    integrate: Callable[[Problem], QuadraturePosterior] | None,
) -> FitResult:
    """The same with this posterior; other questions about sharing are put to `integrate`, if there is one."""
    converged = quadrature_convergence(posterior, result.facts["converged"])
    found = with_law(result, "exact", posterior, converged)
    facts = dict(found.facts)
    shared = None if integrate is None else sharing(result.problem, posterior.log_evidence, integrate)
    if shared is not None:
        facts["sharing"] = shared
    return replace(found, fit=replace(found.fit, log_evidence=posterior.log_evidence), facts=facts)


def with_law(
    result: FitResult, method: str, law: Distribution, converged: Fact, *, posterior: bool = True
) -> FitResult:
    """Put a law of the constants in the place of the local picture; the facts about the optimum stay.

    Parameters
    ----------
    result : FitResult
        Of least squares.
    method : str
    law : Distribution
    converged : Fact
    posterior : bool
        Whether the law is one: then predictive checks are made, and the prior of the noise is told.
    """
    problem, found = result.problem, result.least_squares
    rng = np.random.default_rng(result.seed)
    constants = constants_from_law(problem, law, result.constants)
    facts = dict(result.facts)
    facts["converged"] = converged
    facts["identifiable"] = identifiable(
        problem, found, constants, result.fit.n_sticking, result.fit.n_sliding
    )
    facts["at_bound"] = at_bound(constants)
    n = int(min(DRAWS, law.kept))
    drawn = law.draws(n, rng)
    state = state_from_law(problem, law, result.state, drawn, n)
    if posterior:
        facts["predictive"] = predictive(problem, {name: x[:_CHECKED] for name, x in drawn.items()})
    names = result.correlation[0]
    return replace(
        result,
        method=method,
        noise=noise_from_law(problem, law, result.noise, problem.noise_bounds() if posterior else {}),
        constants=constants,
        derived=derived_from_law(problem, law, result.derived, constants),
        correlation=(names, correlation_from_law(law, names)),
        facts=facts,
        state=state,
        law=law,
    )


def with_chains(
    result: FitResult,
    *,
    max_steps: int | None = None,
    workers: int = 1,
    resume: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
    halt: Callable[[Evidence], bool] | None = None,
) -> FitResult:
    """Put a sample of the posterior in the place of the local picture; see `ifrfit.inference.mcmc.sample`."""
    from importlib.metadata import version

    from ifrfit.inference import mcmc

    drawn = mcmc.sample(
        result.problem,
        result.least_squares,
        result.seed,
        max_steps=mcmc.MAX_STEPS if max_steps is None else max_steps,
        workers=workers,
        resume=resume,
        progress=progress,
        halt=halt,
    )
    converged = mcmc.sample_converged(drawn, result.facts["converged"])
    versions = dict(result.versions) | {name: version(name) for name in ("emcee", "arviz-stats")}
    return replace(with_law(result, "mcmc", drawn.law, converged), sample=drawn, versions=versions)


def with_replicates(
    result: FitResult,
    scheme: str | None,
    replicates: int | None,
    workers: int,
    progress: Callable[[int, int], None] | None,
) -> FitResult:
    """Put the law of the bootstrap in the place of the local picture."""
    from ifrfit.inference.bootstrap import REPLICATES, bootstrap
    from ifrfit.inference.bootstrap.summary import with_draws

    found = bootstrap(
        result.problem,
        result.least_squares,
        scheme="cases" if scheme is None else scheme,
        replicates=REPLICATES if replicates is None else replicates,
        seed=result.seed,
        workers=workers,
        progress=progress,
    )
    return with_draws(result, found)


def with_profiles(result: FitResult) -> FitResult:
    """Put profile intervals in the place of the local ones."""
    from ifrfit.inference.profile.convergence_fact import profile_converged
    from ifrfit.inference.profile.profile_all import profiled_estimates

    problem, found = result.problem, result.least_squares
    constants, derived, profiles = profiled_estimates(problem, found)
    facts = dict(result.facts)
    facts["identifiable"] = identifiable(
        problem, found, constants, result.fit.n_sticking, result.fit.n_sliding
    )
    facts["at_bound"] = at_bound(constants)
    facts["converged"] = profile_converged(profiles, facts["converged"])
    return replace(
        result, method="profile", constants=constants, derived=derived, facts=facts, profiles=profiles
    )
