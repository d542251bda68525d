"""The posterior about each mode that least squares knows: where integrators begin to look for its mass."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.laplace import gaussian_approximation
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.optimize.noise_modes import noise_at_mode

_MOST = 8


def fits_at_modes(problem: Problem, start: LeastSquaresFit, rise: float) -> list[LeastSquaresFit]:
    """The fit, and the same at each further mode: its constants, its noise, its Gaussian.

    Parameters
    ----------
    problem : Problem
        Without an offset of the angles, or at the fitted one.
    start : LeastSquaresFit
    rise : float
        Of minus twice the log likelihood over the best mode, up to which other modes of the noise count.

    Returns
    -------
    list of LeastSquaresFit
        The best first; at most 8. An end of the domain stands where a mode has no finite value.
    """
    thetas = [start.optimum.theta, *(theta for above, theta in start.rivals if above <= rise)]
    if not start.rivals:
        thetas += [theta for _, theta in start.optimum.minima[1:]]
    low, high = problem.parameters.bounds()
    found = []
    for theta in thetas[:_MOST]:
        theta = np.where(np.isfinite(theta), theta, np.where(np.isfinite(low), low, high))
        sigma = noise_at_mode(problem, theta, 0.0).sigma if start.rivals else start.sigma
        gaussian = gaussian_approximation(problem, sigma, theta)
        found.append(
            replace(start, optimum=replace(start.optimum, theta=theta), sigma=sigma, gaussian=gaussian)
        )
    return found
