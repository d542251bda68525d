"""Series that share a constant, one entry held: exact in each series, a search over what is shared."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.branch_and_bound import minimise
from ifrfit.inference.optimize.lagrangian_bound import KAPPA, C, constants_at
from ifrfit.inference.optimize.linear_families import kappa_form
from ifrfit.inference.optimize.optimum import Array, theta_of
from ifrfit.inference.optimize.parameter_group import (
    Constants,
    ParameterGroup,
    is_separable,
    restitution_optimum,
    restitution_sums,
    without_normal_rows,
)
from ifrfit.inference.optimize.solve import series_groups, whole_group

_REACH = 0.02  # of the domain about the neighbour's shared value, where the best one is sought first
_GRID = 9  # values over the whole domain that are looked at where it is not there


def best_of_series(problem: Problem, sigma: Array, at: Mapping[int, float], near: Array) -> Array | None:
    """theta with some entries held and the rest at its best; None if more than one constant is shared.

    Parameters
    ----------
    problem : Problem
        With several series, and constants separate by series.
    sigma : ndarray
    at : mapping
        Place in theta to the value held there.
    near : ndarray
        theta nearby.
    """
    whole = whole_group(problem, sigma)
    if not problem.closure.bilinear or whole.of_kind("curved").any():
        return None
    blocks = _settled(problem, series_groups(problem, sigma), whole, at)
    if blocks is None:
        return None
    leads = _leads(problem, whole, at)
    for number, mu in leads.items():
        own = series_groups(problem, sigma)[number] if whole.e_n.separate else whole
        blocks[number] = _led(blocks[number], own, mu)
    found = _best(problem, whole, blocks, at, leads, near)
    if found is None:
        return None
    theta = theta_of(problem, _unled(whole, found, leads))
    for place, value in at.items():
        theta[place] = value
    return theta


def _best(
    problem: Problem,
    whole: ParameterGroup,
    blocks: list[ParameterGroup],
    at: Mapping[int, float],
    leads: Mapping[int, float],
    near: Array,
) -> list[Constants] | None:
    """Best constants of each series; None if more than one constant is shared."""
    places = problem.positions()
    shared = [x for x in (whole.c, whole.mu) if not x.separate and x.fixed is None]
    shared = [x for x in shared if int(places[x.name][0]) not in at or (x is whole.mu and leads)]
    if not shared:
        return [_alone(block) for block in blocks]
    if len(shared) > 1:
        return None
    place = C if shared[0] is whole.c else KAPPA
    if place == KAPPA and len({block.e_n.fixed for block in blocks}) > 1:
        return None
    prior = whole.c.prior if place == C else blocks[0].mu.prior if leads else whole.mu.prior
    x = _shared_value(problem, blocks, place, prior, near)
    return [constants_at(block, place, x) for block in blocks]


def _leads(problem: Problem, whole: ParameterGroup, at: Mapping[int, float]) -> dict[int, float]:
    """Series whose mu is held while e_n is free: there e_n is no longer settled apart, kappa leads it."""
    places = problem.positions()
    if whole.e_n.fixed is not None:
        return {}
    return {
        number: at[i_mu]
        for number, (i_e, i_mu) in enumerate(zip(places["e_n"].tolist(), places["mu"].tolist(), strict=True))
        if i_e not in at and at.get(i_mu, 0.0) > 0.0
    }


def _led(block: ParameterGroup, own: ParameterGroup, mu: float) -> ParameterGroup:
    """The block with kappa = mu (1 + e_n) free in the place of e_n.

    e_n stays where it was settled, and a stand-in for mu moves kappa: over the domain of e_n, and with what
    measures e_n directly (`own` has it) as its prior, which leaves the same sum of squares.
    """
    factor = mu / (1.0 + (block.e_n.fixed or 0.0))
    weight, product, _ = restitution_sums(own)
    prior = None if weight == 0.0 else (factor * (1.0 + product / weight), factor / math.sqrt(weight))
    low, high = (factor * (1.0 + end) for end in (own.e_n.lower, own.e_n.upper))
    return replace(block, mu=replace(block.mu, lower=low, upper=high, fixed=None, prior=prior))


def _unled(whole: ParameterGroup, found: list[Constants], leads: Mapping[int, float]) -> list[Constants]:
    """Constants with e_n where kappa has led it, and kappa kept in every series that shares it."""
    out = list(found)
    for number, held in leads.items():
        settled, c, mu = found[number]
        e_n = min(max(mu * (1.0 + settled) / held - 1.0, whole.e_n.lower), whole.e_n.upper)
        if not whole.e_n.separate and whole.mu.separate:
            out = [(e_n, c, mu * (1.0 + settled) / (1.0 + e_n)) for settled, c, mu in out]
        out[number] = e_n, c, held
    return out


def _settled(
    problem: Problem, blocks: list[ParameterGroup], whole: ParameterGroup, at: Mapping[int, float]
) -> list[ParameterGroup] | None:
    """The blocks with e_n settled by what measures it directly, and with what is held fixed."""
    places = problem.positions()
    if whole.e_n.fixed is None:
        if not is_separable(whole) or (whole.e_n.separate and not whole.mu.separate):
            return None
        common = restitution_optimum(whole)[0]
        settled = []
        for number, block in enumerate(blocks):
            e_n = restitution_optimum(block)[0] if whole.e_n.separate else common
            settled.append(without_normal_rows(block, at.get(int(places["e_n"][number]), e_n)))
        blocks = settled
    out = []
    for number, block in enumerate(blocks):
        if (mu := at.get(int(places["mu"][number]))) is not None:
            block = replace(block, mu=replace(block.mu, fixed=mu, prior=None))
        own = problem.closure.constant
        if own and (c := at.get(int(places[own][number]))) is not None:
            block = replace(block, c=replace(block.c, fixed=c, prior=None))
        out.append(block)
    return out


def _alone(block: ParameterGroup) -> Constants:
    form = kappa_form(block)
    return form.to_constants(minimise(form.problem).t)


def _held(block: ParameterGroup, place: int, x: float) -> ParameterGroup:
    if place == C:
        return replace(block, c=replace(block.c, fixed=x, prior=None))
    return replace(block, mu=replace(block.mu, fixed=x / (1.0 + (block.e_n.fixed or 0.0)), prior=None))


def _shared_value(
    problem: Problem, blocks: list[ParameterGroup], place: int, prior: tuple[float, float] | None, near: Array
) -> float:
    """The shared constant, or kappa in the place of mu, at which the series together are best."""
    from scipy.optimize import minimize_scalar

    scale = 1.0 if place == C else 1.0 + (blocks[0].e_n.fixed or 0.0)
    places = problem.positions()
    name = problem.closure.constant if place == C else "mu"
    start = float(near[places[name or "mu"][0]]) * scale
    low, high = _range(blocks, place, start)

    def total(x: float) -> float:
        value = sum(minimise(kappa_form(_held(block, place, x)).problem).chi2 for block in blocks)
        return value if prior is None else value + ((x / scale - prior[0]) / prior[1]) ** 2

    start = min(max(start, low), high)
    reach = _REACH * (high - low)
    grid = np.unique([max(start - reach, low), start, min(start + reach, high)])
    values = [total(x) for x in grid.tolist()]
    if grid[int(np.argmin(values))] != start or start in (low, high):
        grid = np.unique(np.concatenate((grid, np.linspace(low, high, _GRID))))
        values = [total(x) for x in grid.tolist()]
    i = int(np.argmin(values))
    ends = float(grid[max(i - 1, 0)]), float(grid[min(i + 1, grid.size - 1)])
    found = minimize_scalar(total, bounds=ends, method="bounded", options={"xatol": 1e-8 * (high - low)})
    return min((float(found.fun), float(found.x)), (values[i], float(grid[i])))[1]


def _range(blocks: list[ParameterGroup], place: int, start: float) -> tuple[float, float]:
    """Domain of the shared value; kappa ends where every row sticks."""
    first = blocks[0]
    if place == C:
        return first.c.lower, first.c.upper
    factor = 1.0 + (first.e_n.fixed or 0.0)
    low = first.mu.lower * factor
    if math.isfinite(first.mu.upper):
        return low, first.mu.upper * factor
    linear = first.coefficients
    bound = max(linear.b0 + linear.b1 * c for c in (first.c.lower, first.c.upper))
    highest = max(float(b.rows.tau[np.isfinite(b.rows.tau)].max(initial=0.0)) for b in blocks)
    return low, max(1.01 * bound * highest, 1.01 * start, low + 1.0)
