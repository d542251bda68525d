"""What each estimator says of one experiment, held against the truth."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import numpy as np
from calibration_scenes import Experiment, understated_sigma, walton, without_kink
from numpy.typing import NDArray
from scipy import special

from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.posterior import TOLERANCE, exact_posterior
from ifrfit.inference.profile.least_squares_estimates import estimates_of_optimum
from ifrfit.inference.profile.profile_all import profile_all
from ifrfit.inference.result.types import Estimate, Interval
from ifrfit.inference.summary.gaussian import truncated_gaussian

Array = NDArray[np.float64]
Score = tuple[float, float, float, float]  # rank of the truth, whether it is in the 50, 68, 95 % interval
Scores = dict[tuple[str, str], Score]  # by (method, quantity)

LEVELS = (0.50, 0.68, 0.95)
TAILS = np.round([[0.5 - 0.5 * level, 0.5 + 0.5 * level] for level in LEVELS], 9)
NARROWED = 0.9  # half widths of the control that is too sure of itself, over what they should be
COARSE = 1e-2  # tolerance of the controls, and where the scatter is not plain, which takes longer
UNDERSTATED = 0.7  # sigma of the control that trusts its rows too much, over the true one

EXACT = "exact"
COVARIANCE = "covariance"
BOUNDED = "least squares"
PROFILE = "profile"
NARROW = "exact, intervals 10 % narrower"
WRONG_SIGMA = "exact, sigma 30 % too small"
NO_KINK = "exact, model without the kink"
WALTON = "exact, closure FR"


class Marginals(Protocol):
    """What a posterior must give to be judged."""

    @property
    def names(self) -> tuple[str, ...]:
        """Quantities that have a marginal."""

    def cdf(self, name: str, x: float, /) -> Array | float:
        """Posterior probability below x."""

    def quantile(self, name: str, p: Array, /) -> Array | float:
        """Where the posterior probability below is p."""


def score_marginals(post: Marginals, truth: Mapping[str, float], shrink: float = 1.0) -> dict[str, Score]:
    """Rank of the truth in each marginal, and which central intervals hold it.

    Parameters
    ----------
    post : Marginals
    truth : mapping
    shrink : float
        Factor on the intervals' half widths about the median; anything but 1 is a negative control.
    """
    found = {}
    for name in post.names:
        q = np.asarray(post.quantile(name, np.append(TAILS.ravel(), 0.5)), dtype=float)
        median = float(q[-1])
        ends = median + shrink * (q[:-1].reshape(TAILS.shape) - median)
        rank = float(post.cdf(name, truth[name])) if shrink == 1.0 else math.nan
        found[name] = _score(truth[name], rank, [(float(a), float(b)) for a, b in ends])
    return found


def score_exact(
    experiment: Experiment, fit: LeastSquaresFit | None
) -> tuple[dict[str, dict[str, Score]], float]:
    """Scores of the exact posterior and of its intervals narrowed, and the error that it states."""
    plain = experiment.problem.error_model.is_plain
    post = exact_posterior(experiment.problem, TOLERANCE if plain else COARSE, fit)
    scores = {
        EXACT: score_marginals(post, experiment.truth),
        NARROW: score_marginals(post, experiment.truth, NARROWED),
    }
    return scores, float(max(post.error, post.error_evidence))


WRONG: dict[str, Callable[[Experiment], Experiment]] = {
    WRONG_SIGMA: lambda experiment: understated_sigma(experiment, UNDERSTATED),
    NO_KINK: without_kink,
    WALTON: walton,
}


def score_wrong(experiment: Experiment, control: str) -> dict[str, Score]:
    """Scores of the exact posterior of a wrong likelihood, one of `WRONG`: the test must not let it pass."""
    seen = WRONG[control](experiment)
    return score_marginals(exact_posterior(seen.problem, COARSE), seen.truth)


def score_covariance(experiment: Experiment, fit: LeastSquaresFit) -> dict[str, Score]:
    """Scores of the symmetric local Gaussian; Student's t where sigma comes from the misfit.

    Bounds are not heeded. Where the data do not see a quantity at all it has no covariance interval.
    """
    dof = fit.noise_dof  # infinite where sigma is known: then Student's t is the Gaussian
    found = {}
    for name, (value, functional, prior_sd) in _functionals(experiment, fit).items():
        sd = math.sqrt(fit.gaussian.variance(functional, prior_sd))
        if not (math.isfinite(sd) and sd > 0.0):
            continue
        ends = value + sd * special.stdtrit(dof, TAILS)
        truth = experiment.truth[name]
        found[name] = _score(truth, float(special.stdtr(dof, (truth - value) / sd)), ends.tolist())
    return found


def score_bounded(experiment: Experiment, fit: LeastSquaresFit) -> dict[str, Score]:
    """Scores of the 68 and 95 % intervals that least squares reports, its bounds heeded."""
    label = experiment.scene.label
    estimates: dict[str, Estimate] = {}
    gaussian = truncated_gaussian(experiment.problem, fit)
    constants, kappas = estimates_of_optimum(experiment.problem, fit, gaussian)
    for name, found in constants.items():
        each = {"": found} if isinstance(found, Estimate) else found
        estimates |= {label(name, series): estimate for series, estimate in each.items()}
    for series, kappa in kappas.items():
        estimates[label("kappa", series)] = kappa
    return {
        name: _two(experiment.truth[name], estimate.interval68, estimate.interval95)
        for name, estimate in estimates.items()
    }


def score_profile(experiment: Experiment, fit: LeastSquaresFit) -> dict[str, Score]:
    """Scores of the 68 and 95 % intervals of the profile likelihood."""
    return {
        name: _two(experiment.truth[name], each.interval68, each.interval95)
        for name, each in profile_all(experiment.problem, fit, curves=False).items()
        if name in experiment.truth
    }


def _functionals(experiment: Experiment, fit: LeastSquaresFit) -> dict[str, tuple[float, Array, float]]:
    """Value of each constant and kappa, its derivative by the local coordinates, and its prior sd."""
    problem, theta, to_theta = experiment.problem, fit.optimum.theta, fit.gaussian.to_theta
    entries = problem.parameters.entries
    found = {
        name: (float(theta[i]), to_theta[i], entries[i].prior_sd)
        for i, name in enumerate(problem.parameters.names)
    }
    places = problem.parameters.positions
    for series, i_e, i_mu in zip(problem.series, places["e_n"], places["mu"], strict=True):
        factor, mu = 1.0 + float(theta[i_e]), float(theta[i_mu])
        slope = factor * to_theta[i_mu] + mu * to_theta[i_e]
        found[experiment.scene.label("kappa", series)] = (mu * factor, slope, entries[i_mu].prior_sd * factor)
    return found


def _two(truth: float, interval68: Interval, interval95: Interval) -> Score:
    return _score(truth, math.nan, [(math.nan, math.nan), interval68, interval95])


def _score(truth: float, rank: float, intervals: Sequence[Sequence[float]]) -> Score:
    inside = [math.nan if math.isnan(a) or math.isnan(b) else float(a <= truth <= b) for a, b in intervals]
    return rank, inside[0], inside[1], inside[2]
