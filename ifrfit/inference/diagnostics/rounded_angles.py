"""Angles that were rounded: each may have been any within a step, over which its likelihood is integrated."""

from __future__ import annotations

import numpy as np

from ifrfit.inference.diagnostics.angle_error_size import AngleSlopes, FittedErrors
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit

_STEPS = (10.0, 5.0, 2.0, 1.0)  # degrees, in which angles are rounded
_FEWEST = 4  # different angles
_PLACES = 21  # in a step
_ROUNDS = 12
_HOPELESS = -60.0  # fall of -2 log likelihood at the constants of exact angles
_AT_REST = 1e-2
_DIFFERENCE = 1e-6
_LOOSE = 1e-6


def step_of_angles(problem: Problem) -> float:
    """The largest of the usual steps that all angles are multiples of; 0 where they are of none."""
    gamma = np.unique(problem.rows.gamma_deg[problem.rows.has_angle])
    if gamma.size < _FEWEST:
        return 0.0
    return next((step for step in _STEPS if np.array_equal(np.round(gamma / step) * step, gamma)), 0.0)


def rounding_errors(
    problem: Problem, fit: LeastSquaresFit, slopes: AngleSlopes, before: Array, unknown: tuple[Index, ...]
) -> tuple[FittedErrors, Array] | None:
    """Errors of angles that were rounded: even within a step, so that nothing but noises is fitted of them.

    The likelihood of an impact is its mean over the step, so that kinks of the law count; constants and
    noises are those of the largest one, by expectation and maximisation.

    Parameters
    ----------
    problem : Problem
    fit : LeastSquaresFit
        With exact angles.
    slopes : AngleSlopes
        There, in units of its sigma.
    before : ndarray, (m,)
        -2 log likelihood of each impact with which it is compared, as `deviance_of` has it.
    unknown : tuple of ndarray of int
        Rows that share an unknown noise.

    Returns
    -------
    errors : FittedErrors
    left : ndarray, (n,)
        Residuals in units in which these errors and the noise of an impact are independent and of size 1.
        None where the angles are no multiples of a step, or exact ones describe the data far better.
    """
    step = step_of_angles(problem)
    if step == 0.0:
        return None
    turned = problem.at_offset(step * ((np.arange(_PLACES) + 0.5) / _PLACES - 0.5)[:, None])
    theta, free = fit.optimum.theta, np.flatnonzero(problem.parameters.free)
    lower, upper = problem.parameters.bounds()
    square = np.ones(slopes.left.size)
    for rows in unknown:
        square[rows] = max(float(np.median(slopes.left[rows] ** 2)), _LOOSE)

    def values(theta: Array) -> Array:
        return np.nan_to_num(turned.predict(np.tile(theta, (_PLACES, 1))))

    deviance, now = before, np.inf
    for turn in range(_ROUNDS):
        here = values(theta)
        left = (problem.rows.value - here) / fit.sigma
        far = np.stack([slopes.by_impact(each) for each in left**2 / square])
        least = far.min(axis=0)
        weight = np.exp(-0.5 * (far - least))
        deviance = least - 2.0 * np.log(weight.mean(axis=0)) + slopes.by_impact(np.log(square))
        weight = (weight / weight.sum(axis=0))[:, slopes.impacts]
        total = float(deviance.sum())
        if now - total < _AT_REST or (turn > 1 and float(before.sum()) - total < _HOPELESS):
            break
        now = total
        for rows in unknown:
            square[rows] = max(float((weight * left**2)[:, rows].sum(axis=0).mean()), _LOOSE)
        root = np.sqrt(weight / square) / fit.sigma
        jacobian = np.stack(
            [
                (values(theta + _DIFFERENCE * np.eye(theta.size)[one]) - here) * root / _DIFFERENCE
                for one in free
            ],
            axis=-1,
        )
        wish = np.linalg.lstsq(
            jacobian.reshape(-1, free.size), ((problem.rows.value - here) * root).ravel(), rcond=_LOOSE
        )[0]
        theta = theta.copy()
        theta[free] = np.clip(theta[free] + wish, lower[free], upper[free])
    gain = before - deviance
    fall = float(gain.sum())
    here = values(theta) / (fit.sigma * np.sqrt(square))
    spread = here - here.mean(axis=0)
    left = problem.rows.value / (fit.sigma * np.sqrt(square)) - here.mean(axis=0)
    for rows in np.split(
        np.argsort(slopes.impacts, kind="stable"), np.cumsum(np.bincount(slopes.impacts))[:-1]
    ):
        size, axes = np.linalg.eigh(np.eye(rows.size) + spread[:, rows].T @ spread[:, rows] / _PLACES)
        left[rows] = axes @ (axes.T @ left[rows] / np.sqrt(size))
    widening = np.sqrt(square * (1.0 + spread.var(axis=0)))
    errors = FittedErrors(step / np.sqrt(12.0), np.sqrt(square), widening, fall, fall - float(gain.max()))
    return errors, left
