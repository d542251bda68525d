"""What a fit is asked about: each constant, kappa, the restitution in sticking, the transition angle."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ifrfit.inference.model.parameters import Domain
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.optimize.optimum import Array
from ifrfit.inference.optimize.search_objective import FollowingMu
from ifrfit.inference.profile.closed_profile import closed_profile
from ifrfit.inference.profile.curve import ProfileCurve, Resolution
from ifrfit.inference.profile.objective import Misfit, limit
from ifrfit.inference.profile.searched_profile import Constraint, SearchedProfile
from ifrfit.inference.summary.gaussian import kappa_at
from ifrfit.physics.observables import OBSERVABLES

_COVERED = 0.997
_PRIOR_TAU = 2.0  # upper end of the default prior of a transition


@dataclass(frozen=True)
class Quantity:
    """One quantity with a profile.

    Attributes
    ----------
    name : str
    of : callable
        theta to its value.
    constraint : Constraint
        What is left free where it is held at a value.
    domain : Domain
    functional : ndarray
        Its derivative by the coordinates of the local picture.
    far : float or None
        Value from which on the profile is level.
    """

    name: str
    of: Callable[[Array], float]
    constraint: Constraint
    domain: Domain
    functional: Array
    far: float | None = None


def entry(problem: Problem, fit: LeastSquaresFit, place: int) -> Quantity:
    """A free entry of theta."""
    constant = problem.parameters.entries[place]
    lower = constant.lower
    if constant.name == "e_n":
        lower = max(lower, min(problem.rows.lowest_e_n, constant.upper))
    far = None
    if constant.name == "mu":
        far = _level(problem, place)
    return Quantity(
        problem.parameters.names[place],
        lambda theta: float(theta[place]),
        Constraint(place),
        replace(constant.domain, lower=lower),
        fit.gaussian.to_theta[place],
        far,
    )


def kappa(problem: Problem, fit: LeastSquaresFit, series: int) -> Quantity:
    """kappa = mu (1 + e_n) of a series, one of both free."""
    own = problem.parameters.kappas[series]
    i_e, i_mu, e_n, mu = own.i_e_n, own.i_mu, own.e_n, own.mu

    def of_e_n(x: Array) -> Array:
        of_mu = x / mu.fixed - 1.0 if mu.fixed else np.full(x.size, e_n.lower)
        return np.clip(of_mu, e_n.lower, e_n.upper)

    if mu.fixed is not None:
        constraint = Constraint(i_e, value_at=of_e_n)
    else:
        law = problem.closure.law(problem.inertia_factor)
        constraint = Constraint(mu=FollowingMu(i_mu, i_e, None, law, (mu.lower, mu.upper)))
    high_e = e_n.ends[1]
    lowest = max(e_n.lower, min(problem.rows.lowest_e_n, e_n.upper))
    far = _level(problem, i_mu)
    return Quantity(
        own.name,
        own.value,
        constraint,
        replace(own, e_n=replace(e_n, lower=lowest)).domain,
        kappa_at(problem, fit, series)[1],
        None if far is None else far * (1.0 + high_e),
    )


def transition_tau(problem: Problem, fit: LeastSquaresFit, series: int) -> Quantity | None:
    """Slip ratio at the transition of a series, kappa/b, where b depends on the closure constant.

    None at an optimum without a transition. Bounds that a user sets to mu do not limit it.
    """
    places = problem.parameters.positions
    i_e, i_mu = int(places["e_n"][series]), int(places["mu"][series])
    i_c = int(places[problem.closure.constant or ""][series])
    law = problem.closure.law(problem.inertia_factor)
    theta = fit.optimum.theta
    bound = float(law.bound(theta[i_c]))
    if bound <= 0.0 or problem.parameters.entries[i_mu].fixed is not None:
        return None

    def of(theta: Array) -> float:
        b = float(law.bound(theta[i_c]))
        return float(theta[i_mu] * (1.0 + theta[i_e]) / b) if b > 0.0 else math.inf

    functional = kappa_at(problem, fit, series)[1] / bound
    slope = float(law.bound_slope(theta[i_c])) / bound
    functional = functional - of(theta) * slope * fit.gaussian.to_theta[i_c]
    same = np.isin(problem.rows.series, _series_with(problem, series))
    tau = problem.rows.tau[same & np.isfinite(problem.rows.tau)]
    far = 1.05 * float(tau.max(initial=0.1)) if _level(problem, i_mu) is not None else None
    return Quantity(
        "transition_tau",
        of,
        Constraint(mu=FollowingMu(i_mu, i_e, i_c, law)),
        Domain(0.0, math.inf, _PRIOR_TAU),
        functional,
        far,
    )


def _series_with(problem: Problem, series: int) -> Index:
    """Series that have all constants of one of them."""
    places = np.array(list(problem.parameters.positions.values()))
    return np.flatnonzero((places == places[:, series, None]).all(axis=0))


def _level(problem: Problem, place: int) -> float | None:
    """mu from which on every impact sticks and nothing changes; None where mu itself is measured."""
    names = set(np.array(problem.rows.names)[np.unique(problem.rows.which)].tolist())
    if any(OBSERVABLES[name].kind == "friction" for name in names) or problem.parameters.entries[place].prior:
        return None
    shared = not problem.parameters["mu"].separate
    (series,) = (0,) if shared else np.flatnonzero(problem.parameters.positions["mu"] == place)[:1].tolist()
    at = np.isfinite(problem.rows.tau) & (shared | (problem.rows.series == series))
    law = problem.closure.law(problem.inertia_factor)
    c = [x for c in problem.parameters if c.name == problem.closure.constant for x in c.ends] or [0.0]
    bound = max(float(law.bound(x)) for x in c)
    e_n = problem.parameters["e_n"].ends[0]
    return max(1.05 * bound * float(problem.rows.tau[at].max(initial=0.1)) / (1.0 + e_n), 1e-3)


def profile_curve(misfit: Misfit, quantity: Quantity, dof: float, resolution: Resolution) -> ProfileCurve:
    """Trace the profile of a quantity from all optima of the fit."""
    fit = misfit.fit
    value = quantity.of(fit.optimum.theta)
    ends = quantity.domain.lower, quantity.domain.upper, quantity.far
    closed = closed_profile(misfit, quantity.constraint)
    if closed is not None:
        curve = ProfileCurve(closed, *ends, resolution)
    else:
        searched = SearchedProfile(misfit, quantity.constraint, value)
        curve = ProfileCurve(searched, *ends, resolution, searched.unconverged)
    variance = fit.gaussian.variance(quantity.functional, quantity.domain.prior_sd)
    sd = math.sqrt(variance)
    step = sd if 0.0 < sd < 0.2 * quantity.domain.prior_sd else 0.05 * quantity.domain.prior_sd
    rivals = [quantity.of(theta) for theta in fit.optimum.outlying if np.isfinite(theta).all()]
    curve.explore([value, *rivals], step, limit(_COVERED, dof))
    return curve


def quantities_of(problem: Problem, fit: LeastSquaresFit) -> Mapping[str, Quantity]:
    """Every free entry of theta; and kappa (by series where e_n or mu is separate) unless e_n is given.

    With e_n given kappa is mu times a number, and needs no profile of its own.
    """
    found = {
        problem.parameters.names[place]: entry(problem, fit, place)
        for place in np.flatnonzero(problem.parameters.free).tolist()
    }
    if problem.parameters["e_n"].fixed is not None:
        return found
    for series, own in enumerate(problem.parameters.kappas):
        if own.name and own.name not in found:
            found[own.name] = kappa(problem, fit, series)
    return found
