"""One constant shared by series that otherwise have their own: certified.

At a given value of the shared constant every series is solved exactly on its own, which leaves a search over
one number, proven by `ifrfit.inference.optimize.lagrangian_bound`.
"""

from __future__ import annotations

import math

import numpy as np

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.lagrangian_bound import KAPPA, C, Shared, constants_at, prove
from ifrfit.inference.optimize.optimum import Optimum, theta_of
from ifrfit.inference.optimize.parameter_group import (
    ParameterGroup,
    is_separable,
    restitution_optimum,
    without_normal_rows,
)
from ifrfit.inference.optimize.scalar_search import dips


def solve_shared(problem: Problem, blocks: list[ParameterGroup], whole: ParameterGroup) -> Optimum | None:
    """Optimum of series under one shared constant; None if more than one ties them together.

    Parameters
    ----------
    problem : Problem
    blocks : list of ParameterGroup
        One a series, without the priors of shared constants.
    whole : ParameterGroup
        All rows, with all priors.
    """
    if any(block.of_kind("curved").any() for block in blocks):
        return None
    settled = _settle_e_n(problem, blocks, whole)
    if settled is None:
        return None
    blocks, base = settled
    shared = [x for x in (whole.c, whole.mu) if not x.separate and x.fixed is None]
    if len(shared) != 1:
        return None
    place = C if shared[0] is whole.c else KAPPA
    if place == KAPPA and len({block.e_n.fixed for block in blocks}) > 1:
        return None
    return _outer(problem, blocks, shared[0].prior, place, base)


def _settle_e_n(
    problem: Problem, blocks: list[ParameterGroup], whole: ParameterGroup
) -> tuple[list[ParameterGroup], float] | None:
    """Hold e_n where the user or the normal rows alone decide it; None where the rest has a say."""
    if whole.e_n.fixed is not None:
        return blocks, 0.0
    if not is_separable(whole) or (whole.e_n.separate and not whole.mu.separate):
        return None
    if whole.e_n.separate:
        parts = [restitution_optimum(block) for block in blocks]
        held = [without_normal_rows(block, e) for block, (e, _) in zip(blocks, parts, strict=True)]
        return held, sum(objective for _, objective in parts)
    e_n, objective = restitution_optimum(whole)
    return [without_normal_rows(block, e_n) for block in blocks], objective


def _outer(
    problem: Problem, blocks: list[ParameterGroup], prior: tuple[float, float] | None, place: int, base: float
) -> Optimum:
    """Search over the shared value, then bound everything else."""
    limits = _range(blocks, place)
    scale = 1.0 if place == C else 1.0 / (1.0 + (blocks[0].e_n.fixed or 0.0))
    known = None if prior is None else (prior[0] / scale, prior[1] / scale)
    shared = Shared(tuple(blocks), place, known)
    dipped = dips(shared.along, *limits, _seeds(shared))
    found = sorted((shared.total(x), x) for _, x in dipped)
    best, bound = prove(shared, found[0], limits)
    found = [best, *(dip for dip in found if abs(dip[1] - best[1]) > 1e-6 * (1.0 + abs(best[1])))]
    minima = [
        (value + base, [constants_at(block, place, x) for block in blocks])
        for value, x in found
        if value <= best[0] + 4.0
    ]
    return Optimum(
        theta_of(problem, minima[0][1]),
        best[0] + base,
        max(0.0, best[0] - bound),
        tuple((value, theta_of(problem, constants)) for value, constants in minima),
        "all partitions of each series at each shared value",
    )


def _seeds(shared: Shared) -> list[float]:
    """What each series would choose for itself, all its local minima."""
    optima = [constants for series in shared.series for constants in series.optima]
    return [c if shared.place == C else mu * (1.0 + e_n) for e_n, c, mu in optima]


def _range(blocks: list[ParameterGroup], place: int) -> tuple[float, float]:
    """Domain of the shared value; kappa ends where every row sticks."""
    first = blocks[0]
    if place == C:
        return first.c.lower, first.c.upper
    linear = first.coefficients
    bound = max(linear.b0 + linear.b1 * c for c in (first.c.lower, first.c.upper))
    finite = [block.rows.tau[np.isfinite(block.rows.tau)] for block in blocks]
    highest = max(float(tau.max(initial=0.0)) for tau in finite)
    factor = 1.0 + (first.e_n.fixed or 0.0)
    low = first.mu.lower * factor
    if math.isfinite(first.mu.upper):
        return low, first.mu.upper * factor
    return low, max(bound * highest * 1.01, low + 1.0)
