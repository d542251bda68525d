"""The objective of a profile: chi2, or the misfit with the noise profiled out of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from ifrfit.inference.distributions.truncated_normal import half_width
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.batched_search import BatchedSearch
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, group_dof
from ifrfit.inference.optimize.noise_modes import NoiseAtMode, noise_at_mode
from ifrfit.inference.optimize.optimum import Array
from ifrfit.inference.optimize.parameter_group import ParameterGroup
from ifrfit.inference.optimize.solve import independent_groups
from ifrfit.inference.profile.separable_sums import SeparableSums

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
    search : BatchedSearch
        Over all free constants, with the unknown noises.
    modes : tuple of NoiseAtMode
        The fit first, then the rivals within `_WITHIN` of it.
    """

    problem: Problem
    fit: LeastSquaresFit
    search: BatchedSearch
    modes: tuple[NoiseAtMode, ...]

    @classmethod
    def of(cls, problem: Problem, fit: LeastSquaresFit) -> Misfit:
        """The misfit under the problem's noise policy."""
        search = BatchedSearch.of(problem, problem.noise.base, problem.noise_groups().values())
        dof = group_dof(problem, fit)
        theta = fit.optimum.theta
        squares = search.squares(problem.residual(theta[None]) / search.base)[0]
        rivals = [noise_at_mode(problem, place, rise) for rise, place in fit.rivals if rise <= _WITHIN]
        own = NoiseAtMode(0.0, theta, fit.sigma, dof, squares)
        return cls(problem, fit, search, (own, *rivals))

    def rise(self, theta: Array) -> float:
        """Rise of the objective at theta over the fit."""
        return float(self.rises(theta[None])[0])

    def rises(self, theta: Array) -> Array:
        """`rise` at several theta, (m, p) to (m,); infinite where a value is undefined."""
        return np.concatenate([self._rises(theta[part]) for part in self.search.blocks(len(theta))])

    def _rises(self, theta: Array) -> Array:
        with np.errstate(all="ignore"):
            residual = self.problem.residual(theta) / self.search.base
            found = self.rises_of(self.search.squares(residual), self.search.of_known(theta, residual))
        return np.where(np.isnan(found), np.inf, found)

    def rises_of(self, squares: Array, total: Array) -> Array:
        """Rise at sums of squares of the groups, (m, groups), and chi2 of what is known, (m,)."""
        log = np.log(squares)
        every = [
            mode.rise + (log - np.log(mode.squares)) @ mode.dof + total - at
            for mode, at in zip(self.modes, self._totals, strict=True)
        ]
        return np.asarray(np.array(every)[self.nearest(log), np.arange(len(total))])

    @cached_property
    def separable(self) -> Callable[[int], SeparableSums | None]:
        """Sums of the rows of a series, by its number, and of all that share its constants; None without.

        They are those of errors of the values alone, and of a law that is linear in the closure constant and
        kappa. Each is worked out once.
        """
        return cache(self._separable)

    def _separable(self, number: int) -> SeparableSums | None:
        parameters, theta = self.problem.parameters, self.fit.optimum.theta
        if number > 0 and not parameters.differ_by_series:
            return self.separable(0)
        e_n, *c, mu = theta[[places[number] for places in parameters.positions.values()]].tolist()
        constants = e_n, c[0] if c else 0.0, mu
        if self._groups is None or not np.isfinite(constants).all():
            return None
        return SeparableSums.of(*self._groups[number], constants)

    @cached_property
    def _groups(self) -> list[tuple[ParameterGroup, Index]] | None:
        """Rows that share no free constant with others; None where there are none, or no sums of squares."""
        problem = self.problem
        if not problem.error_model.is_plain or problem.offset is not None or problem.common is not None:
            return None
        if problem.parameters.is_tied or not problem.closure.bilinear:
            return None
        return independent_groups(problem, self.search.base)

    def dof_at(self, theta: Array) -> Array:
        """Degrees of freedom of each group in the mode nearest to each theta, (m, p) to (m, groups)."""
        return np.concatenate([self._dof_at(theta[part]) for part in self.search.blocks(len(theta))])

    def _dof_at(self, theta: Array) -> Array:
        with np.errstate(all="ignore"):
            residual = self.problem.residual(theta) / self.search.base
            log = np.log(self.search.squares(np.nan_to_num(residual)))
        return np.array([mode.dof for mode in self.modes])[self.nearest(log)]

    def nearest(self, log_squares: Array) -> Index:
        """Number of the mode whose sums of squares are nearest, by their logarithms, (m, groups) to (m,)."""
        modes = np.array([np.log(mode.squares) for mode in self.modes])
        return np.asarray(np.abs(log_squares[:, None] - modes).sum(axis=2).argmin(axis=1))

    @cached_property
    def _totals(self) -> Array:
        """chi2 of rows with a known sigma and of the priors at each mode."""
        theta = np.array([mode.theta for mode in self.modes])
        return self.search.of_known(theta, self.problem.residual(theta) / self.search.base)


def limit(level: float, dof: float = math.inf, *, one_sided: bool = False) -> float:
    """Rise at the end of an interval of this level; of one tail if `one_sided`.

    z^2 of the normal law where the noise is known (0.989 and 3.841 for 68 and 95 %, chi2 of one degree of
    freedom), dof log(1 + t^2/dof) of Student's t where it comes from the misfit.
    """
    t = half_width(2.0 * level - 1.0 if one_sided else level, dof)
    return t * t if math.isinf(dof) else dof * math.log1p(t * t / dof)
