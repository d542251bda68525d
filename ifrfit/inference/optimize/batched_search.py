"""Bounded search from many places at once, for problems that no certified method covers.

The objective is that of least squares with each unknown noise at its best,

    sum over groups of d_g log S_g + chi2 of rows with a known sigma + chi2 of the priors,

with S_g the sum of squares of group g in units of its base. A step is Newton's with the Hessian of Gauss and
Newton, less what the logarithm takes from it where it stays positive; it is damped after Levenberg and
Marquardt where it does not lead down. Values have kinks where an impact passes from sticking to sliding, and
optima lie on these: a step that would cross the first kink on its way is tried along the kink as well.
Derivations stand in docs/theory/search.md.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Index
from ifrfit.physics.impulse_laws import Law

Bool = NDArray[np.bool_]

_STEPS = 60
_AT_REST = 1e-9  # fall of the objective that a step promises, below which a search has converged
_ROUNDING = 1e-13  # of the objective
_TRUSTED = 0.25  # share of the promised fall that a step must keep for no other to be tried
_DAMPING = (1e-8, 1e-2, 1e10)  # least, first, last: relative to the diagonal of the Hessian
_DAMPED = (1.0, 8.0, 64.0)  # times the damping of the last step
_STEEPEST = 1e100  # slope, whose square is a number still: that of angles has no end where e_n is 0
_LOOSE = 1e-11  # eigenvalue, relative, of a direction that the data do not see: it stays where it is
_CONVEX = 0.05  # least eigenvalue with which the logarithm's part of the Hessian is kept
_CANCELLED = 1e-12  # share of two derivatives that their sum keeps of rounding alone
_ROOM = 1e-12  # from a bound, relative to the range, within which a constant lies on it
_FAR = 1e9  # where a constant without an upper bound ends
_ON_KINK = 1e-3  # distance from a kink, in standard deviations
_POLISHES = 20
_ALIGNED = 0.01  # share of a step, squared, that may lie across the one before where it goes on along it
_FURTHER = 20.0  # times the step, at most, that it is then made longer
_CREEPING = 3e-4, 8  # fall of a damped step, and of how many, after which a search is given up
_MERGED_EVERY, _MERGED = 8, 1e-4  # steps after which searches are merged that are so near, of the range
_NOTHING = 1e-20  # fall of the objective that leaves no digit of theta in doubt
_ENTRIES = 2_000_000  # of a Jacobian, by which batches are divided


class Found(NamedTuple):
    """Where searches ended.

    Attributes
    ----------
    theta : ndarray, (m, p)
    value : ndarray, (m,)
        Of the objective.
    converged : ndarray of bool, (m,)
        Whether no step promises a fall any more; on a kink, none along it.
    """

    theta: Array
    value: Array
    converged: Bool

    def take(self, which: Index | Bool) -> Found:
        """Some of them."""
        return Found(self.theta[which], self.value[which], self.converged[which])


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
class BatchedSearch:
    """A problem with some entries of theta free within bounds.

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
    def of(cls, problem: Problem, sigma: Array, groups: Iterable[Index] = ()) -> BatchedSearch:
        """Over all free constants, at known sigma but for the noises of some groups of rows."""
        free, bounds = problem.parameters.free, problem.parameters.bounds()
        return cls(problem, sigma, tuple(groups), free, *bounds)

    def run(self, theta: Array, dof: Array, x: Array | None = None, steps: int = _STEPS) -> Found:
        """Search from each of several places.

        Parameters
        ----------
        theta : ndarray, (m, p)
            Places to begin from; what is not free stays.
        dof : ndarray, (m, groups) or (groups,)
            Factor of the logarithm of each group's sum of squares.
        x : ndarray, (m,), optional
            Of `FollowingMu`.
        steps : int
            After which a search is given up.
        """
        m = len(theta)
        dof = np.broadcast_to(dof, (m, len(self.groups)))
        x = np.zeros(m) if x is None else x
        parts = [self._run(theta[at], dof[at], x[at], steps) for at in self.blocks(m)]
        return Found(*(np.concatenate(each) for each in zip(*parts, strict=True)))

    def blocks(self, m: int) -> list[slice]:
        """Parts of m places whose Jacobians fit into memory."""
        step = max(1, _ENTRIES // max(1, self.base.size * self.free.size))
        return [slice(start, start + step) for start in range(0, m, step)]

    def polish(self, found: Found, dof: Array) -> Found:
        """Take the last digits of theta, where the objective no longer tells one place from the next.

        Full steps of the model, as long as each promises less than the one before.
        """
        x = np.zeros(len(found.theta))
        dof = np.broadcast_to(dof, (len(found.theta), len(self.groups)))
        theta = found.theta.copy()
        active = np.flatnonzero(found.converged)
        promised = np.full(len(theta), np.inf)
        steps = _Steps.none(len(theta), int(self.free.sum()))
        for _ in range(_POLISHES if self.free.any() else 0):
            if not active.size:
                break
            _, z = self.objective(theta[active], dof[active])
            model = _Model.of(self, theta[active], z, dof[active], x[active])
            on_kink = model.is_on_kink & (model.promised > _AT_REST + _ROUNDING * np.abs(found.value[active]))
            left = np.where(on_kink, model.promised_along, model.promised)
            going = (left < promised[active]) & (left > _NOTHING)
            step = np.where(
                on_kink[:, None], model.step_along_nearest_kink, model.step(np.zeros(active.size))
            )
            longer = step * steps.factor(active, step, model.unit)[:, None]
            steps.keep(active, step, longer)
            active, promised[active] = active[going], left
            theta[np.ix_(active, np.flatnonzero(self.free))] += longer[going]
            theta[active] = self.at(theta[active], x[active])
        value, _ = self.objective(theta, dof)
        slack = _AT_REST + _ROUNDING * np.abs(found.value)
        good = value <= found.value + slack
        return Found(
            np.where(good[:, None], theta, found.theta), np.where(good, value, found.value), found.converged
        )

    def objective(self, theta: Array, dof: Array) -> tuple[Array, Array]:
        """Objective, (m,), and residuals in units of base, (m, n); infinite where a value is undefined."""
        with np.errstate(all="ignore"):
            z = self.problem.residual(theta) / self.base
            return (dof * np.log(self.squares(z))).sum(axis=1) + self.of_known(theta, z), z

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

    def _run(self, start: Array, dof: Array, x: Array, steps: int) -> Found:
        theta = self.at(start, x)
        value, z = self.objective(theta, dof)
        value = np.where(np.isnan(value), np.inf, value)
        converged = np.zeros(len(theta), dtype=bool)
        damping = np.full(len(theta), _DAMPING[1])
        active = np.flatnonzero(np.isfinite(value))
        if not self.free.any():
            return Found(theta, value, np.isfinite(value))
        first = theta.copy(), value.copy()
        leader, creeping = np.arange(len(theta)), np.zeros(len(theta), dtype=np.intp)
        last = _Steps.none(len(theta), int(self.free.sum()))
        for number in range(steps):
            if number % _MERGED_EVERY == _MERGED_EVERY - 1:
                active = self._leading(active, theta, value, dof, x, leader)
            if not active.size:
                break
            model = _Model.of(self, theta[active], z[active], dof[active], x[active])
            tolerance = _AT_REST + _ROUNDING * np.abs(value[active])
            done = model.promised <= tolerance
            converged[active[done]] = True
            active, model, tolerance = active[~done], model.take(~done), tolerance[~done]
            if not active.size:
                break
            fall, index = self._move(active, model, theta, value, z, dof, x, damping, last)
            stuck = fall <= tolerance
            on_kink = stuck & model.is_on_kink & (model.promised_along <= tolerance)
            converged[active[on_kink & (damping[active] > 1.0)]] = True
            change = np.array([0.125, 0.125, 1.0, 8.0, *(1.0,) * 4])[index]
            damping[active] = np.where(stuck, 512.0, change) * np.maximum(damping[active], _DAMPING[0])
            # where residuals are huge, curvature is not that of Gauss and Newton, and damped steps creep
            creeping[active] = np.where((index > 0) & (fall < _CREEPING[0]), creeping[active] + 1, 0)
            left = (damping[active] < _DAMPING[2]) & (creeping[active] < _CREEPING[1])
            # where a kink meets a bound the model of one side may point beyond the bound; no step leads down
            converged[active[~left & model.is_on_kink & model.is_on_bound]] = True
            active = active[~converged[active] & left]
        # one that has done no more than creep stays, so that noises about it come to rest
        stays = (creeping >= _CREEPING[1]) & (first[1] - value < _CREEPING[0] * _CREEPING[1])
        theta = np.where(stays[:, None], first[0], theta)
        return Found(theta, np.where(stays, first[1], value), converged).take(leader)

    def _leading(
        self, active: Index, theta: Array, value: Array, dof: Array, x: Array, leader: Index
    ) -> Index:
        """Active searches but those that have come next to a better one, which becomes their leader."""
        low, high = self.bounds(x[active])
        width = _MERGED * np.where(self.free, np.minimum(high - low, 1.0), 0.0)
        asked = np.column_stack((dof, x))[active]
        kept: list[int] = []
        for number in np.argsort(value[active], kind="stable").tolist():
            near = np.abs(theta[active[kept]] - theta[active[number]]) <= width[number]
            same = near.all(axis=1) & (asked[kept] == asked[number]).all(axis=1)
            if same.any():
                leader[leader == active[number]] = active[kept[int(same.argmax())]]
            else:
                kept.append(number)
        return np.sort(active[kept])

    def _move(
        self,
        active: Index,
        model: _Model,
        theta: Array,
        value: Array,
        z: Array,
        dof: Array,
        x: Array,
        damping: Array,
        last: _Steps,
    ) -> tuple[Array, Index]:
        """Take the best step of each search, in place; gives its fall, and which step it was.

        The undamped one first, and a longer one where it goes on along the `last`; the damped ones, and those
        along kinks, where it does not keep its promise.
        """
        fall, index = np.zeros(active.size), np.zeros(active.size, dtype=np.intp)

        def tried(which: Index, number: int, step: Array, kink: Index | None = None) -> None:
            at = active[which]
            places = theta[at].copy()
            places[:, self.free] += step
            places = self.at(places, x[at])
            if kink is not None:
                places = self._onto(kink, places)
            far, residual = self.objective(places, dof[at])
            gain = value[at] - far
            better = gain > np.maximum(fall[which], 0.0)
            own = which[better]
            best[own], rest[own] = places[better], residual[better]
            fall[own], index[own] = gain[better], number

        best, rest = theta[active], z[active]
        every = np.arange(active.size)
        step = model.step(np.zeros(active.size))
        tried(every, 0, step)
        if not model.margin.shape[1]:  # beyond a kink lies another optimum
            longer = last.factor(active, step, model.unit)
            if (which := np.flatnonzero(longer != 1.0)).size:
                tried(which, 0, (longer[:, None] * step)[which])
        others = np.flatnonzero(~(fall >= _TRUSTED * model.promised))
        if others.size:
            own = model.take(others)
            for number, factor in enumerate(_DAMPED, start=1):
                tried(others, number, own.step(factor * damping[active[others]]))
            damped = (np.zeros(others.size), damping[active[others]])
            along = [(kink, each) for kink in own.kinks_ahead for each in damped]
            for number, (kink, each) in enumerate(along, start=len(_DAMPED) + 1):
                tried(others, number, own.step_along(kink, each), kink)
        gone = (best - theta[active])[:, self.free] * (index == 0)[:, None]
        last.keep(active, step, gone)
        moved = active[fall > 0.0]
        theta[moved], z[moved] = best[fall > 0.0], rest[fall > 0.0]
        value[moved] -= fall[fall > 0.0]
        return fall, index

    @cached_property
    def _is_known(self) -> Bool:
        known = np.ones(self.base.size, dtype=bool)
        for rows in self.groups:
            known[rows] = False
        return known

    @cached_property
    def _least(self) -> Array:
        """Sum of squares of each group below which there is nothing but rounding."""
        return np.array([self.problem.rounding_variance(rows) * rows.size for rows in self.groups])

    def squares(self, z: Array) -> Array:
        """Sum of squares of each group, (m, groups)."""
        if not self.groups:
            return np.zeros((len(z), 0))
        found = np.stack([(z[:, rows] ** 2).sum(axis=1) for rows in self.groups], axis=1)
        return np.asarray(np.maximum(found, self._least))

    def of_known(self, theta: Array, z: Array) -> Array:
        """chi2 of rows with a known sigma and of the priors, (m,)."""
        prior = self.problem.parameters.prior_residuals(theta)
        return np.asarray((z[:, self._is_known] ** 2).sum(axis=1) + np.square(prior).sum(axis=1))

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

    def _onto(self, kink: Index, theta: Array) -> Array:
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
        slopes = np.clip(np.nan_to_num(self.problem.jacobian(theta)), -_STEEPEST, _STEEPEST)
        slopes = slopes / self.base[:, None]
        slopes = self._through_mu(slopes, theta, x)
        weight = np.ones(z.shape)
        squares = self.squares(z)
        for number, rows in enumerate(self.groups):
            weight[:, rows] = (dof[:, number] / squares[:, number])[:, None]
        gradient = -2.0 * (slopes.transpose(0, 2, 1) @ (weight * z)[..., None])[..., 0]
        scaled = slopes * np.sqrt(weight)[..., None]
        hessian = 2.0 * scaled.transpose(0, 2, 1) @ scaled
        place, mean, sd = self.problem.parameters.priors
        if place.size:
            rows_of_prior = np.zeros((len(theta), place.size, theta.shape[1]))
            rows_of_prior[:, np.arange(place.size), place] = 1.0 / sd
            rows_of_prior = self._through_mu(rows_of_prior, theta, x)
            off = (theta[:, place] - mean) / sd
            gradient += 2.0 * (rows_of_prior.transpose(0, 2, 1) @ off[..., None])[..., 0]
            hessian += 2.0 * rows_of_prior.transpose(0, 2, 1) @ rows_of_prior
        whole = hessian.copy()
        for number, rows in enumerate(self.groups):
            pull = (slopes[:, rows].transpose(0, 2, 1) @ z[:, rows, None])[..., 0]
            pull *= (2.0 * np.sqrt(dof[:, number]) / squares[:, number])[:, None]
            whole -= pull[:, :, None] * pull[:, None, :]
        return gradient, hessian, whole


@dataclass(frozen=True)
class _Model:
    """Quadratic models of the objective at m places, in units of the constants' own sizes.

    Attributes
    ----------
    vectors, values : ndarray, (m, q, q), (m, q)
        Eigenvectors and eigenvalues of the scaled Hessian.
    gradient : ndarray, (m, q)
        By the eigenvectors.
    unit : ndarray, (m, q)
        Of each free constant; 0 where a bound stops it.
    margin, slopes : ndarray, (m, kinks), (m, kinks, q)
        Of the kinks, by the free constants; nothing where there are none.
    is_on_bound : ndarray of bool, (m,)
        Whether some free constant lies on a bound.
    """

    vectors: Array
    values: Array
    gradient: Array
    unit: Array
    margin: Array
    slopes: Array
    is_on_bound: Bool

    @classmethod
    def of(cls, search: BatchedSearch, theta: Array, z: Array, dof: Array, x: Array) -> _Model:
        """The models at theta."""
        gradient, hessian, whole = search.derivatives(theta, z, dof, x)
        lower, upper = (end[:, search.free] for end in search.bounds(x))
        here = theta[:, search.free]
        room = _ROOM * np.minimum(upper - lower, 1.0)
        is_low, is_high = here <= lower + room, here >= upper - room
        stopped = (is_low & (gradient > 0.0)) | (is_high & (gradient < 0.0))
        q = here.shape[1]
        diagonal = hessian[:, range(q), range(q)]
        unit = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        unit = np.where(stopped, 0.0, unit)
        scale = unit[:, :, None] * unit[:, None, :]
        values, vectors = np.linalg.eigh(whole * scale)
        bent = values[:, 0] < _CONVEX
        if stopped.any():  # what is stopped has an eigenvalue of 0
            bent = (values < -_LOOSE).any(axis=1) | (_least_moving(values, stopped) < _CONVEX)
        if bent.any():
            values[bent], vectors[bent] = np.linalg.eigh((hessian * scale)[bent])
        along = (np.swapaxes(vectors, 1, 2) @ (unit * gradient)[..., None])[..., 0]
        if search.problem.closure.bilinear and search.problem.has_oblique:
            margin, slopes = search.margins(theta, x)
        else:
            margin, slopes = np.zeros((len(theta), 0)), np.zeros((len(theta), 0, q))
        is_on_bound = np.asarray((is_low | is_high).any(axis=1))
        return cls(vectors, values, along, unit, margin, slopes, is_on_bound)

    def take(self, which: Bool | Index) -> _Model:
        """Some of them."""
        return _Model(*(getattr(self, name)[which] for name in self.__dataclass_fields__))

    @cached_property
    def _inverse(self) -> Array:
        """Reciprocal eigenvalues, 0 of directions that the data do not see."""
        seen = self.values > _LOOSE * np.maximum(self.values[:, -1:], 1e-300)
        return np.where(seen, 1.0 / np.where(seen, self.values, 1.0), 0.0)

    @cached_property
    def promised(self) -> Array:
        """Fall of the model from here to its minimum, (m,)."""
        return np.asarray(0.5 * (self._inverse * self.gradient**2).sum(axis=1))

    def step(self, damping: Array) -> Array:
        """To the minimum of each model with its damping, (m, q)."""
        inverse = self._damped_inverse(damping)
        return -self.unit * (self.vectors @ (inverse * self.gradient)[..., None])[..., 0]

    def _damped_inverse(self, damping: Array | float) -> Array:
        seen, more = self._inverse > 0.0, np.broadcast_to(damping, len(self.unit))[:, None]
        return np.where(seen, 1.0 / np.where(seen, self.values + more, 1.0), 0.0)

    def _across(self, damping: Array | float = 0.0) -> tuple[Array, Array, Array]:
        """Of each kink: H^-1 a by the eigenvectors, a H^-1 a, and how far the damped step goes across it."""
        scaled = (self.slopes * self.unit[:, None, :]) @ self.vectors
        turned = scaled * self._damped_inverse(damping)[:, None, :]
        return turned, (turned * scaled).sum(axis=2), -(turned @ self.gradient[..., None])[..., 0]

    @cached_property
    def _nearest(self) -> tuple[Index, Array, Array]:
        """The nearest kink, its distance in standard deviations, and the fall across it, (m,) each."""
        _, size, moved = self._across()
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = np.where(size > 0.0, np.abs(self.margin) / np.sqrt(size), np.inf)
            fall = np.where(size > 0.0, 0.5 * moved**2 / size, 0.0)
        kink = distance.argmin(axis=1)
        at = np.arange(kink.size), kink
        return kink, distance[at], fall[at]

    @property
    def kinks_ahead(self) -> list[Index]:
        """The first kink that Newton's step meets, and the nearest one."""
        if not self.margin.shape[1]:
            return []
        _, size, moved = self._across()
        with np.errstate(divide="ignore", invalid="ignore"):
            share = -self.margin / moved
        share = np.where((share >= 0.0) & (size > 0.0), share, np.inf)
        return [share.argmin(axis=1), self._nearest[0]]

    def step_along(self, kink: Index, damping: Array) -> Array:
        """To the minimum of the damped model on a kink each, (m, q); eq. (3)."""
        turned, size, moved = self._across(damping)
        at = np.arange(kink.size), kink
        with np.errstate(divide="ignore", invalid="ignore"):
            back = (moved[at] + self.margin[at]) / size[at]
        back = np.where((size[at] > 0.0) & np.isfinite(back), back, 0.0)
        toward = self.unit * (self.vectors @ turned[at][..., None])[..., 0]
        return self.step(damping) - back[:, None] * toward

    @property
    def step_along_nearest_kink(self) -> Array:
        """To the minimum on the nearest kink, (m, q)."""
        nothing = np.zeros(len(self.unit))
        return self.step_along(self._nearest[0], nothing) if self.margin.shape[1] else self.step(nothing)

    @property
    def is_on_kink(self) -> Bool:
        """Whether a place lies on a kink, (m,)."""
        return self._nearest[1] <= _ON_KINK if self.margin.shape[1] else np.zeros(len(self.unit), dtype=bool)

    @property
    def promised_along(self) -> Array:
        """Fall of the model along the nearest kink, (m,)."""
        return self.promised - self._nearest[2] if self.margin.shape[1] else self.promised


@dataclass(frozen=True)
class _Steps:
    """The last step of the model of each search, and how far it went, (m, q) each.

    Where residuals are large, steps of Gauss and Newton shrink by one ratio each. Where the next one goes on
    along the last, it is as long as the line through the two leads to no step at all (Aitken).
    """

    step: Array
    moved: Array

    @classmethod
    def none(cls, m: int, q: int) -> _Steps:
        """Before the first steps."""
        return cls(np.zeros((m, q)), np.zeros((m, q)))

    def keep(self, which: Index, step: Array, moved: Array) -> None:
        """The steps of some searches."""
        self.step[which], self.moved[which] = step, moved

    def factor(self, which: Index, step: Array, unit: Array) -> Array:
        """By which the next steps of some searches are to be longer, (m,); 1 where nothing is known."""
        scale = np.where(unit > 0.0, 1.0 / np.where(unit > 0.0, unit, 1.0), 0.0)
        now, before, moved = step * scale, self.step[which] * scale, self.moved[which] * scale
        along, size = (now * before).sum(axis=1), (before**2).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = along / size
            factor = (moved * before).sum(axis=1) / size / (1.0 - ratio)
            across = ((now - ratio[:, None] * before) ** 2).sum(axis=1)
            good = (across <= _ALIGNED * (now**2).sum(axis=1)) & (factor > 0.0) & (factor < _FURTHER)
        return np.where(good, factor, 1.0)


def _least_moving(values: Array, stopped: Bool) -> Array:
    """Least eigenvalue beside the zeros of constants that a bound stops, (m,)."""
    q = values.shape[1]
    number = np.minimum(stopped.sum(axis=1), q - 1)
    return np.asarray(values[np.arange(len(values)), number])
