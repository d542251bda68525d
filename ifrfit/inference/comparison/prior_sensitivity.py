"""The priors behind the evidence, and how the evidence moves with their widths."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import DataError, UsageError
from ifrfit.inference.comparison.result import HOPELESS, PriorRow
from ifrfit.inference.diagnostics.friction_beyond_prior import BeyondPrior, beyond_prior
from ifrfit.inference.model.entry_names import quantity_of
from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array
from ifrfit.inference.optimize.least_squares import followed
from ifrfit.inference.posterior import (
    ExactPosterior,
    ImportancePosterior,
    QuadraturePosterior,
    log_evidence,
)
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.restore import posterior_of
from ifrfit.inference.result.types import Interval
from ifrfit.physics.closures import get_closure

MU_WIDTHS = (0.25, 0.5, 2.0)  # times the stated width: 0.5, 1 and 4 of the default 2
OWN_WIDTH = 0.5
_NOTHING = 1e-6  # share of the posterior that no evidence feels
_ENOUGH = 1e-3  # share of a posterior, within or outside, that its distribution function tells
_DRAWS = 20_000  # behind a joint share
_ERROR_OF_SHARE = 0.02  # standard error of its logarithm that will do


def prior_of(problem: Problem) -> dict[str, dict[str, float]]:
    """Prior of each free constant: ends of a uniform one, with mean and sd of the user's."""
    found = {}
    for constant in problem.parameters:
        if constant.fixed is None:
            unknown = FreeParameter.of(constant.name, constant)
            found[constant.name] = {"lower": unknown.lower, "upper": unknown.upper}
            if constant.prior is not None:
                found[constant.name] |= {"mean": constant.prior[0], "sd": constant.prior[1]}
    return found


def optima_beyond_priors(fits: Mapping[str, FitResult]) -> dict[str, BeyondPrior]:
    """Closures whose optimum lies beyond their prior: criteria and evidence are of other constants."""
    found = {name: beyond_prior(*fit.problem_and_optimum()) for name, fit in fits.items()}
    return {name: beyond for name, beyond in found.items() if beyond is not None}


def words_beside_criteria(closure: str, beyond: BeyondPrior) -> str:
    """What stands beside criteria that are of the best point of the domain, not of the prior."""
    return (
        f"AIC, BIC and p of fit of {get_closure(closure).title} are of {beyond.places}; its evidence is of "
        f"the prior, {beyond.ends}, where AIC is {beyond.gain:.3g} more."
    )


def prior_table(
    fits: Mapping[str, FitResult], beyond: Mapping[str, BeyondPrior] | None = None
) -> tuple[PriorRow, ...]:
    """Log evidences with wider and narrower priors, one change at a time.

    The end of mu's uniform prior moves for all closures together. Each closure's own constant is held to
    half its domain, placed about its posterior median: the narrowest that a favourable colleague may have
    chosen, which raises that closure's evidence by log 2 at most. The domains are the widest that create no
    energy already, so they are not widened. Constants that are fixed or have a prior of the user's stay.
    A closure without hope is not integrated afresh: where its posterior does not tell, it has no number. One
    whose optimum lies beyond the prior has as much hope as there, and a row reaches beyond that, up to 10.

    Parameters
    ----------
    fits : mapping of str to FitResult
    beyond : mapping of str to BeyondPrior, optional
        Closures whose optimum lies beyond their prior.
    """
    beyond = beyond or {}
    stated = {name: _log_evidence(fit) for name, fit in fits.items()}
    gains = {name: 0.5 * each.gain for name, each in beyond.items()}
    hopeful = {n for n, own in stated.items() if own + gains.get(n, 0.0) >= max(stated.values()) - HOPELESS}
    rows = [PriorRow("", dict(stated))]
    problems = {name: fit.problem_and_optimum()[0] for name, fit in fits.items()}
    mu = _varied(next(iter(problems.values())), "mu")
    if mu is not None:
        low, high = mu.lower, FreeParameter.of("mu", mu).upper
        uppers = [low + width * (high - low) for width in MU_WIDTHS]
        rooms = [beyond[name].room for name in hopeful & beyond.keys()]
        farthest = max((room for room in rooms if math.isfinite(room)), default=0.0)
        if farthest > uppers[-1]:
            uppers.append(farthest)
        for upper in uppers:
            ends = low, upper
            found = {n: _evidence(fit, "mu", ends, afresh=n in hopeful) for n, fit in fits.items()}
            rows.append(PriorRow(f"mu up to {upper:g}", found, upper))
    for name, problem in problems.items():
        closure = get_closure(name)
        own = _varied(problem, closure.constant) if closure.constant else None
        if own is None:
            continue
        ends = _half(posterior_of(fits[name]), _labels(problem, own.name), own)
        words = f"{own.name} of {closure.title} in [{ends[0]:.4g}, {ends[1]:.4g}]"
        evidence = _evidence(fits[name], own.name, ends, afresh=name in hopeful)
        rows.append(PriorRow(words, stated | {name: evidence}))
    return tuple(rows)


