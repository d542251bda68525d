"""Constants, noise and derived quantities as the exact posterior has them, with their statuses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ifrfit.inference.constants import Constant
from ifrfit.inference.derived import sticking_of
from ifrfit.inference.kappa import kappa_bounds
from ifrfit.inference.local import kappa_coordinates
from ifrfit.inference.optimum import Array
from ifrfit.inference.posterior import LEVELS, Posterior
from ifrfit.inference.problem import Problem
from ifrfit.inference.result import Estimate, Fact, Interval, Noise, State
from ifrfit.inference.rules import FACTS, HALF
from ifrfit.physics.transition import transition_angles

DRAWS = 2000  # kept in the result, for predictions
_REACHED = 0.1465  # density at a bound over the largest one, above which the 95 % region reaches the bound
_STEP = 0.02  # in sd: from the bound to where its density is taken

Estimates = Mapping[str, Estimate | Mapping[str, Estimate]]


def exact_constants(problem: Problem, posterior: Posterior, local: Estimates) -> dict[str, Any]:
    """Every constant from its marginal.

    Parameters
    ----------
    problem : Problem
    posterior : Posterior
    local : mapping
        The estimates of least squares: they know which constants the data see at all, and which lean on a
        prior.
    """
    found: dict[str, Any] = {}
    for constant in problem.constants:
        own = local[constant.name]
        if isinstance(own, Estimate):
            found[constant.name] = exact_estimate(posterior, constant.name, constant, own)
        else:
            found[constant.name] = {
                series: exact_estimate(posterior, f"{constant.name}[{series}]", constant, each)
                for series, each in own.items()
            }
    return found


def exact_estimate(posterior: Posterior, name: str, constant: Constant, local: Estimate) -> Estimate:
    """One constant: posterior median, mean, sd and intervals; its status by the table of statuses."""
    if local.status == "fixed":
        return local
    if local.value is None:
        # what the data leave open follows the prior: the interval is that of the data alone
        return replace(local, mean=posterior.mean(name))
    low95, low68, median, high68, high95 = np.asarray(posterior.quantile(name, LEVELS))
    mean, sd = posterior.mean(name), posterior.sd(name)
    central = (float(low68), float(high68)), (float(low95), float(high95))
    if not sd < HALF * constant.prior_sd:
        reason = "the posterior is nearly as wide as the prior"
        return Estimate(None, None, *central, "not_determined", reason, mean)
    mean_density = 0.68 / max(float(high68 - low68), 1e-300)  # the largest one is no less
    side = _side(posterior, name, constant.lower, constant.prior_upper, mean_density)
    if side:
        bound = constant.lower if side < 0 else constant.upper
        ends = [_one_sided(posterior, name, side, bound, p) for p in (0.68, 0.95)]
        reason = local.reason if local.status == "one_sided" else f"not told from its bound {bound:g}"
        return Estimate(float(median), sd, ends[0], ends[1], "one_sided", reason, mean)
    status = "determined" if local.status == "one_sided" else local.status
    reason = "" if local.status == "one_sided" else local.reason
    return Estimate(float(median), sd, *central, status, reason, mean)


def _side(posterior: Posterior, name: str, lower: float, upper: float, top: float) -> int:
    """-1 if the 95 % region of highest density reaches the lower bound, 1 for the upper, 0 for neither.

    `top` is what the largest density is at least.
    """
    sd = posterior.sd(name)
    step = _STEP * sd
    below = np.asarray(posterior.cdf(name, np.array([lower, lower + step, upper - step, upper])))
    ends = (below[1] - below[0]) / step, (below[3] - below[2]) / step
    if max(ends) <= _REACHED * top:
        return 0
    edges = np.clip(posterior.mean(name) + sd * np.linspace(-4.0, 4.0, 33), lower, upper)
    with np.errstate(divide="ignore", invalid="ignore"):
        density = np.diff(np.asarray(posterior.cdf(name, edges))) / np.diff(edges)
    top = max(float(np.nanmax(np.where(np.isfinite(density), density, 0.0))), *ends)
    if max(ends) <= _REACHED * top:
        return 0
    if min(ends) > _REACHED * top:
        return 0 if ends[0] == ends[1] else (-1 if ends[0] > ends[1] else 1)
    return -1 if ends[0] > ends[1] else 1


def _one_sided(posterior: Posterior, name: str, side: int, bound: float, p: float) -> Interval:
    edge = float(posterior.quantile(name, p if side < 0 else 1.0 - p))
    return (bound, edge) if side < 0 else (edge, bound)


def exact_derived(
    problem: Problem, posterior: Posterior, local: Mapping[str, Any], constants: Mapping[str, Any]
) -> dict[str, Any]:
    """kappa, transition angles and the restitution in sticking."""
    names = [name for name in posterior.names if name.startswith("kappa")]
    kappa = local["kappa"]
    if isinstance(kappa, Estimate):
        kappas = {series: _kappa(problem, posterior, names, 0, kappa) for series in problem.series}
        found: Any = kappas[problem.series[0]]
    else:
        kappas = {
            series: _kappa(problem, posterior, names, i, kappa[series])
            for i, series in enumerate(problem.series)
        }
        found = kappas
    return {
        "kappa": found,
        "transition_angle_deg": {
            series: _transition(problem, posterior, i, kappas[series], local["transition_angle_deg"][series])
            for i, series in enumerate(problem.series)
        },
        "beta_sticking": sticking_of(problem, constants),
    }


def _kappa(
    problem: Problem, posterior: Posterior, names: list[str], series: int, local: Estimate
) -> Estimate:
    if local.status == "fixed" or not names:
        return local
    lower, upper = kappa_bounds(problem, series)
    found = exact_estimate(
        posterior, _own(names, problem.series[series]), Constant("kappa", lower, upper), local
    )
    return replace(found, reason=found.reason or local.reason)


def _own(names: list[str], series: str) -> str:
    return next((name for name in names if name.endswith(f"[{series}]")), names[0])


def _transition(problem: Problem, posterior: Posterior, series: int, kappa: Estimate, local: Any) -> Any:
    """Transition angles from quantiles of the transition: an angle runs with tau one way or the other."""
    if local is None or kappa.status == "fixed" or kappa.value is None:
        return local if kappa.status == "fixed" else None
    rows = problem.rows.series == series
    spin = [float(np.median(s[rows])) for s in (problem.rows.incidence.spin_x, problem.rows.incidence.spin_y)]
    tau = posterior.transition(problem.series[series])
    locals_ = [local] if isinstance(local, Estimate) else list(local)
    found = []
    for number, old in enumerate(locals_):
        angles = np.array([_angle(t, spin, number, len(locals_), float(old.value or 0.0)) for t in tau])
        ends = sorted((angles[1], angles[3])), sorted((angles[0], angles[4]))
        half = 0.5 * (ends[0][1] - ends[0][0]) if kappa.stderr is not None else None
        within68, within95 = ((float(low), float(high)) for low, high in ends)
        found.append(Estimate(float(angles[2]), half, within68, within95, kappa.status, kappa.reason))
    return found[0] if isinstance(local, Estimate) else found


def _angle(tau: float, spin: list[float], number: int, count: int, near: float) -> float:
    """The transition angle on a branch; its old place where that branch has ended."""
    angles = transition_angles(float(tau), *spin)
    if len(angles) == count:
        return float(angles[number])
    return float(min(angles, key=lambda a: abs(a - near))) if angles else near


def exact_noise(
    problem: Problem, posterior: Posterior, local: Noise, bounds: Mapping[str, Interval]
) -> Noise:
    """Noise with its posterior; sigma is its median."""
    estimates = {}
    for name in posterior.names:
        if not name.startswith("noise"):
            continue
        low95, low68, median, high68, high95 = (
            float(q) for q in np.asarray(posterior.quantile(name, LEVELS))
        )
        key = name[len("noise[") : -1]
        estimates[key] = Estimate(
            median,
            posterior.sd(name),
            (low68, high68),
            (low95, high95),
            "determined",
            "",
            posterior.mean(name),
        )
    sigma = dict(local.sigma)
    if problem.noise == "unknown":
        sigma |= {name: float(e.value) for name, e in estimates.items() if e.value is not None}
    elif problem.noise == "scaled":
        factor = estimates[""].value
        assert factor is not None
        for name, rows in problem.groups().items():
            sigma[name] = factor * float(np.sqrt((problem.sigma[rows] ** 2).mean()))
    return Noise(local.policy, sigma, estimates, dict(bounds))


def exact_state(problem: Problem, posterior: Posterior, state: State, drawn: Mapping[str, Array]) -> State:
    """State for predictions: medians, and `DRAWS` draws that stand for the posterior."""
    names, sample = in_state_coordinates(problem, drawn, DRAWS)
    kappas = [name for name in posterior.names if name.startswith("kappa")]
    point = sample[0].copy()  # fixed entries are the same in all
    for i, name in enumerate(names):
        own = _own(kappas, name[name.find("[") + 1 : -1]) if name.startswith("kappa") and kappas else name
        if own in posterior.names:
            point[i] = float(posterior.quantile(own, 0.5))
    return replace(state, names=names, point=point, sample=sample)


def in_state_coordinates(
    problem: Problem, drawn: Mapping[str, Array], n: int
) -> tuple[tuple[str, ...], Array]:
    """Names and draws, (n, p), with kappa in the place of mu where that is one to one."""
    columns = [
        drawn[name] if name in drawn else np.full(n, entry.fixed)
        for name, entry in zip(problem.names, problem.entries(), strict=True)
    ]
    sample = np.column_stack(columns)
    names, _, _ = kappa_coordinates(problem, sample[0])
    places = problem.positions()
    for e_n, mu in {(int(e), int(m)) for e, m in zip(places["e_n"], places["mu"], strict=True)}:
        if names[mu] != problem.names[mu]:
            sample[:, mu] *= 1.0 + sample[:, e_n]
    return names, sample


def exact_converged(posterior: Posterior, settled: Fact) -> Fact:
    """Whether the quadrature reached its tolerance, and the noise of the least squares behind it settled."""
    figures = {
        "error": posterior.error,
        "error_evidence": posterior.error_evidence,
        "tolerance": posterior.tolerance,
    } | dict(settled.figures)
    reached = f"{posterior.error:.0e} of a standard deviation"
    if posterior.converged and settled.ok:
        says = f"quadrature converged: no result moves by more than {posterior.tolerance:g} of its sd"
    elif not posterior.converged:
        says = f"the quadrature reached {reached} only, for {posterior.tolerance:.0e} wanted"
    else:
        says = settled.says
    return Fact(posterior.converged and settled.ok, says, figures, FACTS["converged"])


def exact_correlation(posterior: Posterior, names: tuple[str, ...]) -> Array:
    """Posterior correlation of the free constants."""
    covariance = posterior.covariance(names)
    size = np.sqrt(np.diag(covariance))
    with np.errstate(divide="ignore", invalid="ignore"):
        found = covariance / np.outer(size, size)
    np.fill_diagonal(found, 1.0)
    return np.asarray(np.where(np.isfinite(found), found, 0.0))
