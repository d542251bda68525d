"""The numbers that a method gives of each constant, and how far they are from the reference's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.distributions.protocol import LEVELS, Distribution
from ifrfit.inference.distributions.truncated_normal import half_width
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, dof_of_functional
from ifrfit.inference.profile.types import ProfileLikelihood

Array = NDArray[np.float64]

QUANTITIES = ("mean", "sd", "interval95")
_TAILS = np.array([LEVELS[0], LEVELS[-1]])
_LEVEL = LEVELS[-1] - LEVELS[0]


@dataclass(frozen=True)
class Numbers:
    """Mean, sd and ends of the central 95 % interval of every free constant.

    Attributes
    ----------
    mean, sd : ndarray, (p,)
    ends : ndarray, (p, 2)
    """

    mean: Array
    sd: Array
    ends: Array

    def errors(self, reference: Numbers) -> dict[str, Array]:
        """Distance from the reference in its standard deviations, (p, ...), by `QUANTITIES`."""
        return {
            "mean": np.abs(self.mean - reference.mean) / reference.sd,
            "sd": np.abs(self.sd - reference.sd) / reference.sd,
            "interval95": np.abs(self.ends - reference.ends) / reference.sd[:, None],
        }


def largest_errors(given: Sequence[Numbers], reference: Numbers) -> dict[str, float]:
    """Error of each quantity, in standard deviations of the reference: the largest over the constants.

    Parameters
    ----------
    given : sequence of Numbers
        Of several seeds where a method draws: the error of each constant is then the root mean square over
        them, so that no lucky run passes for an exact one.
    reference : Numbers
    """
    each = [numbers.errors(reference) for numbers in given]
    return {
        name: float(np.sqrt(np.mean([one[name] ** 2 for one in each], axis=0)).max()) for name in QUANTITIES
    }


def of_distribution(problem: Problem, distribution: Distribution) -> Numbers:
    """From marginals: of the exact posterior, of chains, of replicates."""
    names = problem.parameters.free_names
    return Numbers(
        np.array([distribution.mean(name) for name in names]),
        np.array([distribution.sd(name) for name in names]),
        np.array([np.asarray(distribution.quantile(name, _TAILS)) for name in names]),
    )


def of_least_squares(problem: Problem, found: LeastSquaresFit) -> Numbers:
    """Optimum, standard deviation by the covariance, and the symmetric interval cut at the domain's ends.

    Directions that the data leave loose have the standard deviation of the default prior.
    """
    sd = found.gaussian.theta_sd[problem.parameters.free]
    low, high = _domain(problem)
    value = np.clip(found.optimum.theta[problem.parameters.free], low, high)
    free = found.gaussian.to_theta[problem.parameters.free]
    half = np.array([half_width(_LEVEL, dof_of_functional(problem, found, each)) for each in free]) * sd
    return Numbers(
        value, sd, np.clip(np.stack((value - half, value + half), axis=1), low[:, None], high[:, None])
    )


def of_profiles(problem: Problem, profiles: Mapping[str, ProfileLikelihood]) -> Numbers:
    """Optimum, and the interval whose half width gives the standard deviation, cut at the domain's ends."""
    own = [profiles[name] for name in problem.parameters.free_names]
    low, high = _domain(problem)
    ends = np.clip(np.array([profile.central95 for profile in own]), low[:, None], high[:, None])
    half = [half_width(_LEVEL, profile.dof) for profile in own]
    return Numbers(
        np.clip([profile.value for profile in own], low, high),
        0.5 * np.ptp(ends, axis=1) / np.array(half),
        ends,
    )


def _domain(problem: Problem) -> tuple[Array, Array]:
    """Ends of the default prior of each free constant."""
    own = [constant for constant in problem.parameters.entries if constant.fixed is None]
    return np.array([c.lower for c in own]), np.array([c.prior_upper for c in own])
