"""Does the model describe the data? Residuals, lack of fit, and where it sits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ifrfit.errors import DataError
from ifrfit.inference.diagnostics.thresholds import FACTS, RANK, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import OBLIQUE, Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, refit
from ifrfit.inference.result.types import Fact
from ifrfit.text import joined, p_text

Array = NDArray[np.float64]

_TRIALS = 12  # angles at which the near-normal impacts are cut off, to see whether that mends the fit
_COMFORTABLE = 0.05
_NEAR_NORMAL = 30.0  # degrees below which microslip is the likely reason of a misfit
_SPLINE_KNOTS = 4  # three degrees of freedom beside the constant
_FITTED = 1e-6  # 1 - leverage below which a row is fitted exactly
_REST = 1e-6  # least share of the misfit that is left to the other rows
_ELSEWHERE = 0.5  # share of the sum of squares in rows that know no angle, from which the misfit sits there
_SMALLEST = 8  # rows of an observable below which no smooth departure is looked for


@dataclass(frozen=True)
class Residuals:
    """Residuals of a fit: standardised ones are over sigma, studentised ones also over their own leverage.

    `is_given` says of which rows sigma is known, (n,). `dof`, (n,), are the degrees of freedom of Student's t
    that the studentised residuals have: infinite where sigma is known.
    """

    raw: Array
    standardised: Array
    studentised: Array
    is_given: NDArray[np.bool_]
    dof: Array


def residuals_of(problem: Problem, fit: LeastSquaresFit) -> Residuals:
    """Residuals at the optimum.

    Where sigma comes from the misfit, a row is left out of its own yardstick (external studentisation), so
    that an outlier does not hide behind the noise it feigns.
    """
    raw = problem.rows.value - problem.predict(fit.optimum.theta)
    standardised = raw / fit.sigma
    own = 1.0 - fit.gaussian.leverage
    # a row that the constants run through has no residual, whatever rounding leaves of it
    internal = np.where(own > _FITTED, standardised / np.sqrt(np.maximum(own, _FITTED)), 0.0)
    given = problem.noise.is_given
    if math.isinf(fit.noise_dof):
        return Residuals(raw, standardised, internal, given, np.broadcast_to(math.inf, raw.shape))
    groups = list(problem.noise_groups().values())
    if len(groups) > 1 or problem.noise.is_mixed:
        deleted, dof = internal.copy(), np.full(raw.size, math.inf)
        fitted = fitted_directions(problem, fit)
        for rows in groups:
            external, dof[rows] = _left_out(fitted, standardised, rows)
            deleted[rows] = np.where(dof[rows] > 0.0, external, internal[rows])
        return Residuals(raw, standardised, deleted, given, dof)
    dof = np.broadcast_to(fit.noise_dof - 1.0, raw.shape)
    if fit.noise_dof <= 1.0:
        return Residuals(raw, standardised, internal, given, dof)
    rest = np.maximum(fit.noise_dof - internal**2, _REST * fit.noise_dof)
    return Residuals(raw, standardised, internal * np.sqrt((fit.noise_dof - 1.0) / rest), given, dof)


def fitted_directions(problem: Problem, fit: LeastSquaresFit) -> Array:
    """Rows of A, (n, k), where A A' takes weighted values to their fit: the leverage is its diagonal."""
    local = fit.gaussian
    seen = local.singular > RANK * local.singular.max(initial=0.0)
    by_phi = problem.jacobian(fit.optimum.theta) @ local.to_theta / fit.sigma[:, None]
    if fit.angle_offset is None:
        return np.asarray(by_phi @ local.vectors[:, seen] / local.singular[seen])
    # an error that the rows have in common is one more constant, with a prior of 1
    common = fit.angle_offset.common / fit.sigma
    size = float(common @ common)
    root = 1.0 / math.sqrt(1.0 + size)
    rest = by_phi - np.outer(common, common @ by_phi) * (1.0 / (1.0 + size))
    return np.column_stack((rest @ local.vectors[:, seen] / local.singular[seen], root * common))


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
    rest = rows.size - 1.0 - (float(leverage.sum()) - leverage) - (within - leverage**2) / left
    rest = np.maximum(rest, 0.0)
    variance = np.maximum(squares, _REST * rows.size) / np.maximum(rest, _REST)
    of_group = np.maximum(within - leverage**2, 0.0) / left**2
    of_constants = np.maximum(leverage / left - of_group, 0.0)
    total = variance * (1.0 + of_group) + of_constants
    share = variance * (1.0 + of_group) / total
    return moved / np.sqrt(total), rest / share**2


