"""Least squares where rows have errors in common: the best of these beside the best constants.

The sum of squares of residuals over their independent errors, plus that of the common errors over their
standard deviations, is least at the generalised least squares of the constants: minimised over the common
errors alone it is q' (D + B B')^-1 q of `ifrfit.inference.model.common_errors`.
"""

from __future__ import annotations

import numpy as np

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.laplace import weighted_jacobian
from ifrfit.inference.optimize.optimum import Array

_ON_BOUND = 1e-9  # of a domain's width: a constant that is held by its bound does not move


def common_step(problem: Problem, sigma: Array, theta: Array, loadings: Array, value: Array) -> Array:
    """By how much the common errors move to the joint optimum of constants and them, to first order.

    Parameters
    ----------
    problem : Problem
        At the common errors so far.
    sigma : ndarray, (n,)
    theta : ndarray, (p,)
        The optimum there.
    loadings : ndarray, (n, r)
        What one standard error of each does to the rows.
    value : ndarray, (r,)
        The common errors so far.

    Returns
    -------
    ndarray, (r,)
    """
    _, _, to_theta, by_phi, residual = weighted_jacobian(problem, sigma, theta)
    low, high = problem.parameters.bounds()
    margin = _ON_BOUND * np.where(np.isfinite(high - low), high - low, 1.0)
    moves = problem.parameters.free & (theta > low + margin) & (theta < high - margin)
    scale = (problem.parameters.prior_sd / np.abs(np.diag(to_theta)))[moves]
    n, r = loadings.shape
    more = np.zeros((len(by_phi), r))
    more[:n] = loadings / sigma[:, None]
    matrix = np.block([[by_phi[:, moves] * scale, more], [np.zeros((r, int(moves.sum()))), np.eye(r)]])
    moved, *_ = np.linalg.lstsq(matrix, np.concatenate((residual, -value)), rcond=None)
    return np.asarray(moved[int(moves.sum()) :])
