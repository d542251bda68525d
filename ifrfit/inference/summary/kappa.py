"""kappa = mu (1 + e_n): what tangential data determine even where they leave e_n and mu open."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ifrfit.inference.diagnostics.thresholds import HALF
from ifrfit.inference.distributions.truncated_normal import half_width, quantile
from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquares
from ifrfit.inference.profile.open_estimates import is_local, open_estimate, outlying
from ifrfit.inference.result.types import Estimate, Interval


def kappa_of(problem: Problem, fit: LeastSquares, series: int) -> Estimate:
    """kappa of one series with its status."""
    places = problem.parameters.positions
    i_e, i_mu = int(places["e_n"][series]), int(places["mu"][series])
    theta = fit.optimum.theta
    e_n = float(theta[i_e])
    entries = problem.parameters.entries
    if entries[i_e].fixed is not None and entries[i_mu].fixed is not None:
        value = float(theta[i_mu]) * (1.0 + e_n)
        return Estimate(value, None, (value, value), (value, value), "fixed", "mu (1 + e_n)")
    value = float(theta[i_mu]) * (1.0 + e_n)
    # d kappa/d phi: the coordinate itself, or by the product rule where mu is the coordinate
    functional = (1.0 + e_n) * fit.gaussian.to_theta[i_mu] + theta[i_mu] * fit.gaussian.to_theta[i_e]
    constant = Parameter("kappa", *kappa_bounds(problem, series))
    sd = math.sqrt(fit.gaussian.variance(functional, constant.prior_sd))
    rivals = [float(theta[i_mu] * (1.0 + theta[i_e])) for theta in outlying(fit.optimum)]
    reach = half_width(0.95, fit.noise_dof) * sd
    if sd < HALF * constant.prior_sd and is_local(value, reach, rivals):

        def q(p: float) -> float:
            return quantile(p, value, sd, constant.lower, constant.upper, fit.noise_dof)

        if value - constant.lower <= reach:
            reason = f"not told from its bound {constant.lower:g}"
            low = constant.lower
            return Estimate(value, sd, (low, q(0.68)), (low, q(0.95)), "one_sided", reason)
        return Estimate(value, sd, (q(0.16), q(0.84)), (q(0.025), q(0.975)), "determined", "mu (1 + e_n)")
    return _open_kappa(problem, fit, series, e_n, constant, seen=math.isfinite(sd))


def kappa_bounds(problem: Problem, series: int) -> tuple[float, float]:
    """Domain of kappa in a series."""
    places, entries = problem.parameters.positions, problem.parameters.entries
    e_n, mu = entries[int(places["e_n"][series])], entries[int(places["mu"][series])]
    return mu.lower * (1.0 + e_n.lower), mu.upper * (1.0 + e_n.upper)


def _open_kappa(
    problem: Problem, fit: LeastSquares, series: int, e_n: float, kappa: Parameter, *, seen: bool
) -> Estimate:
    """What kappa may be where the data do not fix it: the profile of mu with e_n held."""
    mu = problem.parameters["mu"]
    if mu.fixed is not None:
        everything = (kappa.lower, kappa.upper)
        return Estimate(None, None, everything, everything, "not_determined", "e_n is open")
    shared = replace(problem.parameters["e_n"].fixed_at(e_n), separate=False)
    at_e_n = problem.with_parameters([shared])
    old, new = problem.parameters.positions, at_e_n.parameters.positions
    minima = []
    for objective, before in fit.optimum.minima:
        theta = np.zeros(len(at_e_n.parameters.names))
        for name, places in new.items():
            theta[places] = before[old[name]]
        theta[new["e_n"]] = e_n
        minima.append((objective, theta))
    moved = replace(fit, optimum=replace(fit.optimum, theta=minima[0][1], minima=tuple(minima)))
    own_series = series if mu.separate else None
    found = open_estimate(at_e_n, moved, mu, int(new["mu"][series]), own_series, seen=seen)
    return _times(found, 1.0 + e_n)


def _times(estimate: Estimate, factor: float) -> Estimate:
    def scaled(interval: Interval) -> Interval:
        return interval[0] * factor, interval[1] * factor

    return replace(
        estimate,
        value=None if estimate.value is None else estimate.value * factor,
        stderr=None if estimate.stderr is None else estimate.stderr * factor,
        interval68=scaled(estimate.interval68),
        interval95=scaled(estimate.interval95),
    )
