"""Does the model describe the data? Lack of fit, and where it sits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy import special

from ifrfit.errors import DataError
from ifrfit.inference.diagnostics.quadratic_forms import Array, smooth_departure
from ifrfit.inference.diagnostics.repeats import few_settings, repeated
from ifrfit.inference.diagnostics.residuals import Residuals, residuals_of
from ifrfit.inference.diagnostics.thresholds import FACTS, REFUTED
from ifrfit.inference.diagnostics.uncounted_uncertainties import remedy_of_uncounted
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import OBLIQUE, Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, fitted_constants, refit
from ifrfit.inference.result.types import Fact
from ifrfit.text import joined, p_text, times_text

_TRIALS = 12  # angles at which the near-normal impacts are cut off, to see whether that mends the fit
_COMFORTABLE = 0.05
_NEAR_NORMAL = 30.0  # degrees below which microslip is the likely reason of a misfit
SMOOTH = 3  # rows of the head or tail that a departure of the order sits in, at least
_PERCENT, _CREDIBLE = 100.0, 0.005  # factor of a sigma in percent, and tail of chi2 with which it is one
_WIDER = 2.0  # times that others scatter more over their sigma, for a series to be one of its own
_LARGE = 30.0  # factor from which a sigma is no estimate
_ELSEWHERE = 0.5  # share of the sum of squares in rows that know no angle, from which the misfit sits there


def lack_of_fit(
    problem: Problem,
    fit: LeastSquaresFit,
    residuals: Residuals,
    *,
    remedy: bool = True,
    scatter: Fact | None = None,
) -> Fact:
    """Test whether constants can describe the data.

    With known sigma by chi2; without by pure error where inputs repeat; by a smooth departure in tau, with
    the runs test beside it, where none or few do. Pure error is that of each observable and of all
    together, p times the number of tests. Where some sigma is known, also by chi2 of these rows. Where
    several tests are made the smallest p counts, times their number.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquaresFit
    residuals : Residuals
    remedy : bool
        Whether one is searched, among the impacts near the normal.
    scatter : Fact, optional
        That settings scatter by more than their repeats, which then are no yardstick: what it says of a
        smooth departure of the means takes the place of pure error.
    """
    r = residuals.standardised
    dof = r.size - round(float(fit.gaussian.leverage.sum()))
    runs = _runs(r, oblique_groups(problem))
    rule = FACTS["lack_of_fit"]
    figures: dict[str, object] = {"dof": dof, "p_runs": runs}
    tests: dict[str, float] = {}
    chi2, dof_known = chi2_of_given(problem, fit, residuals)
    if dof_known > 0:
        tests["chi2"] = float(special.chdtrc(dof_known, chi2))
    if not problem.noise.is_known:
        pure = {} if scatter is not None else _pure_error(problem, fit, r, dof)
        if scatter is not None:
            tests["smooth departure of means"] = scatter.figures["p_smooth"]
        elif pure:
            tests["pure error"] = min(1.0, len(pure) * min(pure.values()))
            figures["p_pure"] = pure
        if scatter is None and (not pure or _are_few(problem, dof)):
            smooth = _smooth(problem, fit, r, oblique_groups(problem))
            found = [x for x in (smooth, runs) if x is not None]
            tests["smooth departure"] = min(found) if found else math.nan
            figures["p_smooth"] = smooth
    test, p = _smallest(tests)
    figures |= {"test": test, "p": None if math.isnan(p) else p}
    if math.isnan(p):
        oblique = any(rows.size for rows in oblique_groups(problem))
        why = "there are too few rows" if oblique else "all rows are repeats of single values"
        return Fact(True, f"the fit is not tested: {why}", figures | {"tested": False}, rule)
    if p >= REFUTED:
        return Fact(True, f"no lack of fit (p = {p_text(p)}, {test})", figures, rule)
    # a smooth departure is none of one row, but where a common sigma tells how far off that is
    fewest = SMOOTH if problem.noise.has_unknown and test not in ("chi2", "pure error") else 1
    where, signs, near_normal = misfit(problem, r, _refuted_rows(problem, fit, residuals, figures), fewest)
    figures["where"] = where
    says = (
        f"the data contradict one set of constants (p = {p_text(p)}, {test}); "
        f"the misfit sits {where}: {signs}"
        f"{_oblique_remedy(problem, fit) if near_normal and remedy and problem.closure.bilinear else ''}"
        f"{few_settings(problem, fit, r) if test == 'pure error' and remedy else ''}"
        f"{remedy_of_uncounted(problem) if test == 'chi2' and remedy else ''}"
    )
    return Fact(False, says, figures, rule)


def chi2_of_given(problem: Problem, fit: LeastSquaresFit, residuals: Residuals) -> tuple[float, float]:
    """Sum of squares of rows with known sigma, and its degrees of freedom: their number less leverage.

    Errors that rows have in common add their own squares, as in generalised least squares.
    Where other rows share in the constants that is not quite a law of chi2, but one of smaller variance.
    """
    given = problem.noise.is_given
    square = float(residuals.standardised[given] @ residuals.standardised[given])
    leverage = float(fit.gaussian.leverage[given].sum())
    if problem.noise.is_known:
        if fit.common is not None:  # of all rows together: exactly of the law
            return square + fit.common.square, given.size - round(fitted_constants(problem, fit))
        return square, given.size - round(leverage)
    return square, max(int(given.sum()) - leverage, 0.0)


def chi2_by_observable(
    problem: Problem, fit: LeastSquaresFit, residuals: Residuals
) -> dict[str, tuple[float, float]]:
    """Sum of squares and degrees of freedom of rows with known sigma, by observable; of those with one."""
    every = {name: problem.rows.rows_of(name) for name in problem.rows.names}
    return _chi2_of_each(problem, fit, residuals, every)


def _chi2_of_each(
    problem: Problem, fit: LeastSquaresFit, residuals: Residuals, every: Mapping[str, Index]
) -> dict[str, tuple[float, float]]:
    """Sum of squares and degrees of freedom of rows with known sigma, by name; of those with one."""
    found = {}
    for name, own in every.items():
        rows = own[problem.noise.is_given[own]]
        square = float(residuals.standardised[rows] @ residuals.standardised[rows])
        dof = rows.size - float(fit.gaussian.leverage[rows].sum())
        if dof >= 1.0:
            found[name] = square, dof
    return found


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
    """Whether rows scatter less than their sigma says: chi2 from below; None where they do not.

    Of all rows, of each observable, and of each of several series, where the others scatter more; p
    times the number of tests. `advise` says whether to take sigma from
    the scatter: where errors are alike that would be too small.
    """
    chi2, dof = chi2_of_given(problem, fit, residuals)
    each = chi2_by_observable(problem, fit, residuals)
    if dof < 1 or not each:
        return None
    groups = problem.groups() if len(problem.series) > 1 else {}
    of_series = _chi2_of_each(problem, fit, residuals, groups)
    tests = len(of_series) + (1 if len(problem.rows.names) == 1 else len(each) + 1)
    narrow_series = _narrow_alone(of_series, tests)
    alone = {name: min(1.0, tests * float(special.chdtr(dof, chi2))) for name, (chi2, dof) in each.items()}
    p = min([1.0, tests * float(special.chdtr(dof, chi2)), *alone.values(), *narrow_series.values()])
    if p >= REFUTED:
        return None
    narrow = [name for name in each if alone[name] < REFUTED]
    which, remedy = "the values", "--noise scaled"
    if problem.noise.is_mixed:
        which, remedy = "values whose sigma is given", "--noise unknown"
    if 0 < len(narrow) < len(each):
        which, remedy = f"the values of {joined(narrow)}", "--noise unknown"
        chi2, dof = np.sum([each[name] for name in narrow], axis=0).tolist()
    of = [problem.rows.names.index(name) for name in narrow or each]
    rows = np.flatnonzero(problem.noise.is_given & np.isin(problem.rows.which, of))
    if narrow_series and {*narrow_series} != {s for s in of_series if s.rpartition("/")[2] in narrow}:
        rows = np.concatenate([groups[name][problem.noise.is_given[groups[name]]] for name in narrow_series])
        names = [f"{name.rpartition('/')[2]} in {name.rpartition('/')[0]}" for name in narrow_series]
        which, remedy = f"the values of {joined(names)}", "--noise unknown"
        chi2, dof = np.sum([of_series[name] for name in narrow_series], axis=0).tolist()
    factor = math.sqrt(dof / max(chi2, 1e-300))
    figures = {"p": p, "chi2": chi2, "dof": dof, "factor": factor, "observables": narrow or list(each)}
    why = _too_large(problem, rows, residuals.standardised[rows], dof, factor)
    says = (
        f"{which} scatter {times_text(factor)} times less than their sigma (chi2 = {chi2:.3g} for "
        f"{dof:.0f} degrees of freedom, p = {p_text(p)}): {why}"
        f"{f'; {remedy} takes its size from the scatter' if advise else ''}"
    )
    return Fact(False, says, figures, FACTS["scatter_too_small"])


def _narrow_alone(groups: Mapping[str, tuple[float, float]], tests: int) -> dict[str, float]:
    """p from below, by series and observable, of those that scatter too little, the rest twice as much."""
    p = {name: min(1.0, tests * float(special.chdtr(dof, chi2))) for name, (chi2, dof) in groups.items()}
    narrow = {name: one for name, one in p.items() if one < REFUTED}
    if len(narrow) in (0, len(groups)):
        return {}
    chi2, dof = np.sum([groups[name] for name in narrow], axis=0)
    rest, rest_dof = np.sum([pair for name, pair in groups.items() if name not in narrow], axis=0)
    return narrow if rest / rest_dof > _WIDER**2 * chi2 / dof else {}


def _too_large(problem: Problem, rows: Index, r: Array, dof: float, factor: float) -> str:
    """What such a sigma of some rows, (m,), may be, by their standardised residuals, (m,)."""

    def fits(divisor: Array) -> bool:
        p = float(special.chdtr(dof, ((r * divisor) ** 2).sum()))
        return min(p, 1.0 - p) > _CREDIBLE

    count = problem.observations.table["n_repeats"].to_numpy(dtype=float)[rows]
    if (count > 1.0).any() and fits(np.sqrt(count)):
        return (
            "sigma looks as if it were that of one of the n readings of each row: divide it by the root of n"
        )
    if fits(np.full(r.size, _PERCENT)) and 0.5 < factor / _PERCENT < 2.0:
        return "sigma looks as if it were in percent: divide it by 100"
    of_value = ", as one in percent of each value would be" if factor > _LARGE else ""
    return f"sigma is too large{of_value}, or is no standard uncertainty of one reading"


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


def _pure_error(problem: Problem, fit: LeastSquaresFit, r: Array, dof: int) -> dict[str, float]:
    """p of F tests against the scatter of repeats, of all rows and of each observable; empty without repeats.

    Alone an observable has constants of its own: together, others dilute what is wrong in one.
    """
    group = problem.rows.repeated
    count = np.bincount(group)
    mean = np.bincount(group, r) / count
    pure = float(((r - mean[group]) ** 2).sum())
    dof_pure = r.size - count.size
    dof_lack = dof - dof_pure
    if dof_pure < 3 or dof_lack < 1 or pure <= 0.0:
        return {}
    f = max(float(r @ r) - pure, 0.0) / dof_lack / (pure / dof_pure)
    found = {"all": float(special.fdtrc(dof_lack, dof_pure, f))}
    for each in repeated(problem, fit, r):
        found |= each.tests
    return found


def _are_few(problem: Problem, dof: int) -> bool:
    """Whether repeats have fewer degrees of freedom than what they are to judge."""
    dof_pure = len(problem.rows) - int(problem.rows.repeated.max()) - 1
    return 2 * dof_pure < dof


def oblique_groups(problem: Problem) -> list[Index]:
    """Rows of each observable that depends on the regime, sorted by tau."""
    rows = (problem.rows.rows_of(each.name) for each in problem.rows.observables if each.kind in OBLIQUE)
    return [own[np.argsort(problem.rows.tau[own], kind="stable")] for own in rows]


def _smooth(problem: Problem, fit: LeastSquaresFit, r: Array, groups: Sequence[Index]) -> float | None:
    """p of a smooth departure of some rows in tau beyond the model's own directions."""
    jacobian = problem.free_jacobian(fit.optimum.theta) / fit.sigma[:, None]
    found = smooth_departure(groups, problem.rows.tau, jacobian, r)
    return None if found is None else found.p


