"""`fit`: from data to a result."""

from __future__ import annotations

import math
import platform
from collections.abc import Collection, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from ifrfit._version import __version__
from ifrfit.data import Observations, Selection, combine, resolve, select
from ifrfit.errors import UsageError
from ifrfit.inference.constants import make_constants
from ifrfit.inference.criticism import Residuals, lack_of_fit, residuals_of
from ifrfit.inference.derived import derived_of
from ifrfit.inference.estimates import constants_of
from ifrfit.inference.identifiability import identifiable
from ifrfit.inference.least_squares import LeastSquares, least_squares
from ifrfit.inference.outliers import outliers
from ifrfit.inference.problem import Problem, make_problem
from ifrfit.inference.result import Estimate, Fact, FitResult, FitStatistics, Noise, State
from ifrfit.inference.rules import FACTS
from ifrfit.physics.closures import get_closure
from ifrfit.physics.observables import OBSERVABLES

METHODS = ("lsq",)

Data = str | Path | Observations


def fit(
    data: Data | Sequence[Data],
    *,
    closure: str = "ifr",
    method: str = "lsq",
    fix: Mapping[str, float] | None = None,
    prior: Mapping[str, tuple[float, float]] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    separate: str | Collection[str] = (),
    noise: str | None = None,
    observable: str | Sequence[str] = (),
    series: str | Sequence[str] = (),
    gamma_min: float | None = None,
    gamma_max: float | None = None,
    speed_min: float | None = None,
    speed_max: float | None = None,
    exclude: str | int | Sequence[str | int] = (),
    independent: bool = False,
    inertia_factor: float | None = None,
    convention: Sequence[str] | Mapping[str, str] = (),
    params: Any = None,
    seed: int = 0,
    command: str = "",
) -> FitResult:
    """Recover one set of constants from measured impacts, sticking and sliding together.

    Parameters
    ----------
    data : str, Path, Observations, or a sequence of them
        Files, names of bundled datasets, or what `read` and `load_dataset` return.
    closure : str
        ifr, fr, f or ifr-contact.
    method : str
        lsq: least squares with a certificate of the global optimum.
    fix : mapping
        Constant to its known value.
    prior : mapping
        Constant to (mean, sd) of an earlier measurement.
    bounds : mapping
        Constant to (lower, upper), in the place of the passive domain.
    separate : str or collection of str
        Constants with a value of their own in each series.
    noise : {"known", "scaled", "unknown"}, optional
        What sigma means; by default the dataset's own policy, else known where every row has a sigma, else
        unknown.
    observable, series : str or sequence of str
        Use only these.
    gamma_min, gamma_max : float
        Degrees from the normal.
    speed_min, speed_max : float
        m/s.
    exclude : sequence
        Row numbers (lines of the file), FILE:ROW, or impact ids.
    independent : bool
        Take faces of the same impacts as independent all the same.
    inertia_factor : float, optional
        J = I/(m R^2); by default the dataset's, else 2/5.
    convention : sequence or mapping
        How columns are meant, see `read`.
    params : lmfit.Parameters, optional
        Fixed values and bounds in lmfit's form.
    seed : int
        Of the bands.
    command : str
        The command line, for the record.

    Returns
    -------
    FitResult

    Raises
    ------
    UsageError
        For choices that do not exist or contradict.
    DataError
        For data that are refused.
    """
    if method not in METHODS:
        raise UsageError(f"There is no method '{method}'. This version has {', '.join(METHODS)}.")
    chosen = get_closure(closure)
    observations = _gather(data, convention, inertia_factor)
    selection = Selection(
        observable=_tuple(observable),
        series=_tuple(series),
        gamma_min=gamma_min,
        gamma_max=gamma_max,
        speed_min=speed_min,
        speed_max=speed_max,
        exclude=tuple(str(x) for x in _tuple(exclude)),
        independent=independent,
    )
    observations = select(observations, selection)
    j = inertia_factor if inertia_factor is not None else _inertia_factor(observations)
    if not 0.0 < j < math.inf:
        raise UsageError(f"--inertia-factor {j:g}: it must be positive (2/5 for a solid sphere).")
    if seed < 0:
        raise UsageError(f"--seed {seed}: it must be 0 or more.")
    choices: dict[str, Any] = {"fix": dict(fix or {}), "bounds": dict(bounds or {})}
    if params is not None:
        from ifrfit.inference.lmfit_bridge import constants_from

        for key, value in constants_from(params).items():
            choices[key] = value | choices[key]
    constants = make_constants(chosen, j, prior=prior, separate=_tuple(separate), **choices)
    problem = make_problem(observations, chosen, j, constants, noise)
    return _result(problem, least_squares(problem), method, seed, command)


