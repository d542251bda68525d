"""The optimum of a problem at given noise, by the method that fits it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.group_optimum import raised, solve_group
from ifrfit.inference.optimize.multistart import multistart
from ifrfit.inference.optimize.optimum import Array, Optimum, theta_of
from ifrfit.inference.optimize.parameter_group import Constants, GroupOptimum, ParameterGroup
from ifrfit.inference.optimize.shared_parameter import fix_restitution, solve_shared


def solve(
    problem: Problem, sigma: Array, near: Array | None = None, *, proven: bool = True, slack: float = 0.0
) -> Optimum:
    """Find the optimum.

    Parameters
    ----------
    problem : Problem
    sigma : ndarray
        Standard uncertainty of each row.
    near : ndarray, optional
        theta of a neighbouring problem: a search looks for the optimum there alone.
    proven : bool
        Whether a proof is needed where it is dear (series that share some constants, a search over e_n);
        without it what lies near `near` will do there, too.
    slack : float
        Gap that is small enough there.

    Returns
    -------
    Optimum
    """
    if not problem.closure.bilinear and problem.has_oblique:
        return multistart(problem, sigma, near)
    independent = independent_groups(problem, sigma)
    if independent is not None and not problem.parameters.differ_by_series:
        ((group, _),) = independent
        found = solve_group(
            group, None if near is None or proven else float(near[problem.parameters.positions["e_n"][0]])
        )
        if found is None:
            return multistart(problem, sigma, near)
        return _optimum(problem, found)
    if independent is not None:
        places = problem.parameters.positions["e_n"]
        parts = []
        for i, (group, _) in enumerate(independent):
            alone = solve_group(group, None if near is None or proven else float(near[places[i]]))
            parts.append(_searched(problem, i, sigma, near) if alone is None else alone)
        return _join(problem, parts)
    groups = series_groups(problem, sigma)
    whole = whole_group(problem, sigma)
    joined = _solve_separate(problem, groups, whole)
    if joined is not None:
        return joined
    linked = solve_shared(problem, groups, whole, None if proven else near, proven=proven, slack=slack)
    return multistart(problem, sigma, near) if linked is None else linked


def whole_group(problem: Problem, sigma: Array) -> ParameterGroup:
    """All rows as one group."""
    e_n, c, mu = _specs(problem)
    return ParameterGroup(problem.rows, 1.0 / sigma, problem.closure, problem.inertia_factor, e_n, c, mu)


def series_groups(problem: Problem, sigma: Array) -> list[ParameterGroup]:
    """One group a series, its fixed entries included. A prior on a shared constant is not in any of them."""
    places, entries = problem.parameters.positions, problem.parameters.entries

    def own(c: Parameter, number: int) -> Parameter:
        return entries[places[c.name][number]] if c.separate else replace(c, prior=None)

    groups = []
    for number in range(len(problem.series)):
        at = np.flatnonzero(problem.rows.series == number)
        rows = problem.rows.take(at)
        e_n, c, mu = (own(x, number) for x in _specs(problem))
        groups.append(
            ParameterGroup(rows, 1.0 / sigma[at], problem.closure, problem.inertia_factor, e_n, c, mu)
        )
    return groups


def independent_groups(problem: Problem, sigma: Array) -> list[tuple[ParameterGroup, Index]] | None:
    """Groups that share no free constant, each with its rows; None where series share some of them only."""
    if not problem.parameters.differ_by_series:
        return [(whole_group(problem, sigma), np.arange(len(problem.rows)))]
    if not all(c.separate or c.fixed is not None for c in problem.parameters):
        return None
    groups = enumerate(series_groups(problem, sigma))
    return [(group, np.flatnonzero(problem.rows.series == number)) for number, group in groups]


def _specs(problem: Problem) -> tuple[Parameter, Parameter, Parameter]:
    parameters, own = problem.parameters, problem.closure.constant
    none = Parameter("", 0.0, 0.0, fixed=0.0)  # closure F has no constant of its own
    return parameters["e_n"], parameters[own] if own else none, parameters["mu"]


def _optimum(problem: Problem, found: GroupOptimum) -> Optimum:
    """A single group: theta is (e_n, c, mu), less c where the closure has none."""
    places = (0, 1, 2) if problem.closure.constant else (0, 2)
    kept = list(zip(places, problem.parameters, strict=True))

    def theta(constants: Constants) -> Array:
        return np.array(
            [x if math.isinf(x := constants[i]) else min(max(x, c.lower), c.upper) for i, c in kept]
        )

    minima = tuple((value, theta(constants)) for value, constants in found.minima)
    extremes = tuple(theta(constants) for constants in found.extremes)
    return Optimum(
        minima[0][1], found.objective, found.gap, minima, found.method, extremes, is_local=found.is_local
    )


def _searched(problem: Problem, number: int, sigma: Array, near: Array | None) -> GroupOptimum:
    """A series alone, by a search."""
    part = problem.by_series[number]
    own = np.flatnonzero(problem.rows.series == number)
    names = ("e_n", problem.closure.constant, "mu")

    def constants(theta: Array, which: Problem, series: int) -> Constants:
        places = which.parameters.positions
        e_n, c, mu = (0.0 if name is None else float(theta[places[name][series]]) for name in names)
        return e_n, c, mu

    start = None
    if near is not None:
        start = np.zeros(len(part.parameters.names))
        for name, value in zip(names, constants(near, problem, number), strict=True):
            if name is not None:
                start[part.parameters.positions[name]] = value
    found = multistart(part, sigma[own], start)
    minima = tuple((value, constants(theta, part, 0)) for value, theta in found.minima)
    method = f"{found.method} of each series"
    return GroupOptimum(minima[0][1], found.objective, None, minima, (), method, is_local=found.is_local)


def _solve_separate(problem: Problem, groups: list[ParameterGroup], whole: ParameterGroup) -> Optimum | None:
    """Optimum of series that share nothing but an e_n that is measured alone; None for others."""
    if any(not x.separate and x.fixed is None for x in (whole.c, whole.mu)):
        return None
    fixed = fix_restitution(groups, whole)
    if fixed is None:
        return None
    parts = [solve_group(group) for group in fixed[0]]
    known = [part for part in parts if part is not None]
    if len(known) < len(parts):
        return None
    return _join(problem, [raised(known[0], fixed[1]), *known[1:]])


def _join(problem: Problem, parts: list[GroupOptimum]) -> Optimum:
    """Series that share nothing: objectives and gaps add; a rival of one series is a rival of the whole."""
    best = [part.constants for part in parts]
    objective = sum(part.objective for part in parts)
    minima = [(objective, theta_of(problem, best))]
    extremes: list[Array] = []
    for i, part in enumerate(parts):
        for value, constants in part.minima[1:]:
            swapped = [*best[:i], constants, *best[i + 1 :]]
            minima.append((objective + value - part.objective, theta_of(problem, swapped)))
        extremes += [theta_of(problem, [*best[:i], constants, *best[i + 1 :]]) for constants in part.extremes]
    minima.sort(key=lambda pair: pair[0])
    gaps = [part.gap for part in parts]
    gap = None if any(g is None for g in gaps) else sum(g for g in gaps if g is not None)
    searched = [part.method for part in parts if part.method.endswith("series")]
    method = searched[0] if searched else "all partitions of each series"
    is_local = any(part.is_local for part in parts)
    return Optimum(minima[0][1], objective, gap, tuple(minima), method, tuple(extremes), is_local=is_local)
