"""Residuals of a fit, standardised and studentised, and rows that do not belong to the rest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from ifrfit.data.observations import word_of
from ifrfit.errors import DataError
from ifrfit.inference.diagnostics.quadratic_forms import Array
from ifrfit.inference.diagnostics.thresholds import FACTS, REFUTED
from ifrfit.inference.model.common_errors import whitening
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, refit
from ifrfit.inference.result.types import Fact

_FITTED = 1e-6  # 1 - leverage below which a row is fitted exactly
_REST = 1e-6  # least share of the misfit that is left to the other rows
_MOST = 8  # outliers that are looked for
_AS_IT_SHOULD = 0.01  # p of chi2 without the outliers from which they are all that misfits
_FEW_OF_ONE = 0.15  # share of the rows of an observable that is no doubt of its sigma
_FEW = 0.25  # share of all rows that may be outliers and be left out


@dataclass(frozen=True)
class Residuals:
    """Residuals of a fit: standardised ones are over sigma, studentised ones also over their own leverage.

    `dof`, (n,), are the degrees of freedom of Student's t that the studentised residuals have: infinite where
    sigma is known.
    """

    raw: Array
    standardised: Array
    studentised: Array
    dof: Array


def residuals_of(problem: Problem, fit: LeastSquaresFit) -> Residuals:
    """Residuals at the optimum.

    Where sigma comes from the misfit, a row is left out of its own yardstick (external studentisation), so
    that an outlier does not hide behind the noise it feigns.
    """
    raw = problem.residual(fit.optimum.theta)
    standardised = raw / fit.sigma
    own = 1.0 - fit.gaussian.leverage
    # a row that the constants run through has no residual, whatever rounding leaves of it
    internal = np.where(own > _FITTED, standardised / np.sqrt(np.maximum(own, _FITTED)), 0.0)
    if math.isinf(fit.noise_dof):
        return Residuals(raw, standardised, internal, np.broadcast_to(math.inf, raw.shape))
    groups = list(problem.noise_groups().values())
    if len(groups) > 1 or problem.noise.is_mixed:
        deleted, dof = internal.copy(), np.full(raw.size, math.inf)
        fitted = fitted_directions(problem, fit)
        for rows in groups:
            external, dof[rows] = _left_out(fitted, standardised, rows)
            deleted[rows] = np.where(dof[rows] > 0.0, external, internal[rows])
        return Residuals(raw, standardised, deleted, dof)
    dof = np.broadcast_to(fit.noise_dof - 1.0, raw.shape)
    if fit.noise_dof <= 1.0:
        return Residuals(raw, standardised, internal, dof)
    # no residual of a linear fit exceeds all of the misfit: at a bound, or beside a kink, no leverage holds
    internal = np.where(internal**2 > (1.0 + _REST) * fit.noise_dof, standardised, internal)
    rest = np.maximum(fit.noise_dof - internal**2, _REST * fit.noise_dof)
    return Residuals(raw, standardised, internal * np.sqrt((fit.noise_dof - 1.0) / rest), dof)


def fitted_directions(problem: Problem, fit: LeastSquaresFit) -> Array:
    """Rows of A, (n, k), where A A' takes weighted values to their fit: the leverage is its diagonal."""
    local = fit.gaussian
    seen = local.seen
    by_phi = problem.jacobian(fit.optimum.theta) @ local.to_theta / fit.sigma[:, None]
    loadings = fit.common_loadings
    if loadings is None:
        return np.asarray(by_phi @ local.vectors[:, seen] / local.singular[seen])
    # an error that the rows have in common is one more constant, with a prior of 1
    unit, size = whitening(loadings, fit.sigma)
    share = size**2 / (1.0 + size**2)
    rest = by_phi - (unit * share) @ (unit.T @ by_phi)
    return np.column_stack((rest @ local.vectors[:, seen] / local.singular[seen], unit * np.sqrt(share)))


def _left_out(fitted: Array, standardised: Array, rows: Index) -> tuple[Array, Array]:
    """Residual of each row of one unknown noise from the fit without it, over its sd, and its dof.

    The noise is that which the other rows of the group leave to it, the row left out of the constants, too;
    other noises stay. The constants bring in an error of their own, of which that noise has a share. Of a
    single group it is the external studentisation, with one degree of freedom less than the noise.
    """
    own, r = fitted[rows], standardised[rows]
    among = own.T @ own
    leverage = (own**2).sum(axis=1)
    within = np.einsum("ij,jk,ik->i", own, among, own)  # squares of the fit's weights on the group's rows
    left = 1.0 - leverage
    has_residual = left > _FITTED
    left = np.maximum(left, _FITTED)
    moved = np.where(has_residual, r / left, 0.0)  # residual from the fit without the row
    squares = float(r @ r) + 2.0 * moved * (own @ (own.T @ r)) + moved**2 * (within - 1.0)
    wrong = squares < -_REST * rows.size  # more than all of the misfit: no leverage holds, as above
    moved, squares = np.where(wrong, r, moved), np.where(wrong, float(r @ r) - r**2, squares)
    rest = rows.size - 1.0 - (float(leverage.sum()) - leverage) - (within - leverage**2) / left
    rest = np.maximum(rest, 0.0)
    variance = np.maximum(squares, _REST * rows.size) / np.maximum(rest, _REST)
    of_group = np.maximum(within - leverage**2, 0.0) / left**2
    of_constants = np.maximum(leverage / left - of_group, 0.0)
    total = variance * (1.0 + of_group) + of_constants
    share = variance * (1.0 + of_group) / total
    return moved / np.sqrt(total), rest / share**2


