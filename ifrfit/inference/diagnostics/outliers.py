"""Rows that do not belong to the rest."""

from __future__ import annotations

import math

import numpy as np
from scipy import special

from ifrfit.errors import DataError
from ifrfit.inference.diagnostics.residuals import Residuals, residuals_of
from ifrfit.inference.diagnostics.thresholds import FACTS, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, refit
from ifrfit.inference.result.types import Fact

_MOST = 8  # outliers that are looked for
_FEW = 0.25  # share of all rows that may be outliers and be left out


def outliers(problem: Problem, fit: LeastSquaresFit, residuals: Residuals) -> Fact:
    """Rows beyond the Bonferroni limit, found one by one.

    The worst row is left out and the rest fitted again before the next one is judged: an outlier drags good
    rows along. A row whose sigma is known has the limit of the normal law, any other that of Student's t with
    the degrees of freedom of its own noise. Where only a search finds an optimum, it goes on from the last
    one.
    """
    found: list[tuple[int, float]] = []  # place in the problem, distance in sigma
    places = np.arange(problem.rows.value.size)
    limit: float | None = None
    kept_problem = problem
    while len(found) < _MOST and places.size > 2:
        limit = _limit(float(residuals.dof.max()), places.size)
        if math.isinf(limit):
            limit = None
            break
        size = np.abs(residuals.studentised)
        beyond = np.flatnonzero(size > limit)  # the least of the limits
        of_row = np.array([_limit(dof, places.size) for dof in residuals.dof[beyond].tolist()])
        beyond, of_row = beyond[size[beyond] > of_row], of_row[size[beyond] > of_row]
        if beyond.size == 0:
            break
        first = int(np.argmax(size[beyond] / of_row))
        worst, limit = int(beyond[first]), float(of_row[first])
        found.append((int(places[worst]), float(residuals.studentised[worst])))
        kept = np.delete(np.arange(places.size), worst)
        places, kept_problem = places[kept], kept_problem.with_rows(kept)
        try:
            fit = refit(kept_problem, fit.sigma[kept], fit.optimum.theta)
        except DataError:  # too few rows are left to tell their noise
            break
        residuals = residuals_of(kept_problem, fit)
    return _fact(problem, found, limit)


def _limit(dof: float, n: int) -> float:
    """The Bonferroni limit of n rows; infinite where the noise rests on too few of them."""
    p = 1.0 - 0.5 * REFUTED / n
    if math.isinf(dof):
        return float(special.ndtri(p))
    return float(special.stdtrit(dof, p)) if dof > 1.0 else math.inf


def _fact(problem: Problem, found: list[tuple[int, float]], limit: float | None) -> Fact:
    of = problem.observations.table["observable"]
    figures = {
        "rows": [row_name(problem, i) for i, _ in found],
        "observables": sorted({str(of.iat[i]) for i, _ in found}),
        "limit": limit,
    }
    if limit is None and not found:
        return Fact(True, "too few rows to tell an outlier", figures, FACTS["outliers"])
    if not found:
        return Fact(True, "no outlier", figures, FACTS["outliers"])
    named = "; ".join(f"{row_name(problem, i)} at {z:+.1f} sigma" for i, z in found)
    many = len(found) > 1
    count = f"{len(found)} outlier{'s' if many else ''}{' or more' if len(found) == _MOST else ''}"
    if len(found) == _MOST and problem.noise.is_known:
        remedy = "with so many, sigma is rather too small for the scatter: --noise scaled or unknown"
    elif len(found) > max(2.0, _FEW * problem.rows.value.size):
        remedy = (
            "so many of so few rows are no outliers: the law does not hold for them, or sigma is too small"
        )
    else:
        them, left_out = "them" if many else "it", [f"--exclude {exclude_name(problem, i)}" for i, _ in found]
        remedy = f"check {them}, or leave {them} out with {' '.join(left_out)}"
    return Fact(False, f"{count}: {named}; {remedy}", figures, FACTS["outliers"])


def row_name(problem: Problem, i: int) -> str:
    """Where a row comes from, in words."""
    table = problem.observations.table
    source, row, observable = (str(table[column].iat[i]) for column in ("source", "row", "observable"))
    return f"{source} line {row} ({observable})"


def exclude_name(problem: Problem, i: int) -> str:
    """What --exclude takes for a row."""
    row = problem.observations.table.iloc[i]
    several = problem.observations.table["source"].nunique() > 1
    return f"{row['source']}:{row['row']}" if several else str(row["row"])
