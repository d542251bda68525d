"""What else makes residuals scatter as errors of the angles do, by the fall of -2 log likelihood.

But for that of outliers each fall is that without the row that speaks most.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ifrfit.inference.diagnostics.angle_error_size import AngleSlopes, deviance_of, fitted_errors
from ifrfit.inference.diagnostics.quadratic_forms import orthonormal
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit

_PARAMETER = 2.0  # of -2 log likelihood, for each that a rival has more
_MOST = 0.25  # share of the rows that may be outliers
_AT_ONCE = 40
_ROUNDS = 20  # of scoring
_FITTED = 1e-6  # what is left of a row below which it is fitted exactly


def drop_of_even(problem: Problem, slopes: AngleSlopes) -> float:
    """With another noise of each observable, as where a sigma is too small."""
    groups = _groups(problem)
    gain = _before(problem, slopes) - deviance_of(slopes, groups)
    more = len(groups) - len(problem.noise_groups()) - 1
    return float(gain.sum() - gain.max()) - _PARAMETER * max(more, 0)


def drop_of_level(problem: Problem, slopes: AngleSlopes, sigma: Array) -> tuple[float, float]:
    """With errors of one size in each observable, whatever the given sigma, (n,), in which the slopes are.

    Returns
    -------
    fall, drop : float
        With and without the row that speaks most.
    """
    groups = _groups(problem)
    own = np.stack([np.isin(np.arange(sigma.size), rows) for rows in groups], axis=1).astype(float)
    start = own @ [math.log(float((sigma[rows] ** 2).mean())) for rows in groups]
    unit = sigma * np.exp(-0.5 * start)
    left, variance = log_variance(slopes.left * unit, slopes.by_constant * unit[:, None], own)
    gain = _before(problem, slopes) - slopes.by_impact(left**2 / variance + np.log(variance / unit**2))
    fall = float(gain.sum()) - _PARAMETER * (len(groups) - len(problem.noise_groups()))
    return fall, fall - float(gain.max())


def drop_of_growth(problem: Problem, fit: LeastSquaresFit, slopes: AngleSlopes) -> float:
    """With an error in proportion to the value, of a size for each observable, beside its noise."""
    rows = np.arange(len(problem.rows))
    values = replace(slopes, along=problem.predict(fit.optimum.theta) / fit.sigma, impacts=rows)
    groups = _groups(problem)
    grown = fitted_errors(values, _before(problem, values), groups, problem.rows.which).drop
    more = len(problem.rows.names) - 1 + len(groups) - len(problem.noise_groups())
    return grown - _PARAMETER * more


def drop_of_angle(problem: Problem, slopes: AngleSlopes) -> float:
    """With a noise of each observable whose logarithm is a parabola of the angle of incidence."""
    groups = _groups(problem)
    angle = np.where(problem.rows.has_angle, np.nan_to_num(problem.rows.gamma_deg), 0.0) / 90.0
    own = np.stack([np.isin(np.arange(angle.size), rows) for rows in groups], axis=1).astype(float)
    columns = np.column_stack((own, angle, angle**2))
    left, variance = log_variance(slopes.left, slopes.by_constant, columns)
    gain = _before(problem, slopes) - slopes.by_impact(left**2 / variance + np.log(variance))
    more = 1 + len(groups) - len(problem.noise_groups())
    return float(gain.sum() - gain.max()) - _PARAMETER * more


def log_variance(residual: Array, by_constant: Array, columns: Array) -> tuple[Array, Array]:
    """Residuals and their variance whose logarithm is linear in some columns, at the largest likelihood.

    A regression of squared residuals on their expectation, by Fisher scoring; constants by weighted squares.

    Parameters
    ----------
    residual : ndarray, (n,)
    by_constant : ndarray, (n, k)
        Slopes in the constants that are fitted beside.
    columns : ndarray, (n, m)
    """
    of = np.zeros(columns.shape[1])
    left, variance = residual, np.ones(residual.size)
    for _ in range(_ROUNDS):
        step = np.linalg.lstsq(columns, left**2 / variance - 1.0, rcond=None)[0]
        of = of + step / max(1.0, float(np.abs(columns @ step).max()))
        variance = np.exp(columns @ of)
        if by_constant.size:
            root = 1.0 / np.sqrt(variance)
            constants = np.linalg.lstsq(by_constant * root[:, None], residual * root, rcond=_FITTED)[0]
            left = residual - by_constant @ constants
    return left, variance


def fall_of_outliers(problem: Problem, slopes: AngleSlopes) -> float:
    """With some rows off by numbers of their own, each at the cost of its choice among all rows, 2 log n.

    The row that speaks most is left out in turn, as far as that pays in the end.
    """
    basis = orthonormal(slopes.by_constant)
    left = slopes.left - basis @ (basis.T @ slopes.left)
    own = 1.0 - (basis**2).sum(axis=1)  # of each row, what the constants and the numbers so far leave it
    unknown = tuple(problem.noise_groups().values())
    best, fall = 0.0, 0.0
    for _ in range(min(int(_MOST * left.size), _AT_ONCE)):
        gain = np.where(own > _FITTED, left**2 / np.maximum(own, _FITTED), 0.0)
        for rows in unknown:
            square = max(float((left[rows] ** 2).sum()), 1e-300)
            gain[rows] = -rows.size * np.log(np.maximum(1.0 - gain[rows] / square, _FITTED))
        row = int(np.argmax(gain))
        if own[row] <= _FITTED:
            break
        fall += float(gain[row]) - 2.0 * math.log(left.size)
        best = max(best, fall)
        column = -basis @ basis[row]
        column[row] += 1.0
        column /= math.sqrt(float(own[row]))
        left = left - column * float(column @ left)
        own = own - column**2
        basis = np.column_stack((basis, column))
    return best


def _before(problem: Problem, slopes: AngleSlopes) -> Array:
    return deviance_of(slopes, tuple(problem.noise_groups().values()))


def _groups(problem: Problem) -> tuple[Index, ...]:
    """Rows that share a noise where that of no row is known."""
    given = problem.noise.is_given
    found = list(problem.noise_groups().values())
    for name in problem.rows.names:
        rows = problem.rows.rows_of(name)
        found.append(rows[given[rows]])
    return tuple(rows for rows in found if rows.size)
