"""What the data allow where a local law does not tell: profiles over all optima."""

from __future__ import annotations

import math
from collections.abc import Mapping

from ifrfit.inference.diagnostics.thresholds import HALF
from ifrfit.inference.distributions.truncated_normal import half_width
from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquares
from ifrfit.inference.optimize.optimum import Array, Optimum
from ifrfit.inference.profile.scalar_profile import (
    CENTRAL,
    ONE_SIDED,
    crossing,
    profile_function,
    series_problem,
)
from ifrfit.inference.result.types import Estimate, Interval

_AT_BOUND = 1e-9
# times the local 95 % interval; the local law knows nothing of what lies further out
_BEYOND = 1.25


def is_local(value: float, reach: float, others: list[float]) -> bool:
    """Whether everything that describes the data nearly as well lies about the local 95 % interval."""
    return all(abs(other - value) <= _BEYOND * reach for other in others)


def outlying(optimum: Optimum) -> list[Array]:
    """Constants elsewhere that describe the data nearly as well as the optimum does."""
    return [theta for _, theta in optimum.minima[1:]] + list(optimum.extremes)


def open_estimate(
    problem: Problem,
    fit: LeastSquares,
    constant: Parameter,
    position: int,
    series: int | None,
    *,
    seen: bool,
) -> Estimate:
    """What the data allow where a local law does not tell: the profile to both sides, over all optima.

    A constant that leans on a direction the data do not see (`seen` false) is never called determined,
    however short its profile: that is what the bounds of another constant leave of it. A separate constant
    is profiled on its own series, with constants of its own: that allows no less than the joint fit does.
    """
    optima = [theta for _, theta in fit.optimum.minima]
    values = [float(theta[position]) for theta in optima]
    sigma = fit.sigma
    if series is not None:
        places = [at[series] for at in problem.parameters.positions.values()]
        optima = [theta[places] for theta in optima]
        problem, sigma = series_problem(problem, sigma, series)
    function = profile_function(problem, sigma, constant.name, optima[0])
    base = function(values[0])
    step = 0.02 * constant.prior_sd

    def ends(rises: Mapping[float, float], level: float) -> Interval:
        target = base + rises[level]
        within = [x for x in values if x == values[0] or function(x) <= target]
        low = crossing(function, min(within), constant.lower, step, target)
        return low, crossing(function, max(within), constant.upper, step, target)

    central = ends(CENTRAL, 0.68), ends(CENTRAL, 0.95)
    low, high = central[1]
    closed = low > constant.lower + _AT_BOUND, high < constant.upper - _AT_BOUND
    spread = (high - low) / (2.0 * half_width(0.95))
    if all(closed) and seen and fit.optimum.n_same == 1 and spread < HALF * constant.prior_sd:
        reason = "several optima describe the data" if len(optima) > 1 else "by its profile"
        return Estimate(values[0], spread, *central, "determined", reason)
    wide = high - low > 0.9 * math.sqrt(12.0) * constant.prior_sd
    if closed[0] != closed[1] and not (wide and closed[1]):
        one = ends(ONE_SIDED, 0.68), ends(ONE_SIDED, 0.95)
        if closed[0]:
            pair = [(end[0], constant.upper) for end in one]
        else:
            pair = [(constant.lower, end[1]) for end in one]
        reason = f"only {'a lower' if closed[0] else 'an upper'} limit"
        return Estimate(None, None, pair[0], pair[1], "one_sided", reason)
    reason = (
        "two optima are equally good" if seen and fit.optimum.n_same > 1 else "the data do not fix a value"
    )
    return Estimate(None, None, *central, "not_determined", reason)
