"""One constant shared by series that otherwise have their own: certified through Lagrange's dual.

At a given value of the shared constant every series is solved exactly on its own, which leaves a search over
one number. The proof: give each series a multiplier (its own slope at the optimum; they sum to zero) and
minimise it exactly over everything. The sum of these minima is a lower bound for all choices at once.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ifrfit.inference.block import Block, Constants, is_separable, normal_part, without_normal
from ifrfit.inference.forms import LinearForm
from ifrfit.inference.linear import kappa_form
from ifrfit.inference.optimum import Array, Optimum, theta_of
from ifrfit.inference.piecewise import minimise
from ifrfit.inference.problem import Problem
from ifrfit.inference.scan import dips

_C, _KAPPA = 1, 2  # places among (e_n, c, kappa)


def solve_shared(problem: Problem, blocks: list[Block], whole: Block) -> Optimum | None:
    """Optimum of series under one shared constant; None if more than one ties them together.

    Parameters
    ----------
    problem : Problem
    blocks : list of Block
        One a series, without the priors of shared constants.
    whole : Block
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
    place = _C if shared[0] is whole.c else _KAPPA
    if place == _KAPPA and len({block.e_n.fixed for block in blocks}) > 1:
        return None
    return _outer(problem, blocks, shared[0].prior, place, base)


def _settle_e_n(problem: Problem, blocks: list[Block], whole: Block) -> tuple[list[Block], float] | None:
    """Hold e_n where the user or the normal rows alone decide it; None where the rest has a say."""
    if whole.e_n.fixed is not None:
        return blocks, 0.0
    if not is_separable(whole) or (whole.e_n.separate and not whole.mu.separate):
        return None
    if whole.e_n.separate:
        parts = [normal_part(block) for block in blocks]
        held = [without_normal(block, e) for block, (e, _) in zip(blocks, parts, strict=True)]
        return held, sum(objective for _, objective in parts)
    e_n, objective = normal_part(whole)
    return [without_normal(block, e_n) for block in blocks], objective


def _outer(
    problem: Problem, blocks: list[Block], prior: tuple[float, float] | None, place: int, base: float
) -> Optimum:
    """Search over the shared value, then bound everything else."""

    def total(x: float) -> float:
        return sum(minimise(kappa_form(_at(block, place, x)).problem).chi2 for block in blocks) + tie(x)

    def tie(x: float) -> float:
        if prior is None:
            return 0.0
        value = x if place == _C else x / (1.0 + (blocks[0].e_n.fixed or 0.0))
        return ((value - prior[0]) / prior[1]) ** 2

    low, high = _range(blocks, place)
    found = dips(total, low, high, _seeds(blocks, place))
    objective = found[0][0]
    minima = [
        (value + base, [_constants(block, place, x) for block in blocks])
        for value, x in found
        if value <= objective + 4.0
    ]
    best = minima[0][1]
    gap = None if prior is not None else max(0.0, objective - _lower_bound(blocks, best, place))
    return Optimum(
        theta_of(problem, best),
        objective + base,
        gap,
        tuple((value, theta_of(problem, constants)) for value, constants in minima),
        "all partitions of each series at each shared value",
    )


def _seeds(blocks: list[Block], place: int) -> list[float]:
    """What each series would choose for itself, all its local minima."""
    seeds = []
    for block in blocks:
        form = kappa_form(block)
        for _, t in minimise(form.problem).optima:
            e_n, c, mu = form.to_constants(t)
            seeds.append(c if place == _C else mu * (1.0 + e_n))
    return seeds


def _at(block: Block, place: int, x: float) -> Block:
    if place == _C:
        return replace(block, c=replace(block.c, fixed=x, prior=None))
    return replace(block, mu=replace(block.mu, fixed=x / (1.0 + (block.e_n.fixed or 0.0)), prior=None))


def _constants(block: Block, place: int, x: float) -> Constants:
    form = kappa_form(_at(block, place, x))
    return form.to_constants(minimise(form.problem).t)


def _range(blocks: list[Block], place: int) -> tuple[float, float]:
    """Domain of the shared value; kappa ends where every row sticks."""
    first = blocks[0]
    if place == _C:
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


def _lower_bound(blocks: list[Block], constants: list[Constants], place: int) -> float:
    """Sum of the series' own minima under multipliers that sum to zero."""
    forms = [kappa_form(block) for block in blocks]
    index = [_free_index(block, place) for block in blocks]
    slopes = np.array(
        [_slope(f, block, c, i) for f, block, c, i in zip(forms, blocks, constants, index, strict=True)]
    )
    pulls = slopes.mean() - slopes
    bound = 0.0
    for form, pull, i in zip(forms, pulls, index, strict=True):
        direction = np.zeros(form.problem.kappa.size)
        direction[i] = pull
        result = minimise(replace(form.problem, pull=direction))
        bound += result.chi2 - result.gap
    return bound


def _free_index(block: Block, place: int) -> int:
    return sum(x.fixed is None for x in (block.e_n, block.c, block.mu)[:place])


def _slope(form: LinearForm, block: Block, constants: Constants, i: int) -> float:
    """Derivative of a series' sum of squares by the shared unknown, at the optimum."""
    e_n, c, mu = constants
    full = (e_n, c, mu * (1.0 + e_n))
    fixed = (block.e_n.fixed, block.c.fixed, block.mu.fixed)
    t: Array = np.array([value for value, held in zip(full, fixed, strict=True) if held is None])
    p = form.problem
    sticks = p.tau * (p.bound @ t + p.bound0) <= p.kappa @ t + p.kappa0
    residual = np.where(sticks, p.stick.residuals(t), p.slide.residuals(t))
    stick, slide = (
        p.stick.onto(np.where(sticks, residual, 0.0)),
        p.slide.onto(np.where(sticks, 0.0, residual)),
    )
    return float(-2.0 * (stick + slide + p.always.onto(p.always.residuals(t)))[i])
