"""The question of one fit put to every closure."""

from __future__ import annotations

from dataclasses import replace

from ifrfit.errors import DataError, UsageError
from ifrfit.inference.comparison.closure_questions import known_to
from ifrfit.inference.comparison.compare import weighed
from ifrfit.inference.comparison.result import Comparison
from ifrfit.inference.model.apply_error_model import with_error_model
from ifrfit.inference.model.parameters import Parameter, make_parameters
from ifrfit.inference.model.problem import Problem, make_problem
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.least_squares_result import optimum_of
from ifrfit.inference.result.method_results import with_posterior
from ifrfit.inference.result.restore import question
from ifrfit.physics.closures import Closure

_TOLERANCE = 1e-2  # of the log evidence and, in sd, of the constants: no more digits are shown


def compare_again(result: FitResult, *, loo: bool = False) -> Comparison:
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
    fits = {closure.name: _fitted(closure, problem, result) for closure in closures}
    return weighed(fits, notes, loo, result.seed)


def _fitted(closure: Closure, problem: Problem, result: FitResult) -> FitResult:
    j = problem.inertia_factor
    constants = _constants(closure, problem)
    try:
        other = make_problem(problem.observations, closure, j, constants, result.noise.policy)
        other = with_error_model(other, problem.error_model, "exact")
        return with_posterior(optimum_of(other, result.seed, brief=True), _TOLERANCE)
    except (UsageError, DataError) as error:
        raise type(error)(f"Closure {closure.title}: {error}") from None


def _constants(closure: Closure, problem: Problem) -> tuple[Parameter, ...]:
    """What the user said of each constant; bounds of its own where the user left those of the closure."""
    usual = {each.name: each for each in make_parameters(problem.closure, problem.inertia_factor)}
    said = {each.name: each for each in problem.parameters}
    found = []
    for own in make_parameters(closure, problem.inertia_factor):
        each = said.get(own.name, own)
        before = usual.get(own.name, own)
        if (each.lower, each.upper) == (before.lower, before.upper):
            each = replace(each, lower=own.lower, upper=own.upper)
        found.append(each)
    return tuple(found)
