"""Profiles by the batched search: many values of a quantity at once, each from the optima beside it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.batched_search import Found
from ifrfit.inference.optimize.multistart import starts
from ifrfit.inference.optimize.optimum import Array
from ifrfit.inference.optimize.search_objective import FollowingMu
from ifrfit.inference.profile.objective import Misfit

# the lowest places from which the search begins at each value, and at those looked at first
_SEEDS, _MOST = 2, 6
_SWEEPS = 4  # from the optimum at one value to that at the next
_IMPROVED = 1e-7  # fall of the rise that calls for another sweep
_OTHER = 1e-6  # places nearer than this are one


@dataclass(frozen=True)
class Constraint:
    """What a quantity with a given value leaves free.

    Attributes
    ----------
    place : int or None
        Entry of theta that is fixed at `value_at`; None where mu follows.
    mu : FollowingMu or None
        The mu that follows from the quantity.
    value_at : callable
        Values of the quantity to those of the entry.
    """

    place: int | None = None
    mu: FollowingMu | None = None
    value_at: Callable[[Array], Array] = field(default=lambda x: x)


class SearchedProfile:
    """Least rise at values of a quantity, each found from the optima at values nearby.

    Parameters
    ----------
    misfit : Misfit
    constraint : Constraint
    value : float
        Of the quantity at the fit's optimum.

    Attributes
    ----------
    unconverged : list of float
        Values at which the search did not come to its end.
    """

    def __init__(self, misfit: Misfit, constraint: Constraint, value: float) -> None:
        problem = misfit.problem
        self._misfit, self._constraint = misfit, constraint
        free = problem.parameters.free.copy()
        free[constraint.place if constraint.mu is None else constraint.mu.i_mu] = False
        self._search = replace(misfit.search, free=free, mu=constraint.mu)
        fit = misfit.fit
        places = [fit.optimum.theta, *fit.optimum.outlying]
        places += [mode.theta for mode in misfit.modes[1:]]
        self._optima = np.array(_distinct(places))
        self._theta = {value: fit.optimum.theta}
        self._rise = {value: 0.0}
        self.unconverged: list[float] = []

    def __call__(self, x: Array) -> Array:
        """Rise at several values, (k,)."""
        is_first = len(self._rise) == 1
        seeds = [self._seeds(value) for value in x.tolist()]
        number = np.repeat(np.arange(x.size), [len(each) for each in seeds])
        self._improve(x, number, np.concatenate(seeds), _MOST if is_first else _SEEDS)
        if is_first:
            self._sweep()
        return np.array([self._rise[value] for value in x.tolist()])

    def _seeds(self, value: float) -> Array:
        """Places to begin from: beside the value, between its neighbours, or the optima of the fit."""
        known = np.array(sorted(self._rise))
        i = int(np.searchsorted(known, value))
        beside = [self._theta[float(known[j])] for j in (i - 1, i) if 0 <= j < known.size]
        if len(beside) == 2:
            share = (value - known[i - 1]) / (known[i] - known[i - 1])
            beside.append(beside[0] + share * (beside[1] - beside[0]))
        return self._everywhere if known.size == 1 else np.array(beside)

    @cached_property
    def _everywhere(self) -> Array:
        """The optima of the fit, and places all over the domain: far values have valleys of their own."""
        return np.concatenate((self._optima, starts(self._misfit.problem)))

    def _sweep(self) -> None:
        """Search at each value from the optima at its neighbours until none improves."""
        known = np.array(sorted(self._rise))
        moved = set(known.tolist())
        for _ in range(_SWEEPS):
            pairs = [
                (i, self._theta[float(known[j])])
                for i in range(known.size)
                for j in (i - 1, i + 1)
                if 0 <= j < known.size and float(known[j]) in moved
            ]
            if not pairs:
                return
            number = np.array([i for i, _ in pairs])
            moved = self._improve(known, number, np.array([theta for _, theta in pairs]), _SEEDS)

    def _improve(self, x: Array, number: Index, start: Array, most: int) -> set[float]:
        """Search at x[number] from each start and keep what is better; gives the values that are."""
        search, at = self._search, x[number]
        start = np.where(self._misfit.problem.parameters.free, start, self._misfit.fit.optimum.theta)
        if self._constraint.place is not None:
            start[:, self._constraint.place] = self._constraint.value_at(at)
        start = search.at(start, at)
        rise = self._misfit.rises(start)
        chosen = _lowest(number, rise, most)
        found = search.run(start[chosen], self._misfit.dof_at(start[chosen]), at[chosen])
        return self._keep(at[chosen], found)

    def _keep(self, x: Array, found: Found) -> set[float]:
        moved = set()
        rises = self._misfit.rises(found.theta)
        for value, theta, rise, converged in zip(
            x.tolist(), found.theta, rises.tolist(), found.converged.tolist(), strict=True
        ):
            before = self._rise.get(value, math.inf)
            if rise < before or value not in self._rise:
                if before - rise > _IMPROVED:
                    moved.add(value)
                self._rise[value], self._theta[value] = rise, theta
                if value in self.unconverged:
                    self.unconverged.remove(value)
                if not converged:
                    self.unconverged.append(value)
        return moved


def _lowest(number: Index, rise: Array, most: int) -> Index:
    """The few lowest of each number."""
    order = np.lexsort((rise, number))
    place = np.arange(order.size) - np.searchsorted(number[order], number[order])
    return order[place < most]


def _distinct(places: Sequence[Array]) -> list[Array]:
    kept: list[Array] = []
    for theta in places:
        if np.isfinite(theta).all() and all(np.abs(theta - other).max() > _OTHER for other in kept):
            kept.append(theta)
    return kept
