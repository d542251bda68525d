"""Every profile of a fit, and the estimates that follow from them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from ifrfit.inference.diagnostics.optimum_facts import only_kappa_is_seen
from ifrfit.inference.diagnostics.thresholds import FACTS
from ifrfit.inference.distributions.truncated_gaussian import TruncatedGaussian
from ifrfit.inference.model.entry_names import quantity_of
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.profile.intervals import profile_of
from ifrfit.inference.profile.least_squares_estimates import through_kappa
from ifrfit.inference.profile.objective import Misfit
from ifrfit.inference.profile.quantities import quantities_of, transition_tau
from ifrfit.inference.profile.types import ProfileLikelihood
from ifrfit.inference.result.types import Angles, Constants, Estimate, Fact
from ifrfit.inference.summary.derived import (
    angle_estimate,
    angle_near,
    constant_bound,
    median_spin,
    transitions_of,
)
from ifrfit.inference.summary.estimates import by_constant
from ifrfit.inference.summary.gaussian import known_of, prior_reasons
from ifrfit.inference.summary.status import KAPPA, Known, linear
from ifrfit.physics.closure import Meaning
from ifrfit.physics.transition import transition_angles


def profile_all(
    problem: Problem,
    fit: LeastSquaresFit,
    *,
    curves: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, ProfileLikelihood]:
    """Profile of free constants, of kappa, of what the closure constant stands for, and of transitions.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquaresFit
        Its optimum.
    curves : bool
        Add places until the curves can be drawn; without, only what intervals and shapes need is looked at.
    progress : callable, optional
        Called with the profiles done, and how many there are to be.

    Returns
    -------
    dict
        Name to `ProfileLikelihood`: the free entries of `Problem.names`; kappa, or kappa[SERIES] where e_n or
        mu is separate; beta_sticking, or beta_sticking[SERIES] where the closure constant is (or another
        `Closure.meaning` in its place); and
        transition_angle_deg[SERIES] in degrees at the median spin of the series, followed by
        " (first)" and " (second)" where sticking begins and ends.
    """
    misfit = Misfit.of(problem, fit)
    reasons = prior_reasons(problem, fit)
    found = {}
    quantities = quantities_of(problem, fit)
    for name, quantity in quantities.items():
        sd = math.sqrt(fit.gaussian.variance(quantity.functional, quantity.domain.prior_sd))
        found[name] = profile_of(misfit, quantity, known_of(problem, fit, name, sd, reasons), fill=curves)
        if progress is not None:
            progress(len(found), len(quantities) + len(problem.series))
    e_n = problem.parameters["e_n"]
    if e_n.fixed is not None:
        factor = 1.0 + e_n.fixed
        for kappa in problem.parameters.kappas:
            if kappa.name and kappa.name not in found:
                mu = found[problem.parameters.names[kappa.i_mu]]
                scaled = mu.mapped(kappa.name, lambda x: x * factor)
                same = linear(mu.estimate(), 0.0, factor, kappa.domain, KAPPA)
                found[kappa.name] = replace(scaled, reason=same.reason)
    own, meaning = problem.closure.constant, problem.closure.meaning
    if own is not None and meaning is not None:
        for name in [name for name in found if quantity_of(name) == own]:
            label = meaning.name + name.removeprefix(own)
            found[label] = found[name].mapped(label, partial(_meant, meaning, problem.inertia_factor))
    taus: dict[tuple[int, ...], ProfileLikelihood | None] = {}
    for number, series in enumerate(problem.series):
        places = tuple(int(own[number]) for own in problem.parameters.positions.values())
        if places not in taus:
            taus[places] = _transition_tau(misfit, number, found, curves)
        tau = taus[places]
        if tau is not None:
            found |= _transitions(problem, number, series, tau)
        if progress is not None:
            progress(len(quantities) + number + 1, len(quantities) + len(problem.series))
    return found


def _meant(meaning: Meaning, inertia_factor: float, c: float) -> float:
    return meaning.value(c, inertia_factor)


def _transition_tau(
    misfit: Misfit, number: int, found: Mapping[str, ProfileLikelihood], curves: bool
) -> ProfileLikelihood | None:
    """Slip ratio at the transition of a series, and of all that share its constants; None where none is."""
    problem, fit = misfit.problem, misfit.fit
    b = constant_bound(problem)
    kappa = found.get(problem.parameters.kappas[number].name)
    if kappa is None:
        return None
    if b is not None:
        return kappa.mapped("transition_tau", lambda x: x / b)
    quantity = transition_tau(problem, fit, number)
    return None if quantity is None else profile_of(misfit, quantity, Known(kappa.has_value), fill=curves)


def _transitions(
    problem: Problem, number: int, series: str, tau: ProfileLikelihood
) -> dict[str, ProfileLikelihood]:
    """Transition angle(s) of a series: what its slip ratio at the transition becomes at its median spin."""
    spin_x, spin_y = median_spin(problem, number)
    angles = transition_angles(tau.value, spin_x, spin_y)
    out = {}
    for i, angle in enumerate(angles):

        def at(x: float, i: int = i, angle: float = angle) -> float:
            return angle_near(x, spin_x, spin_y, i, len(angles), angle)

        name = f"transition_angle_deg[{series}]" + ("" if len(angles) == 1 else (" (first)", " (second)")[i])
        out[name] = tau.mapped(name, at)
    return out


def estimates_of_profiles(
    problem: Problem,
    profiles: Mapping[str, ProfileLikelihood],
    gaussian: TruncatedGaussian,
    local_kappas: Mapping[str, Estimate],
) -> tuple[Constants, Mapping[str, Estimate], dict[str, Angles]]:
    """Constants, kappa of each series, and transition angles of each series, by their profiles.

    Parameters
    ----------
    problem : Problem
    profiles : mapping
        As `profile_all` returns them.
    gaussian : TruncatedGaussian
    local_kappas : mapping
        Those of least squares, for what has no profile.

    Notes
    -----
    Where the data see kappa alone, a prior of e_n or mu that says less than half of its domain counts for
    nothing, as in every method: e_n is anywhere, and mu what the profile of kappa leaves of it.
    """

    def of_kappa(number: int) -> Estimate:
        profile = profiles.get(problem.parameters.kappas[number].name)
        return local_kappas[problem.series[number]] if profile is None else profile.estimate()

    names = problem.parameters.names
    pair = [problem.parameters[name] for name in ("e_n", "mu")]
    loose = only_kappa_is_seen(problem) and any(constant.prior is not None for constant in pair)

    def of_entry(place: int) -> Estimate:
        constant = problem.parameters.entries[place]
        if loose and constant.name in ("e_n", "mu"):
            (number, *_) = np.flatnonzero(problem.parameters.positions[constant.name] == place).tolist()
            return through_kappa(problem, constant, of_kappa(number))
        return profiles[names[place]].estimate()

    constants, kappas = by_constant(problem, of_entry, of_kappa)
    local = transitions_of(problem, gaussian, constants, kappas)
    transitions = {
        series: _transition_of(series, kappas[series], profiles, local[series]) for series in problem.series
    }
    return constants, kappas, transitions


def _transition_of(
    series: str, kappa: Estimate, profiles: Mapping[str, ProfileLikelihood], local: Angles
) -> Angles:
    """As least squares reports it, one angle, two or none, with the intervals of the profile."""
    if local is None:
        return None
    name = f"transition_angle_deg[{series}]"
    found = [profiles[key] for key in (name, f"{name} (first)", f"{name} (second)") if key in profiles]
    if not found:
        return local
    each = [angle_estimate(profile.value, profile.interval68, profile.interval95, kappa) for profile in found]
    return each[0] if len(each) == 1 else each


def profile_converged(profiles: Mapping[str, ProfileLikelihood], noise: Fact) -> Fact:
    """Whether the noise settled, and every profile closes or reaches the end of its domain.

    Parameters
    ----------
    profiles : mapping
        Name to `ProfileLikelihood`, as `profile_all` returns them.
    noise : Fact
        "converged" of the least squares behind them.

    Returns
    -------
    Fact
        Its figures are those of `noise`, the number of profiles, and the names of those that a budget
        stopped.
    """
    stopped = {name: profile.stopped for name, profile in profiles.items() if profile.stopped}
    figures = {**noise.figures, "n_profiles": len(profiles), "stopped": list(stopped)}
    if not noise.ok:
        says = noise.says
    elif stopped:
        first, why = next(iter(stopped.items()))
        names = f"profile of {first} was" if len(stopped) == 1 else f"profiles of {', '.join(stopped)} were"
        says = f"the {names} stopped early ({why}): compare the intervals with --method exact"
    else:
        says = f"{noise.says}, and every profile closes or reaches the end of its domain"
    return Fact(noise.ok and not stopped, says, figures, FACTS["converged"])