def lack_of_fit(problem: Problem, fit: LeastSquaresFit, residuals: Residuals, *, remedy: bool = True) -> Fact:
    """Test whether constants can describe the data.

    With known sigma by chi2; without by pure error where inputs repeat; else by a smooth departure in tau,
    with the runs test beside it. Where some sigma is known, by chi2 of these rows and by the other test of
    all rows: the smaller p counts twice.
    """
    r = residuals.standardised
    dof = r.size - round(float(fit.gaussian.leverage.sum()))
    runs = _runs(problem, r)
    rule = FACTS["lack_of_fit"]
    figures: dict[str, object] = {"dof": dof, "p_runs": runs}
    tests: dict[str, float] = {}
    chi2, dof_known = chi2_of_given(problem, fit, residuals)
    if dof_known > 0:
        tests["chi2"] = float(special.chdtrc(dof_known, chi2))
    if not problem.noise.is_known:
        pure = _pure_error(problem, r, dof)
        if pure is not None:
            tests["pure error"] = pure
        else:
            smooth = _smooth(problem, fit, r)
            found = [x for x in (smooth, runs) if x is not None]
            tests["smooth departure"] = min(found) if found else math.nan
            figures["p_smooth"] = smooth
    test, p = _smallest(tests)
    figures |= {"test": test, "p": None if math.isnan(p) else p}
    if math.isnan(p):
        oblique = any(rows.size for rows in oblique_groups(problem))
        says = "too few rows to test the fit" if oblique else "nothing to test: repeats of single values"
        return Fact(True, says, figures, rule)
    if p >= REFUTED:
        return Fact(True, f"no lack of fit (p = {p_text(p)}, {test})", figures, rule)
    where, signs, near_normal = misfit(problem, r)
    figures["where"] = where
    says = (
        f"the data contradict one set of constants (p = {p_text(p)}, {test}); "
        f"the misfit sits {where}: {signs}"
        f"{_oblique_remedy(problem, fit) if near_normal and remedy and problem.closure.bilinear else ''}"
    )
    return Fact(False, says, figures, rule)


def chi2_of_given(problem: Problem, fit: LeastSquaresFit, residuals: Residuals) -> tuple[float, float]:
    """Sum of squares of rows with known sigma, and its degrees of freedom: their number less leverage.

    Where other rows share in the constants that is not quite a law of chi2, but one of smaller variance.
    """
    given = residuals.is_given
    square = float(residuals.standardised[given] @ residuals.standardised[given])
    leverage = float(fit.gaussian.leverage[given].sum())
    if problem.noise.is_known:
        return square, given.size - round(leverage)
    return square, max(int(given.sum()) - leverage, 0.0)


def _smallest(tests: Mapping[str, float]) -> tuple[str, float]:
    """Name and p value of the test that speaks most against the fit, corrected for their number."""
    made = {name: p for name, p in tests.items() if not math.isnan(p)}
    if not made:
        return next(reversed(list(tests)), "chi2"), math.nan
    name = min(made, key=lambda each: made[each])
    return name, min(1.0, len(made) * made[name])


def scatter_too_small(
    problem: Problem, fit: LeastSquaresFit, residuals: Residuals, *, advise: bool = True
) -> Fact | None:
    """Whether the rows scatter less than their sigma says: chi2 from below; None where they do not.

    `advise` says whether to take sigma from the scatter: where errors are alike that would be too small.
    """
    chi2, dof = chi2_of_given(problem, fit, residuals)
    if dof < 1:
        return None
    p = float(special.chdtr(dof, chi2))
    figures = {"p": p, "chi2": chi2, "dof": dof}
    if p >= REFUTED:
        return None
    which, remedy = "the values", "--noise scaled"
    if problem.noise.is_mixed:
        which, remedy = "values whose sigma is given", "--noise unknown"
    says = (
        f"{which} scatter {math.sqrt(dof / max(chi2, 1e-300)):.2g} times less than their sigma "
        f"(chi2 = {chi2:.3g} for {dof:.0f} degrees of freedom, p = {p_text(p)}): sigma is too large, or is "
        f"no standard uncertainty of one reading"
        f"{f'; {remedy} takes its size from the scatter' if advise else ''}"
    )
    return Fact(False, says, figures, FACTS["scatter_too_small"])


