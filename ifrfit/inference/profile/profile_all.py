"""Every profile of a fit, and the estimates that follow from them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ifrfit.inference.diagnostics.identifiability import only_kappa_is_seen
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquares
from ifrfit.inference.profile.intervals import Known, judged
from ifrfit.inference.profile.objective import Misfit
from ifrfit.inference.profile.quantities import Quantity, follow, quantities_of, transition_tau
from ifrfit.inference.profile.types import Profile
from ifrfit.inference.result.types import Estimate
from ifrfit.inference.summary.derived import angle_near, meaning_of, transition
from ifrfit.inference.summary.estimates import leans_on_prior, too_few
from ifrfit.inference.summary.kappa import kappa_of
from ifrfit.physics.closures import Coefficients, Meaning
from ifrfit.physics.transition import transition_angles

ConstantsMap = dict[str, Estimate | Mapping[str, Estimate]]


def profile_all(problem: Problem, fit: LeastSquares, *, curves: bool = True) -> dict[str, Profile]:
    """Profile of free constants, of kappa, of what the closure constant stands for, and of transitions.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquares
        Its optimum.
    curves : bool
        Add places until the curves can be drawn; without, only what intervals and shapes need is looked at.

    Returns
    -------
    dict
        Name to `Profile`: the free entries of `Problem.names`; kappa, or kappa[SERIES] where e_n or mu is
        separate; beta_sticking, or beta_sticking[SERIES] where the closure constant is (or another
        `Closure.meaning` in its place); and
        transition_angle_deg[SERIES] in degrees at the median spin of the series, followed by
        " (first)" and " (second)" where sticking begins and ends.
    """
    misfit = Misfit.of(problem, fit)
    found = {
        name: _profile(misfit, quantity, _known(problem, fit, quantity), curves)
        for name, quantity in quantities_of(problem, fit).items()
    }
    e_n = problem.parameters["e_n"].fixed
    if e_n is not None:
        for name in [name for name in found if name.split("[")[0] == "mu"]:
            label = "kappa" + name.removeprefix("mu")
            scaled = found[name].mapped(label, lambda x: x * (1.0 + e_n))
            found[label] = replace(scaled, reason=scaled.reason or "mu (1 + e_n)")
    own, meaning = problem.closure.constant, problem.closure.meaning
    if own is not None and meaning is not None:
        for name in [name for name in found if name.split("[")[0] == own]:
            label = meaning.name + name.removeprefix(own)
            found[label] = found[name].mapped(label, partial(_meant, meaning, problem.inertia_factor))
    for number, series in enumerate(problem.series):
        found |= _transitions(misfit, number, series, found, curves)
    return found


def _profile(misfit: Misfit, quantity: Quantity, known: Known, curves: bool) -> Profile:
    dof = misfit.dof_of(quantity.functional)
    trace = follow(misfit, quantity, dof)
    value = trace.settle(quantity.of(misfit.fit.optimum.theta))
    return judged(quantity, trace, value, dof, known, curves=curves)


def _known(problem: Problem, fit: LeastSquares, quantity: Quantity) -> Known:
    """What the rules of statuses ask beside the profile itself."""
    sd = math.sqrt(fit.gaussian.variance(quantity.functional, quantity.domain.prior_sd))
    unique = fit.optimum.n_same == 1
    if quantity.name not in problem.parameters.names:
        return Known(math.isfinite(sd), unique, plain="mu (1 + e_n)")
    place = problem.parameters.names.index(quantity.name)
    constant = problem.parameters.entries[place]
    seen = math.isfinite(sd) and not too_few(problem, constant)
    leans = leans_on_prior(problem, fit, place, constant, sd) if math.isfinite(sd) else ""
    if constant.name in ("e_n", "mu") and only_kappa_is_seen(problem):
        loose = "the data fix kappa = mu (1 + e_n) only" if constant.name == "mu" else Known.loose
        return Known(False, True, leans, loose=loose)
    return Known(seen, unique, leans)


def _meant(meaning: Meaning, inertia_factor: float, c: float) -> float:
    return meaning.value(c, inertia_factor)


def _transitions(
    misfit: Misfit, number: int, series: str, found: Mapping[str, Profile], curves: bool
) -> dict[str, Profile]:
    """Transition angle(s) of a series: what its slip ratio at the transition becomes at its median spin."""
    problem, fit = misfit.problem, misfit.fit
    law = problem.closure.law(problem.inertia_factor)
    kappa = found.get("kappa") or found.get(f"kappa[{series}]")
    if kappa is None:
        return {}
    if isinstance(law, Coefficients) and law.b1 == 0.0:
        tau = kappa.mapped("transition_tau", lambda x: x / law.b0)
    else:
        quantity = transition_tau(problem, fit, number)
        if quantity is None:
            return {}
        tau = _profile(misfit, quantity, Known(kappa.stated), curves)
    rows = problem.rows.series == number
    spin_x = float(np.median(problem.rows.incidence.spin_x[rows]))
    spin_y = float(np.median(problem.rows.incidence.spin_y[rows]))
    angles = transition_angles(tau.value, spin_x, spin_y)
    out = {}
    for i, angle in enumerate(angles):

        def at(x: float, i: int = i, angle: float = angle) -> float:
            if math.isinf(x):  # every impact sticks
                return 0.0 if len(angles) == 2 and i == 0 else 90.0
            return angle_near(x, spin_x, spin_y, i, len(angles), angle)

        name = f"transition_angle_deg[{series}]" + ("" if len(angles) == 1 else (" (first)", " (second)")[i])
        out[name] = tau.mapped(name, at)
    return out


def profiled_estimates(
    problem: Problem, fit: LeastSquares
) -> tuple[ConstantsMap, dict[str, Any], dict[str, Profile]]:
    """Constants and derived quantities by their profiles.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquares

    Returns
    -------
    constants : dict
        As `ifrfit.inference.summary.estimates.constants_of`: name to `Estimate`, or to a mapping by series.
    derived : dict
        As `ifrfit.inference.summary.derived.derived_of`: kappa, transition_angle_deg, beta_sticking.
    profiles : dict
        Name to `Profile`.
    """
    profiles = profile_all(problem, fit)
    constants: ConstantsMap = {}
    places = problem.parameters.positions
    for constant in problem.parameters:
        each = {}
        for number, series in enumerate(problem.series):
            place = int(places[constant.name][number])
            name = problem.parameters.names[place]
            if name in profiles:
                each[series] = profiles[name].estimate()
            else:
                value = float(fit.optimum.theta[place])
                each[series] = Estimate(value, None, (value, value), (value, value), "fixed", "fixed by you")
        constants[constant.name] = each if constant.separate else each[problem.series[0]]
    return constants, _derived(problem, fit, constants, profiles), profiles


def _derived(
    problem: Problem, fit: LeastSquares, constants: ConstantsMap, profiles: Mapping[str, Profile]
) -> dict[str, Any]:
    separate = any(c.separate for c in problem.parameters if c.name in ("e_n", "mu"))
    kappa = {}
    for number, series in enumerate(problem.series):
        profile = profiles.get(f"kappa[{series}]" if separate else "kappa")
        kappa[series] = kappa_of(problem, fit, number) if profile is None else profile.estimate()
    return {
        "kappa": kappa if separate else kappa[problem.series[0]],
        "transition_angle_deg": {
            series: _transition_of(problem, fit, number, series, kappa[series], profiles)
            for number, series in enumerate(problem.series)
        },
    } | meaning_of(problem, constants)


def _transition_of(
    problem: Problem,
    fit: LeastSquares,
    number: int,
    series: str,
    kappa: Estimate,
    profiles: Mapping[str, Profile],
) -> Estimate | list[Estimate] | None:
    """As least squares reports it, one angle, two or none, with the intervals of the profile."""
    if kappa.value is None:
        return None
    name = f"transition_angle_deg[{series}]"
    found = [profiles[key] for key in (name, f"{name} (first)", f"{name} (second)") if key in profiles]
    if not found:
        return transition(problem, fit, number, kappa)
    each = [
        Estimate(
            profile.value,
            0.5 * (profile.interval68[1] - profile.interval68[0]) if kappa.stderr is not None else None,
            profile.interval68,
            profile.interval95,
            kappa.status,
            kappa.reason,
        )
        for profile in found
    ]
    return each[0] if len(each) == 1 else each
