"""Residuals of a fit, standardised and studentised."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.diagnostics.quadratic_forms import Array
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit

_FITTED = 1e-6  # 1 - leverage below which a row is fitted exactly
_REST = 1e-6  # least share of the misfit that is left to the other rows


@dataclass(frozen=True)
class Residuals:
    """Residuals of a fit: standardised ones are over sigma, studentised ones also over their own leverage.

    `is_given` says of which rows sigma is known, (n,): their studentised residuals are normal.
    """

    raw: Array
    standardised: Array
    studentised: Array
    is_given: NDArray[np.bool_]


def residuals_of(problem: Problem, fit: LeastSquaresFit) -> Residuals:
    """Residuals at the optimum.

    Where sigma comes from the misfit, a row is left out of its own yardstick (external studentisation), so
    that an outlier does not hide behind the noise it feigns.
    """
    raw = problem.rows.value - problem.predict(fit.optimum.theta)
    standardised = raw / fit.sigma
    own = 1.0 - fit.gaussian.leverage
    # a row that the constants run through has no residual, whatever rounding leaves of it
    internal = np.where(own > _FITTED, standardised / np.sqrt(np.maximum(own, _FITTED)), 0.0)
    given = problem.noise.is_given
    if math.isinf(fit.noise_dof) or fit.noise_dof <= 1.0:
        return Residuals(raw, standardised, internal, given)
    rest = np.maximum(fit.noise_dof - internal**2, _REST * fit.noise_dof)
    external = internal * np.sqrt((fit.noise_dof - 1.0) / rest)
    return Residuals(raw, standardised, np.where(given, internal, external), given)
