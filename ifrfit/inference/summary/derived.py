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
from ifrfit.physics.closures import Meaning
from ifrfit.physics.transition import transition_angles


def derived_of(
    problem: Problem, fit: LeastSquares, constants: Mapping[str, Estimate | Mapping[str, Estimate]]
) -> dict[str, Any]:
    """kappa, transition_angle_deg, what the closure constant stands for; by series where they differ."""
    each_kappa = {s: kappa_of(problem, fit, i) for i, s in enumerate(problem.series)}
    separate = any(c.separate for c in problem.parameters if c.name in ("e_n", "mu"))
    return {
        "kappa": each_kappa if separate else each_kappa[problem.series[0]],
        "transition_angle_deg": {
            s: transition(problem, fit, i, each_kappa[s]) for i, s in enumerate(problem.series)
        },
    } | meaning_of(problem, constants)


def meaning_of(
    problem: Problem, constants: Mapping[str, Estimate | Mapping[str, Estimate]]
) -> dict[str, Any]:
    """What the closure constant stands for, see `Closure.meaning`; empty where nothing is known of it."""
    closure, j = problem.closure, problem.inertia_factor
    meaning = closure.meaning
    if meaning is None:
        return {}
    if closure.constant is None:
        value = meaning.value(0.0, j)
        reason = f"{f'{value:g}' if value else 'zero'} in closure {closure.title}"
        return {meaning.name: Estimate(value, None, (value, value), (value, value), "fixed", reason)}
    found = constants[closure.constant]
    if isinstance(found, Estimate):
        return {meaning.name: _meant(meaning, found, j)}
    return {meaning.name: {series: _meant(meaning, each, j) for series, each in found.items()}}


def _meant(meaning: Meaning, c: Estimate, j: float) -> Estimate:
    """The quantity by the estimate of the constant: intervals map, as it is monotone."""

    def value(x: float) -> float:
        return meaning.value(x, j)

    inner, outer = (
        (min(ends), max(ends))
        for ends in ((value(low), value(high)) for low, high in (c.interval68, c.interval95))
    )
    sd = None
    if c.stderr is not None:
        sd = abs(value(1.0) - value(0.0)) * c.stderr if meaning.linear else 0.5 * (inner[1] - inner[0])
    return Estimate(
        None if c.value is None else value(c.value),
        sd,
        inner,
        outer,
        c.status,
        c.reason,
        value(c.mean) if meaning.linear and c.mean is not None else None,
    )


def transition(
    problem: Problem, fit: LeastSquares, series: int, kappa: Estimate
) -> Estimate | list[Estimate] | None:
    """Transition angle(s) at the series' median spin; a list where there are two."""
    rows = problem.rows.series == series
    spin_x = float(np.median(problem.rows.incidence.spin_x[rows]))
    spin_y = float(np.median(problem.rows.incidence.spin_y[rows]))
    own = problem.closure.constant
    places = problem.parameters.positions
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