def _tuple(value: Any) -> tuple[Any, ...]:
    if isinstance(value, str | int):
        return (value,)
    return tuple(value)


def _gather(
    data: Data | Sequence[Data], convention: Sequence[str] | Mapping[str, str], inertia_factor: float | None
) -> Observations:
    parts = [data] if isinstance(data, str | Path | Observations) else list(data)
    read = [
        part
        if isinstance(part, Observations)
        else resolve(part, convention=convention, inertia_factor=inertia_factor)
        for part in parts
    ]
    if not read:
        raise UsageError("There is nothing to fit: name a file or a dataset.")
    return read[0] if len(read) == 1 else combine(read)


def _inertia_factor(observations: Observations) -> float:
    stated = {s.descriptor.inertia_factor for s in observations.sources if s.descriptor is not None}
    if len(stated) > 1:
        raise UsageError(
            f"The datasets have different inertia factors ({', '.join(f'{x:g}' for x in sorted(stated))}): "
            "fit them apart, or choose one with --inertia-factor."
        )
    return stated.pop() if stated else 0.4


def _result(problem: Problem, found: LeastSquares, method: str, seed: int, command: str) -> FitResult:
    theta = found.optimum.theta
    e_n, c, mu = problem.per_row(theta)
    _, sticks = problem.impulse(e_n, c, mu)
    residuals = residuals_of(problem, found)
    statistics = _statistics(problem, found, residuals, sticks)
    constants = constants_of(problem, found)
    free = problem.free
    capped = found.local.to_theta @ found.local.covariance(capped=True) @ found.local.to_theta.T
    size = np.sqrt(np.diag(capped))[free]
    names = tuple(n for n, is_free in zip(problem.names, free, strict=True) if is_free)
    points = problem.observations.table.copy()
    points["sigma_used"] = found.sigma
    points["fitted"] = problem.rows.value - residuals.raw
    points["residual"] = residuals.raw
    points["standardised"] = residuals.studentised
    points["tau"] = problem.rows.tau
    points["sticking"] = sticks
    return FitResult(
        closure=problem.closure.name,
        inertia_factor=problem.inertia_factor,
        method=method,
        inputs=problem.observations.sources,
        noise=Noise(problem.noise, found.noise),
        constants=constants,
        derived=derived_of(problem, found, constants),
        correlation=(names, capped[np.ix_(free, free)] / np.outer(size, size)),
        fit=statistics,
        facts=_facts(problem, found, residuals, constants, statistics),
        warnings=_warnings(problem),
        state=_state(problem, found, constants),
        points=points,
        seed=seed,
        command=command,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        versions=_versions(),
        problem=problem,
    )


def _statistics(
    problem: Problem, found: LeastSquares, residuals: Residuals, sticks: np.ndarray
) -> FitStatistics:
    r = residuals.raw
    n = r.size
    dof = n - round(float(found.local.leverage.sum()))
    yardstick = problem.sigma if problem.noise == "scaled" else found.sigma
    chi2 = float(((r / yardstick) ** 2).sum())
    prior = problem.prior_residuals(found.optimum.theta)
    likely, n_noise = found.sigma, 0
    if problem.noise != "known":
        groups = {"": np.arange(n)} if problem.noise == "scaled" else problem.groups()
        n_noise = len(groups)
        likely = found.sigma.copy()  # the most likely noise, without the correction for the constants
        for rows in groups.values():
            likely[rows] *= math.sqrt(float(((r[rows] / likely[rows]) ** 2).mean()))
    log_l = float(-0.5 * ((r / likely) ** 2).sum() - np.log(likely).sum() - 0.5 * n * math.log(2.0 * math.pi))
    k = found.local.rank + n_noise
    oblique = np.array([OBSERVABLES[x].kind in ("tangential", "curved") for x in problem.rows.names])
    regime = oblique[problem.rows.which]
    from scipy.special import chdtrc

    return FitStatistics(
        n=n,
        n_sliding=int((regime & ~sticks).sum()),
        n_sticking=int((regime & sticks).sum()),
        rank=found.local.rank,
        prior_chi2=float(prior @ prior),
        chi2=chi2,
        dof=dof,
        reduced_chi2=chi2 / dof if dof > 0 and problem.noise != "unknown" else None,
        p_value=float(chdtrc(dof, chi2)) if dof > 0 and problem.noise == "known" else None,
        rmse=float(np.sqrt((r * r).mean())),
        log_likelihood=log_l,
        aic=2.0 * k - 2.0 * log_l,
        bic=k * math.log(n) - 2.0 * log_l,
    )


