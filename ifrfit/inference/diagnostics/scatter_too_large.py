"""Do the values scatter more than their sigma says, evenly? Then sigma is doubted before the law."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from ifrfit.errors import DataError
from ifrfit.inference.diagnostics.angle_error_size import AngleSlopes
from ifrfit.inference.diagnostics.independence import independence
from ifrfit.inference.diagnostics.lack_of_fit import chi2_by_observable, chi2_of_given, lack_of_fit
from ifrfit.inference.diagnostics.normal_restitution import OF_SPEEDS, hides_speeds
from ifrfit.inference.diagnostics.residuals import Residuals, are_all_that_misfits, outliers, residuals_of
from ifrfit.inference.diagnostics.rival_scatter import drop_of_even, drop_of_level
from ifrfit.inference.diagnostics.scatter_by_angle import scatter_by_angle
from ifrfit.inference.diagnostics.thresholds import ALIKE, FACTS, REFUTED
from ifrfit.inference.diagnostics.uncounted_uncertainties import remedy_of_uncounted
from ifrfit.inference.model.noise import NoiseModel
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, refit
from ifrfit.inference.result.types import Fact
from ifrfit.text import joined, p_text, times_text

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

    The mirror of `scatter_too_small`, also where only some rows have a sigma. chi2 refutes the fit, no slip
    or effect explains it, and with the noise taken from the scatter (a common factor; one for each
    observable, where the sigma of some are right) there is no lack of fit (p >= 0.05), neighbours are not
    alike and there is no outlier, and the middle half of the residuals is as wide as the rest (to a factor of
    0.6); or a noise that changes with the angle leaves no outlier, and is told by a fact of its own. Where
    errors of one size take `ALIKE` more off -2 log likelihood than a factor on sigma, they are taken; else a
    few outliers without which chi2 is as it should be are told in its place.

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
        None where no sigma is known, or something else may be the reason.
    """
    lack = found.get("lack_of_fit")
    plain = problem.noise.is_given.any() and problem.error_model.is_plain
    if not plain or lack is None or "unrelated_readings" in found:
        return None
    chi2, dof = chi2_of_given(problem, fit, residuals)
    each = chi2_by_observable(problem, fit, residuals)
    p_each = {name: float(special.chdtrc(dof, square)) for name, (square, dof) in each.items()}
    refuted = not lack.ok or (len(each) + 1) * min(p_each.values(), default=1.0) < REFUTED
    if not refuted or dof < _FEWEST or not each:
        return None
    wide = [name for name in each if p_each[name] < REFUTED] or list(each)
    of_all = len(wide) == len(each)
    slopes = AngleSlopes.of(problem, fit.optimum.theta, fit.sigma)
    fall, drop = drop_of_level(problem, slopes, fit.sigma)
    is_level = drop > drop_of_even(problem, slopes) + ALIKE
    if _is_explained(found, chi2, dof, fall if is_level else 0.0):
        return None
    if not is_level and are_all_that_misfits(found.get("outliers")):
        return None
    squares, own_dof = np.sum([each[name] for name in wide], axis=0).tolist()
    factor = math.sqrt(squares / own_dof)
    places = [problem.rows.names.index(name) for name in wide]
    times = np.where(np.isin(problem.rows.which, places), factor, 1.0)
    scattered = problem.with_noise(_noise_of_scatter(problem, times, of_all=of_all, level=is_level))
    try:
        again = refit(scattered, fit.sigma * times)
    except DataError:  # too few rows to tell their noise
        return None
    left = residuals_of(scattered, again)
    p = lack_of_fit(scattered, again, left, remedy=False).figures["p"]
    if p is None or p < _EVEN or independence(scattered, again, left, explained=False) is not None:
        return None
    uneven = scatter_by_angle(scattered, again, left)
    # no rows are to be apart from the others, at an even noise or one that changes with the angle
    if not (outliers(scattered, again, left).ok and _is_even(left)) and not (uneven and uneven.outliers.ok):
        return None
    p_chi2 = min(lack.figures["p"], *p_each.values())
    which = "the values" if of_all and problem.noise.is_known else f"the values of {joined(wide)}"
    why, remedy = "sigma is too small, or something scatters that it leaves out", ""
    if is_level:
        why = (
            "errors of one size, whatever the angle or the value, describe them better than sigma does (-2 "
            f"log likelihood falls by {drop:.3g})"
        )
    elif set(wide) <= {"e_n", "v_n"} and hides_speeds(problem):
        why = f"sigma is too small, or impacts differ in speed, which no column holds: {OF_SPEEDS}"
    if uneven is None:
        anew = ", and looks for errors of the angles anew" if is_level else ""
        by_hand = f" multiply it by {factor:.2g}, or" if scattered.noise.is_mixed else ""
        policy = "unknown" if scattered.noise.is_mixed else scattered.noise.policy
        remedy = f";{by_hand} --noise {policy} takes its size from the scatter{anew}"
    says = (
        f"{which} scatter {times_text(factor)} times more than their sigma, without a trend (chi2 = "
        f"{squares:.3g} for {own_dof:.0f} degrees of freedom, p = {p_text(p_chi2)}; trend: p = {p_text(p)}): "
        f"{why}{remedy_of_uncounted(problem)}{remedy}"
    )
    figures = {"p": p_chi2, "chi2": squares, "dof": own_dof, "factor": factor, "p_trend": p}
    return Rescattered(Fact(False, says, figures, FACTS["scatter_too_large"]), scattered, again, left)


def _noise_of_scatter(problem: Problem, times: Array, *, of_all: bool, level: bool) -> NoiseModel:
    """The noise with its size from the scatter; beside rows without a sigma the given one times a factor."""
    noise = problem.noise
    if level or noise.is_known:
        return replace(noise, policy="scaled" if of_all and not level else "unknown")
    return replace(noise, sigma=noise.sigma * times)


def _is_even(residuals: Residuals) -> bool:
    """Whether the middle of the residuals is as wide as all of them: several outliers hide one another."""
    return float(np.median(np.abs(residuals.studentised))) / _MEDIAN >= _BULK


def _is_explained(found: Mapping[str, Fact], chi2: float, dof: float, by_level: float) -> bool:
    """Whether a slip or an effect that is named leaves no more scatter than sigma allows.

    And no errors of one size take as much off -2 log likelihood.
    """
    drops = [
        test["drop"]
        for name in ("slips", "effects")
        if name in found and not found[name].ok
        for called, test in found[name].figures.get("tests", {}).items()
        if called in found[name].figures["called"] and test.get("drop") is not None
    ]
    left = [chi2 - drop for drop in drops if drop > by_level]
    return any(float(special.chdtrc(dof - 1.0, max(each, 0.0))) >= _EXPLAINED for each in left)
