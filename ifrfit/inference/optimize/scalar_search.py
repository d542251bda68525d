"""Minima of a function of one variable: over a whole range, or about a place near the minimum."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_GRID = 33
_XATOL = 1e-12
_SHARE = 0.01  # of the range, to either side of a place near the minimum
_MOST = 8  # dips of the grid that are polished, the deepest ones
DISTINCT = 1e-6  # relative; minima nearer to one another are one


def scalar_minima(
    function: Callable[[Array], Array],
    low: float,
    high: float,
    seeds: Iterable[float] = (),
    *,
    n_grid: int = _GRID,
    xatol: float = _XATOL,
) -> list[tuple[float, float]]:
    """Local minima of `function` on [low, high] as (value, place), best first.

    Parameters
    ----------
    function : callable
        Values at many places at once, (n,) to (n,).
    low, high : float
    seeds : iterable of float
        Places that join the grid. Each interval of the grid next to a dip is searched by Brent's method.
    n_grid : int
        Places of the grid.
    xatol : float
        Tolerance of the places of the minima.
    """
    inside = [x for x in seeds if low < x < high]
    grid = np.unique(np.concatenate((np.linspace(low, high, n_grid), inside)))
    values = function(grid)
    padded = np.concatenate(([np.inf], values, [np.inf]))
    found: list[tuple[float, float]] = []
    dips = np.flatnonzero((values <= padded[:-2]) & (values <= padded[2:]))
    for i in map(int, dips[np.argsort(values[dips], kind="stable")][:_MOST]):
        pair = _polished(lambda x: float(function(np.array([x]))[0]), grid, values, i, xatol)
        if all(are_distinct(pair[1], place) for _, place in found):
            found.append(pair)
    return sorted(found)


def minimum_near(
    function: Callable[[float], float],
    start: float,
    low: float,
    high: float,
) -> tuple[float, float]:
    """Minimum of `function` on [low, high] about `start`, as (value, place).

    It is looked for on the grid over the whole range where it does not lie beside `start`.

    Parameters
    ----------
    function : callable
    start : float
        A place near the minimum.
    low, high : float
    """
    start = min(max(start, low), high)
    step = _SHARE * (high - low)
    grid = np.unique([max(start - step, low), start, min(start + step, high)])
    values = np.array([function(x) for x in grid.tolist()])
    if grid[int(np.argmin(values))] != start or start in (low, high):
        grid = np.unique(np.concatenate((grid, np.linspace(low, high, _GRID))))
        values = np.array([function(x) for x in grid.tolist()])
    return _polished(function, grid, values, int(np.argmin(values)), _XATOL)


def bounded_minimum(
    function: Callable[[float], float], low: float, high: float, xatol: float
) -> tuple[float, float]:
    """A local minimum between two places by Brent's method, as (value, place)."""
    from scipy.optimize import minimize_scalar

    found = minimize_scalar(function, bounds=(low, high), method="bounded", options={"xatol": xatol})
    return float(found.fun), float(found.x)


def are_distinct(x: float, y: float) -> bool:
    """Whether two minima are not one."""
    return abs(x - y) > DISTINCT * (1.0 + abs(y))


def _polished(
    function: Callable[[float], float], grid: Array, values: Array, i: int, xatol: float
) -> tuple[float, float]:
    """The best of grid place i and of what Brent's method finds between its neighbours."""
    at_grid = float(values[i]), float(grid[i])
    low, high = float(grid[max(i - 1, 0)]), float(grid[min(i + 1, grid.size - 1)])
    return at_grid if low == high else min(bounded_minimum(function, low, high, xatol), at_grid)
