"""Compute what a report shows beyond a fit, once: reports themselves only draw it.

Profiles, intervals by three methods and the other closures are computed where that takes about a second;
otherwise the appraisal says why they are missing, and which command computes them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ifrfit.errors import IfrfitError
from ifrfit.inference.appraisal import Appraisal
from ifrfit.inference.comparison.compare import compare_result
from ifrfit.inference.diagnostics.interval_comparison import intervals
from ifrfit.inference.distributions.marginal_density import marginal_densities
from ifrfit.inference.estimators import Exact
from ifrfit.inference.posterior import ExactPosterior, exact_posterior
from ifrfit.inference.profile.profile_all import profile_all
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.prediction import draw_kept
from ifrfit.inference.result.restore import question
from ifrfit.physics.observables import OBSERVABLES

if TYPE_CHECKING:
    from ifrfit.inference.comparison.result import Comparison
    from ifrfit.inference.model.problem import Problem
    from ifrfit.inference.optimize.least_squares import LeastSquaresFit
    from ifrfit.inference.profile.types import ProfileLikelihood

DRAWS = 2000
# beyond these, profiles and comparisons take long
MOST_CONSTANTS = 6
MOST_ROWS = 2000
MOST_CURVED = 60  # rows that no closure is linear in: each of them is computed at every node


def appraise(result: FitResult, *, closures: bool = True) -> Appraisal:
    """Put the question of a fit to the other methods, and to the other closures.

    Parameters
    ----------
    result : FitResult
        Of a fit, or read from a file.
    closures : bool
        Whether to compare closures.

    Returns
    -------
    Appraisal
    """
    comparison, without_comparison = _comparison(result) if closures else (None, "")
    profiles: Mapping[str, ProfileLikelihood] = {}
    table = None
    posterior = result.distribution if isinstance(result.distribution, ExactPosterior) else None
    try:
        problem, optimum = question(result)
    except IfrfitError as error:
        profiles, without_profiles = result.profiles, error.in_shell
        if result.is_sampled:
            more = "intervals are not compared" if profiles else "ifrfit fit --method profile profiles them"
            without_profiles = f"{_beyond_memory(result)}: {more}."
    else:
        without_profiles = _without_profiles(problem)
        if result.profiles:
            profiles = result.profiles
        elif not without_profiles:
            profiles = profile_all(problem, optimum)
        if profiles:
            posterior = _posterior(result, problem, optimum)
            table = intervals(problem, optimum, posterior, profiles)
    draws = draw_kept(result, DRAWS, np.random.default_rng(result.seed))
    return Appraisal(
        draws,
        profiles,
        without_profiles,
        table,
        comparison,
        without_comparison,
        {} if posterior is None else marginal_densities(posterior, result.asked, draws),
    )


def _beyond_memory(result: FitResult) -> str:
    return f"The {result.fit.n:,} rows of this fit were not held in memory"


def _without_profiles(problem: Problem) -> str:
    """Why profiles are not computed; empty where they are."""
    free = int(problem.parameters.free.sum())
    if free == 0:
        return "Every constant is fixed: there is nothing to profile."
    if problem.parameters.is_tied:
        return "Profiles do not know constants that are tied."
    if problem.common is not None:
        return "Profiles know no errors that rows have in common."
    if problem.offset is not None:
        return "Profiles do not fit an angle offset."
    if not problem.error_model.is_plain:
        return "Profiles know independent Gaussian errors of the values only."
    if free > MOST_CONSTANTS or problem.rows.value.size > MOST_ROWS:
        return (
            f"{free} free constants and {problem.rows.value.size} rows: profiles take long here. "
            "ifrfit fit --method profile computes them."
        )
    return ""


def _posterior(result: FitResult, problem: Problem, optimum: LeastSquaresFit) -> ExactPosterior | None:
    """The exact posterior of an exact fit, as it was left or integrated again; None of other methods."""
    if isinstance(result.distribution, ExactPosterior):
        return result.distribution
    return exact_posterior(problem, start=optimum) if result.method == Exact.name else None


def _comparison(result: FitResult) -> tuple[Comparison | None, str]:
    """All closures by the question of a result; or none, and the sentence that says why."""
    if result.is_sampled:
        return None, f"{_beyond_memory(result)}: ifrfit compare puts the closures side by side"
    reason = _too_large_to_compare(result)
    if reason:
        return None, f"{reason}: ifrfit compare puts the closures side by side"
    try:
        return compare_result(result), ""
    except IfrfitError as error:
        return None, f"They cannot be compared here. {error.in_shell}"


def _too_large_to_compare(result: FitResult) -> str:
    free = sum(found.status != "fixed" for found in result.flat_constants().values())
    if len(result.points) > MOST_ROWS or free > MOST_CONSTANTS:
        return f"{len(result.points)} rows and {free} free constants take long"
    curved = sum(OBSERVABLES[name].kind == "curved" for name in result.points["observable"])
    if curved > MOST_CURVED:
        return f"{curved} rebound angles or total restitutions take long"
    error_model = result.noise.error_model
    if not error_model.is_plain and result.noise.policy != "known":
        return "Such a scatter with a noise that is not known takes long"
    return ""