def _runs(r: Array, groups: Sequence[Index]) -> float | None:
    """Wald-Wolfowitz runs test of the residuals' signs along tau, pooled over observables; two-sided p.

    Where an observable has residuals of one sign alone, of which that test says nothing, p of so many tosses
    of a coin takes its place.
    """
    runs = expected = variance = 0.0
    alike = 1.0
    for rows in groups:
        positive = r[rows] > 0.0
        n1, n2 = float(positive.sum()), float((~positive).sum())
        n = n1 + n2
        if n1 < 2 or n2 < 2:
            if n > 1 and min(n1, n2) == 0.0:
                alike = min(alike, len(groups) * 2.0 ** (1.0 - n))
            continue
        runs += 1.0 + float((positive[1:] != positive[:-1]).sum())
        expected += 1.0 + 2.0 * n1 * n2 / n
        variance += 2.0 * n1 * n2 * (2.0 * n1 * n2 - n) / (n * n * (n - 1.0))
    if variance < 2.0:
        return alike if alike < REFUTED else None
    z = max(abs(runs - expected) - 0.5, 0.0) / math.sqrt(variance)
    return min(alike, float(2.0 * special.ndtr(-z)))


def _refuted_rows(
    problem: Problem, fit: LeastSquaresFit, residuals: Residuals, figures: Mapping[str, Any]
) -> Index:
    """Rows of which the failed test speaks: those with sigma, or of the observable with the smallest p.

    Where sigma of all is known, be it up to a factor, their squares compare, and these are all rows.
    """
    if not problem.noise.has_unknown:
        return np.arange(len(problem.rows))
    if figures["test"] == "chi2":
        return np.flatnonzero(problem.noise.is_given)
    pure = {name: p for name, p in figures.get("p_pure", {}).items() if name != "all"}
    if not pure or figures["test"] != "pure error":
        return most_orderly(problem, residuals.standardised, fit)
    return problem.rows.rows_of(min(pure, key=lambda name: pure[name]).removeprefix("angles of "))