def _facts(
    problem: Problem,
    found: LeastSquares,
    residuals: Residuals,
    constants: Mapping[str, Any],
    statistics: FitStatistics,
) -> dict[str, Fact]:
    return {
        "converged": Fact(
            found.converged,
            "the noise has come to rest" if found.converged else "the noise has not come to rest",
            {"change": found.change},
            FACTS["converged"],
        ),
        "global_optimum": _global_optimum(found),
        "identifiable": identifiable(problem, found, statistics.n_sticking, statistics.n_sliding),
        "at_bound": _at_bound(constants),
        "lack_of_fit": lack_of_fit(problem, found, residuals),
        "outliers": outliers(problem, found, residuals),
    }


def _global_optimum(found: LeastSquares) -> Fact:
    optimum = found.optimum
    figures = {
        "gap": optimum.gap,
        "n_optima_same": optimum.n_same,
        "n_optima_near": optimum.n_near,
        "road": optimum.road,
    }
    rule = FACTS["global_optimum"]
    rivals = optimum.n_near - 1
    if optimum.certified:
        alone = "the only one" if rivals == 0 else f"with {rivals} other within 4 of its chi2"
        return Fact(optimum.n_same == 1, f"global optimum certified, {alone}", figures, rule)
    proof = "no bound is known for these observables" if optimum.gap is None else f"gap {optimum.gap:.1e}"
    return Fact(False, f"the optimum is not proven to be global ({optimum.road}; {proof})", figures, rule)


def _at_bound(constants: Mapping[str, Any]) -> Fact:
    """Constants that lie on a bound, and those that the data do not tell from it."""
    on: list[str] = []
    near: list[str] = []
    for name, found in constants.items():
        each = {"": found} if isinstance(found, Estimate) else found
        for series, estimate in each.items():
            label = f"{name}[{series}]" if series else name
            if estimate.status == "one_sided" and estimate.value is not None:
                (on if "lies on" in estimate.reason else near).append(label)
    parts = [f"{', '.join(on)} on the bound of the domain"] if on else []
    parts += [f"{', '.join(near)} not told from the bound of the domain"] if near else []
    says = "; ".join(parts) or "no constant lies on a bound"
    return Fact(not parts, says, {"on": on, "near": near}, FACTS["at_bound"])


def _state(problem: Problem, found: LeastSquares, constants: Mapping[str, Any]) -> State:
    """Coordinates for predictions; a centre beyond a bound only where the bound holds the optimum back."""
    local = found.local
    covariance = local.covariance(capped=True)
    lower, upper = problem.bounds()
    entries = problem.entries()
    gradient = np.zeros(local.phi.size)
    low, high = lower.copy(), upper.copy()
    for i, (name, constant) in enumerate(zip(local.names, entries, strict=True)):
        if name.startswith("kappa"):
            e_n = float(problem.per_row(found.optimum.theta)[0][0])
            low[i], high[i] = lower[i] * (1.0 + e_n), upper[i] * (1.0 + e_n)
        value = local.phi[i]
        if constant.fixed is None and (value - low[i] <= 1e-9 or high[i] - value <= 1e-9):
            gradient[i] = local.gradient[i]
    shift = -0.5 * covariance @ gradient
    return State(local.names, local.phi, local.phi + shift, covariance, low, high)


def _warnings(problem: Problem) -> tuple[str, ...]:
    said = list(problem.observations.notes)
    table = problem.observations.table
    ignored = [
        column
        for column in ("sigma_spin_x", "sigma_spin_y", "sigma_gamma_deg")
        if (table[column].fillna(0.0) > 0.0).any()
    ]
    if ignored:
        said.append(
            f"Not propagated by least squares: {' and '.join(ignored)}; angles and spins are taken as exact."
        )
    return tuple(said)


def _versions() -> dict[str, str]:
    import pandas
    import scipy

    return {
        "ifrfit": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "pandas": pandas.__version__,
    }
