"""What a method adds to the certified optimum that every fit starts from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ifrfit.inference.exact import (
    exact_constants,
    exact_converged,
    exact_correlation,
    exact_derived,
    exact_noise,
    exact_state,
)
from ifrfit.inference.facts import at_bound
from ifrfit.inference.identifiability import identifiable
from ifrfit.inference.posterior import TOLERANCE, explore
from ifrfit.inference.posterior.noise import noise_bounds
from ifrfit.inference.predictive import predictive
from ifrfit.inference.result import FitResult
from ifrfit.inference.sharing import sharing

COARSE = 1e-3  # tolerance where the scatter is not plain: every node costs all rows
_CHECKED = 300  # draws behind the posterior predictive checks


def with_posterior(result: FitResult) -> FitResult:
    """Put the exact posterior in the place of the local picture; the facts about the optimum stay."""
    problem, found = result.problem, result.least_squares
    posterior = explore(problem, start=found, tolerance=TOLERANCE if problem.scatter.is_plain else COARSE)
    rng = np.random.default_rng(result.seed)
    constants = exact_constants(problem, posterior, result.constants)
    fit = replace(result.fit, log_evidence=posterior.log_evidence)
    facts = dict(result.facts)
    facts["converged"] = exact_converged(posterior, facts["converged"])
    facts["identifiable"] = identifiable(problem, found, constants, fit.n_sticking, fit.n_sliding)
    facts["at_bound"] = at_bound(constants)
    state = exact_state(problem, posterior, result.state, rng)
    facts["predictive"] = predictive(problem, posterior.draws(_CHECKED, rng))
    shared = sharing(problem, posterior.log_evidence, explore)
    if shared is not None:
        facts["sharing"] = shared
    names = result.correlation[0]
    return replace(
        result,
        method="exact",
        noise=exact_noise(problem, posterior, result.noise, noise_bounds(problem)),
        constants=constants,
        derived=exact_derived(problem, posterior, result.derived, constants),
        correlation=(names, exact_correlation(posterior, names)),
        fit=fit,
        facts=facts,
        state=state,
        posterior=posterior,
    )


def with_profiles(result: FitResult) -> FitResult:
    """Put profile intervals in the place of the local ones."""
    from ifrfit.inference.profiling import profile_converged, profiled_estimates

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
