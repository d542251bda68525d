"""Do the values scatter more than their sigma says, evenly? Then sigma is doubted before the law."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from ifrfit.errors import DataError
from ifrfit.inference.diagnostics.lack_of_fit import chi2_of_given, lack_of_fit
from ifrfit.inference.diagnostics.residuals import Residuals, outliers, residuals_of
from ifrfit.inference.diagnostics.scatter_by_angle import scatter_by_angle
from ifrfit.inference.diagnostics.thresholds import FACTS, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares
from ifrfit.inference.result.types import Fact
from ifrfit.text import joined, p_text

_EVEN = 0.05  # p of a lack of fit at the noise of the scatter, from which nothing speaks against the law
_EXPLAINED = 0.01  # p of chi2 that a slip or an effect leaves, from which it is the reason
_BULK = 0.6  # spread of the median residual over that of all: below, a few large ones make it
_MEDIAN = float(special.ndtri(0.75))  # of the absolute value of a standard normal number
_FEWEST = 8  # degrees of freedom with which a departure of the law would have shown


@dataclass(frozen=True)
class Rescattered:
    """What is said of a sigma that is too small, and the question and fit at the noise of the scatter."""

    fact: Fact
    problem: Problem
    fit: LeastSquaresFit
    residuals: Residuals


def scatter_too_large(
    problem: Problem, fit: LeastSquaresFit, residuals: Residuals, found: Mapping[str, Fact]
) -> Rescattered | None:
    """Whether a known sigma alone contradicts the fit: at the noise of the scatter nothing else does.

    The mirror of `scatter_too_small`. chi2 refutes the fit, no slip or effect explains it, and with the noise
    taken from the scatter (a common factor; one for each observable, where the sigma of some are right)
    there is no lack of fit (p >= 0.05) and no outlier, and the middle half of the residuals is as wide as the
    rest (to a factor of 0.6); or a noise that changes with the angle leaves no outlier.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquaresFit
    residuals : Residuals
    found : mapping of str to Fact
        What the residuals say at the sigma as given.

    Returns
    -------
    Rescattered or None
        None where sigma is not known, or something else may be the reason.
    """
    lack = found.get("lack_of_fit")
    if not (problem.noise.is_known and problem.error_model.is_plain) or lack is None or lack.ok:
        return None
    chi2, dof = chi2_of_given(problem, fit, residuals)
    if dof < _FEWEST or _is_explained(found, chi2, dof):
        return None
    wide = _too_wide(problem, fit, residuals)
    of_all = len(wide) == len(problem.rows.names)
    scattered = problem.with_noise(replace(problem.noise, policy="scaled" if of_all else "unknown"))
    try:
        again = least_squares(scattered)
    except DataError:  # too few rows to tell their noise
        return None
    left = residuals_of(scattered, again)
    p = lack_of_fit(scattered, again, left, remedy=False).figures["p"]
    if p is None or p < _EVEN or not _are_of_one_kind(scattered, again, left):
        return None
    factor = math.sqrt(sum(each[0] for each in wide.values()) / sum(each[1] for each in wide.values()))
    which = "the values" if of_all else f"the values of {joined(list(wide))}"
    says = (
        f"{which} scatter {factor:.2g} times more than their sigma, without a trend "
        f"(chi2 = {chi2:.3g} for {dof:.0f} degrees of freedom, p = {p_text(lack.figures['p'])}; trend: "
        f"p = {p_text(p)}): sigma is too small, or something scatters that it leaves out; --noise "
        f"{scattered.noise.policy} takes its size from the scatter"
    )
    figures = {"p": lack.figures["p"], "chi2": chi2, "dof": dof, "factor": factor, "p_trend": p}
    return Rescattered(Fact(False, says, figures, FACTS["scatter_too_large"]), scattered, again, left)


def _are_of_one_kind(problem: Problem, fit: LeastSquaresFit, residuals: Residuals) -> bool:
    """Whether no rows are apart from the others: at an even noise, or at one that changes with the angle."""
    if outliers(problem, fit, residuals).ok and _is_even(residuals):
        return True
    uneven = scatter_by_angle(problem, fit, residuals)
    return uneven is not None and uneven.outliers.ok


def _is_even(residuals: Residuals) -> bool:
    """Whether the middle of the residuals is as wide as all of them: several outliers hide one another."""
    return float(np.median(np.abs(residuals.studentised))) / _MEDIAN >= _BULK


def _is_explained(found: Mapping[str, Fact], chi2: float, dof: float) -> bool:
    """Whether a slip or an effect that is named leaves no more scatter than sigma allows."""
    drops = [
        test["drop"]
        for name in ("slips", "effects")
        if name in found and not found[name].ok
        for called, test in found[name].figures.get("tests", {}).items()
        if called in found[name].figures["called"] and test.get("drop") is not None
    ]
    return any(float(special.chdtrc(dof - 1.0, max(chi2 - drop, 0.0))) >= _EXPLAINED for drop in drops)


def _too_wide(problem: Problem, fit: LeastSquaresFit, residuals: Residuals) -> dict[str, tuple[float, float]]:
    """Sum of squares and degrees of freedom of the observables refuted alone; of all, if none is."""
    each = {}
    for name in problem.rows.names:
        rows = problem.rows.rows_of(name)
        square = float(residuals.standardised[rows] @ residuals.standardised[rows])
        each[name] = square, max(rows.size - float(fit.gaussian.leverage[rows].sum()), 1e-3)
    wide = {name: one for name, one in each.items() if special.chdtrc(one[1], one[0]) < REFUTED}
    return wide or each
