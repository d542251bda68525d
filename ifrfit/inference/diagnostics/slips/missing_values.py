"""Zeros and repeated numbers that stand for values which were not measured."""

from __future__ import annotations

import math

import numpy as np
from scipy import special

from ifrfit.inference.diagnostics.slips.refit import Misfit, best_start, refitted, starts
from ifrfit.inference.diagnostics.slips.slip import Slip
from ifrfit.inference.diagnostics.thresholds import REFUTED
from ifrfit.inference.model.noise import resolution
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit

_FEWEST_LEFT = 6  # rows of the observable beside them
_REPEATED = 3  # rows of one number from which it may stand for "not measured"
_NEIGHBOUR = 1.5  # steps of the readings up to which two of them are neighbours
_ROWS_OF_ZEROS = 0.5  # share of an observable's rows that may stand for "not measured"


def missing_values(problem: Problem, fit: LeastSquaresFit) -> list[Slip]:
    """Values of exactly 0, or of one number beyond all others, that lie far from what all other rows say."""
    found = []
    for name in problem.rows.names:
        own = problem.rows.rows_of(name)
        given, count = np.unique(problem.rows.value[own], return_counts=True)
        repeated = count >= _REPEATED
        repeated[1:-1] = False
        if given.size > 1:  # the neighbour of another reading by one step of these readings is a reading, too
            step = resolution(problem.rows.value[own])
            repeated[[0, -1]] &= np.diff(given)[[0, -1]] > _NEIGHBOUR * step
        for code in given[(given == 0.0) | repeated].tolist():
            at = own[problem.rows.value[own] == code]
            if at.size > _ROWS_OF_ZEROS * own.size or own.size - at.size < _FEWEST_LEFT:
                continue
            far, p, drop = _far_from_rest(problem, fit, name, at)
            if far.size and (code == 0.0 or far.size >= _REPEATED):
                kind = "zero-for-missing" if code == 0.0 else "code-for-missing"
                found.append(Slip(kind, drop, p, observable=name, rows=tuple(far.tolist())))
    return found


def _far_from_rest(
    problem: Problem, fit: LeastSquaresFit, name: str, at: Index
) -> tuple[Index, float, float]:
    """Rows of one number that lie far from a fit without them, the largest p value of these, and chi2."""
    rows = problem.rows
    own = rows.rows_of(name)
    kept = np.setdiff1d(np.arange(len(rows)), at)
    part = problem.with_rows(kept)
    misfit = Misfit.of(part)
    start = best_start(
        lambda tried, some: part.with_rows(some).predict(tried),
        misfit,
        part.rows.value,
        starts(problem, fit.optimum.theta),
    )
    theta, left = refitted(part, misfit, start[0])
    sigma = misfit.sigma(left)[rows.which[kept] == rows.names.index(name)]
    # readings scatter by their rounding at least
    floor = resolution(rows.value[own]) / math.sqrt(12.0)
    z = problem.residual(theta)[at] / max(float(np.sqrt((sigma**2).mean())), floor)
    dof = max(sigma.size - theta.size, 1)
    far = np.abs(z) > -float(special.stdtrit(dof, 0.5 * REFUTED / own.size))
    least = float(np.abs(z[far]).min(initial=np.inf))
    return at[far], own.size * 2.0 * float(special.stdtr(dof, -least)), float((z**2).sum())
