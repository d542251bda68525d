"""Bounded search from many places at once, for problems that no certified method covers.

Each search takes the steps of its `KinkedQuadratic`: the undamped one, or damped ones where that does not
lead down. Optima lie on kinks: a step that would cross the first one on its way is tried along it as well.
Derivations stand in docs/theory/search.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ifrfit.inference.model.rows import Array, Index
from ifrfit.inference.optimize.aitken import StepsBefore
from ifrfit.inference.optimize.kinked_quadratic import KinkedQuadratic
from ifrfit.inference.optimize.search_objective import Bool, SearchObjective

_STEPS = 60
_AT_REST = 1e-9  # fall of the objective that a step promises, below which a search has converged
_ROUNDING = 1e-13  # of the objective
_TRUSTED = 0.25  # share of the promised fall that a step must keep for no other to be tried
_DAMPING = (1e-8, 1e-2, 1e10)  # least, first, last: relative to the diagonal of the Hessian
_DAMPED = (1.0, 8.0, 64.0)  # times the damping of the last step
_POLISHES = 20
_CREEPING = 3e-4, 8  # fall of a damped step, and of how many, after which a search is given up
_MERGED_EVERY, _MERGED = 8, 1e-4  # steps after which searches are merged that are so near, of the range
_NOTHING = 3e-18  # fall of the objective that leaves theta in doubt by 2e-9 of its sd, as rounding does


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
class BatchedSearch(SearchObjective):
    """An objective, and the search for its minima."""

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

    def polish(self, found: Found, dof: Array) -> Found:
        """Take the last digits of theta, where the objective no longer tells one place from the next.

        Full steps of the model, as long as each promises less than the one before.
        """
        x = np.zeros(len(found.theta))
        dof = np.broadcast_to(dof, (len(found.theta), len(self.groups)))
        theta = found.theta.copy()
        active = np.flatnonzero(found.converged)
        promised = np.full(len(theta), np.inf)
        steps = StepsBefore.none(len(theta), int(self.free.sum()))
        for _ in range(_POLISHES if self.free.any() else 0):
            if not active.size:
                break
            _, z = self.objective(theta[active], dof[active])
            model = KinkedQuadratic.of(self, theta[active], z, dof[active], x[active])
            on_kink = model.is_on_kink & (model.promised > _AT_REST + _ROUNDING * np.abs(found.value[active]))
            left = np.where(on_kink, model.promised_along, model.promised)
            going = (left < promised[active]) & (left > _NOTHING)
            step = np.where(
                on_kink[:, None], model.step_along_nearest_kink, model.step(np.zeros(active.size))
            )
            longer = step * steps.factor(active, step, model.unit)[:, None]
            steps.keep(active, step, longer)
            active = active[going]
            promised[active] = left[going]
            theta[np.ix_(active, np.flatnonzero(self.free))] += longer[going]
            theta[active] = self.at(theta[active], x[active])
        value, _ = self.objective(theta, dof)
        slack = _AT_REST + _ROUNDING * np.abs(found.value)
        good = value <= found.value + slack
        return Found(
            np.where(good[:, None], theta, found.theta), np.where(good, value, found.value), found.converged
        )

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
        last = StepsBefore.none(len(theta), int(self.free.sum()))
        for number in range(steps):
            if number % _MERGED_EVERY == _MERGED_EVERY - 1:
                active = self._leading(active, theta, value, dof, x, leader)
            if not active.size:
                break
            model = KinkedQuadratic.of(self, theta[active], z[active], dof[active], x[active])
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
        model: KinkedQuadratic,
        theta: Array,
        value: Array,
        z: Array,
        dof: Array,
        x: Array,
        damping: Array,
        last: StepsBefore,
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
                places = self.onto(kink, places)
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