def most_orderly(problem: Problem, r: Array, fit: LeastSquaresFit | None = None) -> Index:
    """Rows of the observable whose residuals say most, by the runs of its signs and a smooth departure.

    Of several unknown noises each takes the size of its own residuals, so that the sum of squares of an
    observable says nothing of the law.

    Parameters
    ----------
    problem : Problem
    r : ndarray, (n,)
        Standardised residuals.
    fit : LeastSquaresFit, optional
        Whose residuals they are; without it runs alone are looked at.
    """
    found: list[tuple[float, Index]] = []
    for rows in oblique_groups(problem):
        smooth = None if fit is None else _smooth(problem, fit, r, [rows])
        tests = [p for p in (smooth, _runs(r, [rows])) if p is not None]
        found.append((min(tests, default=1.0), rows))
    return min(found, key=lambda each: each[0], default=(1.0, np.arange(r.size)))[1]


def misfit(problem: Problem, r: Array, within: Index, fewest: int = 1) -> tuple[str, str, bool]:
    """Where the excess of squares sits: the head or tail along tau that stands out most, or readings of e_n.

    Parameters
    ----------
    problem : Problem
    r : ndarray, (n,)
        Standardised residuals.
    within : ndarray of int
        Rows among which it is looked for.
    fewest : int
        Rows of a head or tail.

    Returns
    -------
    where, signs : str
    near_normal : bool
        Whether it sits at the impacts nearest to the normal.
    """
    best, place = -math.inf, (np.empty(0, dtype=np.intp), "")
    groups = [rows[np.isin(rows, within)] for rows in oblique_groups(problem)]
    others = np.setdiff1d(within, np.concatenate([np.empty(0, dtype=np.intp), *groups]))
    if others.size and float(r[others] @ r[others]) > _ELSEWHERE * float(r[within] @ r[within]):
        names = [name for name in problem.rows.names if np.isin(problem.rows.rows_of(name), others).any()]
        return f"in {joined(names)}", _signs(problem, r, others, within), False
    for rows in groups:
        square = r[rows] ** 2
        m = np.arange(fewest, rows.size)
        for part, inner in (("below", np.cumsum(square)[:-1]), ("beyond", np.cumsum(square[::-1])[:-1])):
            if not m.size:
                continue
            score = (inner[fewest - 1 :] / m - square.mean()) * np.sqrt(m)
            i = int(np.argmax(score)) + fewest - 1
            if float(score.max()) > best:
                best = float(score.max())
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
    return where, _signs(problem, r, rows, within), part == "below" and float(gamma.max()) < _NEAR_NORMAL


def _signs(problem: Problem, r: Array, rows: Index, within: Index) -> str:
    positive = int((r[rows] > 0.0).sum())
    side, count = ("positive", positive) if 2 * positive >= rows.size else ("negative", rows.size - positive)
    says = f"{count} of {rows.size} residuals {side}"
    if rows.size == within.size < r.size:  # all of its own sum of squares
        return says
    share = float((r[rows] ** 2).sum() / (r[within] @ r[within]))
    names = [name for name in problem.rows.names if np.isin(problem.rows.rows_of(name), within).any()]
    whole = "" if len(names) == len(problem.rows.names) else f" of {joined(names)}"
    return f"{says}, {100 * share:.0f} % of the sum of squares{whole}"
