"""A distribution that is known by draws of unequal weight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ifrfit.inference.distributions.draws import resolution_of

Array = NDArray[np.float64]


@dataclass(frozen=True)
class WeightedDraws:
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
