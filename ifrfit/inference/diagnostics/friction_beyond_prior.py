"""A best friction beyond the end of its default prior, which every posterior ends at."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from ifrfit.inference.diagnostics.thresholds import FACTS, FRICTION_OF_NO_CONTACT, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares
from ifrfit.inference.optimize.noise_modes import likely_sigma
from ifrfit.inference.result.types import Fact
from ifrfit.text import joined

_ROOM = 1.2  # times the best friction, to which a prior should reach
_COST_OF_CONSTANT = 2.0  # in AIC


@dataclass(frozen=True)
class BeyondPrior:
    """Optimum of least squares that lies beyond the end of a prior.

    Attributes
    ----------
    optimum, upper : mapping of str to float
        Of each entry that is beyond: where the optimum lies, and where the prior ends.
    gain : float
        Fall of minus twice the log likelihood from the best point within the prior.
    """

    optimum: Mapping[str, float]
    upper: Mapping[str, float]
    gain: float

    @property
    def room(self) -> float:
        """Where a prior should end; infinite where the optimum is a friction of no contact."""
        farthest = _ROOM * max(self.optimum.values())
        return math.inf if farthest > FRICTION_OF_NO_CONTACT else float(math.ceil(farthest))

    @property
    def places(self) -> str:
        """Where the optimum lies, in words."""
        return joined([f"{name} = {value:.3g}" for name, value in self.optimum.items()])

    @property
    def ends(self) -> str:
        """Where the prior ends, in words."""
        return joined([f"{name} up to {end:g}" for name, end in self.upper.items()])


def beyond_prior(problem: Problem, fit: LeastSquaresFit) -> BeyondPrior | None:
    """Where the optimum lies beyond a prior, by more than a constant costs in AIC; None where it does not.

    An open mu has no end for least squares, and its default prior has one: then a posterior is of the rest
    that the prior leaves. Errors that are not plain are not looked at.
    """
    theta = fit.optimum.theta
    pairs = zip(problem.free_parameters, theta[problem.parameters.free], strict=True)
    beyond = {unknown: float(value) for unknown, value in pairs if value > unknown.upper}
    is_plain = problem.error_model.is_plain and problem.common is None and problem.offset is None
    if not (beyond and is_plain and all(map(math.isfinite, beyond.values()))):
        return None
    within = least_squares(problem.within_prior(), proven=False)
    gain = 2.0 * (_log_likelihood(problem, theta) - _log_likelihood(problem, within.optimum.theta))
    if gain <= _COST_OF_CONSTANT:
        return None
    optima = {unknown.name: value for unknown, value in beyond.items()}
    return BeyondPrior(optima, {unknown.name: unknown.upper for unknown in beyond}, gain)


def _log_likelihood(problem: Problem, theta: Array) -> float:
    """At constants, with the noise that makes it largest there; less what is the same for all constants."""
    sigma = problem.noise.sigma if problem.noise.is_known else likely_sigma(problem, theta)
    return float(-0.5 * np.sum((problem.residual(theta) / sigma) ** 2) - np.log(sigma).sum())


def friction_beyond_prior(problem: Problem, fit: LeastSquaresFit) -> Fact | None:
    """Whether the prior cuts the best friction off, and with it moves every constant of a posterior.

    Returns
    -------
    Fact or None
        None where it does not, or the data hardly say so.
    """
    found = beyond_prior(problem, fit)
    if found is None or (p := float(chdtrc(1, found.gain))) >= REFUTED:
        return None
    says = (
        f"the best friction lies beyond its prior: {found.places} describes the data better than any "
        f"{found.ends} does (by {found.gain:.3g} in -2 log likelihood), and the posterior of every constant "
        "is of what the prior leaves. "
    )
    if math.isinf(found.room):
        says += "No contact has such a friction: compare closures, and look at the signs and units"
    else:
        says += f"Give mu room: --bounds mu=0,{found.room:g}"
    figures = {"p": p, "optimum": dict(found.optimum), "upper": dict(found.upper), "gain": found.gain}
    return Fact(False, says, figures, FACTS["friction_beyond_prior"])
