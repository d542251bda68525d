"""From a problem, its optimum and an estimation to the result of a fit."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ifrfit.inference.diagnostics.collect import at_bound
from ifrfit.inference.diagnostics.identifiability import identifiable
from ifrfit.inference.diagnostics.omitted_effects.experimental_conditions import Setting
from ifrfit.inference.diagnostics.predictive_checks import predictive
from ifrfit.inference.distributions.protocol import Distribution
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquares
from ifrfit.inference.profile.profile_all import estimates_of_profiles
from ifrfit.inference.result.estimation import Estimation, Unresolved
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.least_squares_result import optimum_of
from ifrfit.inference.result.types import Estimate, Fact, Interval
from ifrfit.inference.summary.distribution_estimates import (
    DRAWS,
    constants_from_law,
    correlation_from_law,
    derived_from_law,
    noise_from_law,
    state_from_law,
)
from ifrfit.inference.summary.kappa import kappa_bounds

_CHECKED = 300  # draws behind the posterior predictive checks


def build_result(
    problem: Problem,
    optimum: LeastSquares,
    estimation: Estimation,
    *,
    seed: int = 0,
    command: str = "",
    conditions: Setting | None = None,
    brief: bool = False,
) -> FitResult:
    """The result of a fit.

    Parameters
    ----------
    problem : Problem
    optimum : LeastSquares
        Of the problem.
    estimation : Estimation
        What the method found beyond the optimum.
    seed : int
        Of the draws and bands.
    command : str
        The command line, for the record.
    conditions : Setting, optional
        The scene of the data, for the effects' criteria.
    brief : bool
        Leave out what takes further fits and serves readers of this one alone: outliers, remedies, effects.
    """
    result = optimum_of(problem, seed, command, conditions, brief=brief, found=optimum)
    return with_estimation(result, estimation)


def with_estimation(result: FitResult, estimation: Estimation) -> FitResult:
    """Put what a method found in the place of the local picture; the facts about the optimum stay."""
    local, converged = result, estimation.diagnostics["converged"]
    if estimation.profiles:
        result = _with_profiles(result, estimation)
    if estimation.unresolved:
        result = _with_unresolved(result, estimation.unresolved)
    own = estimation.distribution
    if own is not None:
        result = with_law(result, estimation.method, own, converged, posterior=estimation.is_posterior)
    if not estimation.predicts:
        result = replace(result, law=None, state=local.state)
    return replace(
        result,
        method=estimation.method,
        fit=replace(result.fit, log_evidence=estimation.log_evidence),
        facts={**result.facts, **estimation.diagnostics},
        warnings=(*result.warnings, *estimation.warnings),
        effort=estimation.effort,
        versions={**result.versions, **estimation.versions},
        sample=estimation.files.get("chains.npz"),
    )


def _with_profiles(result: FitResult, estimation: Estimation) -> FitResult:
    problem, found = result.problem, result.least_squares
    constants, derived = estimates_of_profiles(problem, found, estimation.profiles)
    counts = result.fit
    facts = dict(result.facts)
    facts["identifiable"] = identifiable(problem, found, constants, counts.n_sticking, counts.n_sliding)
    facts["at_bound"] = at_bound(constants)
    return replace(result, constants=constants, derived=derived, facts=facts, profiles=estimation.profiles)


def _with_unresolved(result: FitResult, unresolved: Mapping[str, Unresolved]) -> FitResult:
    """The local estimates, without values for what the method leaves open."""
    problem = result.problem
    parameters = problem.parameters

    def each_of(name: str, entry: Estimate | Mapping[str, Estimate], whole: Sequence[Interval]) -> Any:
        def opened(number: int, series: str, estimate: Estimate) -> Estimate:
            why = unresolved.get(f"{name}[{series}]", unresolved.get(name))
            return estimate if why is None else _open(estimate, why, whole[number])

        if isinstance(entry, Estimate):
            return opened(0, "", entry)
        return {series: opened(i, series, entry[series]) for i, series in enumerate(problem.series)}

    constants = {}
    for name, entry in result.constants.items():
        domain = parameters[name].lower, parameters[name].upper
        constants[name] = each_of(name, entry, [domain] * len(problem.series))
    bounds = [kappa_bounds(problem, number) for number in range(len(problem.series))]
    kappa = each_of("kappa", result.derived["kappa"], bounds)
    return replace(result, constants=constants, derived={**result.derived, "kappa": kappa})


def _open(local: Estimate, why: Unresolved, whole: Interval) -> Estimate:
    if local.value is None or local.status == "fixed":
        return local
    if why.lower68 is None or why.lower95 is None:
        return Estimate(None, None, whole, whole, "not_determined", why.reason)
    ends = (why.lower68, math.inf), (why.lower95, math.inf)
    return Estimate(None, None, *ends, "one_sided", f"only a lower limit: {why.reason}")


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
