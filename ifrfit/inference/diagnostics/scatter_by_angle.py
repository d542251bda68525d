"""Noises that change with the angle of incidence, whatever the reason."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ifrfit.errors import DataError
from ifrfit.inference.diagnostics.angle_error_size import AngleSlopes
from ifrfit.inference.diagnostics.growing_scatter import RANKS, UnevenScatter, by_ranks, outliers_under
from ifrfit.inference.diagnostics.quadratic_forms import Array
from ifrfit.inference.diagnostics.residuals import Residuals
from ifrfit.inference.diagnostics.rival_scatter import fall_of_outliers, log_variance
from ifrfit.inference.diagnostics.thresholds import ALIKE, FACTS, REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.result.types import Fact
from ifrfit.text import joined, p_text

_FEWEST = 16  # rows of an observable below which none is looked for
_ANGLES = 5  # different ones, likewise
_MORE = 2  # numbers that a parabola has beyond a level
_FITTED = 1e-6  # 1 - leverage below which a row is fitted exactly
_EXACT = 1e-9  # root mean square of residuals of values without errors, in sigma
_PLACES = (0.1, 0.5, 0.9)  # quantiles of the angles at which the noise is told
# by whether no sigma is given
_REMEDY = {
    True: "Rows then count by their own errors with a sigma in every row",
    False: "Rows count by their own errors with these sizes in the place of the sigma that is given",
}


@dataclass(frozen=True)
class _Found:
    name: str
    rows: Index
    variance: Array
    p: float
    drop: float
    of_series: float


def scatter_by_angle(problem: Problem, fit: LeastSquaresFit, residuals: Residuals) -> UnevenScatter | None:
    """Test the noise of each observable for a change with the angle of incidence.

    The likelihood ratio of a variance whose logarithm is a parabola of the angle against an even one, of
    residuals over the root of 1 - leverage, times the share of the degrees of freedom that are left, has
    chi2 of two of them (Harvey 1976, Econometrica 44, 461); times the number of observables. It counts where
    it takes `ALIKE` off -2 log likelihood without the row that speaks most, sizes of residuals go with the
    fitted ones by ranks, too, and single outliers, at 2 log n each, explain less: what falls out of a noise
    with heavy tails is no change with the angle.

    Returns
    -------
    UnevenScatter or None
        None where the scatter is even.
    """
    if not problem.error_model.is_plain:
        return None
    own = 1.0 - fit.gaussian.leverage
    tested = []
    for name in problem.rows.names:
        rows = problem.rows.rows_of(name)
        rows = rows[problem.rows.has_angle[rows] & (own[rows] > _FITTED)]
        if rows.size >= _FEWEST and np.unique(problem.rows.gamma_deg[rows]).size >= _ANGLES:
            tested.append(_tested(problem, name, rows, residuals.standardised, own))
    found = [one for one in tested if len(tested) * one.p < REFUTED and one.drop > ALIKE]
    if not found:
        return None
    best = min(found, key=lambda one: one.p)
    slopes = AngleSlopes.of(problem, fit.optimum.theta, fit.sigma)
    if fall_of_outliers(problem, slopes) > sum(one.drop for one in found) - ALIKE:
        return None
    sigma = fit.sigma.copy()
    for one in found:
        sigma[one.rows] *= np.sqrt(one.variance)
    try:
        others, _ = outliers_under(problem, fit, sigma)
    except DataError:
        return None
    return UnevenScatter(_fact(problem, fit, best), others)


def _tested(problem: Problem, name: str, rows: Index, z: Array, own: Array) -> _Found:
    """The variance of one observable by the angle, in that of its own mean square, and what speaks for it."""
    z = z[rows] / np.sqrt(own[rows])
    z = z / max(math.sqrt(float((z**2).mean())), _EXACT)
    angle = problem.rows.gamma_deg[rows] / 90.0
    _, variance = log_variance(z, np.empty((z.size, 0)), np.column_stack((np.ones(z.size), angle, angle**2)))
    gain = z**2 - z**2 / variance - np.log(variance)
    left = max(float(own[rows].sum()) - _MORE, 0.0) / z.size
    # chi2 of two degrees of freedom
    p = math.exp(-0.5 * left * max(float(gain.sum()), 0.0)) if by_ranks(z, variance) > RANKS else 1.0
    drop = float(gain.sum() - gain.max()) - 2.0 * _MORE
    return _Found(name, rows, variance, p, drop, _drop_of_series(z, problem.rows.series[rows]))


def _drop_of_series(z: Array, series: Index) -> float:
    """Fall of -2 log likelihood with an even noise of each series, of z whose mean square is 1."""
    _, of = np.unique(series, return_inverse=True)
    count = np.bincount(of).astype(float)
    mean = np.maximum(np.bincount(of, z**2) / count, _EXACT**2)
    return -float((count * np.log(mean)).sum()) - 2.0 * (count.size - 1.0)


def _fact(problem: Problem, fit: LeastSquaresFit, best: _Found) -> Fact:
    gamma, sigma = problem.rows.gamma_deg[best.rows], fit.sigma[best.rows]
    z = problem.residual(fit.optimum.theta)[best.rows] / sigma
    order = np.argsort(gamma)
    places = [order[round(share * (gamma.size - 1))] for share in _PLACES]
    angles = gamma[places].tolist()
    sizes = (sigma * np.sqrt(best.variance * float((z**2).mean())))[places].tolist()
    told = joined([f"{size:.2g} at {angle:.0f}" for angle, size in zip(angles, sizes, strict=True)])
    or_series = ", or from series to series" if best.of_series > best.drop - ALIKE else ""
    says = (
        f"the scatter of {best.name} changes with the angle of incidence{or_series}: {told} degrees (p = "
        f"{p_text(best.p)}; -2 log likelihood falls by {best.drop:.3g}). {_REMEDY[problem.noise.is_unknown]}"
    )
    figures = {"p": best.p, "observable": best.name, "drop": best.drop, "angles": angles, "sizes": sizes}
    return Fact(False, says, figures, FACTS["scatter_by_angle"])