def _oblique_remedy(problem: Problem, whole: LeastSquaresFit) -> str:
    """Whether the oblique impacts alone can be described, found by trying."""
    says = ". Microslip does this near the normal: try --closure maw"
    gamma = problem.observations.table["gamma_deg"].to_numpy(dtype=float)
    angles = np.unique(gamma[gamma < _NEAR_NORMAL])
    for angle in angles[:: 1 + angles.size // _TRIALS]:
        cut = math.floor(float(angle)) + 1
        kept = np.flatnonzero(~(gamma < cut))
        part = problem.with_rows(kept)
        try:
            fit = refit(part, whole.sigma[kept])
        except DataError:  # too few rows are left to tell their noise
            break
        found = lack_of_fit(part, fit, residuals_of(part, fit), remedy=False)
        if found.figures["p"] is not None and found.figures["p"] >= _COMFORTABLE:
            return (
                f"{says}, or --gamma-min {cut}, with which there is no lack of fit "
                f"(p = {p_text(found.figures['p'])})"
            )
    return says


def _pure_error(problem: Problem, r: Array, dof: int) -> float | None:
    """p of the F test of lack of fit against the scatter of repeats; None without repeats."""
    i = problem.rows.incidence
    inputs = np.column_stack((problem.rows.series, problem.rows.which, i.sine, i.cosine, i.spin_x, i.spin_y))
    _, group = np.unique(inputs, axis=0, return_inverse=True)
    group = group.reshape(-1)
    count = np.bincount(group)
    mean = np.bincount(group, r) / count
    pure = float(((r - mean[group]) ** 2).sum())
    dof_pure = r.size - count.size
    dof_lack = dof - dof_pure
    if dof_pure < 3 or dof_lack < 1 or pure <= 0.0:
        return None
    f = max(float(r @ r) - pure, 0.0) / dof_lack / (pure / dof_pure)
    return float(special.fdtrc(dof_lack, dof_pure, f))


def oblique_groups(problem: Problem) -> list[Index]:
    """Rows of each observable that depends on the regime, sorted by tau."""
    rows = (problem.rows.rows_of(each.name) for each in problem.rows.observables if each.kind in OBLIQUE)
    return [own[np.argsort(problem.rows.tau[own], kind="stable")] for own in rows]


def _smooth(problem: Problem, fit: LeastSquaresFit, r: Array) -> float | None:
    """p of a natural cubic spline in tau, one an observable, beyond the model's own directions."""
    columns = []
    for rows in oblique_groups(problem):
        rows = rows[np.isfinite(problem.rows.tau[rows])]
        basis = _natural_spline(problem.rows.tau[rows]) if rows.size >= _SMALLEST else None
        if basis is not None:
            wide = np.zeros((r.size, basis.shape[1]))
            wide[rows] = basis
            columns.append(wide)
    if not columns:
        return None
    jacobian = problem.jacobian(fit.optimum.theta)[:, problem.parameters.free] / fit.sigma[:, None]
    own = orthonormal(jacobian)
    extra = np.concatenate(columns, axis=1)
    extra = orthonormal(extra - own @ (own.T @ extra))
    left = r - own @ (own.T @ r)
    gained = float(((extra.T @ left) ** 2).sum())
    rest = float(left @ left) - gained
    dof_rest = r.size - own.shape[1] - extra.shape[1]
    if dof_rest < 3 or extra.shape[1] == 0 or rest <= 0.0:
        return None
    f = gained / extra.shape[1] / (rest / dof_rest)
    return float(special.fdtrc(extra.shape[1], dof_rest, f))


def _natural_spline(tau: Array) -> Array | None:
    """Basis of the natural cubic splines in tau, knots at quantiles, that vanish at the first knot, (n, 3).

    By truncated powers (Hastie, Tibshirani & Friedman 2009, eqs 5.4 and 5.5): scipy.interpolate would take
    longer to import than the whole fit.
    """
    knots = np.unique(np.quantile(tau, np.linspace(0.0, 1.0, _SPLINE_KNOTS)))
    if knots.size < _SPLINE_KNOTS:
        return None
    x, t = (tau - knots[0]) / np.ptp(knots), (knots - knots[0]) / np.ptp(knots)
    cubes = np.maximum(x[:, None] - t, 0.0) ** 3
    d = (cubes[:, :-1] - cubes[:, -1:]) / (t[-1] - t[:-1])
    return np.column_stack((x, d[:, :-1] - d[:, -1:]))


def orthonormal(a: Array) -> Array:
    """Orthonormal basis of the columns' span."""
    size = np.sqrt((a * a).sum(axis=0))
    seen = size > 1e-12 * size.max(initial=0.0)
    if not seen.any():
        return a[:, seen]
    basis, weight, _ = np.linalg.svd(a[:, seen] / size[seen], full_matrices=False)
    return np.asarray(basis[:, weight > 1e-9 * weight[0]])


def _runs(problem: Problem, r: Array) -> float | None:
    """Wald-Wolfowitz runs test of the residuals' signs along tau, pooled over observables; two-sided p."""
    runs = expected = variance = 0.0
    for rows in oblique_groups(problem):
        positive = r[rows] > 0.0
        n1, n2 = float(positive.sum()), float((~positive).sum())
        n = n1 + n2
        if n1 < 2 or n2 < 2:
            continue
        runs += 1.0 + float((positive[1:] != positive[:-1]).sum())
        expected += 1.0 + 2.0 * n1 * n2 / n
        variance += 2.0 * n1 * n2 * (2.0 * n1 * n2 - n) / (n * n * (n - 1.0))
    if variance < 2.0:
        return None
    z = max(abs(runs - expected) - 0.5, 0.0) / math.sqrt(variance)
    return float(2.0 * special.ndtr(-z))


def misfit(problem: Problem, r: Array) -> tuple[str, str, bool]:
    """Where the excess of squares sits: the head or tail along tau that stands out most, or readings of e_n.

    Returns
    -------
    where, signs : str
    near_normal : bool
        Whether it sits at the impacts nearest to the normal.
    """
    best, place = -math.inf, (np.empty(0, dtype=np.intp), "")
    groups = oblique_groups(problem)
    others = np.setdiff1d(np.arange(r.size), np.concatenate([np.empty(0, dtype=np.intp), *groups]))
    if others.size and float(r[others] @ r[others]) > _ELSEWHERE * float(r @ r):
        names = [name for name in problem.rows.names if np.isin(problem.rows.rows_of(name), others).any()]
        return f"in {joined(names)}", _signs(r, others), False
    for rows in groups:
        square = r[rows] ** 2
        m = np.arange(1, rows.size)
        for part, inner in (("below", np.cumsum(square)[:-1]), ("beyond", np.cumsum(square[::-1])[:-1])):
            if not m.size:
                continue
            score = (inner / m - square.mean()) * np.sqrt(m)
            i = int(np.argmax(score))
            if float(score[i]) > best:
                best = float(score[i])
                place = (rows[: i + 1] if part == "below" else rows[rows.size - i - 1 :], part)
    rows, part = place
    if rows.size == 0:
        return "in no one place", "all rows take part", False
    gamma = problem.observations.table["gamma_deg"].to_numpy(dtype=float)[rows]
    observable = problem.rows.names[problem.rows.which[rows[0]]]
    if part == "below":
        where = f"in {observable} up to {gamma.max():.3g} degrees"
    else:
        where = f"in {observable} from {gamma.min():.3g} degrees on"
    return where, _signs(r, rows), part == "below" and float(gamma.max()) < _NEAR_NORMAL


def _signs(r: Array, rows: Index) -> str:
    positive = int((r[rows] > 0.0).sum())
    side, count = ("positive", positive) if 2 * positive >= rows.size else ("negative", rows.size - positive)
    share = float((r[rows] ** 2).sum() / (r @ r))
    return f"{count} of {rows.size} residuals {side}, {100 * share:.0f} % of the sum of squares"
