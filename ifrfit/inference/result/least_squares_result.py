"""The result of least squares: what every fit begins with."""

from __future__ import annotations

import platform
from datetime import UTC, datetime

import numpy as np

from ifrfit._version import __version__
from ifrfit.inference.diagnostics.collect import facts_of
from ifrfit.inference.diagnostics.lack_of_fit import residuals_of
from ifrfit.inference.diagnostics.omitted_effects.assess import effects_of
from ifrfit.inference.diagnostics.omitted_effects.experimental_conditions import Setting
from ifrfit.inference.model.apply_error_model import reported_policy
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.fit_statistics import state_of, statistics_of
from ifrfit.inference.result.types import Noise
from ifrfit.inference.summary.derived import derived_of
from ifrfit.inference.summary.estimates import constants_of


def optimum_of(
    problem: Problem,
    seed: int = 0,
    command: str = "",
    setting: Setting | None = None,
    *,
    brief: bool = False,
) -> FitResult:
    """Least squares with everything that is said of an optimum; other methods begin with it.

    Parameters
    ----------
    problem : Problem
    seed : int
        Of the draws and bands that follow.
    command : str
        The command line, for the record.
    setting : Setting, optional
        The scene of the data, for the effects' criteria.
    brief : bool
        Leave out what takes further fits and serves readers of this one alone: outliers, remedies, effects.
    """
    import pandas as pd

    found = least_squares(problem)
    theta = found.optimum.theta
    e_n, c, mu = problem.per_row(theta)
    _, sticks = problem.impulse(e_n, c, mu)
    residuals = residuals_of(problem, found)
    statistics = statistics_of(problem, found, residuals, sticks)
    constants = constants_of(problem, found)
    free = problem.parameters.free
    capped = found.gaussian.to_theta @ found.gaussian.covariance(capped=True) @ found.gaussian.to_theta.T
    size = np.sqrt(np.diag(capped))[free]
    names = tuple(n for n, is_free in zip(problem.parameters.names, free, strict=True) if is_free)
    table = problem.observations.table
    columns = {
        "sigma_used": found.sigma,
        "fitted": problem.rows.value - residuals.raw,
        "residual": residuals.raw,
        "standardised": residuals.studentised,
        "tau": problem.rows.tau,
        "sticking": sticks,
    }
    points = pd.concat([table, pd.DataFrame(columns, index=table.index)], axis=1)
    derived = derived_of(problem, found, constants)
    effects, fact = ((), {}) if brief else effects_of(problem, found, setting, constants, derived)
    return FitResult(
        closure=problem.closure.name,
        inertia_factor=problem.inertia_factor,
        method="lsq",
        inputs=problem.observations.sources,
        noise=Noise(reported_policy(problem), found.noise, error_model=problem.error_model),
        constants=constants,
        derived=derived,
        correlation=(names, capped[np.ix_(free, free)] / np.outer(size, size)),
        fit=statistics,
        facts=facts_of(problem, found, residuals, constants, statistics, fact, brief=brief),
        warnings=_warnings(problem),
        state=state_of(problem, found),
        points=points,
        seed=seed,
        command=command,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        versions=_versions(),
        asked=problem.parameters.parameters,
        scene=None if setting is None else setting.told,
        effects=effects,
        problem=problem,
        least_squares=found,
    )


def _warnings(problem: Problem) -> tuple[str, ...]:
    said = list(problem.observations.notes)
    table = problem.observations.table
    ignored = [
        problem.observations.called(column)
        for column in ("sigma_spin_x", "sigma_spin_y", "sigma_gamma_deg")
        if (table[column].to_numpy(dtype=float) > 0.0).any()
    ]
    if ignored and problem.error_model.angles == "none":
        said.append(f"Not propagated: {' and '.join(ignored)}; angles and spins are taken as exact.")
    if not problem.error_model.is_plain:
        said.append(
            f"Scatter: {problem.error_model.words}. chi2, residuals and what is said of misfit and outliers "
            "are those of the reweighted rows."
        )
    if problem.closure.caveat:
        said.append(problem.closure.caveat)
    given = int(np.isfinite(problem.noise.sigma).sum())
    if problem.noise.is_unknown and given:
        said.append(
            f"sigma is given in {given} of {len(problem.rows)} rows, and is not used: the noise comes from "
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