def _log_evidence(fit: FitResult) -> float:
    return float(posterior_of(fit).log_evidence)


def _varied(problem: Problem, name: str) -> Parameter | None:
    """The constant, if it is free under a uniform prior."""
    constant = problem.parameters[name]
    return constant if constant.fixed is None and constant.prior is None else None


def _labels(problem: Problem, name: str) -> list[str]:
    """Entries of theta that a constant has."""
    return [entry for entry in problem.parameters.names if quantity_of(entry) == name]


def _half(posterior: ExactPosterior, labels: Sequence[str], constant: Parameter) -> Interval:
    """Part of the domain, half as wide, about the posterior median (the mean of several)."""
    medians = [float(posterior.quantile(label, 0.5)) for label in labels]
    width = OWN_WIDTH * (constant.upper - constant.lower)
    low = min(max(float(np.mean(medians)) - 0.5 * width, constant.lower), constant.upper - width)
    return low, min(low + width, constant.upper)


def _share_between(posterior: ExactPosterior, labels: Sequence[str], ends: Interval) -> float | None:
    """Share of a posterior in which all entries lie between two ends; None where its digits are too few."""
    cuts = [np.asarray(posterior.cdf(label, np.array(ends))) for label in labels]
    outside = sum(1.0 - float(upper - lower) for lower, upper in cuts)
    if len(labels) == 1 or outside <= _ENOUGH:
        return 1.0 - outside if 1.0 - outside > _ENOUGH else None

    def inside(drawn: Mapping[str, Array]) -> NDArray[np.bool_]:
        each = [(drawn[label] >= ends[0]) & (drawn[label] <= ends[1]) for label in labels]
        return np.asarray(np.all(each, axis=0))

    rng = np.random.default_rng(0)
    if isinstance(posterior, ImportancePosterior):
        share, error = posterior.share_of(inside(posterior.values))
        return share if error <= _ERROR_OF_SHARE else None
    if isinstance(posterior, QuadraturePosterior):
        share = float(inside(posterior.draws(_DRAWS, rng, labels)).mean())
    else:
        share = float(inside(posterior.draws(_DRAWS, rng)).mean())
    error = math.sqrt((1.0 - share) / max(share * min(_DRAWS, posterior.n_draws), 1e-300))
    return share if error <= _ERROR_OF_SHARE else None


def _evidence(fit: FitResult, name: str, ends: Interval, *, afresh: bool) -> float | None:
    """Log evidence with a uniform prior of one constant between other ends.

    A narrower uniform prior cuts the posterior: the evidence gains the ratio of the widths and keeps the
    posterior's share between the ends, that of several entries by joint draws, where these tell it well. A
    wider one loses that ratio where the posterior has died out in the upper half of the old domain; else it
    is integrated afresh, or None.
    """
    problem, optimum = fit.problem_and_optimum()
    posterior = posterior_of(fit)
    old = FreeParameter.of(name, problem.parameters[name])
    labels = _labels(problem, name)
    if old.lower <= ends[0] and ends[1] <= old.upper:
        share = _share_between(posterior, labels, ends)
        if share is not None:
            gain = math.log((old.upper - old.lower) / (ends[1] - ends[0]))
            return _log_evidence(fit) + len(labels) * gain + math.log(share)
    if ends[0] == old.lower and ends[1] >= old.upper:
        middle = 0.5 * (old.lower + old.upper)
        if all(1.0 - float(np.asarray(posterior.cdf(label, middle))) <= _NOTHING for label in labels):
            ratio = (old.upper - old.lower) / (ends[1] - ends[0])
            return _log_evidence(fit) + len(labels) * math.log(ratio)
    if not afresh:
        return None
    moved = replace(problem.parameters[name], lower=ends[0], upper=ends[1])
    at = np.array([optimum.optimum.theta[problem.parameters.names.index(label)] for label in labels])
    inside = bool(((at > max(ends[0], old.lower)) & (at < min(ends[1], old.upper))).all())
    other = problem.with_parameters([moved])
    try:
        # an optimum that neither domain cuts is where to begin in both
        start = optimum if inside else followed(other, optimum)
        return log_evidence(other, posterior.tolerance, start)
    except (UsageError, DataError):  # a domain that this closure cannot have
        return None
