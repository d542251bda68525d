"""Does the scatter of a ratio grow as its denominator falls? Errors of the velocities behind it do that."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from ifrfit.errors import DataError
from ifrfit.inference.diagnostics.quadratic_forms import Array, orthonormal, ratio_exceeds
from ifrfit.inference.diagnostics.residuals import Residuals, outliers, residuals_of
from ifrfit.inference.diagnostics.thresholds import ALIKE, FACTS, REFUTED
from ifrfit.inference.model.noise import NoiseModel
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, refit
from ifrfit.inference.result.types import Fact
from ifrfit.physics.observable import Observable
from ifrfit.text import p_text

_FEWEST = 12  # rows of an observable below which none is looked for
_SUSPECT = 2.0  # standard deviations from which the exact p value is worked out
_EXACT = 600  # rows beyond which the normal approximation is exact enough
RANKS = 2.33  # standard deviations of the rank correlation of sizes of residuals: not a few far rows alone
_LEAST = 2.0  # factor between the ends, below which it does not matter
_OPTIONS = {"velocity": "--sigma-velocity", "spin": "--sigma-spin"}


@dataclass(frozen=True)
class UnevenScatter:
    """A finding, and the outliers under a noise that grows so.

    Attributes
    ----------
    fact : Fact
    outliers : Fact
    """

    fact: Fact
    outliers: Fact


@dataclass(frozen=True)
class _Found:
    observable: Observable
    rows: Index
    amplification: Array
    p: float
    drop: float


def growing_scatter(problem: Problem, fit: LeastSquaresFit, residuals: Residuals) -> UnevenScatter | None:
    """Test unknown noises for a growth as one over the denominator of their observable.

    The score test of a power of that amplification in the variance: the sum of squared residuals times its
    logarithm, over their sum, exact at any number of constants for normal errors (Cook & Weisberg 1983,
    Biometrika 70, 1); also without the row that speaks most, and times the number of observables. It counts
    where sizes of residuals also go with the amplification by ranks, and where errors of velocities alone,
    whose power is 1, take more than `ALIKE` off -2 log likelihood.

    Returns
    -------
    UnevenScatter or None
        None where the scatter is even.
    """
    if problem.noise.is_known or problem.noise.is_scaled or not problem.error_model.is_plain:
        return None
    jacobian = problem.free_jacobian(fit.optimum.theta) / fit.sigma[:, None]
    own = orthonormal(jacobian)
    z = residuals.standardised - own @ (own.T @ residuals.standardised)
    tested = []
    for observable, rows, incidence in problem.rows.by_observable:
        if observable.numerator is None or observable.divided_by is None or observable.unit == "deg":
            continue
        if rows.size < _FEWEST or problem.noise.is_given[rows].any():
            continue
        amplification = 1.0 / np.maximum(np.abs(observable.divided_by(incidence)), 1e-9)
        if amplification.max() < _LEAST * amplification.min():
            continue
        p, drop = _tests(amplification, own[rows], z[rows])
        tested.append(_Found(observable, rows, amplification, p, drop))
    found = [replace(one, p=len(tested) * one.p) for one in tested]
    found = [one for one in found if one.p < REFUTED and one.drop > ALIKE]
    if not found:
        return None
    best = min(found, key=lambda one: one.p)
    try:
        others, weighted = outliers_under(problem, fit, _grown_sigma(problem, fit, found))
    except DataError:
        return None
    size = float((weighted.sigma[best.rows] / best.amplification)[0])
    return UnevenScatter(_fact(problem, best, size), others)


def _tests(amplification: Array, basis: Array, z: Array) -> tuple[float, float]:
    """p of a scatter that grows, and the fall of -2 log likelihood where it does so in proportion."""
    lean = 2.0 * np.log(amplification)
    drop = z.size * math.log(float((z**2).mean()) / float(((z / amplification) ** 2).mean()))
    drop -= float(lean.sum())
    if by_ranks(z, amplification) < RANKS:
        return 1.0, drop
    share = (lean - lean.mean()) * z**2
    kept = np.arange(z.size) != int(np.argmax(share))
    return max(_p(lean, basis, z), _p(lean[kept], basis[kept], z[kept])), drop


def by_ranks(z: Array, expected: Array) -> float:
    """Standard deviations of the correlation of the ranks of sizes and of what is expected of them."""
    sizes, ranks = (np.argsort(np.argsort(x)).astype(float) for x in (np.abs(z), expected))
    return float(np.corrcoef(sizes, ranks)[0, 1]) * math.sqrt(z.size - 1.0)


def _p(lean: Array, basis: Array, z: Array) -> float:
    lean = lean - lean.mean()
    found = float(lean @ z**2) / float(z @ z)
    normal = found * z.size / math.sqrt(2.0 * float(lean @ lean))
    if normal < _SUSPECT:
        return 1.0
    return float(special.ndtr(-normal)) if z.size > _EXACT else ratio_exceeds(np.diag(lean), found, basis)


def outliers_under(problem: Problem, fit: LeastSquaresFit, sigma: Array) -> tuple[Fact, LeastSquaresFit]:
    """Outliers of a fit whose noise is in proportion to some sigma, (n,), and that fit."""
    grown = problem.with_noise(NoiseModel("scaled", sigma))
    weighted = refit(grown, sigma, fit.optimum.theta)
    return outliers(grown, weighted, residuals_of(grown, weighted)), weighted


def _grown_sigma(problem: Problem, fit: LeastSquaresFit, found: list[_Found]) -> Array:
    sigma = fit.sigma.copy()
    left = problem.residual(fit.optimum.theta)
    for one in found:
        square = float(((left[one.rows] / one.amplification) ** 2).mean())
        sigma[one.rows] = one.amplification * math.sqrt(square)
    return sigma


def _fact(problem: Problem, best: _Found, size: float) -> Fact:
    name, numerator = best.observable.name, best.observable.numerator
    gamma = problem.rows.gamma_deg[best.rows]
    end = (
        "normal" if gamma[np.argmax(best.amplification)] < gamma[np.argmin(best.amplification)] else "grazing"
    )
    factor = float(best.amplification.max() / best.amplification.min())
    if numerator == "contact":
        options = f"--sigma-velocity and --sigma-spin, together some {size:.2g} of the incoming speed"
    else:
        options = f"{_OPTIONS[str(numerator)]} {size:.2g}"
    says = (
        f"the scatter of {name} grows towards {end} incidence (p = {p_text(best.p)}), as where velocities "
        f"have errors of one size: by a factor of {factor:.2g} over these angles. Rows then count by "
        f"their own errors with {options}, or with a sigma in every row"
    )
    figures = {"p": best.p, "observable": name, "drop": best.drop, "factor": factor, "size": size}
    return Fact(False, says, figures, FACTS["growing_scatter"])
