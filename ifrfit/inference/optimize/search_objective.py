"""The objective of searches without a certificate, its derivatives, and where its kinks lie.

It is that of least squares with each unknown noise at its best,

    sum over groups of d_g log S_g + chi2 of rows with a known sigma + chi2 of the priors,

with S_g the sum of squares of group g in units of its base. Values have kinks where an impact passes from
sticking to sliding. Everything takes many places at once. Derivations stand in docs/theory/search.md.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Index, as_slice
from ifrfit.physics.impulse_laws import Law

Bool = NDArray[np.bool_]

_STEEPEST = 1e100  # slope, whose square is a number still: that of angles has no end where e_n is 0
_CANCELLED = 1e-12  # share of two derivatives that their sum keeps of rounding alone
_FAR = 1e9  # where a constant without an upper bound ends
_ENTRIES = 2_000_000  # of a Jacobian, by which batches are divided


@dataclass(frozen=True)
class FollowingMu:
    """mu of a series as a function of its e_n and closure constant: mu = x b(c)/(1 + e_n).

    Attributes
    ----------
    i_mu, i_e_n : int
        Places in theta.
    i_c : int or None
        That of the closure constant; None where b is 1, so that x is kappa. Else x is the slip ratio at the
        transition.
    law : Law
    limits : (float, float)
        Of mu: they limit e_n.
    """

    i_mu: int
    i_e_n: int
    i_c: int | None
    law: Law
    limits: tuple[float, float] = (0.0, np.inf)

    def value(self, theta: Array, x: Array) -> Array:
        """mu at theta, (m, p), for x, (m,)."""
        bound = 1.0 if self.i_c is None else self.law.bound(theta[:, self.i_c])
        return np.asarray(x * bound / (1.0 + theta[:, self.i_e_n]))

    def slopes(self, theta: Array, x: Array) -> list[tuple[int, Array]]:
        """Places in theta, and the derivative of mu by what stands there."""
        up = 1.0 + theta[:, self.i_e_n]
        found = [(self.i_e_n, -self.value(theta, x) / up)]
        if self.i_c is not None:
            found.append((self.i_c, x * self.law.bound_slope(theta[:, self.i_c]) / up))
        return found


@dataclass(frozen=True)
class SearchObjective:
    """The objective of a problem with some entries of theta free within bounds.

    Attributes
    ----------
    problem : Problem
    base : ndarray, (n,)
        Sigma of each row up to the factor of its group.
    groups : tuple of ndarray of int
        Rows that share one unknown noise.
    free : ndarray of bool, (p,)
        What the search may move.
    lower, upper : ndarray, (p,)
    mu : FollowingMu or None
        A mu that follows; it is not free itself.
    """

    problem: Problem
    base: Array
    groups: tuple[Index, ...]
    free: Bool
    lower: Array
    upper: Array
    mu: FollowingMu | None = None

    @classmethod
    def of(cls, problem: Problem, sigma: Array, groups: Iterable[Index] = ()) -> Self:
        """Over all free constants, at known sigma but for the noises of some groups of rows."""
        free, bounds = problem.parameters.free, problem.parameters.bounds()
        return cls(problem, sigma, tuple(groups), free, *bounds)

    def blocks(self, m: int) -> list[slice]:
        """Parts of m places whose Jacobians fit into memory."""
        step = max(1, _ENTRIES // max(1, self.base.size * self.free.size))
        return [slice(start, start + step) for start in range(0, m, step)]

    def objective(self, theta: Array, dof: Array) -> tuple[Array, Array]:
        """Objective, (m,), and residuals in units of base, (m, n); infinite where a value is undefined."""
        with np.errstate(all="ignore"):
            z = self.residuals(theta)
            return (dof * np.log(self.squares(z))).sum(axis=1) + self.of_known(theta, z), z

    def residuals(self, theta: Array) -> Array:
        """Residuals in units of base, (m, n)."""
        return np.asarray(self.problem.residual(theta) / self.base)

    def slopes(self, theta: Array) -> Array:
        """Derivatives of the values by theta in units of base, (m, n, p)."""
        slopes = np.clip(np.nan_to_num(self.problem.jacobian(theta)), -_STEEPEST, _STEEPEST)
        return np.asarray(slopes / self.base[:, None])

    def prior_residuals(self, theta: Array) -> Array:
        """Standardised distance from the mean of each prior, (m, priors)."""
        return self.problem.parameters.prior_residuals(theta)

    def lowest(self, theta: Sequence[Array] | Array, dof: Array, most: int) -> Array:
        """The lowest of several places, best first, with what is fixed at its value, (m, p)."""
        parameters, nothing = self.problem.parameters, np.zeros(len(theta))
        places = self.at(np.where(parameters.free, theta, parameters.fixed), nothing)
        value = np.concatenate([self.objective(places[at], dof)[0] for at in self.blocks(len(places))])
        return np.asarray(places[np.argsort(np.nan_to_num(value, nan=np.inf), kind="stable")[:most]])

    def bounds(self, x: Array) -> tuple[Array, Array]:
        """Bounds of theta, (m, p) each."""
        ends = self.lower, np.minimum(self.upper, _FAR)
        lower, upper = (np.broadcast_to(end, (x.size, end.size)) for end in ends)
        if self.mu is not None and self.mu.limits != (0.0, np.inf):
            lower, upper, i_e_n = lower.copy(), upper.copy(), self.mu.i_e_n
            low, high = self.mu.limits
            upper[:, i_e_n] = np.minimum(upper[:, i_e_n], x / low - 1.0 if low > 0.0 else np.inf)
            lower[:, i_e_n] = np.minimum(np.maximum(lower[:, i_e_n], x / high - 1.0), upper[:, i_e_n])
        return lower, upper

    def at(self, theta: Array, x: Array) -> Array:
        """Theta inside the bounds, and with the mu that follows, (m, p)."""
        theta = np.where(self.free, np.clip(theta, *self.bounds(x)), theta)
        if self.mu is not None:
            theta[:, self.mu.i_mu] = self.mu.value(theta, x)
        return theta

    @cached_property
    def _spans(self) -> list[Index | slice]:
        """Rows of each group; as slices, of which no copies are taken, where they are evenly spaced."""
        return [as_slice(rows) for rows in self.groups]

    @cached_property
    def _known(self) -> Index | slice:
        """Rows of no group; as a slice, of which no copies are taken, where they are evenly spaced."""
        known = np.ones(self.base.size, dtype=bool)
        for rows in self.groups:
            known[rows] = False
        return as_slice(np.flatnonzero(known))

    @cached_property
    def least_squares(self) -> Array:
        """Sum of squares of each group below which there is nothing but rounding."""
        return np.array([self.problem.rounding_variance(rows) * rows.size for rows in self.groups])

    def squares(self, z: Array) -> Array:
        """Sum of squares of each group, (m, groups)."""
        if not self.groups:
            return np.zeros((len(z), 0))
        found = np.stack([(z[:, rows] ** 2).sum(axis=1) for rows in self._spans], axis=1)
        return np.asarray(np.maximum(found, self.least_squares))

    def of_known(self, theta: Array, z: Array) -> Array:
        """chi2 of rows with a known sigma and of the priors, (m,)."""
        prior = self.prior_residuals(theta)
        return np.asarray((z[:, self._known] ** 2).sum(axis=1) + np.square(prior).sum(axis=1))

    def _through_mu(self, columns: Array, theta: Array, x: Array) -> Array:
        """Derivatives by all of theta, (m, ..., p), as those by what is free, with the mu that follows."""
        if self.mu is not None:
            for place, slope in self.mu.slopes(theta, x):
                through = columns[..., self.mu.i_mu] * slope.reshape(-1, *(1,) * (columns.ndim - 2))
                total = columns[..., place] + through
                # of what cancels, as all that e_n does at a given kappa, rounding must not be left
                columns[..., place] = np.where(np.abs(total) <= _CANCELLED * np.abs(through), 0.0, total)
        return np.asarray(columns[..., self.free])

    @cached_property
    def _kinks(self) -> tuple[Array, Array, Array, Array]:
        """Slip ratios at which some row changes its regime, with the places of e_n, c and mu; each once."""
        rows, places = self.problem.rows, self.problem.parameters.positions
        at = np.flatnonzero(rows.is_oblique & np.isfinite(rows.tau) & (rows.tau > 0.0))
        own = self.problem.closure.constant
        column = [places[name][rows.series[at]] for name in ("e_n", own or "e_n", "mu")]
        every = np.unique(np.column_stack((rows.tau[at], *column)), axis=0)
        return every[:, 0], *every[:, 1:].astype(np.intp).T

    def onto(self, kink: Index, theta: Array) -> Array:
        """Theta with the mu that lies on a kink each, as far as it is free and within its bounds."""
        tau, i_e, i_c, i_mu = (each[kink] for each in self._kinks)
        law = self.problem.closure.law(self.problem.inertia_factor)
        at = np.arange(len(theta))
        has_c = self.problem.closure.constant is not None
        bound = law.bound(theta[at, i_c] if has_c else np.zeros(at.size))
        mu = np.clip(tau * bound / (1.0 + theta[at, i_e]), self.lower[i_mu], self.upper[i_mu])
        theta[at, i_mu] = np.where(self.free[i_mu], mu, theta[at, i_mu])
        return theta

    def margins(self, theta: Array, x: Array) -> tuple[Array, Array]:
        """kappa - tau b(c) of each kink, (m, kinks), and its derivative by what is free, (m, kinks, q)."""
        tau, i_e, i_c, i_mu = self._kinks
        law = self.problem.closure.law(self.problem.inertia_factor)
        has_c = self.problem.closure.constant is not None
        c = theta[:, i_c] if has_c else np.zeros((len(theta), tau.size))
        e_n, mu = theta[:, i_e], theta[:, i_mu]
        slopes = np.zeros((*e_n.shape, theta.shape[1]))
        kink = np.arange(tau.size)
        slopes[:, kink, i_e] += mu
        slopes[:, kink, i_mu] += 1.0 + e_n
        if has_c:
            slopes[:, kink, i_c] -= tau * law.bound_slope(c)
        return mu * (1.0 + e_n) - tau * law.bound(c), self._through_mu(slopes, theta, x)

    def derivatives(self, theta: Array, z: Array, dof: Array, x: Array) -> tuple[Array, Array, Array]:
        """Gradient, (m, q), Hessian without and with the logarithm's part, (m, q, q) each; eq. (2)."""
        slopes = self._through_mu(self.slopes(theta), theta, x).transpose(2, 0, 1)
        squares, one = self.squares(z), np.ones(len(theta))
        # sums of squares with their slopes, (q, m, n), and weights
        terms = [
            (slopes[..., rows], z[:, rows], dof[:, number] / squares[:, number])
            for number, rows in enumerate(self._spans)
        ]
        if (of_known := z[:, self._known]).size:
            terms.append((slopes[..., self._known], of_known, one))
        place, _, sd = self.problem.parameters.priors
        if place.size:
            of_priors = np.zeros((len(theta), place.size, theta.shape[1]))
            of_priors[:, np.arange(place.size), place] = -1.0 / sd
            of_priors = self._through_mu(of_priors, theta, x).transpose(2, 0, 1)
            terms.append((of_priors, self.prior_residuals(theta), one))
        q = len(slopes)
        gradient, hessian, of_logarithms = np.zeros((len(theta), q)), *np.zeros((2, len(theta), q, q))
        for number, (own, off, weight) in enumerate(terms):
            by_place = own.transpose(1, 0, 2)
            pull = 2.0 * weight[:, None] * (by_place @ off[..., None])[..., 0]
            gradient -= pull
            hessian += 2.0 * weight[:, None, None] * (by_place @ by_place.swapaxes(1, 2))
            if number < len(self.groups):
                of_logarithms += pull[:, :, None] * pull[:, None, :] / dof[:, number, None, None]
        return gradient, hessian, hessian - of_logarithms
