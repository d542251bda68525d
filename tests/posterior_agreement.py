"""How far a posterior is from what is known about it, in posterior standard deviations."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from posterior_questions import LEVELS
from scipy import special

from ifrfit.inference.diagnostics.thresholds import SAMPLING_ERROR
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.posterior import integrate
from ifrfit.inference.posterior.transition_quadrature import transition_posterior

# where a bound of mu cuts panels of kappa, the general integral splits them at kappa's quantiles; elsewhere
# its distribution function is good to this (measured: 1.3e-5 at most, where two others agree to 1e-11)
_OF_GENERAL_CDF = 2e-5


def normal(mean: float, sd: float) -> dict[str, Any]:
    """A normal law."""
    return {"mean": mean, "sd": sd, "quantiles": [mean + sd * float(special.ndtri(p)) for p in LEVELS]}


def uniform(low: float, high: float) -> dict[str, Any]:
    """A uniform law."""
    return {
        "mean": 0.5 * (low + high),
        "sd": (high - low) / math.sqrt(12.0),
        "quantiles": [low + p * (high - low) for p in LEVELS],
    }


def distances(post: Any, known: Mapping[str, Any]) -> dict[str, float]:
    """Every mean, sd and quantile against the known one, in known sd; the log evidence absolute.

    `known`: log_evidence and quantities, each with mean, sd and, where they are known, quantiles at `LEVELS`.
    """
    found = {"log evidence": abs(post.log_evidence - known["log_evidence"])}
    for name, law in known["quantities"].items():
        sd = law["sd"]
        found[f"mean {name}"] = abs(post.mean(name) - law["mean"]) / sd
        found[f"sd {name}"] = abs(post.sd(name) / sd - 1.0)
        if "quantiles" in law:
            off = np.abs(np.asarray(post.quantile(name, np.array(LEVELS))) - np.array(law["quantiles"])) / sd
            for level, x in zip(LEVELS, off.tolist(), strict=True):
                found[f"{100 * level:g} % {name}"] = x
    return found


def check(post: Any, known: Mapping[str, Any], tolerance: float) -> None:
    """Every known number within the tolerance, the names as they should be, and the claims honest."""
    assert set(post.names) == set(known["quantities"]), (post.names, tuple(known["quantities"]))
    far = {what: x for what, x in distances(post, known).items() if not x <= tolerance}
    assert not far, far
    assert post.converged, (post.error, post.error_evidence)


def agree(sampled: Any, exact: Any, by_probability: bool = False) -> None:
    """A sampled posterior within four of its standard errors, which are themselves small, of the exact one.

    `by_probability`: a quantile may instead be off by as much in probability as a normal law's would be.
    """
    assert sampled.converged
    assert sampled.error <= SAMPLING_ERROR
    assert abs(sampled.log_evidence - exact.log_evidence) <= 4.0 * sampled.error_evidence + 1e-3
    allowed = 4.0 * sampled.error
    for name in exact.names:
        sd = exact.sd(name)
        if sd == 0.0:
            continue
        assert abs(sampled.mean(name) - exact.mean(name)) <= allowed * sd, name
        assert abs(sampled.sd(name) - sd) <= allowed * sd, name
        at = np.asarray(sampled.quantile(name, LEVELS))
        off = np.abs(at - exact.quantile(name, LEVELS)) / sd
        if by_probability:
            of_normal = np.array([0.058, 0.243, 0.399, 0.243, 0.058])
            off = np.minimum(off, np.abs(exact.cdf(name, at) - np.array(LEVELS)) / of_normal)
        assert (off <= allowed).all(), name


def furthest_from_general(problem: Problem, tolerance: float) -> float | None:
    """Largest difference from the general integral, in sd; None where the question is left to that."""
    start = least_squares(problem)
    found = transition_posterior(problem, tolerance, start)
    if found is None:
        return None
    assert found.converged
    assert found.error <= tolerance
    general = integrate(problem, 1e-2 * tolerance, start)
    assert general.converged
    assert found.names == general.names
    apart = [abs(found.log_evidence - general.log_evidence)]
    for name in found.names:
        mean, sd = general.mean(name), general.sd(name)
        near = mean + sd * np.linspace(-4.0, 4.0, 9)
        apart += [
            abs(found.mean(name) - mean) / sd,
            abs(found.sd(name) / sd - 1.0),
            float(np.abs(found.quantile(name, LEVELS) - general.quantile(name, LEVELS)).max()) / sd,
            float(np.abs(found.cdf(name, near) - general.cdf(name, near)).max())
            - _OF_GENERAL_CDF * (name == "kappa"),
        ]
    constants = found.names[:3]
    scale = [general.sd(name) for name in constants]
    between = found.covariance(constants) - general.covariance(constants)
    apart.append(float((np.abs(between) / np.outer(scale, scale)).max()))
    ends = np.array([one.quantile("transition_tau[run]", LEVELS) for one in (found, general)])
    per_tau = problem.inertia_factor / general.sd("kappa")  # tau is kappa/J
    return max(*apart, float(np.abs(ends[0] - ends[1]).max()) * per_tau)
