"""Least squares where rows have errors in common: the best of these beside the best constants.

The sum of squares of residuals over their independent errors, plus that of the common errors over their
standard deviations, is least at the generalised least squares of the constants: minimised over the common
errors alone it is q' (D + B B')^-1 q of `ifrfit.inference.model.common_likelihood`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ifrfit.inference.model.common_errors import whitening
from ifrfit.inference.model.common_likelihood import CommonLikelihood
from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.laplace import weighted_jacobian
from ifrfit.inference.optimize.optimum import Array
from ifrfit.physics.impulse_laws import Coefficients

_MOST_PARTITIONS = 500
_NEARLY = 3.84  # 95 % point of chi2 with one degree of freedom
_TIE = 1e-9  # relative difference of two partitions that meet in the same place
_ROOM = 1e-12  # of a domain of no width
_TOLERANCE = 1e-12
_ON_BOUND = 1e-9  # of a domain's width: a constant that is held by its bound does not move


def common_step(problem: Problem, sigma: Array, theta: Array, loadings: Array, value: Array) -> Array:
    """By how much the common errors move to the joint optimum of constants and them, to first order.

    Parameters
    ----------
    problem : Problem
        At the common errors so far.
    sigma : ndarray, (n,)
    theta : ndarray, (p,)
        The optimum there.
    loadings : ndarray, (n, r)
        What one standard error of each does to the rows.
    value : ndarray, (r,)
        The common errors so far.

    Returns
    -------
    ndarray, (r,)
    """
    _, _, to_theta, by_phi, residual = weighted_jacobian(problem, sigma, theta)
    low, high = problem.parameters.bounds()
    margin = _ON_BOUND * np.where(np.isfinite(high - low), high - low, 1.0)
    moves = problem.parameters.free & (theta > low + margin) & (theta < high - margin)
    scale = (problem.parameters.prior_sd / np.abs(np.diag(to_theta)))[moves]
    n, r = loadings.shape
    more = np.zeros((len(by_phi), r))
    more[:n] = loadings / sigma[:, None]
    matrix = np.block([[by_phi[:, moves] * scale, more], [np.zeros((r, int(moves.sum()))), np.eye(r)]])
    moved, *_ = np.linalg.lstsq(matrix, np.concatenate((residual, -value)), rcond=None)
    return np.asarray(moved[int(moves.sum()) :])


def common_at(problem: Problem, sigma: Array, theta: Array) -> Array:
    """The most likely common errors, (r,), at given constants, where these errors move values alone."""
    assert problem.common is not None
    loadings = problem.common.value / sigma[:, None]
    information = loadings.T @ loadings + np.eye(loadings.shape[1])
    return np.asarray(np.linalg.solve(information, loadings.T @ (problem.residual(theta) / sigma)))


@dataclass(frozen=True)
class Partition:
    """The best constants with the transition between two neighbours along tau.

    Attributes
    ----------
    objective : float
        Minus twice the log likelihood, but for a constant, with priors: the least in this partition.
    theta : ndarray, (p,)
        The place of it, fixed entries included.
    """

    objective: float
    theta: Array


def partitions(problem: Problem, sigma: Array, about: Array) -> list[Partition]:
    """The least objective of every partition into impacts that stick and impacts that slide.

    Of observables that are linear in e_n, the closure's constant and kappa where impacts keep their regime,
    under a closure whose transition depends on kappa alone, each partition is a linear least squares problem
    with bounds (kappa between two values of tau, times b). Rows are whitened by their covariance. That is
    exact where common errors move values alone: then the least of them all is the least there is, up to what
    the bounds of mu take away where e_n is free. Where they turn angles, it is so to first order about
    the common errors that are given.

    Parameters
    ----------
    problem : Problem
        With common errors.
    sigma : ndarray, (n,)
        Independent errors.
    about : ndarray, (r,)

    Returns
    -------
    list of Partition
        By rising tau; empty for other closures and observables, constants of several series, and many rows.
    """
    law = problem.closure.law(problem.inertia_factor)
    if not isinstance(law, Coefficients) or law.b1 != 0.0 or law.b0 <= 0.0 or not _is_linear(problem):
        return []
    there = problem.at_common(about)
    tau = np.unique(there.rows.tau[there.rows.is_oblique])
    if not 0 < tau.size <= _MOST_PARTITIONS:
        return []
    question = _Question.of(there, law)
    likelihood = CommonLikelihood(problem, about)
    loadings: Array | None = None
    found = []
    for low, high in zip(np.append(0.0, tau), np.append(tau, np.inf), strict=True):
        kappa = law.b0 * low, law.b0 * high
        if kappa[0] > question.highest or kappa[1] < question.lowest:
            continue
        if loadings is None or problem.common is None or problem.common.turns_angles:
            between = question.theta_between(*kappa)
            loadings = likelihood.loadings(between[None])[0]
            unit, size = whitening(loadings, sigma)
            whitener = unit * (1.0 - 1.0 / np.sqrt(1.0 + size**2)), unit
        found.append(question.solved(sigma, loadings @ about, whitener, *kappa))
    return found


def local_minima(found: list[Partition]) -> list[Partition]:
    """Partitions that lie below both their neighbours, the best first."""
    value = np.array([np.inf, *(each.objective for each in found), np.inf])
    tie = _TIE * (1.0 + np.abs(value[1:-1]))
    is_least = (value[1:-1] < value[:-2] - tie) & (value[1:-1] <= value[2:] + tie)
    kept = [each for each, is_one in zip(found, is_least, strict=True) if is_one]
    return sorted(kept, key=lambda each: each.objective)


def outlying(problem: Problem, found: list[Partition]) -> list[Partition]:
    """The first and the last partition along tau that describe the data nearly as well as the best.

    Where nothing slides kappa has no upper end, and mu stands at that of its domain.
    """
    least = min(each.objective for each in found)
    near = [each for each in found if each.objective <= least + _NEARLY]
    ends = [near[0], near[-1]]
    if near[-1] is found[-1]:
        place = problem.parameters.positions["mu"][0]
        theta = near[-1].theta.copy()
        theta[place] = problem.parameters["mu"].upper
        ends.append(replace(near[-1], theta=theta))
    return ends


def _is_linear(problem: Problem) -> bool:
    parameters, kinds = problem.parameters, problem.rows.observables
    e_n, mu = parameters["e_n"], parameters["mu"]
    if any(one.separate for one in parameters) and len(problem.series) > 1:
        return False
    if mu.fixed is not None or (mu.prior is not None and e_n.fixed is None):
        return False
    return all(o.kind == "normal" or (o.kind == "tangential" and not o.ties_e_n) for o in kinds)


@dataclass(frozen=True)
class _Question:
    """Rows as linear functions of e_n, the closure's constant, and kappa, of one group of constants."""

    problem: Problem
    law: Coefficients

    @classmethod
    def of(cls, problem: Problem, law: Coefficients) -> _Question:
        return cls(problem, law)

    @property
    def _of_e_n(self) -> tuple[float, float]:
        e_n = self.problem.parameters["e_n"]
        return (e_n.lower, e_n.upper) if e_n.fixed is None else (e_n.fixed, e_n.fixed)

    @property
    def lowest(self) -> float:
        """Least kappa that mu may have."""
        return self.problem.parameters["mu"].lower * (1.0 + self._of_e_n[0])

    @property
    def highest(self) -> float:
        """Largest kappa that mu may have; perhaps infinite."""
        return self.problem.parameters["mu"].upper * (1.0 + self._of_e_n[1])

    def _constant(self) -> Parameter | None:
        own = self.problem.closure.constant
        return None if own is None else self.problem.parameters[own]

    def theta_between(self, low: float, high: float) -> Array:
        """Constants in the middle of their domains, with kappa between two values."""
        kappa = 0.5 * (low + high) if np.isfinite(high) else 2.0 * low
        own = self._constant()
        c = 0.0 if own is None else 0.5 * (own.lower + own.upper) if own.fixed is None else own.fixed
        return self._theta(sum(self._of_e_n) / 2.0, c, kappa)

    def _theta(self, e_n: float, c: float, kappa: float) -> Array:
        names = [each.name for each in self.problem.parameters]
        values = {"e_n": e_n, "mu": kappa / (1.0 + e_n)}
        found = np.zeros(len(self.problem.parameters.names))
        for name in names:
            found[self.problem.parameters.positions[name]] = values.get(name, c)
        return found

    def solved(
        self, sigma: Array, moved: Array, whitener: tuple[Array, Array], low: float, high: float
    ) -> Partition:
        """The least objective with kappa between two values, and where it lies.

        Values are `moved` by the common errors so far, (n,). Of the whitener (S, P) 1 - S P' is the
        inverse root of the covariance of rows over sigma.
        """
        from scipy.optimize import lsq_linear  # which takes long to load

        rows, law, own = self.problem.rows, self.law, self._constant()
        offset, slope = rows.linear_parts(self.problem.inertia_factor)
        oblique = rows.is_oblique
        sliding = oblique & (law.b0 * rows.tau >= high)
        by_kappa = np.zeros(rows.value.size)
        by_kappa[sliding] = slope[sliding] / rows.tau[sliding]
        by_e_n = np.where(oblique, 0.0, rows.normal_factor(np.ones(rows.value.size, dtype=bool)))
        fixed = np.where(oblique, offset + slope * (law.a0 + np.where(sliding, 0.0, law.b0)), 0.0)
        e_n = self.problem.parameters["e_n"]
        every = [(by_e_n, e_n), (slope * law.a1, own)]
        columns, ends, names = [by_kappa], [(max(low, self.lowest), min(high, self.highest))], ["kappa"]
        for column, parameter in every:
            if parameter is None:
                continue
            if parameter.fixed is not None:
                fixed = fixed + column * parameter.fixed
                continue
            columns.append(column)
            ends.append((parameter.lower, parameter.upper))
            names.append(parameter.name)
        shrunk, unit = whitener
        matrix = np.column_stack(columns) / sigma[:, None]
        right = (rows.value - fixed + moved) / sigma
        matrix, right = matrix - shrunk @ (unit.T @ matrix), right - shrunk @ (unit.T @ right)
        matrix, right = self._with_priors(names, matrix, right)
        lower, upper = np.array(ends).T
        # an end that touches its other one leaves no room, which the solver refuses
        upper = np.maximum(upper, lower + _ROOM * (1.0 + np.abs(lower)))
        best = lsq_linear(matrix, right, (lower, upper), method="bvls", tol=_TOLERANCE)
        x = dict(zip(names, best.x.tolist(), strict=True))
        value = x.get("e_n", e_n.fixed if e_n.fixed is not None else 0.0)
        c = 0.0 if own is None else x.get(own.name, own.fixed if own.fixed is not None else 0.0)
        return Partition(2.0 * float(best.cost), self._theta(value, c, x["kappa"]))

    def _with_priors(self, names: list[str], matrix: Array, right: Array) -> tuple[Array, Array]:
        """Priors of the user as further rows."""
        for place, name in enumerate(names):
            parameter = self.problem.parameters["mu" if name == "kappa" else name]
            if parameter.prior is None:
                continue
            mean, sd = parameter.prior
            factor = 1.0 + self._of_e_n[0] if name == "kappa" else 1.0
            row = np.zeros(len(names))
            row[place] = 1.0 / (sd * factor)
            matrix, right = np.vstack((matrix, row)), np.append(right, mean / sd)
        return matrix, right
