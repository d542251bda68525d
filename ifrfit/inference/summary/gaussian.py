"""The Gaussian approximation of least squares as a distribution of the parameters and of kappa."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.diagnostics.optimum_facts import only_kappa_is_seen
from ifrfit.inference.diagnostics.thresholds import HALF
from ifrfit.inference.distributions.protocol import transition_name
from ifrfit.inference.distributions.truncated_gaussian import TruncatedGaussian
from ifrfit.inference.distributions.truncated_normal import TruncatedNormal
from ifrfit.inference.model.parameters import Domain, Parameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import OBLIQUE
from ifrfit.inference.optimize.laplace import gaussian_approximation
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, dof_of_functional
from ifrfit.inference.result.types import State
from ifrfit.inference.summary.status import KAPPA, ON_BOUNDS, Known, on_bound
from ifrfit.physics.impulse_laws import Coefficients

Array = NDArray[np.float64]


def truncated_gaussian(problem: Problem, fit: LeastSquaresFit) -> TruncatedGaussian:
    """The Gaussian about the optimum, with a marginal for each free entry of theta, kappa and transition."""
    local = fit.gaussian
    lower, upper, gradient = _bounds(problem, fit)
    reasons = prior_reasons(problem, fit)
    priors = dict(zip(problem.parameters.names, (c.prior for c in problem.parameters.entries), strict=True))
    loadings, marginals = {}, {}
    for name, (value, functional, domain) in local_quantities(problem, fit).items():
        # the width of a prior is known, whatever the noise of the rows
        on_prior = priors.get(name) is not None and name in reasons
        dof = math.inf if on_prior else dof_of_functional(problem, fit, functional)
        loadings[name] = functional
        marginals[name] = _marginal(fit, value, functional, domain, dof, gradient)
    for number, series in enumerate(problem.series):
        transition = _transition(problem, fit, number, gradient)
        if transition is not None:
            marginals[transition_name(series)] = transition
    covariance = local.covariance(capped=True)
    center = local.phi - 0.5 * covariance @ gradient
    state = State(local.names, local.phi, center, covariance, lower, upper)
    return TruncatedGaussian(marginals, loadings, state)


def local_quantities(problem: Problem, fit: LeastSquaresFit) -> dict[str, tuple[float, Array, Domain]]:
    """Optimum of each free entry of theta and kappa, derivative by the local coordinates, and domain."""
    theta, names, entries = fit.optimum.theta, problem.parameters.names, problem.parameters.entries
    found = {
        names[place]: (float(theta[place]), fit.gaussian.to_theta[place], entries[place].domain)
        for place in np.flatnonzero(problem.parameters.free | problem.parameters.ties.tied).tolist()
    }
    for number, kappa in enumerate(problem.parameters.kappas):
        if kappa.name and kappa.name not in found:
            found[kappa.name] = (*kappa_at(problem, fit, number), kappa.domain)
    return found


def _marginal(
    fit: LeastSquaresFit, value: float, functional: Array, domain: Domain, dof: float, gradient: Array
) -> TruncatedNormal:
    """Marginal of functional @ phi; its centre lies beyond the bound that the optimum lies on."""
    variance = fit.gaussian.variance(functional, domain.prior_sd)
    center = value
    if math.isfinite(variance) and (on_bound(value, domain.lower) or on_bound(value, domain.upper)):
        seen = fit.gaussian.seen
        spread = fit.gaussian.vectors[:, seen] / fit.gaussian.singular[seen]
        center -= 0.5 * float((functional @ spread) @ (gradient @ spread))
    return TruncatedNormal(value, center, math.sqrt(variance), domain.lower, domain.upper, dof)


def kappa_at(problem: Problem, fit: LeastSquaresFit, series: int) -> tuple[float, Array]:
    """kappa of a series at the optimum, and its derivative by the local coordinates."""
    kappa = problem.parameters.kappas[series]
    e_n, mu = float(fit.optimum.theta[kappa.i_e_n]), float(fit.optimum.theta[kappa.i_mu])
    to_theta = fit.gaussian.to_theta
    # the coordinate itself, or by the product rule where mu is the coordinate
    return mu * (1.0 + e_n), (1.0 + e_n) * to_theta[kappa.i_mu] + mu * to_theta[kappa.i_e_n]


def _transition(
    problem: Problem, fit: LeastSquaresFit, series: int, gradient: Array
) -> TruncatedNormal | None:
    """Slip ratio kappa/b at which sticking ends in a series; None where it does not."""
    own = problem.closure.constant
    place = int(problem.parameters.positions[own][series]) if own else -1
    c = float(fit.optimum.theta[place]) if own else 0.0
    law = problem.closure.law(problem.inertia_factor)
    b = float(law.bound(c))
    if b <= 0.0:
        return None
    kappa, functional = kappa_at(problem, fit, series)
    tau, functional = kappa / b, functional / b
    if own:
        functional = functional - tau * float(law.bound_slope(c)) / b * fit.gaussian.to_theta[place]
    bounds = Domain(0.0, math.inf, 1.0)
    if isinstance(law, Coefficients) and law.b1 == 0.0:
        domain = problem.parameters.kappas[series].domain
        bounds = Domain(domain.lower / b, domain.upper / b, domain.prior_upper / b)
    return _marginal(fit, tau, functional, bounds, dof_of_functional(problem, fit, functional), gradient)


def _bounds(problem: Problem, fit: LeastSquaresFit) -> tuple[Array, Array, Array]:
    """Bounds of the coordinates, and the gradient of the objective by those that lie on one; (p,) each."""
    local = fit.gaussian
    gradient = np.zeros(local.phi.size)
    low, high = (ends.copy() for ends in problem.parameters.bounds())
    places = problem.parameters.positions
    for i, (name, constant) in enumerate(zip(local.names, problem.parameters.entries, strict=True)):
        if name.startswith("kappa"):
            series = int(np.flatnonzero(places["mu"] == i)[0])
            e_n = float(fit.optimum.theta[places["e_n"][series]])
            low[i], high[i] = low[i] * (1.0 + e_n), high[i] * (1.0 + e_n)
        value = local.phi[i]
        if constant.fixed is None and (value - low[i] <= 1e-9 or high[i] - value <= 1e-9):
            gradient[i] = local.gradient[i]
    return low, high, gradient


def prior_reasons(problem: Problem, fit: LeastSquaresFit) -> dict[str, str]:
    """Free entries of theta and kappas that lean on the user's priors, with the reason in words.

    A prior counts where it halves the sd that the data leave. The reason is empty where the data do not see
    the quantity, and no prior says more than the domain of its constant.
    """
    named = [c.name for c in problem.parameters if c.prior is not None]
    if not named:
        return {}
    theta, common = fit.optimum.theta, fit.common_loadings
    bare = gaussian_approximation(problem, fit.sigma, theta, with_priors=False, common=common)
    reason = f"rests on your prior of {' and '.join(named)}"
    informed = any(c.is_informed for c in problem.parameters if c.prior is not None)
    found = {}
    for name, (_, functional, domain) in local_quantities(problem, fit).items():
        without = bare.variance(functional, domain.prior_sd)
        if math.isinf(without):
            found[name] = reason if informed else ""
        elif fit.gaussian.variance(functional, domain.prior_sd) < HALF**2 * without:
            found[name] = reason
    return found


def known_of(
    problem: Problem, fit: LeastSquaresFit, name: str, sd: float, reasons: Mapping[str, str]
) -> Known:
    """What the rule of statuses asks of a free entry of theta, or of kappa.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquaresFit
    name : str
    sd : float
        By the covariance; infinite where the data do not see the quantity.
    reasons : mapping
        As `ifrfit.inference.summary.gaussian.prior_reasons`.
    """
    prior = reasons.get(name, "") if math.isfinite(sd) else ""
    unique = fit.optimum.n_same == 1
    seen = math.isfinite(sd) and reasons.get(name) != ""
    if name not in problem.parameters.names:
        return Known(seen, unique, prior, plain=KAPPA)
    constant = problem.parameters.entries[problem.parameters.names.index(name)]
    if constant.name in ("e_n", "mu") and only_kappa_is_seen(problem):
        loose = f"the data fix kappa = {KAPPA} only" if constant.name == "mu" else Known.loose
        return Known(False, True, prior, loose=loose, bounds=_confined_by(problem, constant))
    return Known(
        seen and not too_few(problem, constant), unique, prior, bounds=_confined_by(problem, constant)
    )


def _confined_by(problem: Problem, constant: Parameter) -> str:
    """The reason where bounds of the user confine a constant, or its partner in kappa; else nothing."""
    partners = ("e_n", "mu") if constant.name in ("e_n", "mu") else (constant.name,)
    named = [name for name in partners if problem.parameters[name].is_confined]
    return f"{ON_BOUNDS} of {' and '.join(named)}" if named else ""


def too_few(problem: Problem, constant: Parameter) -> bool:
    """Whether there are no more oblique rows than constants that only they know: then nothing is tested."""
    direct = {"e_n": "normal", "mu": "friction"}
    known = {name for name, kind in direct.items() if problem.rows.measures(kind)}
    if constant.is_informed or constant.name in known or not problem.rows.measures(*OBLIQUE):
        return False
    oblique = int(np.count_nonzero(problem.rows.is_oblique))
    unknown = [c for c in problem.parameters.entries if not c.is_informed and c.name not in known]
    return oblique <= len(unknown)
