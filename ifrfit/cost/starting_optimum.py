"""The optimum that every method starts from, whatever the errors."""

from __future__ import annotations

from ifrfit.errors import UsageError
from ifrfit.inference.estimations import least_squares_estimation
from ifrfit.inference.fit import Question
from ifrfit.inference.model.apply_error_model import tied_to_e_n
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.options import Model
from ifrfit.inference.result.build import build_result
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.physics.closures import get_closure


def beginning(
    question: Question, model: Model, *, posterior: bool = True, seed: int = 0, command: str = ""
) -> FitResult:
    """Least squares of the data; by effective variance where the true angles are to be integrated out.

    `ifrfit.fit` refuses least squares of such errors as an answer; as a place to begin they are good enough.

    Parameters
    ----------
    question : Question
    model : Model
    posterior : bool
        Whether errors are to be measured against an exact posterior of these data.
    seed, command
        As in `ifrfit.fit`.

    Raises
    ------
    UsageError
        As `ifrfit.fit`; with `posterior` where the errors do not allow one.
    DataError
        As `ifrfit.fit`.
    """
    problem = question.problem(get_closure(model.closure), model.parameters(question.inertia_factor))
    error_model = problem.error_model
    tied = tied_to_e_n(problem, error_model) if posterior else []
    if tied:
        raise UsageError(
            f"--angle-errors {error_model.angles} with {', '.join(tied)}: the true angle ties e_n to the "
            "tangential constants, so there is no exact posterior to measure errors against. Fix e_n, or "
            "choose --kind physics or arithmetic."
        )
    optimum = least_squares(problem)
    estimation = least_squares_estimation(optimum)
    conditions = question.conditions
    return build_result(problem, optimum, estimation, seed=seed, command=command, conditions=conditions)
