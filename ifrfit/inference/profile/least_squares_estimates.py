"""Estimates of least squares: by the Gaussian about the optimum, by profiles where that does not tell."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial

import numpy as np

from ifrfit.inference.diagnostics.optimum_facts import only_kappa_is_seen
from ifrfit.inference.diagnostics.thresholds import HALF
from ifrfit.inference.distributions.truncated_gaussian import TruncatedGaussian
from ifrfit.inference.model.parameters import Domain, Parameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.profile.curve import COARSE
from ifrfit.inference.profile.intervals import profile_of
from ifrfit.inference.profile.objective import Misfit
from ifrfit.inference.profile.quantities import Quantity, entry, kappa
from ifrfit.inference.result.types import Constants, Estimate, Interval
from ifrfit.inference.summary.estimates import by_constant, marginal_of_normal
from ifrfit.inference.summary.gaussian import known_of, prior_reasons
from ifrfit.inference.summary.status import ON_BOUNDS, Known, estimate_of

# times the local 95 % interval; the Gaussian knows nothing of what lies further out
BEYOND = 1.25
_WITHOUT_PROFILE = (
    "the Gaussian of least squares is too narrow for it, and its profile knows no errors that rows have in "
    "common: take --method exact"
)


def estimates_of_optimum(
    problem: Problem, fit: LeastSquaresFit, gaussian: TruncatedGaussian, *, beside_marginals: bool = False
) -> tuple[Constants, Mapping[str, Estimate]]:
    """Every constant and kappa of each series, as `by_constant`.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquaresFit
    gaussian : TruncatedGaussian
        As `ifrfit.inference.summary.gaussian.gaussian_approximation`.
    beside_marginals : bool
        Whether another method has the marginals, so that no more is asked than what the data determine:
        optima that lie near one another, as the domain goes, need no profile then.
    """
    reasons = prior_reasons(problem, fit)
    misfit = cache(partial(Misfit.of, problem, fit))

    def free(name: str, domain: Domain, rivals: list[float], quantity: Callable[[], Quantity]) -> Estimate:
        normal = gaussian.marginals[name]
        known = known_of(problem, fit, name, normal.sd, reasons)
        reach = BEYOND * normal.half_width(0.95)
        apart = max((abs(other - normal.mode) for other in rivals), default=0.0)
        local = apart <= reach or (beside_marginals and apart + reach < HALF * domain.prior_sd)
        if known.seen and local and normal.sd < HALF * domain.prior_sd:
            return estimate_of(domain, marginal_of_normal(normal), replace(known, unique=True))
        if fit.common is not None:
            ends = (domain.lower, domain.upper)
            return Estimate(None, None, ends, ends, "not_determined", _WITHOUT_PROFILE)
        return _profiled(misfit(), quantity(), known)

    @cache
    def of_kappa(number: int) -> Estimate:
        own = problem.parameters.kappas[number]
        at = [own.value(theta) for theta in fit.optimum.outlying]
        return free(own.name, own.domain, at, partial(kappa, problem, fit, number))

    def of_entry(place: int) -> Estimate:
        constant = problem.parameters.entries[place]
        if constant.name in ("e_n", "mu") and only_kappa_is_seen(problem):
            (number, *_) = np.flatnonzero(problem.parameters.positions[constant.name] == place).tolist()
            return through_kappa(problem, constant, of_kappa(number))
        at = [float(theta[place]) for theta in fit.optimum.outlying]
        return free(problem.parameters.names[place], constant.domain, at, partial(entry, problem, fit, place))

    return by_constant(problem, of_entry, of_kappa)


def _profiled(misfit: Misfit, quantity: Quantity, known: Known) -> Estimate:
    """By the profile, over all optima.

    A quantity that depends on a direction the data do not see is never called determined, however short its
    profile: that is what the bounds of another constant leave of it.
    """
    known = replace(known, plain=known.plain or "by its profile")
    return profile_of(misfit, quantity, known, COARSE, fill=False).estimate()


def through_kappa(problem: Problem, constant: Parameter, kappa: Estimate) -> Estimate:
    """e_n is anywhere in its domain, and mu is what kappa leaves of it."""
    e_n = problem.parameters["e_n"]
    if constant.name == "e_n":
        everything = (e_n.lower, e_n.upper)
        return _confined(constant, everything, everything) or Estimate(
            None, None, everything, everything, "not_determined", Known.loose
        )

    def shared_out(interval: Interval) -> Interval:
        return interval[0] / (1.0 + e_n.upper), interval[1] / (1.0 + e_n.lower)

    ends = shared_out(kappa.interval68), shared_out(kappa.interval95)
    if kappa.status == "one_sided":
        reason = "only a lower limit" if np.isinf(ends[1][1]) else "only an upper limit"
        return Estimate(None, None, *ends, "one_sided", reason)
    return (_confined(e_n, *ends) if kappa.value is not None else None) or Estimate(
        None, None, *ends, "not_determined", "the data fix kappa = mu (1 + e_n) only"
    )


def _confined(e_n: Parameter, interval68: Interval, interval95: Interval) -> Estimate | None:
    """What the user's bounds of e_n leave of a quantity; None where they leave too much."""
    if not e_n.is_confined:
        return None
    low, high = interval95
    sd = (high - low) / np.sqrt(12.0)
    return Estimate(0.5 * (low + high), float(sd), interval68, interval95, "prior", f"{ON_BOUNDS} of e_n")
