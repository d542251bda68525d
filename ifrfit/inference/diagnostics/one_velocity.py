"""One velocity given as two observables, or one computed from the other: it would count twice."""

from __future__ import annotations

import itertools

import numpy as np
from scipy import special

from ifrfit.inference.diagnostics.thresholds import FACTS, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Index, numbered
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact
from ifrfit.text import p_text

_FEWEST = 10  # pairs of rows
_ALIKE = 0.95  # correlation of the errors from which they are one
_ONE = 0.999  # the same of errors of two measurements, which impacts that differ make alike, too
_TURNS = 0.4  # share of steps that change their sign, 2/3 of independent errors, below which they are a trend
_COMPUTED = "one was computed from the other, and what is one number of an impact counts as two"
_STEP = 1e-4  # of the impulse factor, or of e_n


def one_velocity(problem: Problem, fit: LeastSquaresFit) -> Fact | None:
    """Look for two observables of the same measurement whose errors go together, setting by setting.

    Residuals are those in the unit of one of the two, through what each says of the impulse factor (of e_n
    where one is normal), taken from that of the neighbour in the angle, so that a trend, which both may have,
    is no reason; half of the pairs count as degrees of freedom. Steps that seldom change their sign are a
    trend that the law misses.

    Returns
    -------
    Fact or None
        None where no errors go together.
    """
    z = problem.residual(fit.optimum.theta) / fit.sigma
    by_factor, by_e_n = (slope / fit.sigma for slope in _slopes(problem, fit.optimum.theta))
    pairs = list(itertools.combinations(problem.rows.observables, 2))
    for one, other in pairs:
        rows, tied = _paired(problem, one.name, other.name), bool(one.takes & other.takes)
        if len(rows) < _FEWEST or not (tied or one.kind == other.kind != "normal"):
            continue
        by = (by_e_n if "normal" in (one.kind, other.kind) else by_factor)[rows]
        seen = (by != 0.0).all(axis=1)
        if seen.sum() < _FEWEST:
            continue
        rows, by = rows[seen], by[seen]
        r = max(_alike(z[rows] * by[:, [unit]] / by) for unit in (0, 1))
        dof = 0.5 * (len(rows) - 1) - 2.0
        t = r * np.sqrt(dof / max(1.0 - r * r, 1e-15))
        p = min(1.0, len(pairs) * 4.0 * float(special.stdtr(dof, -t)))
        if r > (_ALIKE if tied else _ONE) and p < REFUTED:
            why = "one velocity stands in the table twice and counts twice" if tied else _COMPUTED
            says = (
                f"{one.name} and {other.name} have the same errors at {len(rows)} angles (correlation "
                f"{r:.2g}, p = {p_text(p)}): {why}. Keep one: --observable {one.name}, or --observable "
                f"{other.name}"
            )
            figures = {"p": p, "n": len(rows), "rows": [], "correlation": r}
            return Fact(False, says, figures, FACTS["duplicates"])
    return None


def _alike(z: Array) -> float:
    """Correlation of the steps of two columns; 0 where they are steps of a trend, or none."""
    steps = np.diff(z, axis=0)
    turns = (steps[1:] * steps[:-1] < 0.0).mean(axis=0)
    if not steps.std(axis=0).all() or turns.min() < _TURNS:
        return 0.0
    return abs(float(np.atleast_2d(np.corrcoef(steps.T))[0, 1]))


def _slopes(problem: Problem, theta: Array) -> tuple[Array, Array]:
    """Derivative of each row's prediction by the impulse factor of its impact, and by e_n at that factor."""
    e_n, c, mu = problem.per_row(theta)
    k, _ = problem.impulse(e_n, c, mu)
    by_factor, by_e_n = np.zeros(k.size), np.zeros(k.size)
    for observable, at, incidence in problem.rows.by_observable:
        for slope, of_k, of_e in ((by_factor, _STEP, 0.0), (by_e_n, 0.0, _STEP)):
            ends = [
                observable.by_form(
                    incidence, k[at] + s * of_k, e_n[at] + s * of_e, mu[at], problem.inertia_factor
                )
                for s in (1.0, -1.0)
            ]
            slope[at] = (ends[0] - ends[1]) / (2.0 * _STEP)
    return by_factor, by_e_n


def _paired(problem: Problem, one: str, other: str) -> Index:
    """Rows of two observables with one angle and spin that is there once in each, by the angle, (m, 2)."""
    i = problem.rows.incidence
    settings = (np.nan_to_num(x, nan=-1.0) for x in (problem.rows.gamma_deg, i.spin_x, i.spin_y))
    number = numbered(*settings)
    found, once = [], np.ones(number.max(initial=-1) + 1, dtype=bool)
    for rows in (problem.rows.rows_of(name) for name in (one, other)):
        once &= np.bincount(number[rows], minlength=once.size) == 1
        row = np.empty(once.size, dtype=np.intp)
        row[number[rows]] = rows
        found.append(row)
    return np.column_stack(found)[once]
