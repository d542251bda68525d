"""Distributions that are known by draws, of equal weight or not."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ifrfit.inference.distributions.protocol import transition_name
from ifrfit.inference.distributions.quantity_names import NamedQuantities
from ifrfit.inference.model.problem import OFFSET, Problem

Array = NDArray[np.float64]

_RESOLUTION = 0.02, 0.2  # sd: the least and the most over which a density is taken
_COUNTED = 3400.0  # over the number of draws: some 200 of them at the density that decides on "one-sided"


def resolution_of(n_draws: float) -> float:
    """Width, in sd, over which n draws can tell a density."""
    return min(max(_COUNTED / n_draws, _RESOLUTION[0]), _RESOLUTION[1])


@dataclass(frozen=True)
class Draws(NamedQuantities):
    """Draws of the parameters (and noises), as a `Distribution`.

    Attributes
    ----------
    values : mapping of str to ndarray, (m,)
        Draws by name: free entries of theta, kappa, noises; read-only.
    transitions : mapping of str to ndarray, (m,)
        The slip ratio at which sticking ends, by transition_tau[SERIES]; infinite where it does not.
    """

    values: Mapping[str, Array] = field(repr=False)
    transitions: Mapping[str, Array] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, problem: Problem, draws: Mapping[str, Array]) -> Draws:
        """Draws of every free parameter, and of noises where there are any; kappa is worked out.

        Parameters
        ----------
        problem : Problem
        draws : mapping of str to ndarray, (m,)
            By the free entries of `Problem.names`; noises as "noise[SERIES/OBSERVABLE]", or "noise", and the
            "angle_offset". Nothing has to be known of these.

        Raises
        ------
        KeyError
            If a free parameter has no draws.
        """
        others = [name for name in draws if name.startswith("noise") or name == OFFSET]
        draws = {**draws, **problem.parameters.tied_draws(draws)}
        names = (*problem.parameters.free_names, *problem.parameters.tied_names)
        found = {name: draws[name] for name in names} | kappa_draws(problem, draws)
        found |= {name: draws[name] for name in others}
        transitions = {
            transition_name(series): np.broadcast_to(_transition(problem, draws, number), _shape(found))
            for number, series in enumerate(problem.series)
        }
        return cls(_frozen(found), _frozen(transitions))

    @property
    def names(self) -> tuple[str, ...]:
        """Free entries of theta, kappa, and noises."""
        return tuple(self.values)

    @property
    def resolution(self) -> float:
        """Width, in sd, over which draws can tell a density: the more there are the narrower."""
        return resolution_of(self.n_draws)

    @property
    def n_draws(self) -> float:
        """Number of draws."""
        return next((values.size for values in self.values.values()), math.inf)

    @cached_property
    def _sorted(self) -> Mapping[str, Array]:
        return {name: np.sort(values) for name, values in {**self.values, **self.transitions}.items()}

    def mean(self, name: str) -> float:
        """Mean of the draws."""
        return float(self.values[name].mean())

    def sd(self, name: str) -> float:
        """Standard deviation of the draws; exactly 0 where all are the same."""
        values = self.values[name]
        return 0.0 if values.min() == values.max() else float(values.std())

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
        if not names:  # every constant is fixed
            return np.zeros((0, 0))
        centred = [self.values[name] - self.values[name].mean() for name in names]
        stacked = np.array(centred).reshape(len(names), -1)
        return np.asarray(stacked @ stacked.T / max(stacked.shape[1], 1))

    def draws(self, n: int, rng: np.random.Generator) -> dict[str, Array]:
        """n of the draws, each once as long as there are enough of them."""
        kept = int(self.n_draws) if math.isfinite(self.n_draws) else 0
        chosen = rng.choice(kept, n, replace=n > kept) if kept else np.zeros(0, dtype=np.intp)
        return {name: values[chosen] for name, values in self.values.items()}


def kappa_draws(problem: Problem, draws: Mapping[str, Array]) -> dict[str, Array]:
    """kappa = mu (1 + e_n) of each draw, by its names; none where both are fixed."""
    found: dict[str, Array] = {}
    for number, kappa in enumerate(problem.parameters.kappas):
        if kappa.name and kappa.name not in found:
            mu, e_n = (_entry_draws(problem, draws, kind, number) for kind in ("mu", "e_n"))
            found[kappa.name] = np.asarray(mu * (1.0 + e_n))
    return found


def _transition(problem: Problem, draws: Mapping[str, Array], series: int) -> Array:
    """Slip ratio at which sticking ends in a series, of each draw."""
    e_n, c, mu = (
        _entry_draws(problem, draws, kind, series) for kind in ("e_n", problem.closure.constant, "mu")
    )
    law = problem.closure.law(problem.inertia_factor)
    with np.errstate(divide="ignore", invalid="ignore"):
        tau = np.asarray(mu * (1.0 + e_n) / law.bound(c))
    return np.nan_to_num(tau, nan=math.inf, posinf=math.inf)


def _entry_draws(
    problem: Problem, draws: Mapping[str, Array], kind: str | None, series: int
) -> Array | float:
    """Draws of a parameter in a series, or its fixed value; 0 for the constant that a closure has not."""
    if kind is None:
        return 0.0
    place = int(problem.parameters.positions[kind][series])
    fixed = problem.parameters.entries[place].fixed
    return draws[problem.parameters.names[place]] if fixed is None else fixed


def _shape(draws: Mapping[str, Array]) -> tuple[int, ...]:
    return next((values.shape for values in draws.values()), (0,))


def _frozen(draws: Mapping[str, Array]) -> dict[str, Array]:
    """Read-only copies."""
    own = {name: np.array(values, dtype=float) for name, values in draws.items()}
    for values in own.values():
        values.flags.writeable = False
    return own


@dataclass(frozen=True)
class WeightedDraws(NamedQuantities):
    """Draws of the parameters (and noises) with their weights, as a `Distribution`.

    Attributes
    ----------
    values : mapping of str to ndarray, (m,)
        Draws by name: free entries of theta, kappa, noises.
    transitions : mapping of str to ndarray, (m,)
        The slip ratio at which sticking ends, by transition_tau[SERIES]; infinite where it does not.
    weights : ndarray, (m,)
        Probability of each draw; sum 1.
    """

    values: Mapping[str, Array] = field(repr=False)
    transitions: Mapping[str, Array] = field(repr=False)
    weights: Array = field(repr=False)

    @property
    def names(self) -> tuple[str, ...]:
        """Free entries of theta, kappa, and noises."""
        return tuple(self.values)

    @cached_property
    def n_draws(self) -> float:
        """Number of draws of equal weight that tell as much (Kish's effective sample size)."""
        return float(np.floor(1.0 / np.sum(self.weights**2)))

    @property
    def resolution(self) -> float:
        """Width, in sd, over which draws can tell a density: the more there are the narrower."""
        return resolution_of(self.n_draws)

    @cached_property
    def _sorted(self) -> dict[str, tuple[Array, Array]]:
        return {}

    def _in_order(self, name: str) -> tuple[Array, Array]:
        """The draws of a quantity in ascending order, and the probability up to each of them."""
        if name not in self._sorted:
            values = self.values[name] if name in self.values else self.transitions[name]
            order = np.argsort(values)
            self._sorted[name] = values[order], np.cumsum(self.weights[order])
        return self._sorted[name]

    def mean(self, name: str) -> float:
        """Weighted mean."""
        return self._average(self.values[name])

    def sd(self, name: str) -> float:
        """Weighted standard deviation."""
        return float(np.sqrt(self._average((self.values[name] - self.mean(name)) ** 2)))

    def _average(self, values: Array) -> float:
        """Weighted average; not by BLAS, whose threads take longer to start than this takes."""
        return float(np.einsum("i,i->", self.weights, values))

    def quantile(self, name: str, p: ArrayLike) -> Array | float:
        """Quantiles, interpolated between draws; p scalar or array, 0 to 1."""
        values, up_to = self._in_order(name)
        middle = up_to - 0.5 * np.diff(up_to, prepend=0.0)
        wanted = np.asarray(p, dtype=float)
        finite = np.isfinite(values)
        found = np.interp(wanted, middle[finite], values[finite]) if finite.any() else np.inf * (1.0 + wanted)
        if not finite.all():
            found = np.where(wanted > middle[~finite][0], np.inf, found)
        return float(found) if np.ndim(p) == 0 else np.asarray(found)

    def cdf(self, name: str, value: ArrayLike) -> Array | float:
        """Probability of draws below a value; 1 from the largest draw on."""
        values, up_to = self._in_order(name)
        below = np.concatenate(([0.0], up_to))[np.searchsorted(values, value, side="left")]
        found = np.where(np.asarray(value) >= values[-1], 1.0, np.minimum(below, 1.0))
        return float(found) if np.ndim(value) == 0 else found

    def covariance(self, names: Sequence[str]) -> Array:
        """Weighted covariance, (n, n)."""
        centred = np.array([self.values[name] - self.mean(name) for name in names])
        centred = centred.reshape(len(names), self.weights.size)
        return np.asarray((centred * self.weights) @ centred.T)

    def draws(self, n: int, rng: np.random.Generator) -> dict[str, Array]:
        """n draws of everything together, by systematic resampling, in random order."""
        places = (np.arange(n) + rng.random()) / max(n, 1)
        chosen = np.minimum(np.searchsorted(np.cumsum(self.weights), places), self.weights.size - 1)
        chosen = rng.permutation(chosen)
        return {name: values[chosen] for name, values in self.values.items()}
