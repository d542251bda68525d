"""Constants with intervals and statuses, by the rules of the table of statuses."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ifrfit.inference.diagnostics.identifiability import only_kappa_is_seen
from ifrfit.inference.diagnostics.thresholds import HALF
from ifrfit.inference.distributions.truncated_normal import half_width, quantile
from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.laplace import gaussian_approximation
from ifrfit.inference.optimize.least_squares import LeastSquares
from ifrfit.inference.profile.open_estimates import is_local, open_estimate, outlying
from ifrfit.inference.result.types import Estimate, Interval
from ifrfit.inference.summary.kappa import kappa_of

_AT_BOUND = 1e-9


def constants_of(problem: Problem, fit: LeastSquares) -> dict[str, Estimate | Mapping[str, Estimate]]:
    """Every constant as an `Estimate`, or one a series where it is separate."""
    found: dict[str, Estimate | Mapping[str, Estimate]] = {}
    position = 0
    for constant in problem.parameters:
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
    problem: Problem, fit: LeastSquares, constant: Parameter, position: int, series: int | None
) -> Estimate:
    """One entry of theta with its status.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquares
    constant : Parameter
    position : int
        Of the entry in theta.
    series : int or None
        Of the entry, where the constant is separate.
    """
    value = float(fit.optimum.theta[position])
    if constant.fixed is not None:
        return Estimate(value, None, (value, value), (value, value), "fixed", "fixed by you")
    functional = fit.gaussian.to_theta[position]
    sd = math.sqrt(fit.gaussian.variance(functional, constant.prior_sd))
    half = HALF * constant.prior_sd
    rivals = [float(theta[position]) for theta in outlying(fit.optimum)]
    leans = leans_on_prior(problem, fit, position, constant, sd)
    # the width of a prior is known, whatever the noise of the rows
    dof = math.inf if leans and constant.prior is not None else fit.noise_dof
    reach = half_width(0.95, dof) * sd
    if constant.name in ("e_n", "mu") and only_kappa_is_seen(problem):
        return _through_kappa(problem, fit, constant, series or 0)
    seen = math.isfinite(sd) and not too_few(problem, constant)
    if not sd < half or not seen or not is_local(value, reach, rivals):
        return open_estimate(problem, fit, constant, position, series, seen=seen)
    side = _side(constant, value, reach)
    if side:
        return _one_sided(fit, constant, position, side, sd)
    intervals = _intervals(constant, value, sd, dof)
    return Estimate(value, sd, *intervals, "prior" if leans else "determined", leans)


def _through_kappa(problem: Problem, fit: LeastSquares, constant: Parameter, series: int) -> Estimate:
    """e_n is anywhere in its domain, and mu is what kappa leaves of it."""
    e_n = problem.parameters["e_n"]
    if constant.name == "e_n":
        everything = (e_n.lower, e_n.upper)
        return Estimate(None, None, everything, everything, "not_determined", "the data do not fix a value")
    kappa = kappa_of(problem, fit, series)

    def shared_out(interval: Interval) -> Interval:
        return interval[0] / (1.0 + e_n.upper), interval[1] / (1.0 + e_n.lower)

    ends = shared_out(kappa.interval68), shared_out(kappa.interval95)
    if kappa.status == "one_sided":
        reason = "only a lower limit" if math.isinf(ends[1][1]) else "only an upper limit"
        return Estimate(None, None, *ends, "one_sided", reason)
    return Estimate(None, None, *ends, "not_determined", "the data fix kappa = mu (1 + e_n) only")


def too_few(problem: Problem, constant: Parameter) -> bool:
    """Whether there are no more oblique rows than constants that only they know: then nothing is tested."""
    kinds = problem.rows.kinds
    oblique = int(np.isin(kinds, ("tangential", "curved")).sum())
    direct = {"e_n": "normal", "mu": "friction"}
    if oblique == 0 or constant.prior is not None or direct.get(constant.name) in kinds:
        return False
    known = {name for name, kind in direct.items() if kind in kinds}
    unknown = [
        c for c in problem.parameters.entries if c.fixed is None and c.prior is None and c.name not in known
    ]
    return oblique <= len(unknown)


def _side(constant: Parameter, value: float, reach: float) -> int:
    """-1 if the 95 % interval reaches the lower bound, 1 for the upper, 0 if it closes on both sides."""
    low, high = value - constant.lower, constant.upper - value
    if min(low, high) > reach + _AT_BOUND * max(1.0, abs(value)):
        return 0
    return -1 if low <= high else 1


def _intervals(constant: Parameter, center: float, sd: float, dof: float) -> tuple[Interval, Interval]:
    """Central 68 and 95 % intervals of the local law, cut at the bounds."""

    def q(p: float) -> float:
        return quantile(p, center, sd, constant.lower, constant.upper, dof)

    return (q(0.16), q(0.84)), (q(0.025), q(0.975))


def _one_sided(fit: LeastSquares, constant: Parameter, position: int, side: int, sd: float) -> Estimate:
    """An interval that runs from the bound to its quantile.

    Where the bound holds the optimum back, the local law has its centre beyond, and is cut there.
    """
    value = float(fit.optimum.theta[position])
    bound = constant.lower if side < 0 else constant.upper
    held = abs(value - bound) <= _AT_BOUND * max(1.0, abs(bound))
    center = value - 0.5 * sd * sd * float(fit.gaussian.gradient[position]) if held else value

    def edge(p: float) -> float:
        at = p if side < 0 else 1.0 - p
        return quantile(at, center, sd, constant.lower, constant.upper, fit.noise_dof)

    ends = [(bound, edge(p)) if side < 0 else (edge(p), bound) for p in (0.68, 0.95)]
    reason = f"lies on its bound {bound:g}" if held else f"not told from its bound {bound:g}"
    return Estimate(value, sd, ends[0], ends[1], "one_sided", reason)


def leans_on_prior(problem: Problem, fit: LeastSquares, position: int, constant: Parameter, sd: float) -> str:
    """The reason if the user's priors halve the sd, else nothing."""
    named = [c.name for c in problem.parameters if c.prior is not None]
    if not named:
        return ""
    bare = gaussian_approximation(problem, fit.sigma, fit.optimum.theta, with_priors=False)
    without = math.sqrt(bare.variance(bare.to_theta[position], constant.prior_sd))
    if sd < HALF * without:
        return f"rests on your prior of {' and '.join(named)}"
    return ""
