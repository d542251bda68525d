"""Points for figure and report of a fit whose rows are not held: some of a sample, against the fit of all."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ifrfit.inference.model.entry_names import name_in, split_name
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.fit_result import FitResult

if TYPE_CHECKING:
    import pandas as pd

MOST_SHOWN = 4000
_FITTED = 1e-6  # 1 - leverage of a row that is fitted exactly


def shown_points(sample: FitResult, problem: Problem, optimum: LeastSquaresFit, seed: int) -> pd.DataFrame:
    """Points of a sample, with curve, residuals and regimes by the constants of all impacts.

    Parameters
    ----------
    sample : FitResult
        Of the sample alone; its constants are not used.
    problem : Problem
        Of all impacts.
    optimum : LeastSquaresFit
        Of that problem.
    seed : int
        Of the choice among the points of a larger sample.

    Returns
    -------
    DataFrame
        As `FitResult.points`, series by series in random order. The row in its file is not known: 0.
    """
    of = sample.problem
    assert of is not None
    places = [_place(problem, of, name) for name in of.parameters.names]
    theta = optimum.optimum.theta[places]
    e_n, c, mu = of.per_row(theta)
    _, sticks = of.impulse(e_n, c, mu)
    fitted = of.predict(theta)
    points = sample.points.copy()
    names = zip(points["series"], points["observable"], strict=True)
    sigma = points["sigma"].to_numpy(dtype=float)
    if not problem.noise.is_known:
        sigma = np.array([optimum.noise[f"{series}/{observable}"] for series, observable in names])
    residual = of.rows.value - fitted
    local = optimum.gaussian
    by_phi = of.jacobian(theta) @ local.to_theta[places] / sigma[:, None]
    leverage = ((by_phi @ local.vectors[:, local.seen] / local.singular[local.seen]) ** 2).sum(axis=1)
    points = points.assign(
        sigma_used=sigma,
        fitted=fitted,
        residual=residual,
        standardised=residual / sigma / np.sqrt(np.maximum(1.0 - leverage, _FITTED)),
        sticking=sticks,
        row=0,
    )
    rng = np.random.default_rng(seed)
    chosen = np.sort(rng.choice(len(points), min(MOST_SHOWN, len(points)), replace=False))
    order = [problem.series.index(name) for name in points["series"].iloc[chosen]]
    return points.iloc[chosen[np.argsort(order, kind="stable")]].reset_index(drop=True)


def _place(problem: Problem, of: Problem, name: str) -> int:
    """Where all impacts have a constant of the sample, which may have met one of several series alone."""
    quantity, series = split_name(name)
    names = problem.parameters.names
    return names.index(name_in(names, quantity, series or of.series[0]))
