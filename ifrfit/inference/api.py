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
from ifrfit.inference.criticism import residuals_of
from ifrfit.inference.derived import derived_of
from ifrfit.inference.estimates import constants_of
from ifrfit.inference.facts import facts_of
from ifrfit.inference.finish import with_posterior, with_profiles
from ifrfit.inference.least_squares import LeastSquares, least_squares
from ifrfit.inference.problem import Problem, make_problem
from ifrfit.inference.result import FitResult, Noise
from ifrfit.inference.statistics import state_of, statistics_of
from ifrfit.physics.closures import get_closure

METHODS = ("exact", "lsq", "profile")

Data = str | Path | Observations


def fit(
    data: Data | Sequence[Data],
    *,
    closure: str = "ifr",
    method: str = "exact",
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
        exact: the posterior by deterministic quadrature; lsq: least squares with a certificate of the global
        optimum; profile: the profile likelihood of each constant.
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
    found = least_squares(problem)
    result = _result(problem, found, seed, command)
    if method == "lsq":
        return result
    return with_profiles(result) if method == "profile" else with_posterior(result)


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


def _result(problem: Problem, found: LeastSquares, seed: int, command: str) -> FitResult:
    theta = found.optimum.theta
    e_n, c, mu = problem.per_row(theta)
    _, sticks = problem.impulse(e_n, c, mu)
    residuals = residuals_of(problem, found)
    statistics = statistics_of(problem, found, residuals, sticks)
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
        method="lsq",
        inputs=problem.observations.sources,
        noise=Noise(problem.noise, found.noise),
        constants=constants,
        derived=derived_of(problem, found, constants),
        correlation=(names, capped[np.ix_(free, free)] / np.outer(size, size)),
        fit=statistics,
        facts=facts_of(problem, found, residuals, constants, statistics),
        warnings=_warnings(problem),
        state=state_of(problem, found),
        points=points,
        seed=seed,
        command=command,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        versions=_versions(),
        asked=problem.constants,
        problem=problem,
        least_squares=found,
    )


def _warnings(problem: Problem) -> tuple[str, ...]:
    said = list(problem.observations.notes)
    table = problem.observations.table
    ignored = [
        problem.observations.called(column)
        for column in ("sigma_spin_x", "sigma_spin_y", "sigma_gamma_deg")
        if (table[column].fillna(0.0) > 0.0).any()
    ]
    if ignored:
        said.append(f"Not propagated: {' and '.join(ignored)}; angles and spins are taken as exact.")
    given = int(np.isfinite(problem.sigma).sum())
    if problem.noise == "unknown" and given:
        said.append(
            f"sigma is given in {given} of {problem.sigma.size} rows, and is not used: the noise comes from "
            "the misfit. Give every row a sigma, or choose --noise."
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
