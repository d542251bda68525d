"""Minima of a function of one number: a grid, then every dip polished."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_GRID = 33
_MOST = 8  # dips that are polished, the deepest ones


def dips(
    function: Callable[[Array], Array], low: float, high: float, seeds: Iterable[float] = ()
) -> list[tuple[float, float]]:
    """Local minima of `function` on [low, high] as (value, place), best first.

    `function` takes many places at once. Each interval of the grid next to a dip is searched by Brent's
    bounded method; `seeds` join the grid.
    """
    from scipy.optimize import minimize_scalar

    inside = [x for x in seeds if low < x < high]
    grid = np.unique(np.concatenate((np.linspace(low, high, _GRID), inside)))
    values = function(grid)
    padded = np.concatenate(([np.inf], values, [np.inf]))
    found: list[tuple[float, float]] = []
    places = np.flatnonzero((values <= padded[:-2]) & (values <= padded[2:]))
    for i in map(int, places[np.argsort(values[places], kind="stable")][:_MOST]):
        ends = float(grid[max(i - 1, 0)]), float(grid[min(i + 1, grid.size - 1)])
        result = minimize_scalar(
            lambda x: float(function(np.array([x]))[0]),
            bounds=ends,
            method="bounded",
            options={"xatol": 1e-12},
        )
        pair = min((float(result.fun), float(result.x)), (float(values[i]), float(grid[i])))
        if all(abs(pair[1] - place) > 1e-6 * (1.0 + abs(place)) for _, place in found):
            found.append(pair)
    return sorted(found)
