"""Least squares where the scatter is not plain: certified fits whose weights are iterated."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.error_model import ITERATED, PLAIN, ErrorModel
from ifrfit.inference.model.latent_quadrature import slopes
from ifrfit.inference.model.noise import NoiseModel
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.row_likelihood import RowLaw, at_theta
from ifrfit.inference.optimize.laplace import local_picture
from ifrfit.inference.optimize.least_squares import LeastSquares, group_sigma, least_squares

Array = NDArray[np.float64]

_ITERATIONS = 60
_CONVERGED = 1e-8
_SMALLEST = 1e-6  # factor on sigma that is meant seriously


def reweighted(problem: Problem) -> LeastSquares:
    """Fit with weights that follow from the fit.

    Student-t: the weight of a row is (nu + 1)/(nu + z^2), which makes the fixed point the maximum of the
    likelihood (Lange, Little & Taylor 1989). Errors of angle and spin add to sigma through the slope at the
    fit (effective variance); where the true angles are integrated out this is no more than the place to begin
    from. Each single fit is certified; that the weights lead to the best of several fixed points is not.

    Returns
    -------
    LeastSquares
        With `sigma` as weighted, and intervals of the local picture widened to Student's information.
    """
    plain = replace(problem, error_model=PLAIN)
    base, factor = problem.noise.sigma, 1.0
    if problem.noise.is_scaled:
        factor = float(np.median(least_squares(plain).sigma / base))
    nu = problem.error_model.dof
    sigma, change = base * factor, math.inf
    found = least_squares(plain.with_noise(NoiseModel("known", sigma)))
    for _ in range(_ITERATIONS):
        theta = found.optimum.theta
        wide = effective_sigma(problem, theta, factor)
        z = (problem.rows.value - problem.predict(theta)) / wide
        weight = np.ones(z.size) if nu is None else (nu + 1.0) / (nu + z * z)
        if problem.noise.is_scaled:
            dof = max(z.size - float(found.local.leverage.sum()), 0.5)
            factor = max(factor * math.sqrt(float(weight @ (z * z)) / dof), _SMALLEST)
            wide = effective_sigma(problem, theta, factor)
        new = wide / np.sqrt(weight)
        change = float(np.abs(new / sigma - 1.0).max())
        sigma = new
        found = least_squares(plain.with_noise(NoiseModel("known", sigma)))
        if change <= _CONVERGED:
            break
    information = 1.0 if nu is None else math.sqrt((nu + 3.0) / (nu + 1.0))
    local = local_picture(plain, sigma * information, found.optimum.theta)
    dof = math.inf
    if problem.noise.is_scaled:
        dof = max(sigma.size - float(local.leverage.sum()), 0.5)
    optimum = replace(found.optimum, gap=None, road=f"{found.optimum.road}, {ITERATED}")
    return LeastSquares(optimum, sigma, group_sigma(problem, base * factor), dof, change, local)


def effective_sigma(problem: Problem, theta: Array, factor: float = 1.0) -> Array:
    """Error of each row with those of its angle and spin added through the slope at theta, (n,)."""
    sigma = problem.noise.sigma * factor
    if problem.error_model.angles == "none":
        return np.asarray(sigma)
    square = sigma**2
    laws = replace(problem, error_model=ErrorModel(angles="effective", gamma=problem.error_model.gamma))
    for number, _ in enumerate(problem.series):
        rows = np.flatnonzero(problem.rows.series == number)
        law = RowLaw.of(laws, rows)
        for sd, slope in slopes(law, at_theta(problem, theta[None], series=number)):
            square[rows[law.order]] += (slope[0, 0, :, 0] * sd) ** 2
    return np.asarray(np.sqrt(square))
