"""Degrees of freedom behind a standard deviation that rests on noises of which some are estimated."""

from __future__ import annotations

import math

import numpy as np

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.optimize.optimum import Array

_NOTHING = 1e-9  # of the information: a share of it that no number of degrees of freedom changes


def group_dof(problem: Problem, fit: LeastSquaresFit) -> Array:
    """Degrees of freedom that each unknown noise keeps: its rows less their leverage, (groups,)."""
    leverage = fit.gaussian.leverage
    return np.array(
        [max(rows.size - float(leverage[rows].sum()), 0.5) for rows in problem.noise_groups().values()]
    )


def satterthwaite(shares: Array, dof: Array) -> float:
    """Degrees of freedom of a sum of estimated variances; infinite where none of it is estimated.

    Parameters
    ----------
    shares : ndarray, (groups,)
        Of the sum, each with an unknown noise; what is missing to 1 is known.
    dof : ndarray, (groups,)

    References
    ----------
    Satterthwaite (1946), Biometrics Bull. 2, 110.
    """
    spread = float((shares**2 / dof).sum())
    return 1.0 / spread if spread > _NOTHING else math.inf


def dof_of_functional(problem: Problem, fit: LeastSquaresFit, functional: Array) -> float:
    """Degrees of freedom behind the sd of functional @ phi.

    After Satterthwaite: each unknown noise counts by its share of the information.
    """
    if math.isinf(fit.noise_dof):
        return math.inf
    shares = information_shares(problem, fit, functional)
    return fit.noise_dof if shares is None else satterthwaite(shares, group_dof(problem, fit))


def information_shares(problem: Problem, fit: LeastSquaresFit, functional: Array) -> Array | None:
    """Share of each unknown noise's rows in the information on functional @ phi; None if it is not seen."""
    local = fit.gaussian
    inverse = np.where(local.seen, 1.0 / np.where(local.seen, local.singular, 1.0) ** 2, 0.0)
    direction = local.vectors @ (inverse * (functional @ local.vectors))
    total = float(functional @ direction)
    if not (total > 0.0 and math.isfinite(local.variance(functional, 1.0))):
        return None
    moved = problem.jacobian(fit.optimum.theta) @ (local.to_theta @ direction) / fit.sigma
    if fit.angle_offset is not None:  # an error that all rows share is known, by its prior
        common = fit.angle_offset.common / fit.sigma
        moved -= common * float(common @ moved) / (1.0 + float(common @ common))
    groups = problem.noise_groups().values()
    return np.array([float(moved[rows] @ moved[rows]) for rows in groups]) / total
