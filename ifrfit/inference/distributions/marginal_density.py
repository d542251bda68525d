"""The density of one quantity, from the distribution function that a distribution has of it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.distributions.protocol import Distribution
from ifrfit.inference.model.entry_names import quantity_of

if TYPE_CHECKING:
    from pandas import DataFrame

    from ifrfit.inference.model.parameters import Parameter

Array = NDArray[np.float64]

CELLS = 120
_OUTERMOST = (0.002, 0.998)  # between which draws are shown
_ROOM = 0.04  # beside them, by shares of their range


@dataclass(frozen=True)
class MarginalDensity:
    """A density over cells.

    Attributes
    ----------
    edges : ndarray, (n + 1,)
        Ascending; the first and the last may be ends of the support.
    density : ndarray, (n,)
        Probability of each cell over its width.
    median : float
    """

    edges: Array
    density: Array
    median: float

    @property
    def middles(self) -> Array:
        """Middles of the cells, (n,)."""
        return 0.5 * (self.edges[1:] + self.edges[:-1])


def marginal_density(
    distribution: Distribution, name: str, window: tuple[float, float], support: tuple[float, float]
) -> MarginalDensity:
    """Density of a quantity within a window.

    Parameters
    ----------
    distribution : Distribution
    name : str
    window : tuple of float
        Values that are of interest.
    support : tuple of float
        Ends of the domain, may be infinite: no cell reaches beyond them.
    """
    low, high = max(window[0], support[0]), min(window[1], support[1])
    edges = np.linspace(low, high, CELLS + 1)
    below = np.asarray(distribution.cdf(name, edges), dtype=float)
    density = np.maximum(np.diff(below), 0.0) / (edges[1] - edges[0])
    return MarginalDensity(edges, density, float(distribution.quantile(name, 0.5)))


def marginal_window(draws: Array, ends: Sequence[float] = ()) -> tuple[float, float]:
    """The range that holds all but a few draws and the finite ends of an interval, with some room."""
    finite = [end for end in ends if math.isfinite(end)]
    quantiles = np.quantile(draws, _OUTERMOST).tolist()
    low, high = min([quantiles[0], *finite]), max([quantiles[1], *finite])
    room = _ROOM * (high - low) or 1e-6 * max(1.0, abs(low))
    return float(low - room), float(high + room)


def has_density(distribution: Distribution) -> bool:
    """Whether its distribution functions are smooth: those of draws and weighted draws are steps."""
    return math.isinf(distribution.n_draws)


def marginal_densities(
    distribution: Distribution, asked: Iterable[Parameter], draws: Mapping[str, Array] | DataFrame
) -> dict[str, MarginalDensity]:
    """Densities of free constants and of kappa, where all but a few draws lie; none of a law of steps.

    Parameters
    ----------
    distribution : Distribution
    asked : iterable of Parameter
        The constants, whose ends no density crosses.
    draws : mapping of str to ndarray, (n,)
        Of each quantity.
    """
    if not has_density(distribution):
        return {}
    known, found = {each.name: each for each in asked}, {}
    for name in distribution.names:
        support = _support(quantity_of(name), known)
        own = np.asarray(draws[name], dtype=float) if name in draws else np.zeros(1)
        if support is not None and own.std() > 0.0:
            found[name] = marginal_density(distribution, name, marginal_window(own), support)
    return found


def _support(quantity: str, asked: Mapping[str, Parameter]) -> tuple[float, float] | None:
    """Values that a constant or kappa may have; None where nobody says."""
    if quantity in asked:
        return asked[quantity].ends
    if quantity == "kappa" and {"e_n", "mu"} <= asked.keys():
        (e_low, e_high), (low, high) = asked["e_n"].ends, asked["mu"].ends
        return low * (1.0 + e_low), high * (1.0 + e_high)
    return None
