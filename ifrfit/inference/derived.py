"""Quantities that follow from the constants: kappa, the restitution in sticking, the transition angle."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ifrfit.inference.constants import Constant
from ifrfit.inference.estimates import open_estimate
from ifrfit.inference.least_squares import LeastSquares
from ifrfit.inference.problem import Problem
from ifrfit.inference.result import Estimate, Interval
from ifrfit.inference.truncated import half_width, quantile
from ifrfit.physics.closures import rotational_share
from ifrfit.physics.transition import transition_angles


def derived_of(
    problem: Problem, fit: LeastSquares, constants: Mapping[str, Estimate | Mapping[str, Estimate]]
) -> dict[str, Any]:
    """kappa, transition_angle_deg and beta_sticking; by series where they differ."""
    each_kappa = {s: _kappa(problem, fit, i) for i, s in enumerate(problem.series)}
    separate = any(c.separate for c in problem.constants if c.name in ("e_n", "mu"))
    own = problem.closure.constant
    sticking: Any
    if own is None:
        sticking = Estimate(0.0, None, (0.0, 0.0), (0.0, 0.0), "fixed", "zero in closure F")
    else:
        found = constants[own]
        if isinstance(found, Estimate):
            sticking = _beta_sticking(problem, found)
        else:
            sticking = {s: _beta_sticking(problem, e) for s, e in found.items()}
    return {
        "kappa": each_kappa if separate else each_kappa[problem.series[0]],
        "transition_angle_deg": {
            s: _transition(problem, fit, i, each_kappa[s]) for i, s in enumerate(problem.series)
        },
        "beta_sticking": sticking,
    }


def _kappa(problem: Problem, fit: LeastSquares, series: int) -> Estimate:
    """kappa = mu (1 + e_n): what tangential data determine even where they leave e_n and mu open."""
    places = problem.positions()
    i_e, i_mu = int(places["e_n"][series]), int(places["mu"][series])
    theta = fit.optimum.theta
    e_n = float(theta[i_e])
    entries = problem.entries()
    if entries[i_e].fixed is not None and entries[i_mu].fixed is not None:
        value = float(theta[i_mu]) * (1.0 + e_n)
        return Estimate(value, None, (value, value), (value, value), "fixed", "mu (1 + e_n)")
    value = float(theta[i_mu]) * (1.0 + e_n)
    # d kappa/d phi: the coordinate itself, or by the product rule where mu is the coordinate
    functional = (1.0 + e_n) * fit.local.to_theta[i_mu] + theta[i_mu] * fit.local.to_theta[i_e]
    constant = Constant(
        "kappa",
        entries[i_mu].lower * (1.0 + entries[i_e].lower),
        entries[i_mu].upper * (1.0 + entries[i_e].upper),
    )
    sd = math.sqrt(fit.local.variance(functional, constant.prior_sd))
    rivals = [float(theta[i_mu] * (1.0 + theta[i_e])) for _, theta in fit.optimum.minima[1:]]
    reach = half_width(0.95, fit.noise_dof) * sd
    if sd < 0.5 * constant.prior_sd and all(abs(rival - value) <= reach for rival in rivals):

        def q(p: float) -> float:
            return quantile(p, value, sd, constant.lower, constant.upper, fit.noise_dof)

        if value - constant.lower <= reach:
            reason = f"not told from its bound {constant.lower:g}"
            low = constant.lower
            return Estimate(value, sd, (low, q(0.68)), (low, q(0.95)), "one_sided", reason)
        return Estimate(value, sd, (q(0.16), q(0.84)), (q(0.025), q(0.975)), "determined", "mu (1 + e_n)")
    return _open_kappa(problem, fit, series, e_n, constant, seen=math.isfinite(sd))


def _open_kappa(
    problem: Problem, fit: LeastSquares, series: int, e_n: float, kappa: Constant, *, seen: bool
) -> Estimate:
    """What kappa may be where the data do not fix it: the profile of mu with e_n held."""
    mu = next(c for c in problem.constants if c.name == "mu")
    if mu.fixed is not None:
        everything = (kappa.lower, kappa.upper)
        return Estimate(None, None, everything, everything, "not_determined", "e_n is open")
    held = tuple(
        replace(c, fixed=e_n, prior=None, separate=False) if c.name == "e_n" else c for c in problem.constants
    )
    at_e_n = replace(problem, constants=held)
    old, new = problem.positions(), at_e_n.positions()
    minima = []
    for objective, before in fit.optimum.minima:
        theta = np.zeros(len(at_e_n.names))
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

    return replace(estimate, interval68=scaled(estimate.interval68), interval95=scaled(estimate.interval95))


def _beta_sticking(problem: Problem, c: Estimate) -> Estimate:
    """(a + b)/(J/(1 + J)) - 1, linear in the closure constant."""
    linear = problem.closure.coefficients(problem.inertia_factor)
    share = rotational_share(problem.inertia_factor)
    offset, slope = (linear.a0 + linear.b0) / share - 1.0, (linear.a1 + linear.b1) / share
    return Estimate(
        None if c.value is None else offset + slope * c.value,
        None if c.stderr is None else slope * c.stderr,
        (offset + slope * c.interval68[0], offset + slope * c.interval68[1]),
        (offset + slope * c.interval95[0], offset + slope * c.interval95[1]),
        c.status,
        c.reason,
    )


def _transition(
    problem: Problem, fit: LeastSquares, series: int, kappa: Estimate
) -> Estimate | list[Estimate] | None:
    """Transition angle(s) at the series' median spin; a list where there are two."""
    rows = problem.rows.series == series
    spin_x = float(np.median(problem.rows.incidence.spin_x[rows]))
    spin_y = float(np.median(problem.rows.incidence.spin_y[rows]))
    own = problem.closure.constant
    places = problem.positions()
    c = float(fit.optimum.theta[places[own][series]]) if own else 0.0
    linear = problem.closure.coefficients(problem.inertia_factor)
    bound = linear.b0 + linear.b1 * c
    if kappa.value is None or bound <= 0.0:
        return None
    tau = kappa.value / bound
    angles = transition_angles(tau, spin_x, spin_y)
    if not angles:
        return None
    i_e, i_mu = places["e_n"][series], places["mu"][series]
    e_n, mu = fit.optimum.theta[i_e], fit.optimum.theta[i_mu]
    functional = ((1.0 + e_n) * fit.local.to_theta[i_mu] + mu * fit.local.to_theta[i_e]) / bound
    if own:
        functional = functional - tau * linear.b1 / bound * fit.local.to_theta[places[own][series]]
    sd = math.sqrt(fit.local.variance(functional, 1.0))
    found = []
    for number, angle in enumerate(angles):
        ends = []
        for p in (0.16, 0.84), (0.025, 0.975):
            taus = [quantile(q, tau, sd, 0.0, math.inf, fit.noise_dof) for q in p]
            at = [_angle_near(t, spin_x, spin_y, number, len(angles), angle) for t in taus]
            ends.append((min(at), max(at)))
        half = 0.5 * (ends[0][1] - ends[0][0]) if kappa.stderr is not None else None
        found.append(Estimate(angle, half, ends[0], ends[1], kappa.status, kappa.reason))
    return found[0] if len(found) == 1 else found


def _angle_near(tau: float, spin_x: float, spin_y: float, number: int, count: int, angle: float) -> float:
    """The same branch of the transition at another tau; the end of the scale where it has none."""
    angles = transition_angles(tau, spin_x, spin_y)
    if len(angles) == count:
        return angles[number]
    if len(angles) == 1:
        return angles[0] if abs(angles[0] - angle) < 45.0 else (0.0 if number == 0 else 90.0)
    if not angles and count == 2:
        return math.degrees(math.asin(min(1.0, max(0.0, -spin_y / (1.0 + tau * tau)))))
    return 0.0 if tau * tau < spin_x * spin_x + spin_y * spin_y or spin_y >= 0.0 else 90.0
