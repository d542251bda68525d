"""Quantities that follow from the constants: kappa, the transition angle, what the closure constant means."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ifrfit.inference.distributions.protocol import LEVELS, Distribution, transition_name
from ifrfit.inference.distributions.truncated_gaussian import TruncatedGaussian
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.result.types import Constants, Estimate
from ifrfit.physics.closures import rotational_share
from ifrfit.physics.compliance import poisson_ratio
from ifrfit.physics.transition import transition_angles

Angles = Estimate | list[Estimate] | None


def derived_of(
    problem: Problem, constants: Constants, kappas: Mapping[str, Estimate], transitions: Mapping[str, Angles]
) -> dict[str, Any]:
    """kappa, transition_angle_deg, and beta_sticking or poisson_ratio; by series where they differ."""
    separate = any(c.separate for c in problem.parameters if c.name in ("e_n", "mu"))
    return {
        "kappa": dict(kappas) if separate else kappas[problem.series[0]],
        "transition_angle_deg": dict(transitions),
    } | _meaning(problem, constants)


def _meaning(problem: Problem, constants: Constants) -> dict[str, Any]:
    """What the closure constant stands for: beta_sticking; of chi the poisson_ratio of like materials."""
    name = "poisson_ratio" if problem.closure.constant == "chi" else "beta_sticking"
    if problem.closure.constant is None:
        return {name: Estimate(0.0, None, (0.0, 0.0), (0.0, 0.0), "fixed", "zero in closure F")}
    found = constants[problem.closure.constant]
    of = poisson_of if name == "poisson_ratio" else beta_sticking
    if isinstance(found, Estimate):
        return {name: of(problem, found)}
    return {name: {series: of(problem, each) for series, each in found.items()}}


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


def transitions_of(
    problem: Problem,
    gaussian: TruncatedGaussian,
    kappas: Mapping[str, Estimate],
    distribution: Distribution | None = None,
) -> dict[str, Angles]:
    """Transition angle(s) of each series at its median spin; a list where there are two, None without any.

    Parameters
    ----------
    problem : Problem
    gaussian : TruncatedGaussian
        Of least squares: its optimum says how many angles there are.
    kappas : mapping
        By series; their status is that of the angles, and without a value there is none.
    distribution : Distribution, optional
        Its quantiles of the transition are taken, its median for the value; by default the Gaussian's, and
        the optimum.
    """
    found: dict[str, Angles] = {}
    for number, series in enumerate(problem.series):
        name, kappa = transition_name(series), kappas[series]
        at_optimum = gaussian.marginals.get(name)
        if at_optimum is None or kappa.value is None:
            found[series] = None
            continue
        # a fixed kappa leaves the closure constant to the transition, which the Gaussian knows
        own = gaussian if distribution is None or kappa.status == "fixed" else distribution
        taus = np.asarray(own.quantile(name, LEVELS), dtype=float).tolist()
        if own is gaussian:
            taus[2] = at_optimum.mode
        found[series] = _angles(problem, number, at_optimum.mode, taus, kappa)
    return found


def _angles(problem: Problem, number: int, tau: float, taus: list[float], kappa: Estimate) -> Angles:
    """The branches of the transition at quantiles of tau: an angle runs with tau one way or the other."""
    spin = median_spin(problem, number)
    found = []
    angles = transition_angles(tau, *spin)
    for branch, angle in enumerate(angles):
        low95, low68, best, high68, high95 = (angle_near(t, *spin, branch, len(angles), angle) for t in taus)
        within68 = min(low68, high68), max(low68, high68)
        within95 = min(low95, high95), max(low95, high95)
        half = 0.5 * (within68[1] - within68[0]) if kappa.stderr is not None else None
        found.append(Estimate(best, half, within68, within95, kappa.status, kappa.reason))
    if not found:
        return None
    return found[0] if len(found) == 1 else found


def median_spin(problem: Problem, series: int) -> tuple[float, float]:
    """R omega/u before impact, of the median row of a series, along and across the slip."""
    rows = problem.rows.series == series
    incidence = problem.rows.incidence
    return float(np.median(incidence.spin_x[rows])), float(np.median(incidence.spin_y[rows]))


def angle_near(tau: float, spin_x: float, spin_y: float, number: int, count: int, angle: float) -> float:
    """The same branch of the transition at another tau; the end of the scale where it has none."""
    if math.isinf(tau):  # every impact sticks
        return 0.0 if count == 2 and number == 0 else 90.0
    angles = transition_angles(tau, spin_x, spin_y)
    if len(angles) == count:
        return angles[number]
    if len(angles) == 1:
        return angles[0] if abs(angles[0] - angle) < 45.0 else (0.0 if number == 0 else 90.0)
    if not angles and count == 2:
        return math.degrees(math.asin(min(1.0, max(0.0, -spin_y / (1.0 + tau * tau)))))
    return 0.0 if tau * tau < spin_x * spin_x + spin_y * spin_y or spin_y >= 0.0 else 90.0
