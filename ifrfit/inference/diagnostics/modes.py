"""Whether one set of constants explains the data, or several that lie apart do."""

from __future__ import annotations

import math

import numpy as np

from ifrfit.inference.diagnostics.thresholds import FACTS, RIVAL
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.laplace import gaussian_approximation
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.optimize.noise_modes import noise_at_mode
from ifrfit.inference.optimize.optimum import Array
from ifrfit.inference.result.types import Fact
from ifrfit.text import joined

_DISTANCE = 3.0  # sd between modes, in at least one constant, that are no kinks of one hill


def several_modes(problem: Problem, found: LeastSquaresFit) -> Fact | None:
    """Modes of the posterior that lie apart, each with its weight; None where there is one.

    The weight is Laplace's: the height of the mode times the volume of the Gaussian about it.

    Parameters
    ----------
    problem : Problem
    found : LeastSquaresFit
        Its rivals, or where noise is known its other minima.
    """
    optimum = found.optimum
    rivals = found.rivals or tuple((value - optimum.objective, theta) for value, theta in optimum.minima[1:])
    kept: list[tuple[float, Array, Array]] = []
    for rise, theta in ((0.0, optimum.theta), *rivals):
        if not np.isfinite(theta).all():
            continue
        sigma = noise_at_mode(problem, theta, rise).sigma if found.rivals else found.sigma
        covariance = gaussian_approximation(problem, sigma, theta).covariance(capped=True)
        sd = np.sqrt(np.diag(covariance))
        if all(_differ(theta - other, np.maximum(sd, spread)) for _, other, spread in kept):
            free = problem.parameters.free
            volume = 0.5 * float(np.linalg.slogdet(covariance[np.ix_(free, free)])[1])
            if math.isfinite(volume):  # none where the data do not see a constant at all
                kept.append((-0.5 * rise + volume, theta, sd))
    log = np.array([height for height, _, _ in kept])
    weights = np.exp(log - log.max()) / np.exp(log - log.max()).sum() if log.size else log
    modes = [(float(w), theta) for w, (_, theta, _) in zip(weights, kept, strict=True) if w >= RIVAL]
    if len(modes) < 2:
        return None
    modes.sort(key=lambda mode: -mode[0])
    free = problem.parameters.free
    names = np.array(problem.parameters.names)[free].tolist()
    told = [
        {"weight": weight, "constants": dict(zip(names, theta[free].tolist(), strict=True))}
        for weight, theta in modes
    ]
    words = [_words(theta[free], names, weight) for weight, theta in modes]
    says = f"{len(modes)} sets of constants explain the data: {joined(words)}"
    return Fact(False, says, {"modes": told}, FACTS["noise_modes"])


def _differ(difference: Array, sd: Array) -> bool:
    return bool((np.abs(difference) > _DISTANCE * sd).any())


def _words(values: Array, names: list[str], weight: float) -> str:
    each = ", ".join(f"{name} {value:.3g}" for name, value in zip(names, values.tolist(), strict=True))
    return f"{each} (weight {weight:.2g})"
