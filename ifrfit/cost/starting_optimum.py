"""The optimum that every method starts from, whatever the scatter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ifrfit.errors import UsageError
from ifrfit.inference.fit import fit
from ifrfit.inference.model.apply_error_model import tied_to_e_n, with_error_model
from ifrfit.inference.model.error_model import PLAIN, ErrorModel, make_error_model
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.least_squares_result import optimum_of

# the choices beside which errors are no longer independent and Gaussian
_LAWS = ("tails", "dof", "angle_errors", "angle_population", "sigma_gamma")


def beginning(
    data: Any, *, posterior: bool = True, seed: int = 0, command: str = "", **choices: Any
) -> FitResult:
    """Least squares of the data; by effective variance where the true angles are to be integrated out.

    Parameters
    ----------
    data
        As in `ifrfit.fit`.
    posterior : bool
        Whether errors are to be measured against an exact posterior of these data.
    seed, command
        As in `ifrfit.fit`.
    **choices
        Keywords of `ifrfit.fit`.

    Raises
    ------
    UsageError
        As `ifrfit.fit`; with `posterior` where the scatter does not allow one.
    DataError
        As `ifrfit.fit`.
    """
    error_model = error_model_of(choices)
    if not error_model.integrates:
        return fit(data, method="lsq", seed=seed, command=command, **choices)
    # `fit` refuses least squares of this scatter as an answer; as a place to begin they are good enough
    plain = fit(data, method="lsq", seed=seed, command=command, **without_laws(choices))
    problem = with_error_model(plain.problem, error_model, "mcmc")
    tied = tied_to_e_n(problem, error_model) if posterior else []
    if tied:
        raise UsageError(
            f"--angle-errors {error_model.angles} with {', '.join(tied)}: the true angle ties e_n to the "
            "tangential constants, so there is no exact posterior to measure errors against. Fix e_n, or "
            "choose --kind physics or arithmetic."
        )
    return optimum_of(problem, seed, command)


def error_model_of(choices: Mapping[str, Any]) -> ErrorModel:
    """The scatter that was chosen."""
    return make_error_model(**{name: choices[name] for name in PLAIN.choices() if name in choices})


def without_laws(choices: Mapping[str, Any]) -> dict[str, Any]:
    """The choices with independent Gaussian errors; those propagated from velocities stay."""
    return {name: value for name, value in choices.items() if name not in _LAWS}
