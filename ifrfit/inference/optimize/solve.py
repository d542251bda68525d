"""The optimum of a problem at given noise, by the method that fits it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ifrfit.inference.model.common_errors import refuse
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.branch_and_bound import minimise
from ifrfit.inference.optimize.linear_families import LinearForm, linear_form
from ifrfit.inference.optimize.multistart import multistart
from ifrfit.inference.optimize.optimum import Array, Optimum, thetas_of, thetas_of_all
from ifrfit.inference.optimize.parameter_group import (
    Constants,
    GroupOptimum,
    ParameterGroup,
    is_separable,
    restitution_optimum,
    without_normal_rows,
)
from ifrfit.inference.optimize.piecewise import PiecewiseOptimum
from ifrfit.inference.optimize.restitution_and_friction import solve_over_e_n
from ifrfit.inference.optimize.shared_parameter import fix_restitution, solve_shared
from ifrfit.inference.optimize.tied_search import tied_search
from ifrfit.inference.optimize.transition_search import optimum_in_c_and_kappa, unlimited


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
    if problem.parameters.is_tied:
        return tied_search(problem, sigma, near)
    if problem.common is not None:
        raise refuse("The search for the optimum")
    if not problem.closure.bilinear and problem.has_oblique:
        return multistart(problem, sigma, near)
    independent = _independent(problem, sigma)
    if independent is not None:
        parts = []
        for i, group in enumerate(independent):
            alone = solve_group(group, certified=proven or near is None)
            if alone is None and len(independent) == 1:
                return multistart(problem, sigma, near)
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
    """All rows as one group; entries fixed in one of several series alone are not fixed in it."""
    e_n, c, mu = problem.parameters.constants_of_all
    return ParameterGroup(problem.rows, sigma, problem.closure, problem.inertia_factor, e_n, c, mu)


def series_groups(problem: Problem, sigma: Array) -> list[ParameterGroup]:
    """One group a series, its fixed entries included. A prior on a shared constant is not in any of them."""
    groups, known = [], problem.parameters
    for number in range(len(problem.series)):
        at = np.flatnonzero(problem.rows.series == number)
        rows = problem.rows.take(at)
        e_n, c, mu = (
            known.entry(x, number) if x.separate else replace(x, prior=None) for x in known.constants
        )
        groups.append(ParameterGroup(rows, sigma[at], problem.closure, problem.inertia_factor, e_n, c, mu))
    return groups


def independent_groups(problem: Problem, sigma: Array) -> list[tuple[ParameterGroup, Index]] | None:
    """Groups that share no free constant, each with its rows; None where series share some of them only."""
    groups = _independent(problem, sigma)
    if groups is None:
        return None
    if not problem.parameters.differ_by_series:
        return [(groups[0], np.arange(len(problem.rows)))]
    return [(group, np.flatnonzero(problem.rows.series == number)) for number, group in enumerate(groups)]


def _independent(problem: Problem, sigma: Array) -> list[ParameterGroup] | None:
    """Groups that share no free constant: one, or one a series; None where series share some of them only."""
    if not problem.parameters.differ_by_series:
        return [whole_group(problem, sigma)]
    if not all(c.separate or c.fixed is not None for c in problem.parameters):
        return None
    return series_groups(problem, sigma)


def _searched(problem: Problem, number: int, sigma: Array, near: Array | None) -> GroupOptimum:
    """A series alone, by a search."""
    mine = [int(places[number]) for places in problem.parameters.positions.values()]
    own_sigma = sigma[problem.rows.series == number]
    found = multistart(problem.by_series[number], own_sigma, None if near is None else near[mine])

    def constants(theta: Array) -> Constants:
        e_n, *c, mu = theta.tolist()
        return e_n, c[0] if c else 0.0, mu

    minima = tuple((value, constants(theta)) for value, theta in found.minima)
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
    """Groups that share nothing: objectives and gaps add; a rival of one of them is a rival of the whole."""
    if len(parts) == 1:
        return _of_all_series(problem, parts[0])
    best = [part.constants for part in parts]
    objective = sum(part.objective for part in parts)
    values, minima, extremes = [objective], [best], []
    for i, part in enumerate(parts):
        below, above = best[:i], best[i + 1 :]
        values += [objective + (value - part.objective) for value, _ in part.minima[1:]]
        minima += [[*below, constants, *above] for _, constants in part.minima[1:]]
        extremes += [[*below, constants, *above] for constants in part.extremes]
    thetas = thetas_of(problem, minima + extremes)
    pairs = sorted(zip(values, thetas, strict=False), key=lambda pair: pair[0])
    gaps = [part.gap for part in parts if part.gap is not None]
    gap = sum(gaps) if len(gaps) == len(parts) else None
    searched = [part.method for part in parts if part.method.endswith("series")]
    method = (searched or ["all partitions of each series"])[0]
    is_local = any(part.is_local for part in parts)
    return Optimum(
        pairs[0][1], objective, gap, tuple(pairs), method, tuple(thetas[len(minima) :]), is_local=is_local
    )


def _of_all_series(problem: Problem, part: GroupOptimum) -> Optimum:
    """The optimum of one group, whose constants are those of all series."""
    every = [part.constants, *(constants for _, constants in part.minima[1:]), *part.extremes]
    theta, *rest = thetas_of_all(problem, every)
    rivals = [(value, other) for (value, _), other in zip(part.minima[1:], rest, strict=False)]
    pairs = sorted([(part.objective, theta), *rivals], key=lambda pair: pair[0])
    extremes = tuple(rest[len(rivals) :])
    return Optimum(
        pairs[0][1], part.objective, part.gap, tuple(pairs), part.method, extremes, is_local=part.is_local
    )


def solve_group(group: ParameterGroup, *, certified: bool = True) -> GroupOptimum | None:
    """Optimum of rows that share one set of constants; None where only a search can find it.

    Parameters
    ----------
    group : ParameterGroup
    certified : bool
        Whether a certified search over e_n is wanted where no other road is; else None.
    """
    if group.rows.measures("curved"):
        return None
    plain = optimum_in_c_and_kappa(group)
    if plain is not None:
        return plain
    if group.e_n.fixed is None and is_separable(group):
        e_n, objective = restitution_optimum(group)
        rest = without_normal_rows(group, e_n)
        found = solve_group(rest, certified=certified)
        return None if found is None else raised(found, objective)
    form = linear_form(group)
    if form is None:
        return solve_over_e_n(group) if certified else None
    optimum = minimise(form.problem)
    minima = tuple((value, center_unmeasured(group, form.to_constants(t))) for value, t in optimum.optima)
    return GroupOptimum(minima[0][1], optimum.chi2, optimum.gap, minima, _extremes(group, form, optimum))


def _extremes(group: ParameterGroup, form: LinearForm, optimum: PiecewiseOptimum) -> tuple[Constants, ...]:
    """Outlying constants that describe the data as well; infinite where no oblique row sets a limit."""
    found = [form.to_constants(t) for t in optimum.extremes]
    if not group.rows.measures("tangential"):
        return tuple(found)
    return (*found, *unlimited(group, optimum, form.to_constants(optimum.t)))


def raised(found: GroupOptimum, by: float) -> GroupOptimum:
    """The same optimum with something added to every objective."""
    minima = tuple((value + by, constants) for value, constants in found.minima)
    return replace(found, objective=found.objective + by, minima=minima)


def center_unmeasured(group: ParameterGroup, constants: Constants) -> Constants:
    """Put the closure constant into the middle of its domain where nothing measures it, and e_n.

    e_n is put into the middle of what bounds of mu allow.
    """
    e_n, c, mu = constants
    if group.c.fixed is None and group.c.prior is None and not group.rows.measures("tangential"):
        c = 0.5 * (group.c.lower + group.c.upper)
        constants = e_n, c, mu
    touched = (
        group.e_n.fixed is not None
        or group.e_n.prior is not None
        or group.rows.measures("normal", "friction")
        or group.rows.measures_scale("impulse")
        or group.rows.measures_scale("rebound")
        or group.mu.fixed is not None
        or group.mu.prior is not None
    )
    kappa = mu * (1.0 + e_n)
    if touched or kappa <= 0.0:
        return constants
    low = kappa / group.mu.upper - 1.0 if group.mu.upper > 0.0 else -math.inf
    high = kappa / group.mu.lower - 1.0 if group.mu.lower > 0.0 else math.inf
    middle = 0.5 * (max(group.e_n.lower, low) + min(group.e_n.upper, high))
    return middle, c, kappa / (1.0 + middle)
