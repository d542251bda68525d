"""Independent errors of the angles, one of each impact: whether they show, and how large they are."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ifrfit.inference.diagnostics.quadratic_forms import Array, orthonormal, projected_weights, sum_exceeds
from ifrfit.inference.diagnostics.thresholds import REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.angle_offset import slope_by_offset

_DEGREES = 1.0  # error against which the test of none has the most power
_OF_THE_REST = 0.01  # p without the impact that speaks most, below which it is not that one alone
_SUSPECT = 2.0  # standard deviations from which the exact p value is worked out
_EXACT = 400  # rows beyond which the constants take too little to matter
_STEPS = 100
_AT_REST = 1e-4  # relative change of the variances
_LOOSE = 1e-12


@dataclass(frozen=True)
class AngleSlopes:
    """Rows at some constants, all in units of a sigma, and how an error of the angle moves them.

    Attributes
    ----------
    along : ndarray, (n,)
        Slope in the angle, per degree, in the regime at these constants.
    left : ndarray, (n,)
        Residuals.
    by_constant : ndarray, (n, k)
        Slopes in the free constants.
    impacts : ndarray of int, (n,)
    """

    along: Array
    left: Array
    by_constant: Array
    impacts: Index

    @classmethod
    def of(cls, problem: Problem, theta: Array, sigma: Array) -> AngleSlopes:
        """At theta, in units of sigma, (n,)."""
        along = np.where(problem.rows.has_angle, slope_by_offset(problem, theta), 0.0)
        return cls(
            np.nan_to_num(along / sigma),
            problem.residual(theta) / sigma,
            problem.free_jacobian(theta) / sigma[:, None],
            problem.rows.impacts,
        )

    def by_impact(self, of_rows: Array) -> Array:
        """Sum over the rows of each impact."""
        return np.bincount(self.impacts, of_rows).astype(float)

    def without(self, errors: FittedErrors) -> AngleSlopes:
        """The same in units in which the noise and these errors are independent and of size 1."""
        t = errors.size * self.along / errors.noise
        size = self.by_impact(t * t)
        # the inverse root of 1 + t t' takes this much of t off
        part = -np.expm1(-0.5 * np.log1p(size)) / np.maximum(size, _LOOSE)

        def whitened(of_rows: Array) -> Array:
            scaled = of_rows / errors.noise
            return np.asarray(scaled - t * (part * self.by_impact(t * scaled))[self.impacts])

        columns = [whitened(column) for column in self.by_constant.T]
        return replace(
            self,
            along=whitened(self.along),
            left=whitened(self.left),
            by_constant=np.column_stack(columns) if columns else self.by_constant,
        )


@dataclass(frozen=True)
class FittedErrors:
    """Errors of the angles, or others that act along known slopes, at the largest likelihood.

    Attributes
    ----------
    size : float
        Standard deviation, degrees.
    noise : ndarray, (n,)
        Of the values alone, in units of the sigma of the slopes.
    widening : ndarray, (n,)
        Of both together, likewise.
    fall : float
        Of -2 log likelihood.
    drop : float
        The same without the impact that speaks most.
    """

    size: float
    noise: Array
    widening: Array
    fall: float
    drop: float


def careful_p(slopes: AngleSlopes, unknown: tuple[Index, ...]) -> float:
    """p of errors of the angles; 1 where without the impact that speaks most it is not below 0.01.

    With t = s df/dgamma / sigma for an error s, the residuals z of an impact have covariance 1 + t t', and
    twice the logarithm of their likelihood ratio is (t.z)^2 / (1 + t.t), but for a constant. The sum over
    impacts for s of one degree is a quadratic form of z, whose tail is exact for normal errors at any number
    of constants. Rows of an unknown noise count over their own sum of squares; of several such the
    surface of one likelihood ratio is taken for the cone that touches it at the residuals.

    Parameters
    ----------
    slopes : AngleSlopes
        At the optimum.
    unknown : tuple of ndarray of int
        Rows that share an unknown noise.
    """
    basis = orthonormal(slopes.by_constant)
    t = _DEGREES * slopes.along
    weight = t / np.sqrt(1.0 + slopes.by_impact(t * t)[slopes.impacts])
    z = slopes.left - basis @ (basis.T @ slopes.left)
    share = weight * z * slopes.by_impact(weight * z)[slopes.impacts]
    group = np.full(z.size, -1)
    for number, rows in enumerate(unknown):
        group[rows] = number
    every = np.arange(z.size)
    p = _p(every, weight, z, share, slopes.impacts, group, basis)
    if p >= REFUTED:
        return p
    kept = np.flatnonzero(slopes.impacts != int(np.argmax(slopes.by_impact(share))))
    return p if _p(kept, weight, z, share, slopes.impacts, group, basis) < _OF_THE_REST else 1.0


def _p(
    kept: Index, weight: Array, z: Array, share: Array, impacts: Index, group: Index, basis: Array
) -> float:
    """p of the form of some impacts; 1 where nothing is suspicious."""
    weight, z, share, basis = (x[kept] for x in (weight, z, share, basis))
    impacts, group = impacts[kept], group[kept]
    excess = float(share.sum() - (weight[group < 0] ** 2).sum())
    variance = float((np.bincount(impacts, weight**2) ** 2).sum())
    scale = np.zeros(z.size)
    for number in range(int(group.max(initial=-1)) + 1):
        rows = group == number
        square, mean = float((z[rows] ** 2).sum()), float((weight[rows] ** 2).sum()) / max(rows.sum(), 1)
        excess -= mean * square
        variance -= mean**2 * float(rows.sum())
        scale[rows] = float(share[rows].sum()) / max(square, 1e-300)
    if variance <= _LOOSE or excess < _SUSPECT * math.sqrt(2.0 * variance):
        return 1.0
    return sum_exceeds(_form_weights(weight, scale, impacts, basis), float(share[group < 0].sum()))


def _form_weights(weight: Array, scale: Array, impacts: Index, basis: Array) -> Array:
    """Weights of the sum of chi2 that the form is: of each impact w w', less a number in each row."""
    if weight.size <= _EXACT:
        form = np.where(impacts[:, None] == impacts, np.outer(weight, weight), 0.0)
        form[np.diag_indices(weight.size)] -= scale
        return projected_weights(form, basis)
    order = np.argsort(impacts, kind="stable")
    first = np.flatnonzero(np.diff(impacts[order], prepend=-1))
    count = np.diff(np.append(first, impacts.size))
    found = []
    for size in np.unique(count).tolist():
        rows = order[first[count == size][:, None] + np.arange(size)]
        blocks = weight[rows][:, :, None] * weight[rows][:, None, :] - scale[rows][:, :, None] * np.eye(size)
        found.append(np.linalg.eigvalsh(blocks).ravel())
    return np.concatenate(found)


