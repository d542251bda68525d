"""The Gaussian approximation at an optimum, cut at the bounds of the parameters."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ifrfit.inference.distributions.coordinates import to_parameters
from ifrfit.inference.distributions.quantity_names import NamedQuantities
from ifrfit.inference.distributions.truncated_normal import TruncatedNormal
from ifrfit.inference.result.types import State

Array = NDArray[np.float64]

_SINGULAR = 1e-10  # share of the largest variance below which a direction has none
_SWEEPS = 40  # of Gibbs sampling per draw; each draw is a chain of its own, so draws are independent
_RESOLUTION = 0.02  # sd: from a bound to where a density is taken


@dataclass(frozen=True)
class TruncatedGaussian(NamedQuantities):
    """Gaussian about the optimum in the coordinates e_n, closure constant, kappa, as a `Distribution`.

    Marginals are those of the uncut Gaussian, each cut at its own bounds and, where the noise comes from the
    misfit, with Student's t; means and standard deviations are those before the cut. Draws are cut at all
    bounds together, and loose directions have at most the variance of the default prior in them.

    Attributes
    ----------
    marginals : mapping of str to TruncatedNormal
        By name of the quantity; transition_tau[SERIES] among them.
    loadings : mapping of str to ndarray
        Derivative of a quantity by the coordinates, (p,).
    state : State
        The coordinates with the Gaussian and its bounds.
    """

    marginals: Mapping[str, TruncatedNormal]
    loadings: Mapping[str, Array] = field(repr=False)
    state: State

    @property
    def names(self) -> tuple[str, ...]:
        """Free entries of theta, and kappa."""
        return tuple(self.loadings)

    @property
    def resolution(self) -> float:
        """Width, in sd, over which a density is taken."""
        return _RESOLUTION

    @property
    def n_draws(self) -> float:
        """There is no end to its draws."""
        return math.inf

    def mean(self, name: str) -> float:
        """The optimum."""
        return self.marginals[name].mode

    def sd(self, name: str) -> float:
        """Standard deviation before the cut; infinite where the data do not see the quantity."""
        return self.marginals[name].sd

    def quantile(self, name: str, p: ArrayLike) -> Array | float:
        """Quantiles of the marginal; p scalar or array, 0 to 1."""
        return _each(self.marginals[name].quantile, p)

    def cdf(self, name: str, value: ArrayLike) -> Array | float:
        """Probability of the marginal below a value."""
        return _each(self.marginals[name].cdf, value)

    def covariance(self, names: Sequence[str]) -> Array:
        """Covariance before the cut, loose directions with the variance of the default prior, (n, n)."""
        loadings = np.array([self.loadings[name] for name in names]).reshape(
            len(names), self.state.center.size
        )
        return np.asarray(loadings @ self.state.covariance @ loadings.T)

    def draws(self, n: int, rng: np.random.Generator) -> dict[str, Array]:
        """Independent draws of all quantities together."""
        found = to_parameters(self.state.names, truncated_draws(self.state, n, rng))
        if "kappa" not in found:  # of a single series with a separate mu
            found["kappa"] = next(x for name, x in found.items() if name.startswith("kappa"))
        return {name: found[name] for name in self.names}


def truncated_draws(state: State, n: int, rng: np.random.Generator) -> Array:
    """Draws of the Gaussian of a state in its coordinates, (n, p), by Gibbs sampling.

    Each coordinate in turn is drawn given the others; entries without variance stay at the optimum.
    """
    from scipy.special import ndtr, ndtri

    point, center, covariance, lower, upper = (
        state.point,
        state.center,
        state.covariance,
        state.lower,
        state.upper,
    )
    free = np.flatnonzero(np.diag(covariance) > 0.0)
    phi = np.tile(point, (n, 1))
    if free.size == 0:
        return phi
    cov = covariance[np.ix_(free, free)]
    size = np.sqrt(np.diag(cov))
    precision = np.linalg.pinv(cov / np.outer(size, size), hermitian=True)
    low = (lower[free] - center[free]) / size
    high = (upper[free] - center[free]) / size
    values, vectors = np.linalg.eigh(cov / np.outer(size, size))
    if values[0] < _SINGULAR * values[-1]:  # entries that are tied: none can be drawn given the others
        root = vectors * np.sqrt(np.where(values > _SINGULAR * values[-1], values, 0.0))
        optimum = (point[free] - center[free]) / size
        phi[:, free] = center[free] + size * _inside(root, low, high, optimum, n, rng)
        return phi
    z = np.tile(np.clip((point[free] - center[free]) / size, low, high), (n, 1))
    for _ in range(_SWEEPS):
        for i in range(free.size):
            sd = 1.0 / math.sqrt(precision[i, i])
            mean = z[:, i] - (z @ precision[i]) / precision[i, i]
            a, b = (low[i] - mean) / sd, (high[i] - mean) / sd
            flip = a > 0.0  # take the tail in which probabilities keep their digits
            a, b = np.where(flip, -b, a), np.where(flip, -a, b)
            below, above = ndtr(a), ndtr(b)
            x = np.clip(ndtri(below + rng.random(n) * (above - below)), a, b)
            z[:, i] = mean + sd * np.where(flip, -x, x)
    phi[:, free] = np.clip(center[free] + size * z, lower[free], upper[free])
    return phi


def _inside(root: Array, low: Array, high: Array, optimum: Array, n: int, rng: np.random.Generator) -> Array:
    """n draws of a normal law about 0, (n, k), those between bounds; the optimum where hardly any is."""
    kept = np.empty((0, low.size))
    for _ in range(_SWEEPS):
        drawn = rng.standard_normal((n, root.shape[1])) @ root.T
        slack = 1e-9
        kept = np.concatenate((kept, drawn[((drawn >= low - slack) & (drawn <= high + slack)).all(axis=1)]))
        if len(kept) >= n:
            break
    if not len(kept):
        return np.tile(optimum, (n, 1))
    return np.clip(kept[np.arange(n) % len(kept)], low, high)


def _each(function: Callable[[float], float], x: ArrayLike) -> Array | float:
    if np.ndim(x) == 0:
        return function(float(np.asarray(x)))
    values = np.asarray(x, dtype=float)
    return np.array([function(value) for value in values.ravel().tolist()]).reshape(values.shape)
