"""Several modes of a fit: which of them is shown, and the result at each of the others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.entry_names import name_in, split_name
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.physics import OBSERVABLES

Array = NDArray[np.float64]


def modes_of(result: FitResult) -> list[Mapping[str, Any]]:
    """Modes of the likelihood that lie apart, heaviest first: weight and constants; empty where one is."""
    fact = result.facts.get("noise_modes")
    return [] if fact is None else list(fact.figures.get("modes", ()))


def at_shown_mode(result: FitResult) -> FitResult:
    """The result at the mode that its fitted values and residuals belong to; itself where there is one.

    Medians of a posterior with several modes may lie between them, where no curve describes the data.
    """
    found = [at for _, at in _at_modes(result)]
    if not found:
        return result
    return min(found, key=_distance_from_fitted)


def other_modes(result: FitResult) -> list[tuple[float, FitResult]]:
    """The other modes: weight, and the result there."""
    if not modes_of(result):
        return []
    point = at_shown_mode(result).state.point
    return [(weight, at) for weight, at in _at_modes(result) if not np.array_equal(at.state.point, point)]


def _at_modes(result: FitResult) -> list[tuple[float, FitResult]]:
    return [
        (float(mode["weight"]), replace(result, state=replace(result.state, point=point)))
        for mode in modes_of(result)
        for point in [_point_of(result, mode["constants"])]
    ]


def _point_of(result: FitResult, constants: Mapping[str, float]) -> Array:
    """The coordinates of the state, (n,), at other values of the free constants."""
    known = {name: each.value for name, each in result.flat_constants().items()} | dict(constants)
    values = []
    for name in result.state.names:
        quantity, series = split_name(name)
        if quantity == "kappa":
            mu, e_n = (known[name_in(known, part, series)] for part in ("mu", "e_n"))
            values.append((mu or 0.0) * (1.0 + (e_n or 0.0)))
        else:
            values.append(known[name_in(known, quantity, series)] or 0.0)
    return np.array(values, dtype=float)


def _distance_from_fitted(result: FitResult) -> float:
    """Sum of squares of what its curves miss the fitted values by, over the noise."""
    points, total = result.points, 0.0
    for (observable, series), rows in points.groupby(["observable", "series"], sort=False):
        known = OBSERVABLES.get(str(observable))
        if known is None or not known.has_angle:
            continue
        arguments = (rows[name].to_numpy(dtype=float) for name in ("gamma_deg", "spin_x", "spin_y"))
        curve = result.predict(*arguments, observable=str(observable), series=str(series), bands=False)
        missed = curve["value"].to_numpy(dtype=float) - rows["fitted"].to_numpy(dtype=float)
        total += float(np.nansum((missed / rows["sigma_used"].to_numpy(dtype=float)) ** 2))
    return total
