"""The question of one fit put to every closure."""

from __future__ import annotations

from ifrfit.errors import DataError, UsageError
from ifrfit.inference.comparison.closure_questions import known_to
from ifrfit.inference.comparison.compare import weighed
from ifrfit.inference.comparison.result import Comparison
from ifrfit.inference.estimations import exact_estimation
from ifrfit.inference.estimators import Exact
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.result.build import build_result
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.restore import question
from ifrfit.physics.closure import Closure

_TOLERANCE = 1e-2  # of the log evidence and, in sd, of the constants: no more digits are shown


def compare_result(result: FitResult, *, loo: bool = False) -> Comparison:
    """Weigh all closures by the impacts, constants and noise of a fit, each to a tolerance of 1e-2.

    The fits are brief: outliers, remedies and effects are not looked for.

    Parameters
    ----------
    result : FitResult
        Of a fit, or read from a file. What it fixed or knew of a constant holds for every closure that has
        this constant.
    loo : bool
        Whether to cross-validate, too.

    Returns
    -------
    Comparison

    Raises
    ------
    UsageError, DataError
        If the result does not keep its question, or a closure cannot be fitted.
    """
    problem, _ = question(result)
    closures, notes = known_to(problem.error_model.is_plain)
    fits = {closure.name: _fitted(closure, problem, result.seed) for closure in closures}
    return weighed(fits, notes, loo, result.seed)


def _fitted(closure: Closure, problem: Problem, seed: int) -> FitResult:
    try:
        other = problem.with_closure(closure)
        reason = Exact().refuses(other)
        if reason:
            raise UsageError(reason)
        optimum = least_squares(other)
        estimation = exact_estimation(other, optimum, _TOLERANCE)
        return build_result(other, optimum, estimation, seed=seed, brief=True)
    except (UsageError, DataError) as error:
        raise type(error)(f"Closure {closure.title}: {error}") from None
