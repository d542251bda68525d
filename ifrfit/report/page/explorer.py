"""What the interactive panel needs to know, as plain numbers: its script does the rest."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.entry_names import quantity_of, split_name
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import FACTOR
from ifrfit.physics import CLOSURES, OBSERVABLES, Closure
from ifrfit.report import panels, style
from ifrfit.report.axis_words import shortened
from ifrfit.report.page.charts.typesetting import runs
from ifrfit.report.page.symbols import symbols
from ifrfit.report.provenance import is_stand_in
from ifrfit.report.regimes import at_true_angles
from ifrfit.report.sentences import undetermined
from ifrfit.text import joined

Array = NDArray[np.float64]

MOST_ROWS = 2000
_SPINS = {"spin_y": r"spin, back ($R\omega_y/u$)", "spin_x": r"spin, lateral ($R\omega_x/u$)"}
RIDGE = 1e-12  # of a correlation matrix: a direction without any spread still has a distance


def reason_without_panel(result: FitResult) -> str:
    """Why there is no panel; empty where there is one."""
    if result.closure not in CLOSURES or not CLOSURES[result.closure].bilinear:
        return f"The panel knows no closure {result.closure}: the picture above stands alone."
    if result.is_sampled:
        return "The panel works out chi2 of the rows that it shows, which are a sample here: there is none."
    common = result.noise.common_errors
    if common is not None and common.are_counted:
        return "The panel works out chi2 of independent rows, and these have errors in common: there is none."
    names = _observables(result)
    if not any(OBSERVABLES[name].has_angle for name in names):
        return "These values do not depend on the angle: there is no curve to move."
    if not any(OBSERVABLES[name].has_angle and OBSERVABLES[name].panel for name in names):
        return f"The panel has no formula for {joined(names)}: the picture above stands alone."
    return ""


def payload(result: FitResult) -> dict[str, Any]:
    """Everything the panel shows and computes with.

    Parameters
    ----------
    result : FitResult
        With points; `reason_without_panel` of it is empty.

    Returns
    -------
    dict
        closures (a and b of k = a + min(b, kappa U_n/|U_t|) as lines in the closure's constant), the rows
        with the sigma that chi2 rests on, each group's best values with the inverse of its covariance in the
        coordinates of the state. Only what JSON knows.
    """
    has_offset = result.noise.angle_offset is not None
    result = at_true_angles(result)
    observables = [name for name in _observables(result) if OBSERVABLES[name].panel is not None]
    points = result.points[result.points["observable"].isin(observables)]
    step = -(-len(points) // MOST_ROWS)
    shown = points.iloc[::step]
    series = [str(name) for name in result.points["series"].unique()]
    styles = style.series_styles(series)
    yardstick = "sigma" if result.noise.policy == "scaled" else "sigma_used"
    return {
        "inertia": float(result.inertia_factor),
        "across": panels.ANGLE + (", fitted offset added" if has_offset else ""),
        "fitted": result.closure,
        "symbols": {
            name: [[run.text, run.is_slanted, run.level] for run in runs(latex)]
            for name, latex in (symbols() | _SPINS).items()
        },
        "closures": {
            name: _closure(closure, result.inertia_factor)
            for name, closure in CLOSURES.items()
            if closure.bilinear
        },
        "observables": [
            {
                "name": name,
                "label": OBSERVABLES[name].meaning,
                "unit": OBSERVABLES[name].unit_text,
                "angled": OBSERVABLES[name].has_angle,
                "limits": _limits(result, name),
            }
            for name in observables
        ],
        "series": [
            {
                "name": name,
                "short": shortened(name, 40),
                "colour": styles[name].colour,
                "marker": styles[name].marker,
                "spin_x": _median(points, name, "spin_x"),
                "spin_y": _median(points, name, "spin_y"),
            }
            for name in series
        ],
        "groups": _groups(result, series),
        "rows": {
            "series": [series.index(str(name)) for name in shown["series"]],
            "observable": [observables.index(str(name)) for name in shown["observable"]],
            **{
                key: _numbers(shown[column].to_numpy(dtype=float))
                for key, column in (
                    ("gamma", "gamma_deg"),
                    ("spin_x", "spin_x"),
                    ("spin_y", "spin_y"),
                    ("value", "value"),
                    ("sigma", yardstick),
                )
            },
        },
        "left_out": [name for name in _observables(result) if name not in observables],
        "open": undetermined(result),
        "stand_in": is_stand_in(result),
        "yardstick": _yardstick(result),
        "thinned": step > 1,
        "n": len(points),
    }


def _limits(result: FitResult, observable: str) -> list[float]:
    """Ends of the axis that hold the data and the fitted curves, as in the figure of the fit."""
    rows = result.points[result.points["observable"] == observable]
    names = [str(name) for name in rows["series"].unique()]
    return list(panels.value_limits(rows, panels.curves(result, observable, names, bands=False), None))


def _yardstick(result: FitResult) -> str:
    """Which sigma chi2 rests on: as in the result, that of the data where they have one."""
    if result.noise.policy == "unknown":
        return "the noise of the fit"
    if result.noise.policy == "mixed":
        return f"the sigma that the data state of {result.noise.whose(given=True)}, else the noise of the fit"
    words = "the sigma that the data state"
    if result.noise.policy == "known":
        return words
    found = result.noise.estimates.get(FACTOR)
    optimum = float((result.points["sigma_used"] / result.points["sigma"]).median())
    factor = optimum if found is None or found.value is None else found.value
    return f"{words}; the noise of the fit is {factor:.3g} times that"


def _observables(result: FitResult) -> list[str]:
    return [str(name) for name in result.points["observable"].unique() if str(name) in OBSERVABLES]


def _closure(closure: Closure, inertia_factor: float) -> dict[str, Any]:
    linear = closure.coefficients(inertia_factor)
    low, high = closure.domain(inertia_factor)
    return {
        "title": closure.title,
        "constant": closure.constant,
        "a": [linear.a0, linear.a1],
        "b": [linear.b0, linear.b1],
        "domain": [low, high],
    }


def _median(points: Any, series: str, column: str) -> float:
    rows = points[(points["series"] == series) & points["gamma_deg"].notna()]
    return float(rows[column].median()) if len(rows) else 0.0


def _numbers(column: Array) -> list[float | None]:
    return [float(x) if math.isfinite(x) else None for x in column]


def _groups(result: FitResult, series: list[str]) -> list[dict[str, Any]]:
    """One group of constants, or one a series where any of them is separate."""
    separate = any(split_name(name)[1] for name in result.state.names)
    found = []
    for label in series if separate else [None]:
        names, best, covariance, free = coordinates(result, label)
        found.append(
            {
                "series": [series.index(label)] if label is not None else list(range(len(series))),
                "best": values_of(names, best),
                "coordinates": [quantity_of(name) for name in names],
                "at": [float(x) for x in best],
                "free": [bool(x) for x in free],
                "precision": _precision(covariance, free),
            }
        )
    return found


def coordinates(
    result: FitResult, series: str | None
) -> tuple[tuple[str, ...], Array, Array, NDArray[np.bool_]]:
    """Coordinates of one series' constants.

    Parameters
    ----------
    result : FitResult
    series : str or None
        Whose, where constants are separate.

    Returns
    -------
    names : tuple of str
        As in the state.
    best : ndarray, (p,)
        The values the result states (posterior medians, or the optimum).
    covariance : ndarray, (p, p)
        Of the posterior draws, or of the local Gaussian where there are none.
    free : ndarray of bool, (p,)
        Which of them have any spread.
    """
    state = result.state
    own = [i for i, name in enumerate(state.names) if split_name(name)[1] in ("", series)]
    if state.sample is None:
        covariance = np.array(state.covariance[np.ix_(own, own)])
    else:
        covariance = np.atleast_2d(np.cov(state.sample[:, own], rowvar=False))
    free = np.sqrt(np.diag(covariance)) > 1e-12 * (1.0 + np.abs(state.point[own]))
    return tuple(state.names[i] for i in own), np.array(state.point[own]), covariance, free


def values_of(names: tuple[str, ...], point: Array) -> dict[str, float]:
    """(e_n, closure constant, mu) at a point of the coordinates, by name without the series."""
    values = {quantity_of(name): float(value) for name, value in zip(names, point, strict=True)}
    kappa = values.pop("kappa", None)
    if kappa is not None:
        values["mu"] = kappa / (1.0 + values["e_n"])
    return values


def _precision(covariance: Array, free: NDArray[np.bool_]) -> list[list[float]]:
    """Inverse of the covariance of the free coordinates, zero elsewhere."""
    inverse = np.zeros_like(covariance)
    index = np.flatnonzero(free)
    if index.size:
        part = covariance[np.ix_(index, index)]
        size = np.sqrt(np.diag(part))
        correlation = part / np.outer(size, size) + RIDGE * np.eye(index.size)
        inverse[np.ix_(index, index)] = np.linalg.inv(correlation) / np.outer(size, size)
    return [[float(x) for x in row] for row in inverse]
