"""Quantities that follow from the constants: kappa, the transition angle, what the closure constant means."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ifrfit.inference.distributions.truncated_normal import quantile
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquares
from ifrfit.inference.result.types import Estimate
from ifrfit.inference.summary.kappa import kappa_of
from ifrfit.physics.closures import rotational_share
from ifrfit.physics.compliance import poisson_ratio
from ifrfit.physics.transition import transition_angles


def derived_of(
    problem: Problem, fit: LeastSquares, constants: Mapping[str, Estimate | Mapping[str, Estimate]]
) -> dict[str, Any]:
    """kappa, transition_angle_deg, and beta_sticking or poisson_ratio; by series where they differ."""
    each_kappa = {s: kappa_of(problem, fit, i) for i, s in enumerate(problem.series)}
    separate = any(c.separate for c in problem.constants if c.name in ("e_n", "mu"))
    return {
        "kappa": each_kappa if separate else each_kappa[problem.series[0]],
        "transition_angle_deg": {
            s: transition(problem, fit, i, each_kappa[s]) for i, s in enumerate(problem.series)
        },
    } | meaning_of(problem, constants)


def meaning_of(
    problem: Problem, constants: Mapping[str, Estimate | Mapping[str, Estimate]]
) -> dict[str, Any]:
    """What the closure constant stands for: beta_sticking; of chi the poisson_ratio of like materials."""
    if problem.closure.constant != "chi":
        return {"beta_sticking": sticking_of(problem, constants)}
    found = constants["chi"]
    if isinstance(found, Estimate):
        return {"poisson_ratio": poisson_of(problem, found)}
    return {"poisson_ratio": {series: poisson_of(problem, each) for series, each in found.items()}}


def poisson_of(problem: Problem, chi: Estimate) -> Estimate:
    """Poisson ratio of sphere and wall of one material; it falls as chi rises."""

    def nu(value: float) -> float:
        return float(poisson_ratio(value, problem.inertia_factor))

    ends = [(nu(high), nu(low)) for low, high in (chi.interval68, chi.interval95)]
    return Estimate(
        None if chi.value is None else nu(chi.value),
        None if chi.stderr is None else 0.5 * (ends[0][1] - ends[0][0]),
        ends[0],
        ends[1],
        chi.status,
        chi.reason,
    )


def sticking_of(problem: Problem, constants: Mapping[str, Estimate | Mapping[str, Estimate]]) -> Any:
    """Restitution of the contact point in sticking, from the estimates of the closure constant."""
    own = problem.closure.constant
    if own is None:
        return Estimate(0.0, None, (0.0, 0.0), (0.0, 0.0), "fixed", "zero in closure F")
    found = constants[own]
    if isinstance(found, Estimate):
        return beta_sticking(problem, found)
    return {series: beta_sticking(problem, each) for series, each in found.items()}


def beta_sticking(problem: Problem, c: Estimate) -> Estimate:
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
        None if c.mean is None else offset + slope * c.mean,
    )


def transition(
    problem: Problem, fit: LeastSquares, series: int, kappa: Estimate
) -> Estimate | list[Estimate] | None:
    """Transition angle(s) at the series' median spin; a list where there are two."""
    rows = problem.rows.series == series
    spin_x = float(np.median(problem.rows.incidence.spin_x[rows]))
    spin_y = float(np.median(problem.rows.incidence.spin_y[rows]))
    own = problem.closure.constant
    places = problem.positions()
    c = float(fit.optimum.theta[places[own][series]]) if own else 0.0
    law = problem.closure.law(problem.inertia_factor)
    bound = float(law.bound(c))
    if kappa.value is None or bound <= 0.0:
        return None
    tau = kappa.value / bound
    angles = transition_angles(tau, spin_x, spin_y)
    if not angles:
        return None
    i_e, i_mu = places["e_n"][series], places["mu"][series]
    e_n, mu = fit.optimum.theta[i_e], fit.optimum.theta[i_mu]
    functional = ((1.0 + e_n) * fit.gaussian.to_theta[i_mu] + mu * fit.gaussian.to_theta[i_e]) / bound
    if own:
        functional = (
            functional - tau * float(law.bound_slope(c)) / bound * fit.gaussian.to_theta[places[own][series]]
        )
    sd = math.sqrt(fit.gaussian.variance(functional, 1.0))
    found = []
    for number, angle in enumerate(angles):
        ends = []
        for p in (0.16, 0.84), (0.025, 0.975):
            taus = [quantile(q, tau, sd, 0.0, math.inf, fit.noise_dof) for q in p]
            at = [angle_near(t, spin_x, spin_y, number, len(angles), angle) for t in taus]
            ends.append((min(at), max(at)))
        half = 0.5 * (ends[0][1] - ends[0][0]) if kappa.stderr is not None else None
        found.append(Estimate(angle, half, ends[0], ends[1], kappa.status, kappa.reason))
    return found[0] if len(found) == 1 else found


def angle_near(tau: float, spin_x: float, spin_y: float, number: int, count: int, angle: float) -> float:
    """The same branch of the transition at another tau; the end of the scale where it has none."""
    angles = transition_angles(tau, spin_x, spin_y)
    if len(angles) == count:
        return angles[number]
    if len(angles) == 1:
        return angles[0] if abs(angles[0] - angle) < 45.0 else (0.0 if number == 0 else 90.0)
    if not angles and count == 2:
        return math.degrees(math.asin(min(1.0, max(0.0, -spin_y / (1.0 + tau * tau)))))
    return 0.0 if tau * tau < spin_x * spin_x + spin_y * spin_y or spin_y >= 0.0 else 90.0
