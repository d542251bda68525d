"""A law that is known by draws of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ifrfit.inference.distributions.protocol import LEVELS
from ifrfit.inference.model.problem import Problem

Array = NDArray[np.float64]

_GRAIN = 0.02, 0.2  # sd: the least and the most over which a density is taken
_COUNTED = 3400.0  # over the number of draws: some 200 of them at the density that decides on "one-sided"


@dataclass(frozen=True)
class Draws:
    """Draws of the constants (and noises), read as `Distribution` says. Made by `Draws.of`.

    Attributes
    ----------
    problem : Problem
    values : mapping of str to ndarray, (m,)
        Draws by name: free entries of theta, kappa, noises; read-only.
    """

    problem: Problem
    values: Mapping[str, Array] = field(repr=False)

    @classmethod
    def of(cls, problem: Problem, draws: Mapping[str, Array]) -> Draws:
        """Draws of every free constant, and of noises where there are any; kappa is worked out.

        Parameters
        ----------
        problem : Problem
        draws : mapping of str to ndarray, (m,)
            By the free entries of `Problem.names`; noises as "noise[SERIES/OBSERVABLE]", or "noise". Nothing
            has to be known of the noise.

        Raises
        ------
        KeyError
            If a free constant has no draws.
        """
        free = [
            name
            for name, is_free in zip(problem.parameters.names, problem.parameters.free, strict=True)
            if is_free
        ]
        noises = [name for name in draws if name.startswith("noise")]
        found = {name: draws[name] for name in free} | kappas_of(problem, draws)
        found |= {name: draws[name] for name in noises}
        return cls(problem, {name: _frozen(values) for name, values in found.items()})

    @property
    def names(self) -> tuple[str, ...]:
        """Free entries of theta, kappa, and noises."""
        return tuple(self.values)

    @property
    def grain(self) -> float:
        """Width, in sd, over which draws can tell a density: the more there are the narrower."""
        return min(max(_COUNTED / self.kept, _GRAIN[0]), _GRAIN[1])

    @property
    def kept(self) -> float:
        """Number of draws."""
        return next((values.size for values in self.values.values()), math.inf)

    @cached_property
    def _sorted(self) -> Mapping[str, Array]:
        return {name: np.sort(values) for name, values in self.values.items()}

    def mean(self, name: str) -> float:
        """Mean of the draws."""
        return float(self.values[name].mean())

    def sd(self, name: str) -> float:
        """Standard deviation of the draws."""
        return float(self.values[name].std())

    def quantile(self, name: str, p: ArrayLike) -> Array | float:
        """Quantiles, interpolated between draws; p scalar or array, 0 to 1."""
        found = np.quantile(self._sorted[name], np.asarray(p, dtype=float))
        return float(found) if np.ndim(p) == 0 else np.asarray(found)

    def cdf(self, name: str, value: ArrayLike) -> Array | float:
        """Share of draws below a value; all from the largest draw on, so that draws on a bound count."""
        draws = self._sorted[name]
        below = np.searchsorted(draws, value, side="left") / draws.size
        found = np.where(np.asarray(value) >= draws[-1], 1.0, below)
        return float(found) if np.ndim(value) == 0 else found

    def covariance(self, names: Sequence[str]) -> Array:
        """Covariance of the draws, (n, n)."""
        both = [self.values[name] - self.values[name].mean() for name in names]
        stacked = np.array(both).reshape(len(names), -1)
        return np.asarray(stacked @ stacked.T / max(stacked.shape[1], 1))

    def transition(self, series: str) -> Array:
        """Quantiles, at `LEVELS`, of the tau where sticking ends in a series; infinite where it does not."""
        number = self.problem.series.index(series)
        e_n, c, mu = (
            entry_draws(self.problem, self.values, kind, number)
            for kind in ("e_n", self.problem.closure.constant, "mu")
        )
        law = self.problem.closure.law(self.problem.inertia_factor)
        with np.errstate(divide="ignore", invalid="ignore"):
            tau = np.asarray(mu * (1.0 + e_n) / law.bound(c))
        return np.asarray(np.quantile(np.nan_to_num(tau, nan=math.inf, posinf=math.inf), LEVELS))

    def draws(self, n: int, rng: np.random.Generator) -> dict[str, Array]:
        """n of the draws, each once as long as there are enough of them."""
        kept = int(self.kept) if math.isfinite(self.kept) else 0
        chosen = rng.choice(kept, n, replace=n > kept) if kept else np.zeros(0, dtype=np.intp)
        return {name: values[chosen] for name, values in self.values.items()}


def kappas_of(problem: Problem, draws: Mapping[str, Array]) -> dict[str, Array]:
    """kappa = mu (1 + e_n) of each draw, by the names of `Distribution`; none where both are fixed."""
    places, entries = problem.parameters.positions, problem.parameters.entries
    found: dict[str, Array] = {}
    for number in range(len(problem.series)):
        own = [int(places["mu"][number]), int(places["e_n"][number])]
        free = [i for i in own if entries[i].fixed is None]
        if not free:
            continue
        bracket = next(
            (problem.parameters.names[i].partition("[")[2] for i in free if entries[i].separate), ""
        )
        name = f"kappa[{bracket}" if bracket and len(problem.series) > 1 else "kappa"
        if name not in found:
            mu, e_n = (entry_draws(problem, draws, kind, number) for kind in ("mu", "e_n"))
            found[name] = np.asarray(mu * (1.0 + e_n))
    return found


def entry_draws(problem: Problem, draws: Mapping[str, Array], kind: str | None, series: int) -> Array | float:
    """Draws of a constant in a series, or its fixed value; 0 for the constant that a closure has not."""
    if kind is None:
        return 0.0
    place = int(problem.parameters.positions[kind][series])
    fixed = problem.parameters.entries[place].fixed
    return draws[problem.parameters.names[place]] if fixed is None else fixed


def _frozen(values: Array) -> Array:
    """A read-only copy."""
    own = np.array(values, dtype=float)
    own.flags.writeable = False
    return own
