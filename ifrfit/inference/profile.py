"""Profile of the objective along one constant: where it closes, and where it stays open."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ifrfit.inference.optimum import Array
from ifrfit.inference.problem import Problem
from ifrfit.inference.solve import solve

CENTRAL = {0.68: 0.98894, 0.95: 3.84146}  # chi2 of one degree of freedom
ONE_SIDED = {0.68: 0.21874, 0.95: 2.70554}  # the same for 36 and 90 %: one tail of 32 and 5 %
_DOUBLINGS = 40
_BISECTIONS = 60


def profile_function(problem: Problem, sigma: Array, name: str) -> Callable[[float], float]:
    """Objective with the constant held at a value and everything else at its best."""

    def value(x: float) -> float:
        held = tuple(replace(c, fixed=x, prior=None) if c.name == name else c for c in problem.constants)
        own = [c.prior for c in problem.constants if c.name == name]
        prior = 0.0 if own[0] is None else ((x - own[0][0]) / own[0][1]) ** 2
        return solve(replace(problem, constants=held), sigma).objective + prior

    return value


def crossing(
    function: Callable[[float], float], start: float, limit: float, step: float, target: float
) -> float:
    """Outermost place between start and limit where the function is still at or below the target.

    `limit` if it never rises above it on the way there; infinite limits are followed by doubled steps.
    """
    direction = 1.0 if limit > start else -1.0
    inside, outside = start, math.nan
    for _ in range(_DOUBLINGS):
        x = inside + direction * step
        if direction * (x - limit) >= 0.0:
            x = limit
        if function(x) > target:
            outside = x
            break
        inside = x
        if x == limit:
            return limit
        step *= 2.0
    if math.isnan(outside):
        return direction * math.inf
    for _ in range(_BISECTIONS):
        middle = 0.5 * (inside + outside)
        if abs(outside - inside) <= 1e-9 * (1.0 + abs(middle)):
            break
        if function(middle) > target:
            outside = middle
        else:
            inside = middle
    return inside


def series_problem(problem: Problem, sigma: Array, series: int) -> tuple[Problem, Array]:
    """The rows of one series alone, with constants of its own."""
    rows = np.flatnonzero(problem.rows.series == series)
    part = replace(
        problem,
        observations=replace(problem.observations, table=problem.observations.table.iloc[rows]),
        constants=tuple(replace(c, separate=False) for c in problem.constants),
        series=(problem.series[series],),
        rows=replace(problem.rows.take(rows), series=np.zeros(rows.size, dtype=np.intp)),
        sigma=problem.sigma[rows],
    )
    return part, sigma[rows]
