"""Laws whose answers are known, to walk on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Normal:
    """Two correlated normal quantities: means 1 and -2, sd 1 and 0.1, correlation 0.9."""

    mean = np.array([1.0, -2.0])
    sd = np.array([1.0, 0.1])
    rho = 0.9

    def __call__(self, at: Array) -> Array:
        x, y = ((at - self.mean) / self.sd).T
        return np.asarray(-0.5 * (x * x - 2.0 * self.rho * x * y + y * y) / (1.0 - self.rho**2))

    def quantities(self, at: Array) -> Mapping[str, Array]:
        return {"x": at[..., 0], "y": at[..., 1]}

    def starts(self, ensembles: int = 4, walkers: int = 32, seed: int = 1) -> Array:
        rng = np.random.default_rng(seed)
        return self.mean + 2.0 * self.sd * rng.standard_normal((ensembles, walkers, 2))


@dataclass(frozen=True)
class Modes:
    """Two normal modes of x at -apart and +apart, sd 1, weights 0.3 and 0.7; beside it a normal y."""

    apart: float

    def __call__(self, at: Array) -> Array:
        x, y = at.T
        low = np.log(0.3) - 0.5 * (x + self.apart) ** 2
        high = np.log(0.7) - 0.5 * (x - self.apart) ** 2
        return np.asarray(np.logaddexp(low, high) - 0.5 * y * y)

    def quantities(self, at: Array) -> Mapping[str, Array]:
        return {"x": at[..., 0], "y": at[..., 1]}

    def starts(self, signs: Array, walkers: int = 32, seed: int = 1) -> Array:
        """One ensemble a row of `signs`, (ensembles, walkers): the mode of each walker."""
        rng = np.random.default_rng(seed)
        at = rng.standard_normal((*signs.shape, 2))
        at[..., 0] += self.apart * signs
        return at


@dataclass(frozen=True)
class Corner:
    """Two independent exponential quantities, which have their mode on the bounds of their domain."""

    def __call__(self, at: Array) -> Array:
        return np.where((at >= 0.0).all(axis=1), -at.sum(axis=1), -np.inf)

    def quantities(self, at: Array) -> Mapping[str, Array]:
        return {"x": at[..., 0], "y": at[..., 1]}

    def starts(self, ensembles: int = 4, walkers: int = 32, seed: int = 1) -> Array:
        return np.random.default_rng(seed).exponential(2.0, (ensembles, walkers, 2))


def autoregressive(shape: tuple[int, int, int], phi: float, *, common: float = 0.0, seed: int = 1) -> Array:
    """Walkers that follow x' = phi x + noise, (ensembles, steps, walkers), of variance 1.

    Of this variance `common` is the same for all walkers of an ensemble.
    """
    from scipy.signal import lfilter

    rng = np.random.default_rng(seed)
    ensembles, steps, walkers = shape
    innovation = np.sqrt(1.0 - phi * phi)

    def series(n: int) -> Array:
        shocks = innovation * rng.standard_normal((ensembles, steps, n))
        shocks[:, 0] /= innovation
        return np.asarray(lfilter([1.0], [1.0, -phi], shocks, axis=1))

    return np.sqrt(common) * series(1) + np.sqrt(1.0 - common) * series(walkers)
