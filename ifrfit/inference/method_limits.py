"""What a method of estimation cannot do for a question, in a sentence with the remedy.

Methods of other packages say what they can by the attributes named here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ifrfit.errors import UsageError
from ifrfit.inference.estimator import Estimator
from ifrfit.inference.estimators import ESTIMATORS, Bootstrap, Exact, LeastSquares, Profile

if TYPE_CHECKING:
    from ifrfit.inference.model.problem import Problem


def refuses(estimator: Estimator, problem: Problem) -> str:
    """Why a method cannot do a problem, its own reasons last; empty where it can."""
    return (
        refuses_prior(estimator, problem)
        or refuses_offset(estimator, problem)
        or refuses_tie(estimator, problem)
        or refuses_common_errors(estimator, problem)
        or estimator.refuses(problem)
    )


def _called(estimator: Estimator) -> str:
    return f"--method {estimator.name}" if estimator.name in ESTIMATORS else "The choice of a method"


def refuses_prior(estimator: Estimator, problem: Problem) -> str:
    """Why a method does not know a prior of the problem; empty where it does.

    A law that is neither normal nor uniform is known to a method whose attribute `takes_every_prior` is true.
    """
    shaped = [f"{one.name}={one.shape}" for one in problem.parameters if one.shape is not None]
    if not shaped or getattr(estimator, "takes_every_prior", False):
        return ""
    return (
        f"{_called(estimator)} knows normal and uniform priors only, not --prior {shaped[0]}: use --method "
        "exact or mcmc."
    )


def refuses_tie(estimator: Estimator, problem: Problem) -> str:
    """Why a method does not know ties between constants; empty where it does, or where there are none.

    A method of another package does if it has an attribute `takes_ties` that is true.
    """
    if not problem.parameters.is_tied:
        return ""
    said = "--tie '" + "=".join(next(iter(problem.parameters.ties.expressions.items()))) + "'"
    if not getattr(estimator, "takes_ties", False):
        return f"{_called(estimator)} does not know {said}: use --method mcmc or lsq."
    if any(getattr(estimator, name, None) is not None for name in ("accuracy", "budget")):
        return f"--accuracy and --budget do not know what {said} costs: leave them out."
    if not problem.error_model.is_plain or problem.offset is not None:
        option = problem.error_model.option if problem.offset is None else "--angle-offset"
        return f"{said} is known beside independent Gaussian errors of the values only: leave {option} out."
    if problem.common is not None:
        return (
            f"{said} is known beside independent Gaussian errors of the values only: leave it out, or say "
            "--common-errors ignored."
        )
    return ""


def refuses_offset(estimator: Estimator, problem: Problem) -> str:
    """Why a method cannot fit the angle offset of a problem; empty where it can, or where there is none.

    A method of another package can if it has an attribute `fits_angle_offset` that is true.
    """
    if problem.offset is None:
        return ""
    if not getattr(estimator, "fits_angle_offset", False):
        return f"{_called(estimator)} fits no angle offset: use --method exact with --angle-offset."
    if any(getattr(estimator, name, None) is not None for name in ("accuracy", "budget")):
        return "--accuracy and --budget do not know what an angle offset costs: leave them out."
    return ""


def refuses_common_errors(estimator: Estimator, problem: Problem) -> str:
    """Why a method cannot count the errors that rows of a problem have in common; empty where it can.

    A method of another package can if it has an attribute `takes_common_errors` that is true.
    """
    if problem.common is None:
        return ""
    from ifrfit.inference.model.common_errors import refuse
    from ifrfit.inference.model.common_likelihood import refuse_beside

    if not getattr(estimator, "takes_common_errors", False):
        return f"{refuse(f'--method {estimator.name}').in_shell} --method exact, lsq and mcmc count them."
    if not problem.free_parameters and estimator.name != LeastSquares.name:
        return "Every constant is fixed, and rows have errors in common: use --method lsq, or leave one free."
    return refuse_beside(problem)


def refuse_crew_in_memory(estimator: Estimator, *, was_large: bool = False) -> None:
    """Refuse what is only for data that are not held in memory.

    A large file that cannot be streamed is held after all: there is only nothing to go on with.

    Raises
    ------
    UsageError
        With the option.
    """
    if isinstance(estimator, Bootstrap):  # whose replicates take workers
        asked: dict[str, object] = {"scheduler": estimator.scheduler}
        if not was_large:
            asked["resume"] = estimator.resume
    elif isinstance(estimator, Exact | LeastSquares | Profile):
        asked = {"workers": estimator.workers > 1, "scheduler": estimator.scheduler}
        if not was_large:
            asked["resume"] = estimator.resume
    else:
        return
    for name, is_given in asked.items():
        if is_given:
            raise UsageError(
                f"--{name}: these data are held in memory, where --method {estimator.name} "
                f"{'takes --workers' if isinstance(estimator, Bootstrap) else 'is one short computation'}. "
                "Leave it out."
            )
