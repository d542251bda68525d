"""Constants, noise and derived quantities as a law of them says, with their statuses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ifrfit.inference.diagnostics.thresholds import HALF
from ifrfit.inference.distributions.protocol import LEVELS, Distribution
from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.laplace import kappa_coordinates
from ifrfit.inference.optimize.optimum import Array
from ifrfit.inference.result.types import Estimate, Interval, Noise, State
from ifrfit.inference.summary.derived import meaning_of
from ifrfit.inference.summary.kappa import kappa_bounds
from ifrfit.physics.transition import transition_angles

DRAWS = 2000  # kept in the result, for predictions
_REACHED = 0.1465  # density at a bound over the largest one, above which the 95 % region reaches the bound

Estimates = Mapping[str, Estimate | Mapping[str, Estimate]]


def constants_from_law(problem: Problem, law: Distribution, local: Estimates) -> dict[str, Any]:
    """Every constant from its marginal.

    Parameters
    ----------
    problem : Problem
    law : Distribution
    local : mapping
        The estimates of least squares: they know which constants the data see at all, and which lean on a
        prior.
    """
    found: dict[str, Any] = {}
    for constant in problem.parameters:
        own = local[constant.name]
        if isinstance(own, Estimate):
            found[constant.name] = estimate_from_law(law, constant.name, constant, own)
        else:
            found[constant.name] = {
                series: estimate_from_law(law, f"{constant.name}[{series}]", constant, each)
                for series, each in own.items()
            }
    return found


def estimate_from_law(law: Distribution, name: str, constant: Parameter, local: Estimate) -> Estimate:
    """One constant: posterior median, mean, sd and intervals; its status by the table of statuses."""
    if local.status == "fixed":
        return local
    if local.value is None:
        # what the data leave open follows the prior: the interval is that of the data alone
        return replace(local, mean=law.mean(name))
    low95, low68, median, high68, high95 = np.asarray(law.quantile(name, LEVELS))
    mean, sd = law.mean(name), law.sd(name)
    central = (float(low68), float(high68)), (float(low95), float(high95))
    if not sd < HALF * constant.prior_sd:
        reason = "the posterior is nearly as wide as the prior"
        return Estimate(None, None, *central, "not_determined", reason, mean)
    side = _side(law, name, constant.lower, constant.prior_upper, sd)
    if side:
        bound = constant.lower if side < 0 else constant.upper
        ends = [_one_sided(law, name, side, bound, p) for p in (0.68, 0.95)]
        reason = local.reason if local.status == "one_sided" else f"not told from its bound {bound:g}"
        return Estimate(float(median), sd, ends[0], ends[1], "one_sided", reason, mean)
    status = "determined" if local.status == "one_sided" else local.status
    reason = "" if local.status == "one_sided" else local.reason
    return Estimate(float(median), sd, *central, status, reason, mean)


def _side(law: Distribution, name: str, lower: float, upper: float, sd: float) -> int:
    """-1 if the 95 % region of highest density reaches the lower bound, 1 for the upper, 0 for neither."""
    if sd == 0.0:  # every draw is the same
        at = law.mean(name)
        return -1 if at == lower else int(at == upper)
    step = law.grain * sd
    middle = law.mean(name) + sd * np.linspace(-4.0, 4.0, 33)
    edges = np.clip(np.concatenate((middle, [lower, lower + step, upper - step, upper])), lower, upper)
    cdf = np.asarray(law.cdf(name, edges))
    with np.errstate(divide="ignore", invalid="ignore"):
        density = np.diff(cdf[:33]) / np.diff(edges[:33])
    # bounds cut some of these steps short, and draws that lie on a bound would be dense there without limit
    top = float(np.where(np.diff(edges[:33]) >= step, density, 0.0).max())
    ends = (cdf[34] - cdf[33]) / step, (cdf[36] - cdf[35]) / step
    top = max(top, *ends)
    if max(ends) <= _REACHED * top:
        return 0
    if min(ends) > _REACHED * top:
        return 0 if ends[0] == ends[1] else (-1 if ends[0] > ends[1] else 1)
    return -1 if ends[0] > ends[1] else 1


def _one_sided(law: Distribution, name: str, side: int, bound: float, p: float) -> Interval:
    edge = float(law.quantile(name, p if side < 0 else 1.0 - p))
    return (bound, edge) if side < 0 else (edge, bound)


def derived_from_law(
    problem: Problem, law: Distribution, local: Mapping[str, Any], constants: Mapping[str, Any]
) -> dict[str, Any]:
    """kappa, transition angles, and what the closure constant stands for."""
    names = [name for name in law.names if name.startswith("kappa")]
    kappa = local["kappa"]
    if isinstance(kappa, Estimate):
        kappas = {series: _kappa(problem, law, names, 0, kappa) for series in problem.series}
        found: Any = kappas[problem.series[0]]
    else:
        kappas = {
            series: _kappa(problem, law, names, i, kappa[series]) for i, series in enumerate(problem.series)
        }
        found = kappas
    return {
        "kappa": found,
        "transition_angle_deg": {
            series: _transition(problem, law, i, kappas[series], local["transition_angle_deg"][series])
            for i, series in enumerate(problem.series)
        },
    } | meaning_of(problem, constants)


def _kappa(problem: Problem, law: Distribution, names: list[str], series: int, local: Estimate) -> Estimate:
    if local.status == "fixed" or not names:
        return local
    if (
        problem.parameters.entries[int(problem.parameters.positions["mu"][series])].fixed == 0.0
    ):  # whatever e_n is
        return Estimate(0.0, None, (0.0, 0.0), (0.0, 0.0), "fixed", "mu (1 + e_n)")
    lower, upper = kappa_bounds(problem, series)
    found = estimate_from_law(
        law, _own(names, problem.series[series]), Parameter("kappa", lower, upper), local
    )
    return replace(found, reason=found.reason or local.reason)


def _own(names: list[str], series: str) -> str:
    return next((name for name in names if name.endswith(f"[{series}]")), names[0])


def _transition(problem: Problem, law: Distribution, series: int, kappa: Estimate, local: Any) -> Any:
    """Transition angles from quantiles of the transition: an angle runs with tau one way or the other."""
    if local is None or kappa.status == "fixed" or kappa.value is None:
        return local if kappa.status == "fixed" else None
    rows = problem.rows.series == series
    spin = [float(np.median(s[rows])) for s in (problem.rows.incidence.spin_x, problem.rows.incidence.spin_y)]
    tau = law.transition(problem.series[series])
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


def noise_from_law(
    problem: Problem, law: Distribution, local: Noise, bounds: Mapping[str, Interval]
) -> Noise:
    """Noise with what the law says of it; sigma is its median, and stays where the law holds no noise."""
    estimates = {}
    for name in law.names:
        if not name.startswith("noise"):
            continue
        low95, low68, median, high68, high95 = (float(q) for q in np.asarray(law.quantile(name, LEVELS)))
        key = name[len("noise[") : -1]
        estimates[key] = Estimate(
            median,
            law.sd(name),
            (low68, high68),
            (low95, high95),
            "determined",
            "",
            law.mean(name),
        )
    sigma = dict(local.sigma)
    if problem.noise.is_unknown:
        sigma |= {name: float(e.value) for name, e in estimates.items() if e.value is not None}
    elif "" in estimates and (factor := estimates[""].value) is not None:
        for name, rows in problem.groups().items():
            sigma[name] = factor * float(np.sqrt((problem.noise.sigma[rows] ** 2).mean()))
    if problem.noise.is_scaled and local.policy == "unknown":  # the factor is on a sigma of 1
        (group,) = problem.groups()
        estimates, bounds = {group: estimates[""]}, {group: bounds[""]}
    return Noise(local.policy, sigma, estimates, dict(bounds), local.error_model)


def state_from_law(
    problem: Problem, law: Distribution, state: State, drawn: Mapping[str, Array], n: int
) -> State:
    """State for predictions: medians, and n draws that stand for the law."""
    names, sample = in_state_coordinates(problem, drawn, n)
    kappas = [name for name in law.names if name.startswith("kappa")]
    point = sample[0].copy()  # fixed entries are the same in all
    for i, name in enumerate(names):
        own = _own(kappas, name[name.find("[") + 1 : -1]) if name.startswith("kappa") and kappas else name
        if own in law.names:
            point[i] = float(law.quantile(own, 0.5))
    return replace(state, names=names, point=point, sample=sample)


def in_state_coordinates(
    problem: Problem, drawn: Mapping[str, Array], n: int
) -> tuple[tuple[str, ...], Array]:
    """Names and draws, (n, p), with kappa in the place of mu where that is one to one."""
    columns = [
        drawn[name] if name in drawn else np.full(n, entry.fixed)
        for name, entry in zip(problem.parameters.names, problem.parameters.entries, strict=True)
    ]
    sample = np.column_stack(columns)
    names, _, _ = kappa_coordinates(problem, sample[0])
    places = problem.parameters.positions
    for e_n, mu in {(int(e), int(m)) for e, m in zip(places["e_n"], places["mu"], strict=True)}:
        if names[mu] != problem.parameters.names[mu]:
            sample[:, mu] *= 1.0 + sample[:, e_n]
    return names, sample


def correlation_from_law(law: Distribution, names: tuple[str, ...]) -> Array:
    """Posterior correlation of the free constants."""
    covariance = law.covariance(names)
    size = np.sqrt(np.diag(covariance))
    with np.errstate(divide="ignore", invalid="ignore"):
        found = covariance / np.outer(size, size)
    np.fill_diagonal(found, 1.0)
    return np.asarray(np.where(np.isfinite(found), found, 0.0))
