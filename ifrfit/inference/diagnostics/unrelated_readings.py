"""Readings that do not go with the angle: in any other order the law would explain as much of them."""

from __future__ import annotations

import numpy as np
from scipy import special

from ifrfit.errors import DataError
from ifrfit.inference.diagnostics.quadratic_forms import smooth_departure
from ifrfit.inference.diagnostics.slips.alternatives import in_any_order
from ifrfit.inference.diagnostics.slips.compared_fit import ComparedFit
from ifrfit.inference.diagnostics.thresholds import BY_CHANCE, BY_RANK, FACTS
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares
from ifrfit.inference.result.types import Fact
from ifrfit.text import joined, p_text

_FEWEST = 12  # angles of which an order is more than chance


def unrelated_readings(problem: Problem, found: LeastSquaresFit) -> Fact | None:
    """Look for observables of which neither the law nor a smooth curve over the angle explains anything.

    That is what rows in a random order leave, where a column was sorted or shuffled by itself. Readings that
    scatter about one value are none of them: where all impacts stick there is nothing to explain. So they are
    to be the law's own values in another order: sorted by size, these leave little of their scatter. Nor are
    readings whose scatter the law's range lies within, by the constants that the other observables tell.

    Returns
    -------
    Fact or None
        None where the law explains each observable that goes with the angle, or has nothing to explain.
    """
    if not problem.error_model.is_plain:
        return None
    named: dict[str, tuple[float, float]] = {}
    residual = problem.residual(found.optimum.theta)
    for observable in problem.rows.observables:
        rows = problem.rows.rows_of(observable.name)
        if not observable.has_angle or np.unique(problem.rows.gamma_deg[rows]).size < _FEWEST:
            continue
        own = _by_series(problem, rows)
        about = _about_means(own, problem.rows.value[rows])
        scatter = float(np.sqrt((about**2).mean()))
        p = min(_p_of_law(problem, about, residual[rows]), _p_of_curve(problem, rows, own, about))
        if p < BY_CHANCE or _left_by_rank(problem, found, observable.name, rows) > BY_RANK * scatter:
            continue
        if _would_show(problem, rows, own, scatter):
            named[observable.name] = (p, scatter)
    if not named:
        return None
    what = joined([f"{name} (which scatter by {scatter:.2g})" for name, (_, scatter) in named.items()])
    p = min(p for p, _ in named.values())
    says = (
        f"readings of {what} do not go with the angle: in any other order the law and a smooth curve would "
        f"explain as much of them (p = {p_text(p)}). See whether each stands in the line of its own angle: a "
        "column may have been sorted, shuffled or shifted by itself"
    )
    return Fact(False, says, {"p": p, "observables": list(named)}, FACTS["unrelated_readings"])


def _by_series(problem: Problem, rows: Index) -> Array:
    """Which series each of some rows is of, (m, n_series)."""
    return np.asarray(problem.rows.series[rows, None] == np.unique(problem.rows.series[rows]), dtype=float)


def _about_means(series: Array, value: Array) -> Array:
    """Values, (m,), less the mean of their series."""
    return np.asarray(value - series @ (series.T @ value / series.sum(axis=0)))


def _p_of_law(problem: Problem, about: Array, residual: Array) -> float:
    """F test of the law against means."""
    k = max(int(problem.parameters.free.sum()), 1)
    left = float(residual @ residual)
    gained = max(float(about @ about) - left, 0.0)
    dof = max(residual.size - k - 1, 1)
    return float(special.fdtrc(k, dof, gained / k / max(left / dof, 1e-300)))


def _left_by_rank(problem: Problem, found: LeastSquaresFit, name: str, rows: Index) -> float:
    """Root mean square of what the law leaves of readings that are beside another's angle, by rank."""
    _, after = ComparedFit.of(problem, found).of_alternative(in_any_order(problem, name))
    return float(np.sqrt((after[rows] ** 2).mean()))


def _would_show(problem: Problem, rows: Index, own: Array, scatter: float) -> bool:
    """Whether the law could be seen in readings beside their own angles: no range within their scatter.

    That is the law of the constants that the other observables tell; where these do not, it is taken to be.
    """
    others = np.delete(np.arange(len(problem.rows)), rows)
    try:
        again = least_squares(problem.with_rows(others), proven=False) if others.size else None
    except DataError:  # too few rows to tell their noise
        again = None
    k = int(problem.parameters.free.sum())
    if again is None or again.gaussian.rank < k:
        return True
    law = float((_about_means(own, problem.predict(again.optimum.theta)[rows]) ** 2).mean())
    dof, noise = max(rows.size - k - 1, 1), max(scatter**2 - law, 1e-300)
    return float(special.fdtrc(k, dof, law / k / (noise / dof))) < BY_CHANCE**2


def _p_of_curve(problem: Problem, rows: Index, series: Array, about: Array) -> float:
    """F test of a curve over the angle in each series."""
    groups = [np.flatnonzero(of_one) for of_one in series.T]
    curve = smooth_departure(groups, problem.rows.gamma_deg[rows], series, about)
    return 1.0 if curve is None else curve.p
