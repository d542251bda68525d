"""A fit with the bootstrap's law in the place of the local picture, and what there is to say of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ifrfit.inference.bootstrap.estimator import Bootstrap
from ifrfit.inference.bootstrap.replicate_fits import NO_E_N, NO_SLIDING
from ifrfit.inference.diagnostics.identifiability import only_kappa_is_seen
from ifrfit.inference.diagnostics.thresholds import FACTS, FAILED
from ifrfit.inference.distributions.draws import Draws
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.laplace import GaussianApproximation
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.method_results import with_law
from ifrfit.inference.result.types import Estimate, Fact, Interval
from ifrfit.inference.summary.kappa import kappa_bounds

_LOADED = 1e-6  # share of the prior sd from which on a constant takes part in a loose combination
_FEWEST = 20  # replicates with an answer below which they are no law of anything

GAUSSIAN = (
    "Draws and bands are those of the Gaussian around the optimum: replicates say nothing of what the data "
    "leave open."
)
ANSWERED = "Draws and bands are those of the replicates that have an answer."
APART = (
    "Rows of one impact were drawn apart, so errors that they share are lost: --resample cases or wild keeps "
    "them."
)


def with_draws(result: FitResult, found: Bootstrap) -> FitResult:
    """Constants, derived quantities and noise from the draws; percentile intervals.

    What more than 1 % of the replicates leave open gets no value: they would all lie beyond one end of its
    interval, and nobody knows how far.
    """
    problem = result.problem
    converged = _converged(found, result.facts["converged"])
    told = replace(result, constants=_opened(result.constants, found), derived=_derived(result, found))
    warnings = result.warnings
    if found.splits_impacts:
        warnings = (*warnings, APART)
    law = Draws.of(problem, found.draws) if found.answered >= _FEWEST else None
    if law is not None:
        told = with_law(told, "bootstrap", law, converged, posterior=False)
    if law is None or _leaves_open(problem, result.least_squares.gaussian):
        told = replace(told, method="bootstrap", law=None, state=result.state)
        warnings = (*warnings, GAUSSIAN)
    elif found.failed > FAILED * found.replicates:
        warnings = (*warnings, ANSWERED)
    says = f"too few to draw from: {found.shortage}" if found.shortage else "enough to draw from"
    facts = {**told.facts, "converged": converged}
    facts["resampling"] = Fact(not found.shortage, says, {"scheme": found.scheme}, FACTS["resampling"])
    return replace(told, facts=facts, warnings=warnings)


def _converged(found: Bootstrap, settled: Fact) -> Fact:
    """Whether nearly every replicate has an answer, and the fit that they start from has settled."""
    figures = {
        "scheme": found.scheme,
        "replicates": found.replicates,
        "failed": found.failed,
        "reasons": dict(found.reasons),
        "certified": found.certified,
    } | dict(settled.figures)
    many = found.failed > FAILED * found.replicates
    if not settled.ok:
        says = settled.says
    elif not found.failed:
        says = f"all {found.replicates:,} replicates have an answer"
    else:
        counted = sorted(found.reasons.items(), key=lambda item: -item[1])
        why = "; ".join(f"{reason} ({count:,})" for reason, count in counted)
        says = f"{found.failed:,} of {found.replicates:,} replicates have no answer: {why}"
        if many:
            says += (
                f". More than {100 * FAILED:g} % are too many for a 95 % interval: measure more impacts of "
                "the kind that is missing, or use --method exact"
            )
    return Fact(settled.ok and not many, says, figures, FACTS["converged"])


def _opened(local: Mapping[str, Any], found: Bootstrap) -> dict[str, Any]:
    """The local estimates, without values for what too many replicates leave open."""
    parameters = found.problem.parameters

    def opened(name: str, series: str, estimate: Estimate) -> Estimate:
        label = f"{name}[{series}]" if series else name
        whole = parameters[name].lower, parameters[name].upper
        return _open(found, label, found.open.get(label, {}), estimate, whole)

    return {
        name: opened(name, "", entry)
        if isinstance(entry, Estimate)
        else {series: opened(name, series, each) for series, each in entry.items()}
        for name, entry in local.items()
    }


def _derived(result: FitResult, found: Bootstrap) -> dict[str, Any]:
    """The same for kappa, which is open where mu is, unless it is only that e_n was lost."""
    problem, kappa = found.problem, result.derived["kappa"]
    separate = problem.parameters["mu"].separate

    def opened(number: int, estimate: Estimate) -> Estimate:
        series = problem.series[number]
        reasons = found.open.get(f"mu[{series}]" if separate else "mu", {})
        reasons = {why: n for why, n in reasons.items() if why != NO_E_N}
        name = f"kappa[{series}]" if f"kappa[{series}]" in found.kappas else "kappa"
        return _open(found, name, reasons, estimate, kappa_bounds(problem, number))

    if isinstance(kappa, Estimate):
        return {**result.derived, "kappa": opened(0, kappa)}
    each = {series: opened(i, kappa[series]) for i, series in enumerate(problem.series)}
    return {**result.derived, "kappa": each}


def _open(
    found: Bootstrap, name: str, reasons: Mapping[str, int], local: Estimate, whole: Interval
) -> Estimate:
    """An estimate without a value if too many replicates leave it open."""
    count = sum(reasons.values())
    if local.value is None or local.status == "fixed" or count <= FAILED * found.replicates:
        return local
    reason = f"{count:,} of {found.replicates:,} replicates leave it open"
    draws = {**found.draws, **found.kappas}[name]
    if set(reasons) == {NO_SLIDING} and draws.size:
        ends = [(float(np.quantile(draws, p)), math.inf) for p in (0.32, 0.05)]
        return Estimate(None, None, ends[0], ends[1], "one_sided", f"only a lower limit: {reason}")
    return Estimate(None, None, whole, whole, "not_determined", reason)


def _leaves_open(problem: Problem, local: GaussianApproximation) -> bool:
    """Whether the data leave anything loose, but e_n and mu that only share kappa."""
    prior_sd = np.array([c.prior_sd for c in problem.parameters.entries])
    loose = np.abs(local.vectors[:, ~local.seen]) > _LOADED * prior_sd[:, None]
    if only_kappa_is_seen(problem):
        loose[sorted(set(problem.parameters.positions["e_n"].tolist()))] = False
    return bool(loose.any())
