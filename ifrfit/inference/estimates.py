"""Constants with intervals and statuses, by the rules of the table of statuses."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ifrfit.inference.constants import Constant
from ifrfit.inference.least_squares import LeastSquares
from ifrfit.inference.local import local_picture
from ifrfit.inference.problem import Problem
from ifrfit.inference.profile import CENTRAL, ONE_SIDED, crossing, profile_function, series_problem
from ifrfit.inference.result import Estimate, Interval
from ifrfit.inference.rules import HALF
from ifrfit.inference.truncated import half_width, quantile
from ifrfit.physics.observables import OBSERVABLES

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
    half = HALF * constant.prior_sd
    rivals = [float(theta[position]) for _, theta in fit.optimum.minima[1:]]
    reach = half_width(0.95, fit.noise_dof) * sd
    seen = math.isfinite(sd) and not _too_few(problem, constant)
    if not sd < half or not seen or any(abs(rival - value) > reach for rival in rivals):
        return open_estimate(problem, fit, constant, position, series, seen=seen)
    side = _side(constant, value, reach)
    if side:
        return _one_sided(fit, constant, position, side, sd)
    leans = _leans_on_prior(problem, fit, position, constant, sd)
    if leans:
        # the width of a prior is known, whatever the noise of the rows
        dof = math.inf if constant.prior is not None else fit.noise_dof
        return Estimate(value, sd, *_intervals(constant, value, sd, dof), "prior", leans)
    return Estimate(value, sd, *_intervals(constant, value, sd, fit.noise_dof), "determined")


def _too_few(problem: Problem, constant: Constant) -> bool:
    """Whether there are no more oblique rows than constants that only they know: then nothing is tested."""
    kinds = np.array([OBSERVABLES[name].kind for name in problem.rows.names])[problem.rows.which]
    oblique = int(np.isin(kinds, ("tangential", "curved")).sum())
    direct = {"e_n": "normal", "mu": "friction"}
    if oblique == 0 or constant.prior is not None or direct.get(constant.name) in kinds:
        return False
    known = {name for name, kind in direct.items() if kind in kinds}
    unknown = [c for c in problem.entries() if c.fixed is None and c.prior is None and c.name not in known]
    return oblique <= len(unknown)


def _side(constant: Constant, value: float, reach: float) -> int:
    """-1 if the 95 % interval reaches the lower bound, 1 for the upper, 0 if it closes on both sides."""
    low, high = value - constant.lower, constant.upper - value
    if min(low, high) > reach + _AT_BOUND * max(1.0, abs(value)):
        return 0
    return -1 if low <= high else 1


def _intervals(constant: Constant, center: float, sd: float, dof: float) -> tuple[Interval, Interval]:
    """Central 68 and 95 % intervals of the local law, cut at the bounds."""

    def q(p: float) -> float:
        return quantile(p, center, sd, constant.lower, constant.upper, dof)

    return (q(0.16), q(0.84)), (q(0.025), q(0.975))


def _one_sided(fit: LeastSquares, constant: Constant, position: int, side: int, sd: float) -> Estimate:
    """An interval that runs from the bound to its quantile.

    Where the bound holds the optimum back, the local law has its centre beyond, and is cut there.
    """
    value = float(fit.optimum.theta[position])
    bound = constant.lower if side < 0 else constant.upper
    held = abs(value - bound) <= _AT_BOUND * max(1.0, abs(bound))
    center = value - 0.5 * sd * sd * float(fit.local.gradient[position]) if held else value

    def edge(p: float) -> float:
        at = p if side < 0 else 1.0 - p
        return quantile(at, center, sd, constant.lower, constant.upper, fit.noise_dof)

    ends = [(bound, edge(p)) if side < 0 else (edge(p), bound) for p in (0.68, 0.95)]
    reason = f"lies on its bound {bound:g}" if held else f"not told from its bound {bound:g}"
    return Estimate(value, sd, ends[0], ends[1], "one_sided", reason)


def _leans_on_prior(problem: Problem, fit: LeastSquares, position: int, constant: Constant, sd: float) -> str:
    """The reason if the user's priors halve the sd, else nothing."""
    named = [c.name for c in problem.constants if c.prior is not None]
    if not named:
        return ""
    bare = local_picture(problem, fit.sigma, fit.optimum.theta, with_priors=False)
    without = math.sqrt(bare.variance(bare.to_theta[position], constant.prior_sd))
    if sd < HALF * without:
        return f"rests on your prior of {' and '.join(named)}"
    return ""


def open_estimate(
    problem: Problem,
    fit: LeastSquares,
    constant: Constant,
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
        places = [at[series] for at in problem.positions().values()]
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
