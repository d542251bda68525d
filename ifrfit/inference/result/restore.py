"""The question of a fit, put again from what its result keeps."""

from __future__ import annotations

from ifrfit.data import Observations
from ifrfit.data.common_errors import common_columns_in
from ifrfit.data.schema import TABLE_COLUMNS
from ifrfit.errors import UsageError
from ifrfit.inference.model.apply_error_model import with_error_model
from ifrfit.inference.model.problem import Problem, make_problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares
from ifrfit.inference.posterior import ExactPosterior
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.physics.closures import get_closure


def question(result: FitResult) -> tuple[Problem, LeastSquaresFit]:
    """The problem of a result and its optimum: as they were left by the fit, or from the points it keeps.

    Parameters
    ----------
    result : FitResult
        Of a fit, or read from a file.

    Returns
    -------
    problem : Problem
    optimum : LeastSquaresFit

    Raises
    ------
    UsageError
        If the file holds no points (more than 100000 rows) or only a sample of them, or not the domains and
        priors of the constants (files of early versions).
    """
    if result.problem is not None and result.least_squares is not None:
        return result.problem, result.least_squares
    if not result.asked:
        raise UsageError(
            "The result does not say with which bounds and priors it was fitted. Fit the data again."
        )
    if result.is_sampled:
        raise UsageError(
            f"The result keeps a sample of {len(result.points):,} of {result.fit.n:,} values, which cannot "
            "stand for all of them. Fit the data again."
        )
    if not len(result.points):
        raise UsageError("The result holds no points. Fit the data again.")
    closure = get_closure(result.closure)
    if tuple(constant.name for constant in result.asked) != closure.constants:
        raise UsageError(
            f"The result names other constants than closure {closure.title} has. Fit the data again."
        )
    kept = [*TABLE_COLUMNS, *common_columns_in(result.points.columns)]
    observations = Observations(result.points[kept], result.inputs)
    problem = make_problem(
        observations,
        closure,
        result.inertia_factor,
        result.asked,
        result.noise.policy,
        separate_noise=result.noise.separate,
        common=result.noise.common_errors is not None and result.noise.common_errors.are_counted,
    )
    problem = with_error_model(problem, result.noise.error_model)
    return problem, least_squares(problem)


def posterior_of(result: FitResult) -> ExactPosterior:
    """The exact posterior of a fit.

    Raises
    ------
    UsageError
        If the fit was made by another method, or was read from a file.
    """
    if not isinstance(result.distribution, ExactPosterior):
        raise UsageError("The result holds no exact posterior. Fit the data again with --method exact.")
    return result.distribution
