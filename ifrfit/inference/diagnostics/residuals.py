"""Residuals of a fit, standardised and studentised."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.diagnostics.quadratic_forms import Array
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit

_FITTED = 1e-6  # 1 - leverage below which a row is fitted exactly
_REST = 1e-6  # least share of the misfit that is left to the other rows


@dataclass(frozen=True)
class Residuals:
    """Residuals of a fit: standardised ones are over sigma, studentised ones also over their own leverage.

    `is_given` says of which rows sigma is known, (n,). `dof`, (n,), are the degrees of freedom of Student's t
    that the studentised residuals have: infinite where sigma is known.
    """

    raw: Array
    standardised: Array
    studentised: Array
    is_given: NDArray[np.bool_]
    dof: Array


def residuals_of(problem: Problem, fit: LeastSquaresFit) -> Residuals:
    """Residuals at the optimum.

    Where sigma comes from the misfit, a row is left out of its own yardstick (external studentisation), so
    that an outlier does not hide behind the noise it feigns.
    """
    raw = problem.residual(fit.optimum.theta)
    standardised = raw / fit.sigma
    own = 1.0 - fit.gaussian.leverage
    # a row that the constants run through has no residual, whatever rounding leaves of it
    internal = np.where(own > _FITTED, standardised / np.sqrt(np.maximum(own, _FITTED)), 0.0)
    given = problem.noise.is_given
    if math.isinf(fit.noise_dof):
        return Residuals(raw, standardised, internal, given, np.broadcast_to(math.inf, raw.shape))
    groups = list(problem.noise_groups().values())
    if len(groups) > 1 or problem.noise.is_mixed:
        deleted, dof = internal.copy(), np.full(raw.size, math.inf)
        fitted = fitted_directions(problem, fit)
        for rows in groups:
            external, dof[rows] = _left_out(fitted, standardised, rows)
            deleted[rows] = np.where(dof[rows] > 0.0, external, internal[rows])
        return Residuals(raw, standardised, deleted, given, dof)
    dof = np.broadcast_to(fit.noise_dof - 1.0, raw.shape)
    if fit.noise_dof <= 1.0:
        return Residuals(raw, standardised, internal, given, dof)
    rest = np.maximum(fit.noise_dof - internal**2, _REST * fit.noise_dof)
    return Residuals(raw, standardised, internal * np.sqrt((fit.noise_dof - 1.0) / rest), given, dof)


def fitted_directions(problem: Problem, fit: LeastSquaresFit) -> Array:
    """Rows of A, (n, k), where A A' takes weighted values to their fit: the leverage is its diagonal."""
    local = fit.gaussian
    seen = local.seen
    by_phi = problem.jacobian(fit.optimum.theta) @ local.to_theta / fit.sigma[:, None]
    if fit.angle_offset is None:
        return np.asarray(by_phi @ local.vectors[:, seen] / local.singular[seen])
    # an error that the rows have in common is one more constant, with a prior of 1
    common = fit.angle_offset.common / fit.sigma
    size = float(common @ common)
    root = 1.0 / math.sqrt(1.0 + size)
    rest = by_phi - np.outer(common, common @ by_phi) * (1.0 / (1.0 + size))
    return np.column_stack((rest @ local.vectors[:, seen] / local.singular[seen], root * common))


def _left_out(fitted: Array, standardised: Array, rows: Index) -> tuple[Array, Array]:
    """Residual of each row of one unknown noise from the fit without it, over its sd, and its dof.

    The noise is that which the other rows of the group leave to it, the row left out of the constants, too;
    other noises stay. The constants bring in an error of their own, of which that noise has a share. Of a
    single group it is the external studentisation, with one degree of freedom less than the noise.
    """
    own, r = fitted[rows], standardised[rows]
    among = own.T @ own
    leverage = (own**2).sum(axis=1)
    within = np.einsum("ij,jk,ik->i", own, among, own)  # squares of the fit's weights on the group's rows
    left = 1.0 - leverage
    has_residual = left > _FITTED
    left = np.maximum(left, _FITTED)
    moved = np.where(has_residual, r / left, 0.0)  # residual from the fit without the row
    squares = float(r @ r) + 2.0 * moved * (own @ (own.T @ r)) + moved**2 * (within - 1.0)
    rest = rows.size - 1.0 - (float(leverage.sum()) - leverage) - (within - leverage**2) / left
    rest = np.maximum(rest, 0.0)
    variance = np.maximum(squares, _REST * rows.size) / np.maximum(rest, _REST)
    of_group = np.maximum(within - leverage**2, 0.0) / left**2
    of_constants = np.maximum(leverage / left - of_group, 0.0)
    total = variance * (1.0 + of_group) + of_constants
    share = variance * (1.0 + of_group) / total
    return moved / np.sqrt(total), rest / share**2