def deviance_of(slopes: AngleSlopes, unknown: tuple[Index, ...]) -> Array:
    """-2 log likelihood of each impact with exact angles, the noises at their best, but for a constant."""
    square = _own_noise(slopes.left, unknown)
    return slopes.by_impact(slopes.left**2 / square + np.log(square))


def fitted_errors(
    slopes: AngleSlopes, before: Array, unknown: tuple[Index, ...], kinds: Index | None = None
) -> FittedErrors:
    """Size of the errors, noises and constants (to first order) at the largest likelihood.

    Each variance is the sum of squares that falls to its errors, over the number of those that the data tell:
    a fixed point of expectation and maximisation, in fewer steps (MacKay 1992, Neural Comput. 4, 415).

    Parameters
    ----------
    slopes : AngleSlopes
    before : ndarray, (m,)
        -2 log likelihood of each impact with which it is compared, as `deviance_of` has it.
    unknown : tuple of ndarray of int
        Rows that share an unknown noise.
    kinds : ndarray of int, (m,), optional
        Kind of each impact's error, where they are of several sizes.
    """
    along, by = slopes.along, np.column_stack((slopes.by_constant, slopes.left))
    square = _own_noise(slopes.left, unknown)
    of = np.zeros(before.size, dtype=np.intp) if kinds is None else kinds
    variance = np.ones(of.max(initial=0) + 1)
    for _ in range(_STEPS):
        lean = along / square
        informed = slopes.by_impact(along * lean)
        share = variance[of] / (1.0 + variance[of] * informed)  # variance of each error, given the residuals
        sums = np.column_stack([slopes.by_impact(column * lean) for column in by.T])
        normal = by.T @ (by / square[:, None]) - sums.T @ (share[:, None] * sums)
        step = np.linalg.lstsq(normal[:-1, :-1], normal[:-1, -1], rcond=_LOOSE)[0]
        left = slopes.left - slopes.by_constant @ step
        mean = share * slopes.by_impact(lean * left)
        free = 1.0 - along * lean * share[slopes.impacts]
        rest = (left - along * mean[slopes.impacts]) ** 2
        new = square.copy()
        for rows in unknown:
            new[rows] = max(float(rest[rows].sum()) / max(float(free[rows].sum()), 0.5), _LOOSE)
        number = np.bincount(of, informed * share)
        grown = np.where(number > 0.0, np.bincount(of, mean**2) / np.maximum(number, _LOOSE), 0.0)
        moved = float((np.abs(grown - variance) / (1.0 + variance)).max() + np.abs(new / square - 1.0).max())
        square, variance = new, grown
        if moved <= _AT_REST:
            break
    informed = slopes.by_impact(along**2 / square)
    share = variance[of] / (1.0 + variance[of] * informed)
    deviance = slopes.by_impact(left**2 / square + np.log(square)) + np.log1p(variance[of] * informed)
    gain = before - deviance + share * slopes.by_impact(along / square * left) ** 2
    widening = np.sqrt(square + variance[of][slopes.impacts] * along**2)
    fall = float(gain.sum())
    return FittedErrors(
        math.sqrt(float(variance[0])), np.sqrt(square), widening, fall, fall - float(gain.max())
    )


def _own_noise(left: Array, unknown: tuple[Index, ...]) -> Array:
    """Squares of the noises of residuals, (n,), 1 where sigma is known."""
    square = np.ones(left.size)
    for rows in unknown:
        square[rows] = max(float((left[rows] ** 2).mean()), _LOOSE)
    return square
