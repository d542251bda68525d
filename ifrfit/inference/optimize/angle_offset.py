"""An unknown offset that all set angles have in common: where least squares puts it, and how well.

At a given offset the question is an ordinary one: so the search goes over one number, of minus twice the log
likelihood at the optimum there plus the square of the offset over its prior sd.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ifrfit.inference.diagnostics.thresholds import HALF
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.laplace import first_order_move
from ifrfit.inference.optimize.noise_modes import best_mode_from
from ifrfit.inference.optimize.optimum import Array
from ifrfit.inference.optimize.scalar_search import scalar_minima
from ifrfit.inference.optimize.solve import solve

_SPAN = 6.0  # prior sd to either side within which the offset is looked for
_GRID = 25  # places over that span
_STEP = 1e-4  # degrees, of central differences
_XATOL = 1e-5  # prior sd: how exactly the best offset is found


@dataclass(frozen=True)
class AngleOffset:
    """The offset of the set angles at the optimum, degrees, and its Gaussian approximation.

    Attributes
    ----------
    value, sd : float
        Best value, and standard deviation with the prior.
    prior_sd : float
        Of its normal prior about 0.
    carried : ndarray, (p,)
        How the coordinates of the expansion (kappa in the place of mu) move with the offset, per degree.
    common : ndarray, (n,)
        How each row's fitted value moves with the offset at given constants, per prior sd.
    minima : tuple of (float, float)
        Other local minima: how far minus twice the log likelihood lies above the best, and the offset.
    """

    value: float
    sd: float
    prior_sd: float
    carried: Array
    common: Array
    minima: tuple[tuple[float, float], ...]

    @property
    def pull(self) -> float:
        """Distance from its prior mean 0, in prior sd."""
        return self.value / self.prior_sd

    @property
    def is_determined(self) -> bool:
        """Whether the data halve the sd of its prior."""
        return self.sd < HALF * self.prior_sd


def offset_minima(problem: Problem, modes: Sequence[Array]) -> list[tuple[float, float]]:
    """Local minima over the offset as (minus twice the log likelihood with the prior, degrees), best first.

    They are looked for between 6 prior sd to either side, on a grid of half of a prior sd and by Brent's
    method about its dips. Where sigma is known each value is that of a certified optimum (if the closure has
    a certificate), else that of the best mode downhill from the given ones.

    Parameters
    ----------
    problem : Problem
        With an unknown offset.
    modes : sequence of ndarray
        theta of the modes at some offset; the first of them is where a search begins if nothing else finds an
        optimum.
    """
    assert problem.offset is not None
    low, high = problem.offset.lower, problem.offset.upper
    prior_sd = prior_sd_of(problem)

    def objective(degrees: Array) -> Array:
        misfit = [_misfit(problem.at_offset(each), modes) for each in degrees.tolist()]
        return np.array(misfit) + (degrees / prior_sd) ** 2

    low, high = max(low, -_SPAN * prior_sd), min(high, _SPAN * prior_sd)
    return scalar_minima(objective, low, high, (0.0,), n_grid=_GRID, xatol=_XATOL * prior_sd)


def prior_sd_of(problem: Problem) -> float:
    """Prior sd of a problem's unknown offset, degrees."""
    assert problem.error_model.offset is not None
    return problem.error_model.offset


def _misfit(problem: Problem, modes: Sequence[Array]) -> float:
    """Minus twice the log likelihood (up to a constant) with the priors at its optimum."""
    if problem.noise.is_known:
        near = None if problem.closure.bilinear else modes[0]
        return solve(problem, problem.noise.sigma, near).objective
    return best_mode_from(problem, modes).value


def offset_at(
    problem: Problem, sigma: Array, theta: Array, found: list[tuple[float, float]], prior_sd: float
) -> AngleOffset:
    """The Gaussian approximation of the offset about an optimum.

    Parameters
    ----------
    problem : Problem
        At the best offset.
    sigma : ndarray, (n,)
    theta : ndarray
        The optimum there.
    found : list of (float, float)
        As `offset_minima` gives them.
    prior_sd : float
    """
    common = slope_by_offset(problem, theta) * prior_sd
    moved, rest = first_order_move(problem, sigma, theta, common)
    (best, value), *others = found
    return AngleOffset(
        value,
        float(prior_sd / np.sqrt(1.0 + rest @ rest)),
        prior_sd,
        moved / prior_sd,
        common,
        tuple((other - best, place) for other, place in others),
    )


def slope_by_offset(problem: Problem, theta: Array) -> Array:
    """Derivative of each row's value by an offset of its angle, at given constants, per degree, (n,)."""
    up, down = (problem.at_offset(step).predict(theta) for step in (_STEP, -_STEP))
    return np.asarray((up - down) / (2.0 * _STEP))