def outliers(problem: Problem, fit: LeastSquaresFit, residuals: Residuals) -> Fact:
    """Rows beyond the Bonferroni limit, found one by one.

    The worst row is left out and the rest fitted again before the next one is judged: an outlier drags good
    rows along. It counts only if that fit does not predict it either: beside a kink, or with few rows, the
    leverage of the fit with it says little. A row whose sigma is known has the limit of the normal law, any
    other that of Student's t with the degrees of freedom of its own noise. Where only a search finds an
    optimum, it goes on from the last one.
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
        for i in np.argsort(-size[beyond] / of_row, kind="stable")[:_MOST].tolist():
            worst = int(beyond[i])
            kept = np.delete(np.arange(places.size), worst)
            try:
                rest = refit(kept_problem.with_rows(kept), fit.sigma[kept], fit.optimum.theta)
            except DataError:  # too few rows are left to tell their noise
                continue
            far = _prediction_error(kept_problem, fit, rest, worst, kept)
            if abs(far) > of_row[i]:
                break
        else:
            break
        limit = float(of_row[i])
        found.append((int(places[worst]), far))
        places, kept_problem, fit = places[kept], kept_problem.with_rows(kept), rest
        residuals = residuals_of(kept_problem, fit)
    return _outliers_fact(problem, found, limit, _p_of_rest(kept_problem, fit))


def _prediction_error(
    problem: Problem, fit: LeastSquaresFit, without: LeastSquaresFit, row: int, kept: Index
) -> float:
    """Residual of a row from the fit of the kept ones, over its sd: its noise, and the constants of that fit.

    The noise of the row changes as that of its group does.
    """
    theta = without.optimum.theta
    group = problem.noise_numbers
    alike = group[kept] == group[row]
    changed = float(np.median((without.sigma / fit.sigma[kept])[alike])) if alike.any() else 1.0
    by_phi = (problem.jacobian(theta) @ without.gaussian.to_theta)[row]
    variance = (fit.sigma[row] * changed) ** 2 + without.gaussian.variance(by_phi, 1.0)
    return float(problem.residual(theta)[row]) / math.sqrt(variance)


def _p_of_rest(problem: Problem, fit: LeastSquaresFit) -> float | None:
    """p of chi2 of the rows that are left, where sigma is known; None where it tells nothing."""
    dof = len(problem.rows) - float(fit.gaussian.leverage.sum())
    if not (problem.noise.is_known and dof >= 1.0 and fit.sigma.size == len(problem.rows)):
        return None
    z = problem.residual(fit.optimum.theta) / fit.sigma
    return float(special.chdtrc(dof, float(z @ z)))


def _limit(dof: float, n: int) -> float:
    """The Bonferroni limit of n rows; infinite where the noise rests on too few of them."""
    return float(special.stdtrit(dof, 1.0 - 0.5 * REFUTED / n)) if dof > 1.0 else math.inf


def _outliers_fact(
    problem: Problem, found: list[tuple[int, float]], limit: float | None, p_rest: float | None
) -> Fact:
    of = problem.observations.table["observable"]
    figures = {
        "rows": [row_name(problem, i) for i, _ in found],
        "observables": sorted({str(of.iat[i]) for i, _ in found}),
        "limit": limit,
    }
    if limit is None and not found:
        says = "no outlier is looked for: there are too few rows"
        return Fact(True, says, figures | {"tested": False}, FACTS["outliers"])
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
        them = "them" if many else "it"
        left_out = dict.fromkeys(f"--exclude {exclude_name(problem, i)}" for i, _ in found)
        remedy = f"check {them}, or leave {them} out with {' '.join(left_out)}"
        at = problem.rows.which[[i for i, _ in found]]
        if all(
            (at == k).sum() <= max(1, _FEW_OF_ONE * (problem.rows.which == k).sum()) for k in np.unique(at)
        ):
            figures["p_of_rest"] = p_rest
    return Fact(False, f"{count}: {named}; {remedy}", figures, FACTS["outliers"])


def are_all_that_misfits(fact: Fact | None) -> bool:
    """Whether some outliers are all that the law misses: without them chi2 is as it should be."""
    p = None if fact is None else fact.figures.get("p_of_rest")
    return p is not None and p >= _AS_IT_SHOULD


def row_name(problem: Problem, i: int) -> str:
    """Where a row comes from, in words."""
    table = problem.observations.table
    source, row, observable = (str(table[column].iat[i]) for column in ("source", "row", "observable"))
    return f"{source} {word_of(problem.observations.sources, source)} {row} ({observable})"


def exclude_name(problem: Problem, i: int) -> str:
    """What --exclude takes for a row."""
    return exclude_names(problem, [i])[0]


def exclude_names(problem: Problem, rows: Sequence[int]) -> list[str]:
    """What --exclude takes for each of some rows."""
    table = problem.observations.table
    several = table["source"].nunique() > 1
    source, row = (table[column].iloc[list(rows)].tolist() for column in ("source", "row"))
    return [f"{a}:{b}" if several else str(b) for a, b in zip(source, row, strict=True)]
