"""The objective of a profile: chi2, or the misfit with the noise profiled out of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ifrfit.inference.distributions.truncated_normal import half_width
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, group_dof
from ifrfit.inference.optimize.noise_modes import NoiseAtMode, noise_at_mode
from ifrfit.inference.optimize.optimum import Array

_WITHIN = 16.0  # rise of a rival mode up to which a profile may pass to it


@dataclass(frozen=True)
class Misfit:
    """How much worse other constants describe the rows than the fit does.

    Known noise: the rise of chi2 plus prior_chi2. Noise from the misfit: with d_g = n_g - leverage_g degrees
    of freedom in group g and S_g its sum of squares, the rise of ``sum_g d_g log S_g + prior_chi2``, and of
    chi2 of the rows whose sigma is known. Its minimum is where least squares comes to rest (S_g/d_g is the
    variance it uses), and with one group and
    constants that act linearly the cut `limit` reproduces Student's t exactly:
    d log(1 + t^2/d) at the quantile t is what t^2 is to chi2. Where the likelihood has several modes each has
    degrees of freedom of its own: the rise is how far the mode whose noises are nearest lies above the best,
    plus the rise over that mode.

    Attributes
    ----------
    problem : Problem
    fit : LeastSquaresFit
    groups : tuple of ndarray of int
        Rows that share one unknown noise; empty where sigma is known.
    base : ndarray
        Sigma of each row up to its group's factor.
    modes : tuple of NoiseAtMode
        The fit first, then the rivals within `_WITHIN` of it.
    """

    problem: Problem
    fit: LeastSquaresFit
    groups: tuple[Index, ...]
    base: Array
    modes: tuple[NoiseAtMode, ...] = ()

    @classmethod
    def of(cls, problem: Problem, fit: LeastSquaresFit) -> Misfit:
        """The misfit under the problem's noise policy."""
        groups, base = tuple(problem.noise_groups().values()), problem.noise.base
        dof = group_dof(problem, fit)
        theta = fit.optimum.theta
        squares = cls(problem, fit, groups, base)._squares_of(problem.residual(theta[None]) / base)[0]
        rivals = [noise_at_mode(problem, place, rise) for rise, place in fit.rivals if rise <= _WITHIN]
        own = NoiseAtMode(0.0, theta, fit.sigma, dof, squares)
        return cls(problem, fit, groups, base, (own, *rivals))

    def rise(self, theta: Array) -> float:
        """Rise of the objective at theta over the fit."""
        return float(self.rises(theta[None])[0])

    def rises(self, theta: Array) -> Array:
        """`rise` at several theta, (m, p) to (m,); infinite where a value is undefined."""
        with np.errstate(all="ignore"):
            residual = self.problem.residual(theta) / self.base
            total, log = self._of_known(theta, residual), np.log(self._squares_of(residual))
            every = [
                mode.rise + (log - np.log(mode.squares)) @ mode.dof + total - at
                for mode, at in zip(self.modes, self._totals, strict=True)
            ]
            found = np.array(every)[self.nearest(log), np.arange(len(theta))]
        return np.where(np.isnan(found), np.inf, found)

    def dof_at(self, theta: Array) -> Array:
        """Degrees of freedom of each group in the mode nearest to each theta, (m, p) to (m, groups)."""
        with np.errstate(all="ignore"):
            residual = self.problem.residual(theta) / self.base
            log = np.log(self._squares_of(np.nan_to_num(residual)))
        return np.array([mode.dof for mode in self.modes])[self.nearest(log)]

    def nearest(self, log_squares: Array) -> Index:
        """Number of the mode whose sums of squares are nearest, by their logarithms, (m, groups) to (m,)."""
        modes = np.array([np.log(mode.squares) for mode in self.modes])
        return np.asarray(np.abs(log_squares[:, None] - modes).sum(axis=2).argmin(axis=1))

    @cached_property
    def _totals(self) -> Array:
        """chi2 of rows with a known sigma and of the priors at each mode."""
        theta = np.array([mode.theta for mode in self.modes])
        return self._of_known(theta, self.problem.residual(theta) / self.base)

    def _of_known(self, theta: Array, residual: Array) -> Array:
        """chi2 of rows whose sigma is given and of the priors, (m,)."""
        prior = self.problem.parameters.prior_residuals(theta)
        known = residual[:, self.problem.noise.is_given]
        return np.asarray(np.square(known).sum(axis=1) + np.square(prior).sum(axis=1))

    def _squares_of(self, residual: Array) -> Array:
        """Sum of squares of each group, (m, n) to (m, groups)."""
        found = np.empty((len(residual), len(self.groups)))
        for i, rows in enumerate(self.groups):
            # what is below rounding says nothing of the noise
            square = (residual[:, None, rows] @ residual[:, rows, None])[:, 0, 0]
            found[:, i] = np.maximum(square, self.problem.rounding_variance(rows) * rows.size)
        return found


def limit(level: float, dof: float = math.inf, *, one_sided: bool = False) -> float:
    """Rise at the end of an interval of this level; of one tail if `one_sided`.

    z^2 of the normal law where the noise is known (0.989 and 3.841 for 68 and 95 %, chi2 of one degree of
    freedom), dof log(1 + t^2/dof) of Student's t where it comes from the misfit.
    """
    t = half_width(2.0 * level - 1.0 if one_sided else level, dof)
    return t * t if math.isinf(dof) else dof * math.log1p(t * t / dof)
