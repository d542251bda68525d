"""Profile of the objective along one constant: where it closes, and where it stays open."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.optimum import Array
from ifrfit.inference.optimize.solve import solve

CENTRAL = {0.68: 0.98894, 0.95: 3.84146}  # chi2 of one degree of freedom
ONE_SIDED = {0.68: 0.21874, 0.95: 2.70554}  # the same for 36 and 90 %: one tail of 32 and 5 %
_DOUBLINGS = 40
_LOWEST = 1e-3  # e_n


def profile_function(problem: Problem, sigma: Array, name: str, near: Array) -> Callable[[float], float]:
    """Objective with the constant held at a value and everything else at its best; `near` is the optimum."""
    own = problem.parameters[name]
    place = problem.parameters.names.index(name)
    rebound = name == "e_n" and problem.rows.has_rebound_scale

    def value(x: float) -> float:
        if rebound:  # a value over the outgoing normal velocity has no limit at e_n = 0
            x = max(x, min(_LOWEST, own.upper))
        start = near.copy()
        start[place] = x
        prior = 0.0 if own.prior is None else ((x - own.prior[0]) / own.prior[1]) ** 2
        return solve(problem.with_fixed({name: x}), sigma, start).objective + prior

    return value


def crossing(
    function: Callable[[float], float], start: float, limit: float, step: float, target: float
) -> float:
    """Where the function rises through the target, going from start towards the limit.

    The limit itself if it never does; an infinite one is approached in doubled steps.
    """
    from scipy.optimize import brentq

    direction = 1.0 if limit > start else -1.0
    inside = start
    for _ in range(_DOUBLINGS):
        x = inside + direction * step
        if direction * (x - limit) >= 0.0:
            x = limit
        if function(x) > target:
            return float(brentq(lambda y: function(y) - target, inside, x, xtol=1e-3 * step, rtol=1e-6))
        if x == limit:
            return limit
        inside, step = x, 2.0 * step
    return direction * math.inf


def series_problem(problem: Problem, sigma: Array, series: int) -> tuple[Problem, Array]:
    """The rows of one series alone, with constants of its own."""
    rows = np.flatnonzero(problem.rows.series == series)
    part = problem.with_rows(rows)
    part = replace(
        part,
        parameters=problem.parameters.of_series(series),
        rows=replace(part.rows, series=np.zeros(rows.size, dtype=np.intp)),
    )
    return part, sigma[rows]
