"""Errors of one hump, skewed or with tails, of each observable: the sinh-arcsinh law for the normal one.

What two kinds of impacts look like that is no more than such errors is not called two kinds.

References
----------
Jones & Pewsey (2009), Biometrika 96, 761.
"""

from __future__ import annotations

import math

import numpy as np

from ifrfit.inference.diagnostics.linear_mixture import Linearised
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array

_PARAMETER = 2.0  # of -2 log likelihood, for each shape beyond the two numbers of a mixture
_SHAPES = 2
# log scale, skewness and log of the tails go from minus to plus these; beyond, a spike beside a few far rows
# would be one hump
_FARTHEST = (1.5, 1.0, 0.9)


def drop_of_unimodal_errors(problem: Problem, linear: Linearised) -> float:
    """Fall of -2 log likelihood with errors of one hump, without the impact that speaks most.

    Place, scale, skewness and tails of each observable are at their best. Of further observables those count
    that take more than their two shapes cost.

    Parameters
    ----------
    problem : Problem
    linear : Linearised
        Residuals at the optimum.
    """
    which = problem.rows.which[linear.rows]
    found = []
    for number in np.unique(which):
        gain = np.zeros(which.size)
        own = which == number
        z = linear.residual[own]
        gain[own] = 2.0 * _log_density(_most_likely(z), z) + z**2
        found.append(gain)
    found.sort(key=lambda gain: -float(gain.sum()))
    cost = _PARAMETER * _SHAPES
    counted = found[:1] + [gain for gain in found[1:] if float(gain.sum()) > cost]
    by_impact = linear.by_impact(np.sum(counted, axis=0))
    return float(by_impact.sum() - by_impact.max()) - cost * (len(counted) - 1)


def _log_density(parameters: Array, z: Array) -> Array:
    """Logarithm of the density but for that of 1/sqrt(2 pi): place, log scale, skewness, log of the tails."""
    place, log_scale, skewness, log_tail = parameters
    x = (z - place) * math.exp(-log_scale)
    bent = math.exp(log_tail) * np.arcsinh(x) - skewness
    log_slope = np.log(np.cosh(bent)) + log_tail - 0.5 * np.log1p(x**2) - log_scale
    return np.asarray(log_slope - 0.5 * np.sinh(bent) ** 2)


def _most_likely(z: Array) -> Array:
    from scipy.optimize import minimize  # a fifth of a second, and rarely asked

    def minus(parameters: Array) -> float:
        if (np.abs(parameters[1:]) > _FARTHEST).any():
            return math.inf
        return -float(_log_density(parameters, z).sum())

    side = float(np.sign((z**3).sum()))
    starts = np.array(((0.0, -0.3, 0.0, -0.3), (-0.5 * side, -0.2, 0.5 * side, -0.1)))
    found = [
        minimize(minus, x, method="Nelder-Mead", options={"maxiter": 400, "xatol": 1e-3, "fatol": 1e-3})
        for x in starts
    ]
    return np.asarray(min(found, key=lambda one: float(one.fun)).x)
