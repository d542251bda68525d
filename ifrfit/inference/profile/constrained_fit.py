"""The optimum under a constraint: with entries of theta fixed, at a given kappa, or with mu a function."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.branch_and_bound import minimise
from ifrfit.inference.optimize.group_optimum import center_free_e_n
from ifrfit.inference.optimize.linear_families import linear_form
from ifrfit.inference.optimize.multistart import multistart
from ifrfit.inference.optimize.optimum import Array, objective_at, theta_of
from ifrfit.inference.optimize.parameter_group import is_separable, restitution_optimum
from ifrfit.inference.optimize.scalar_search import minimum_near
from ifrfit.inference.optimize.solve import series_groups, solve, whole_group
from ifrfit.inference.profile.constrained_series import ConstrainedSeries

_SHARE = 0.05  # of the range of e_n about the neighbour's, where the best one is sought first
_GRID = 7  # values over the whole range that are looked at where it is not there
_XATOL = 1e-7


def best_with(problem: Problem, sigma: Array, at: Mapping[int, float], near: Array) -> Array:
    """theta with some entries held and the rest at its best.

    Parameters
    ----------
    problem : Problem
    sigma : ndarray
        Standard uncertainty of each row.
    at : mapping
        Place in theta to the value held there.
    near : ndarray
        theta nearby, where only a search can find the optimum, and for all series that have no say.

    Returns
    -------
    ndarray
        theta, (p,).
    """
    start = near.copy()
    for place, x in at.items():
        start[place] = x
    if not problem.parameters.differ_by_series:
        return _solved(problem, sigma, at, start)
    if all(c.separate or c.fixed is not None for c in problem.parameters):
        return _alone(problem, sigma, at, start)
    series = ConstrainedSeries.of(problem, sigma, at)
    if series is not None:
        return series.best(start)
    return multistart(_constrained(problem, at), sigma, start).theta


def _solved(problem: Problem, sigma: Array, at: Mapping[int, float], start: Array) -> Array:
    """One set of constants: fixed in the problem itself, which the certified solvers know."""
    theta = solve(_constrained(problem, at), sigma, start).theta.copy()
    for place, x in at.items():
        theta[place] = x
    return theta


def _alone(problem: Problem, sigma: Array, at: Mapping[int, float], start: Array) -> Array:
    """Series that share nothing: only the one of the held entry moves, others keep what is near."""
    places = problem.parameters.positions
    (series,) = {int(np.flatnonzero(own == i)[0]) for i in at for own in places.values() if i in own}
    mine = [int(own[series]) for own in places.values()]
    own_sigma = sigma[problem.rows.series == series]
    theta = start.copy()
    theta[mine] = _solved(
        problem.by_series[series], own_sigma, {mine.index(i): x for i, x in at.items()}, start[mine]
    )
    return theta


def _constrained(problem: Problem, at: Mapping[int, float]) -> Problem:
    """The problem with entries of theta fixed, by their places."""
    return problem.with_fixed({problem.parameters.names[i]: x for i, x in at.items()})


def separable_e_n(problem: Problem, sigma: Array, series: int) -> float | None:
    """Best e_n of a series where the rest of the rows has no say in it; None where it has."""
    e_n, mu = problem.parameters["e_n"], problem.parameters["mu"]
    if e_n.fixed is not None:
        return e_n.fixed
    whole = whole_group(problem, sigma)
    if not is_separable(whole) or whole.rows.of_kind("curved").any() or (e_n.separate and not mu.separate):
        return None
    return restitution_optimum(series_groups(problem, sigma)[series] if e_n.separate else whole)[0]


def best_at_kappa(
    problem: Problem, sigma: Array, kappa: float, range_of_e_n: tuple[float, float], near: Array
) -> Array | None:
    """theta at a given kappa, for one set of constants.

    One certified solve where the rows are linear at that kappa; else one at each e_n, with a search over e_n.
    None where only a local search can find the rest.
    """
    group = whole_group(problem, sigma)
    if any(c.separate for c in problem.parameters) or group.rows.of_kind("curved").any():
        return None
    form = linear_form(group, kappa) if problem.closure.bilinear else None
    if form is not None:
        constants = center_free_e_n(group, form.to_constants(minimise(form.problem).t))
        return theta_of(problem, [constants] * len(problem.series))
    e_n = problem.parameters["e_n"]
    i_e, i_mu = 0, len(problem.parameters.names) - 1
    low = min(max(e_n.lower, range_of_e_n[0], problem.rows.lowest_e_n), e_n.upper)
    high = max(low, min(e_n.upper, range_of_e_n[1]))
    seen: dict[float, tuple[float, Array]] = {}

    def total(e: float) -> float:
        theta = _solved(problem, sigma, {i_e: e, i_mu: kappa / (1.0 + e)}, near)
        seen[e] = objective_at(problem, sigma, theta), theta
        return seen[e][0]

    minimum_near(total, float(near[i_e]), low, high, share=_SHARE, n_grid=_GRID, xatol=_XATOL)
    return min(seen.values(), key=lambda pair: pair[0])[1]
