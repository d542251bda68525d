"""Quantities that follow from the constants: kappa, the transition angle, what the closure constant means."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ifrfit.inference.distributions.protocol import LEVELS, Distribution, transition_name
from ifrfit.inference.distributions.truncated_gaussian import TruncatedGaussian
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.result.types import Angles, Constants, Derived, Estimate, Interval
from ifrfit.inference.summary.status import KAPPA
from ifrfit.physics.closure import Meaning
from ifrfit.physics.impulse_laws import Coefficients
from ifrfit.physics.transition import transition_angles


def derived_of(
    problem: Problem, constants: Constants, kappas: Mapping[str, Estimate], transitions: Mapping[str, Angles]
) -> Derived:
    """kappa, transition_angle_deg, what the closure constant stands for; by series where they differ."""
    separate = any(c.separate for c in problem.parameters if c.name in ("e_n", "mu"))
    return {
        "kappa": dict(kappas) if separate else kappas[problem.series[0]],
        "transition_angle_deg": dict(transitions),
    } | meaning_of(problem, constants)


def meaning_of(problem: Problem, constants: Constants) -> dict[str, Any]:
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
        return {meaning.name: _meant(meaning, closure.constant, found, j)}
    return {
        meaning.name: {series: _meant(meaning, closure.constant, each, j) for series, each in found.items()}
    }


def _meant(meaning: Meaning, name: str, c: Estimate, j: float) -> Estimate:
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
        _reason_of(name, c),
        mean=value(c.mean) if meaning.linear and c.mean is not None else None,
    )


def transitions_of(
    problem: Problem,
    gaussian: TruncatedGaussian,
    constants: Constants,
    kappas: Mapping[str, Estimate],
    distribution: Distribution | None = None,
) -> dict[str, Angles]:
    """Transition angle(s) of each series at its median spin; a list where there are two, None without any.

    Parameters
    ----------
    problem : Problem
    gaussian : TruncatedGaussian
        Of least squares: its optimum says how many angles there are.
    constants : mapping
        Where the transition depends on the closure's own constant, there is none without a value of it.
    kappas : mapping
        By series; their status is that of the angles, and without a value there is none.
    distribution : Distribution, optional
        Its quantiles of the transition are taken, its median for the value; by default the Gaussian's, and
        the optimum. Where the transition is kappa over a number, the estimate of kappa is all it takes.
    """
    found: dict[str, Angles] = {}
    for number, series in enumerate(problem.series):
        name, kappa = transition_name(series), kappas[series]
        at_optimum = gaussian.marginals.get(name)
        if at_optimum is None or kappa.value is None or not _has_bound(problem, constants, series):
            found[series] = None
            continue
        # a fixed kappa leaves the closure constant to the transition, which the Gaussian knows
        own = gaussian if distribution is None or kappa.status == "fixed" else distribution
        b = constant_bound(problem)
        if b is not None:
            ends = (
                kappa.interval95[0],
                kappa.interval68[0],
                kappa.value,
                kappa.interval68[1],
                kappa.interval95[1],
            )
            taus = [end / b for end in ends]
        else:
            taus = np.asarray(own.quantile(name, LEVELS), dtype=float).tolist()
            if own is gaussian:
                taus[2] = at_optimum.mode
        found[series] = _angles(problem, number, at_optimum.mode, taus, kappa)
    return found


def _has_bound(problem: Problem, constants: Constants, series: str) -> bool:
    """Whether the slip ratio kappa/b at which sticking ends has a b: it may depend on the own constant."""
    own = problem.closure.constant
    if own is None or constant_bound(problem) is not None:
        return True
    found = constants[own]
    return (found if isinstance(found, Estimate) else found[series]).value is not None


def constant_bound(problem: Problem) -> float | None:
    """b of the transition tau = kappa/b where it does not depend on the closure constant; else None."""
    law = problem.closure.law(problem.inertia_factor)
    return law.b0 if isinstance(law, Coefficients) and law.b1 == 0.0 else None


def _angles(problem: Problem, number: int, tau: float, taus: list[float], kappa: Estimate) -> Angles:
    """The branches of the transition at quantiles of tau: an angle runs with tau one way or the other."""
    spin = median_spin(problem, number)
    found = []
    angles = transition_angles(tau, *spin)
    for branch, angle in enumerate(angles):
        low95, low68, best, high68, high95 = (angle_near(t, *spin, branch, len(angles), angle) for t in taus)
        within68 = min(low68, high68), max(low68, high68)
        within95 = min(low95, high95), max(low95, high95)
        found.append(angle_estimate(best, within68, within95, kappa))
    if not found:
        return None
    return found[0] if len(found) == 1 else found


def angle_estimate(value: float, within68: Interval, within95: Interval, kappa: Estimate) -> Estimate:
    """A transition angle with the status of kappa, and its reason, unless that says what kappa is."""
    half = 0.5 * (within68[1] - within68[0]) if kappa.stderr is not None else None
    reason = "" if kappa.reason == KAPPA else _reason_of("kappa", kappa)
    return Estimate(value, half, within68, within95, kappa.status, reason)


def _reason_of(name: str, estimate: Estimate) -> str:
    """The reason of what follows from a quantity, whose own bound it names."""
    return f"{name} {estimate.reason}" if " its bound " in estimate.reason else estimate.reason


def median_spin(problem: Problem, series: int) -> tuple[float, float]:
    """R omega/u before impact, of the median row of a series, along and across the slip."""
    if problem.quoted_spins is not None:
        return problem.quoted_spins[series]
    rows = problem.rows.series == series
    incidence = problem.rows.incidence
    x, y = (
        float(np.median(spin[rows])) if spin.any() else 0.0 for spin in (incidence.spin_x, incidence.spin_y)
    )
    return x, y


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
