"""Estimates of parameters, kappa and noises from a distribution, each by the rule in `summary.status`."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ifrfit.inference.diagnostics.thresholds import HALF
from ifrfit.inference.distributions.protocol import LEVELS, Distribution
from ifrfit.inference.distributions.truncated_normal import TruncatedNormal
from ifrfit.inference.model.entry_names import split_name
from ifrfit.inference.model.parameters import Domain, Parameter
from ifrfit.inference.model.problem import OFFSET, Problem
from ifrfit.inference.optimize.angle_offset import AngleOffset
from ifrfit.inference.result.estimation import Unresolved
from ifrfit.inference.result.types import FACTOR, Constants, Estimate, Interval, NoiseSummary, by_entry
from ifrfit.inference.summary.status import (
    AT_BOUND,
    KAPPA,
    ON_BOUNDS,
    Known,
    Marginal,
    OneSided,
    estimate_of,
    fixed_estimate,
    linear,
    on_bound,
)

Array = NDArray[np.float64]
Kappas = Mapping[str, Estimate]  # by series

_REACHED = 0.1465  # density at a bound over the largest one, above which the 95 % region reaches the bound
_STEP = 0.25  # sd over which densities are averaged in the search for the largest one
_SAME = 1e-12  # sd, relative to the mean, below which all draws are one value


def marginal_of_normal(normal: TruncatedNormal) -> Marginal:
    """What a truncated normal says; its 95 % region reaches a bound within the half width of its interval."""
    value, low, high = normal.mode, normal.lower, normal.upper
    reach = normal.half_width(0.95) + AT_BOUND * max(1.0, abs(value))

    def one_sided(below: bool) -> OneSided:
        ends = [normal.quantile(p if below else 1.0 - p) for p in (0.68, 0.95)]
        first, second = ((low, end) if below else (end, high) for end in ends)
        return OneSided(first, second, normal.sd)

    return Marginal(
        value,
        normal.sd,
        (normal.quantile(0.16), normal.quantile(0.84)),
        (normal.quantile(0.025), normal.quantile(0.975)),
        (value - low <= reach, high - value <= reach),
        one_sided,
    )


def marginal_of(distribution: Distribution, name: str, domain: Domain) -> Marginal:
    """What a distribution says of a quantity: median, mean, sd, and which bounds its 95 % region reaches."""
    low95, low68, median, high68, high95 = (float(q) for q in distribution.quantile(name, LEVELS))
    sd = distribution.sd(name)

    def one_sided(below: bool) -> OneSided:
        ends = [float(distribution.quantile(name, p if below else 1.0 - p)) for p in (0.68, 0.95)]
        first, second = ((domain.lower, end) if below else (end, domain.upper) for end in ends)
        return OneSided(first, second, sd)

    return Marginal(
        median,
        sd,
        (low68, high68),
        (low95, high95),
        _reached(distribution, name, (domain.lower, domain.prior_upper), high68 - low68),
        one_sided,
        distribution.mean(name),
    )


def _reached(distribution: Distribution, name: str, bounds: Interval, width68: float) -> tuple[bool, bool]:
    """Whether the 95 % region of highest density reaches the lower, and the upper bound."""

    def below(x: Array, _: NDArray[np.intp]) -> Array:
        return np.asarray(distribution.cdf(name, x[0]))[None]

    mean, sd, width = (
        np.array([number]) for number in (distribution.mean(name), distribution.sd(name), width68)
    )
    (found,) = reached_bounds(mean, sd, width, bounds, distribution.resolution, below).tolist()
    return found[0], found[1]


def reached_bounds(
    mean: Array,
    sd: Array,
    width68: Array,
    bounds: tuple[float, float],
    resolution: float,
    below: Callable[[Array, NDArray[np.intp]], Array],
) -> NDArray[np.bool_]:
    """Whether the 95 % regions of highest density of many laws reach the lower, and the upper bound, (n, 2).

    Parameters
    ----------
    mean, sd, width68 : ndarray, (n,)
        The last of the central 68 % interval.
    bounds : (float, float)
    resolution : float
        Width, in sd, over which a density can be told at a bound.
    below : callable
        From places, (m, k), and the numbers of their laws, (m,), to the probabilities below them.
    """
    lower, upper = bounds
    exact = sd <= _SAME * np.abs(mean)  # every draw is the same
    found = np.zeros((mean.size, 2), dtype=bool)
    for one in np.flatnonzero(exact).tolist():
        found[one] = [on_bound(float(mean[one]), bound) for bound in bounds]
    spread = np.flatnonzero(~exact)
    if not spread.size:
        return found
    step = resolution * sd[spread]
    low, high = np.full(spread.size, lower), np.full(spread.size, upper)
    at_ends = np.stack((low, np.minimum(lower + step, upper), np.maximum(upper - step, lower), high), axis=1)
    p = below(at_ends, spread)
    dense = np.stack(((p[:, 1] - p[:, 0]) / step, (p[:, 3] - p[:, 2]) / step), axis=1)
    # of the steps over which 68 % lie some has as much as their mean
    least_top = 0.68 / (width68[spread] + 2.0 * _STEP * sd[spread])
    near = np.flatnonzero(dense.max(axis=1, initial=0.0) >= _REACHED * least_top)
    rows = spread[near]
    if not rows.size:
        return found
    edges = np.clip(mean[rows, None] + sd[rows, None] * np.arange(-4.0, 4.1, _STEP), lower, upper)
    width = np.diff(edges, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        density = np.diff(below(edges, rows), axis=1) / width
    # bounds cut some of these steps short, and draws that lie on a bound would be dense there without limit
    top = np.where(width >= step[near, None], density, 0.0).max(axis=1)
    top = np.maximum(top, dense[near].max(axis=1))
    found[rows] = dense[near] > _REACHED * top[:, None]
    return found


def estimates_of(
    problem: Problem,
    distribution: Distribution | None,
    local: Constants,
    local_kappas: Kappas,
    unresolved: Mapping[str, Unresolved] | None = None,
    kept: Collection[str] = (),
) -> tuple[Constants, Kappas]:
    """Every constant from its marginal, and kappa of each series, as `by_constant`.

    Parameters
    ----------
    problem : Problem
    distribution : Distribution or None
        None where there is none: then the estimates of least squares stand.
    local, local_kappas : mapping
        The estimates of least squares: they know what the data leave open, and what rests on a prior.
    unresolved : mapping, optional
        By name, what gets no value for other reasons.
    kept : collection of str, optional
        Entries of theta whose estimates stay those of least squares.
    """
    reasons = unresolved or {}
    parameters, known = problem.parameters, by_entry(local)

    def of_entry(place: int) -> Estimate:
        name = parameters.names[place]
        if name in kept:
            return known[name]
        return _estimate(distribution, name, parameters.entries[place].domain, known[name], reasons)

    def of_kappa(number: int) -> Estimate:
        kappa = parameters.kappas[number]
        own = local_kappas[problem.series[number]]
        return _estimate(distribution, kappa.name, kappa.domain, own, reasons)

    return by_constant(problem, of_entry, of_kappa)


def by_constant(
    problem: Problem, of_entry: Callable[[int], Estimate], of_kappa: Callable[[int], Estimate]
) -> tuple[Constants, Kappas]:
    """Every constant (an `Estimate`, or one a series where it is separate), and kappa of each series.

    Parameters
    ----------
    problem : Problem
    of_entry : callable
        From the place of a free entry of theta to its estimate.
    of_kappa : callable
        From the number of a series to the estimate of its kappa, where e_n and mu are free; asked of the
        first of those that share it.
    """
    constants: dict[str, Estimate | Mapping[str, Estimate]] = {}
    estimates = [
        of_entry(place) if entry.fixed is None else fixed_estimate(entry.fixed, _fixed_by(entry, name))
        for place, (entry, name) in enumerate(
            zip(problem.parameters.entries, problem.parameters.names, strict=True)
        )
    ]
    for constant in problem.parameters:
        places = problem.parameters.positions[constant.name]
        each = {series: estimates[place] for series, place in zip(problem.series, places, strict=True)}
        constants[constant.name] = each if constant.separate else each[problem.series[0]]
    names = [kappa.name for kappa in problem.parameters.kappas]
    kappas = [
        kappa_of_constants(problem, number, constants) or of_kappa(names.index(name))
        for number, name in enumerate(names)
    ]
    return constants, dict(zip(problem.series, kappas, strict=True))


def _fixed_by(entry: Parameter, name: str) -> str:
    """Who fixed an entry of theta."""
    tie = dict(entry.ties).get(name)
    return "fixed by you" if tie is None else f"fixed by a tie: {tie}"


def _estimate(
    distribution: Distribution | None,
    name: str,
    domain: Domain,
    local: Estimate,
    unresolved: Mapping[str, Unresolved],
) -> Estimate:
    """One quantity, by what least squares says of the data alone and by the distribution."""
    if local.status == "fixed":
        return local
    if local.value is not None and name in unresolved:
        return replace(_without_value(domain, unresolved[name]), mean=_mean(distribution, name))
    if local.value is None:
        # what the data leave open follows the prior: the interval is that of the data alone
        return replace(local, mean=_mean(distribution, name))
    if distribution is None:
        return local
    on_bounds = local.reason.startswith(ON_BOUNDS)
    known = Known(
        prior=local.reason if local.status == "prior" else "",
        bounds=local.reason if on_bounds else "",
        plain=local.reason if local.status == "determined" else KAPPA if name.startswith("kappa") else "",
        loose="the posterior is nearly as wide as the prior",
        optimum=local.value,
    )
    return estimate_of(domain, marginal_of(distribution, name, domain), known)


def _mean(distribution: Distribution | None, name: str) -> float | None:
    return None if distribution is None or name not in distribution.names else distribution.mean(name)


def _without_value(domain: Domain, unresolved: Unresolved) -> Estimate:
    whole = domain.lower, domain.upper
    if unresolved.lower68 is None or unresolved.lower95 is None:
        return Estimate(None, None, whole, whole, "not_determined", unresolved.reason)
    ends = (unresolved.lower68, math.inf), (unresolved.lower95, math.inf)
    return Estimate(None, None, *ends, "one_sided", f"only a lower limit: {unresolved.reason}")


def kappa_of_constants(problem: Problem, series: int, constants: Constants) -> Estimate | None:
    """kappa of a series where e_n or mu is fixed: the other one times a number; None where both are free."""
    kappa = problem.parameters.kappas[series]
    e_n, mu, domain = kappa.e_n, kappa.mu, kappa.domain
    if mu.fixed is not None and (e_n.fixed is not None or mu.fixed == 0.0):
        return fixed_estimate(domain.lower, KAPPA)
    if e_n.fixed is None and mu.fixed is None:
        return None
    free = constants["mu" if mu.fixed is None else "e_n"]
    own = free if isinstance(free, Estimate) else free[problem.series[series]]
    if mu.fixed is None:
        return linear(own, 0.0, 1.0 + (e_n.fixed or 0.0), domain, KAPPA)
    return linear(own, mu.fixed, mu.fixed, domain, KAPPA)


def noise_of(
    problem: Problem, distribution: Distribution, local: NoiseSummary, bounds: Mapping[str, Interval]
) -> NoiseSummary:
    """Noise as the distribution has it; sigma is its median, and stays where there is no noise in it."""
    estimates = {}
    for name in distribution.names:
        if not name.startswith("noise"):
            continue
        estimates[split_name(name)[1] or FACTOR] = _central(distribution, name)
    sigma = dict(local.sigma)
    if problem.noise.has_unknown:
        for name in sigma:
            if name in local.given:
                continue
            own = estimates.get(name, estimates.get(name.rpartition("/")[2]))
            if own is not None and own.value is not None:
                sigma[name] = own.value
    elif FACTOR in estimates and (factor := estimates[FACTOR].value) is not None:
        for name, rows in problem.groups().items():
            sigma[name] = factor * float(np.sqrt((problem.noise.sigma[rows] ** 2).mean()))
    if problem.noise.is_scaled and local.policy == "unknown":  # the factor is on a sigma of 1
        (group,) = replace(problem.noise, policy="unknown").groups(problem.groups(), len(problem.series))
        estimates, bounds = {group: estimates[FACTOR]}, {group: bounds[""]}
    prior = {name or FACTOR: ends for name, ends in bounds.items()}
    return replace(local, sigma=sigma, estimates=estimates, prior=prior)


def angle_offset_of(found: AngleOffset, distribution: Distribution) -> Estimate:
    """The offset of the set angles as the distribution has it; where that has none, by its Gaussian.

    "prior" where the data do not halve the sd of its prior, else "determined".
    """
    if OFFSET in distribution.names:
        own = _central(distribution, OFFSET)
    else:
        value, sd = found.value, found.sd
        low95, low68, _, high68, high95 = (value + sd * float(special.ndtri(p)) for p in LEVELS)
        own = Estimate(value, sd, (low68, high68), (low95, high95), "determined")
    if own.stderr is not None and own.stderr < HALF * found.prior_sd:
        return own
    return replace(own, status="prior", reason="rests on its prior")


def _central(distribution: Distribution, name: str) -> Estimate:
    """Median, standard deviation, mean and central intervals of a quantity that is determined."""
    low95, low68, median, high68, high95 = (float(q) for q in distribution.quantile(name, LEVELS))
    mean, sd = distribution.mean(name), distribution.sd(name)
    return Estimate(median, sd, (low68, high68), (low95, high95), "determined", mean=mean)


def correlation_of(distribution: Distribution, names: tuple[str, ...]) -> Array:
    """Correlation of the free constants, (n, n)."""
    covariance = distribution.covariance(names)
    size = np.sqrt(np.diag(covariance))
    with np.errstate(divide="ignore", invalid="ignore"):
        found = covariance / np.outer(size, size)
    np.fill_diagonal(found, 1.0)
    return np.asarray(np.where(np.isfinite(found), found, 0.0))
