"""Constants with intervals and statuses, by the rules of the table of statuses."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ifrfit.inference.constants import Constant
from ifrfit.inference.least_squares import LeastSquares
from ifrfit.inference.local import local_picture
from ifrfit.inference.optimum import Array
from ifrfit.inference.problem import Problem
from ifrfit.inference.profile import CENTRAL, ONE_SIDED, crossing, profile_function, series_problem
from ifrfit.inference.result import Estimate, Interval
from ifrfit.inference.truncated import quantile

_AT_BOUND = 1e-9


def constants_of(problem: Problem, fit: LeastSquares) -> dict[str, Estimate | Mapping[str, Estimate]]:
    """Every constant as an `Estimate`, or one a series where it is separate."""
    found: dict[str, Estimate | Mapping[str, Estimate]] = {}
    position = 0
    for constant in problem.constants:
        if not constant.separate:
            found[constant.name] = estimate(problem, fit, constant, position, None)
            position += 1
            continue
        each = {}
        for number, series in enumerate(problem.series):
            each[series] = estimate(problem, fit, constant, position, number)
            position += 1
        found[constant.name] = each
    return found


def estimate(
    problem: Problem, fit: LeastSquares, constant: Constant, position: int, series: int | None
) -> Estimate:
    """One entry of theta with its status.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquares
    constant : Constant
    position : int
        Of the entry in theta.
    series : int or None
        Of the entry, where the constant is separate.
    """
    value = float(fit.optimum.theta[position])
    if constant.fixed is not None:
        return Estimate(value, None, (value, value), (value, value), "fixed", "fixed by you")
    functional = fit.local.to_theta[position]
    sd = math.sqrt(fit.local.variance(functional, constant.prior_sd))
    half = 0.5 * constant.prior_sd
    side = _side(constant, value)
    if side and sd < half:
        return _on_bound(problem, fit, constant, position, side, sd)
    if sd < half:
        intervals = _intervals(fit, constant, value, sd)
        leans = _leans_on_prior(problem, fit, position, constant, sd)
        if leans:
            return Estimate(value, sd, *intervals, "prior", leans)
        return Estimate(value, sd, *intervals, "determined")
    return open_estimate(problem, fit.sigma, constant, value, series)


def _side(constant: Constant, value: float) -> int:
    """-1 on the lower bound, 1 on the upper, 0 between."""
    if value - constant.lower <= _AT_BOUND * max(1.0, abs(constant.lower)):
        return -1
    if math.isfinite(constant.upper) and constant.upper - value <= _AT_BOUND * max(1.0, abs(constant.upper)):
        return 1
    return 0


def _intervals(fit: LeastSquares, constant: Constant, center: float, sd: float) -> tuple[Interval, Interval]:
    """Central 68 and 95 % intervals of the local law, cut at the bounds."""

    def q(p: float) -> float:
        return quantile(p, center, sd, constant.lower, constant.upper, fit.noise_dof)

    return (q(0.16), q(0.84)), (q(0.025), q(0.975))


def _on_bound(
    problem: Problem, fit: LeastSquares, constant: Constant, position: int, side: int, sd: float
) -> Estimate:
    """An optimum held back by its bound: the law's centre lies beyond, and is cut there."""
    value = float(fit.optimum.theta[position])
    variance = fit.local.variance(fit.local.to_theta[position], constant.prior_sd)
    gradient = float(fit.local.gradient[position])
    center = value - 0.5 * variance * gradient
    bound = constant.lower if side < 0 else constant.upper
    ends = []
    for p in (0.68, 0.95):
        edge = quantile(p if side < 0 else 1.0 - p, center, sd, constant.lower, constant.upper, fit.noise_dof)
        ends.append((bound, edge) if side < 0 else (edge, bound))
    return Estimate(value, sd, ends[0], ends[1], "one_sided", f"lies on its bound {bound:g}")


def _leans_on_prior(problem: Problem, fit: LeastSquares, position: int, constant: Constant, sd: float) -> str:
    """The reason if the user's priors halve the sd, else nothing."""
    named = [c.name for c in problem.constants if c.prior is not None]
    if not named:
        return ""
    bare = local_picture(problem, fit.sigma, fit.optimum.theta, with_priors=False)
    without = math.sqrt(bare.variance(bare.to_theta[position], constant.prior_sd))
    if sd < 0.5 * without:
        return f"rests on your prior of {' and '.join(named)}"
    return ""


def open_estimate(
    problem: Problem, sigma: Array, constant: Constant, value: float, series: int | None
) -> Estimate:
    """What the data allow where they do not fix a value: profile to both sides.

    A separate constant is profiled on its own series, with constants of its own: that allows no less than
    the joint fit does.
    """
    if series is not None:
        problem, sigma = series_problem(problem, sigma, series)
        value = float(np.clip(value, constant.lower, constant.upper))
    function = profile_function(problem, sigma, constant.name)
    base = function(value)
    step = 0.05 * constant.prior_sd
    ends: dict[float, Interval] = {}
    for level, rise in CENTRAL.items():
        ends[level] = (
            crossing(function, value, constant.lower, step, base + rise),
            crossing(function, value, constant.upper, step, base + rise),
        )
    closed_low = ends[0.95][0] > constant.lower + _AT_BOUND
    closed_high = ends[0.95][1] < constant.upper - _AT_BOUND
    wide = ends[0.95][1] - ends[0.95][0] > 0.9 * math.sqrt(12.0) * constant.prior_sd
    if closed_low != closed_high and not (wide and closed_high):
        limit = constant.lower if closed_low else constant.upper
        one = {
            level: crossing(function, value, limit, step, base + rise) for level, rise in ONE_SIDED.items()
        }
        pair = [
            (one[level], constant.upper) if closed_low else (constant.lower, one[level])
            for level in (0.68, 0.95)
        ]
        reason = "only a lower limit" if closed_low else "only an upper limit"
        return Estimate(None, None, pair[0], pair[1], "one_sided", reason)
    return Estimate(None, None, ends[0.68], ends[0.95], "not_determined", "the data do not fix a value")
