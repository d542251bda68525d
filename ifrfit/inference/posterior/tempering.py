"""Points of the posterior to powers below one, from the whole domain down to its neighbourhood.

A tail of a millionth of the posterior, a thousand sd away, makes as much of a variance as all the rest, and a
law that is near to the posterior has no point in it. To a power of 1/16 it holds most of the points. Eq. (16a)
of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ifrfit.inference.posterior.constants_density import ConstantsDensity

Array = NDArray[np.float64]

POWERS = 1.0 / 16.0, 1.0 / 4.0, 1.0  # at which points are kept
_RATIO = 2.0  # from one power to the next
_EFFECTIVE = 0.05  # share of uniform points that are effective at the first power
_WALKERS, _FEWEST = 512, 64  # where values are quick, and where they are slow
_ROWS = 10_000  # values that all walkers take at once, roughly
_SWEEPS = 4  # moves of every walker at a power
_LENGTHS = -2.5, 0.3  # of a move, in differences of two walkers: log10 of the shortest and the longest


def tempered_points(
    density: ConstantsDensity, at: Array, log_p: Array, rng: np.random.Generator
) -> list[Array]:
    """Points of the density to each of `POWERS`, (m, d) each.

    Sequential Monte Carlo from uniform points, by powers that rise to the last one (Del Moral, Doucet & Jasra
    2006, J. R. Statist. Soc. B 68, 411); walkers move by differences of two others (ter Braak 2006, Statistics
    and Computing 16, 239).

    Parameters
    ----------
    density : ConstantsDensity
    at : ndarray, (n, d)
        Uniform over the domain.
    log_p : ndarray, (n,)
        Their log density.
    rng : numpy.random.Generator
    """
    log_p = np.where(np.isfinite(log_p), log_p, -1e300)
    rows = len(density.problem.rows) * density.cost_of_row
    walkers = min(max(_ROWS // rows, _FEWEST), _WALKERS)
    kept, before = [], 0.0
    for power in _powers(log_p):
        chosen = _resampled((power - before) * log_p, walkers, rng)
        at, log_p = at[chosen], log_p[chosen]
        others, found = at, []
        for _ in range(_SWEEPS):
            at, log_p = _moved(density, at, log_p, others, power, rng)
            found.append((at, log_p))
        at, log_p = (np.concatenate(each) for each in zip(*found[_SWEEPS // 2 :], strict=True))
        if power in POWERS:
            kept.append(at)
        before = power
    return kept


def _powers(log_p: Array) -> list[float]:
    """Rising powers, from one at which uniform points hold the density to the last of `POWERS`."""
    low, high = -30.0, math.log(POWERS[0])
    if _effective_share(POWERS[0] * log_p) < _EFFECTIVE:
        for _ in range(30):
            middle = 0.5 * (low + high)
            is_even = _effective_share(math.exp(middle) * log_p) >= _EFFECTIVE
            low, high = (middle, high) if is_even else (low, middle)
        high = low
    first = math.exp(high)
    n = round(math.log(POWERS[-1] / first) / math.log(_RATIO))
    return sorted({*POWERS, *(POWERS[-1] / _RATIO**k for k in range(1, n + 1))})


def _effective_share(log_weights: Array) -> float:
    weights = special.softmax(log_weights)
    return float(1.0 / np.sum(weights**2)) / weights.size


def _resampled(log_weights: Array, n: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Numbers of n of the points, by their weights."""
    places = (np.arange(n) + rng.random()) / n
    below = np.cumsum(special.softmax(log_weights))
    return np.minimum(np.searchsorted(below, places), log_weights.size - 1)


def _moved(
    density: ConstantsDensity, at: Array, log_p: Array, others: Array, power: float, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Each walker by a difference of two of the others, or where it was (Metropolis)."""
    n, d = at.shape
    one, other = rng.integers(len(others), size=(2, n))
    length = 10.0 ** rng.uniform(*_LENGTHS, (n, 1))
    tried = at + length * (others[one] - others[other])
    inside = np.ones(n, dtype=bool)
    for j in range(d):
        low, high = density.coordinates.ends(j, tried)
        inside &= (tried[:, j] > low) & (tried[:, j] < high)
    rows = np.flatnonzero(inside)
    found = np.full(n, -np.inf)
    if rows.size:
        found[rows] = density(tried[rows])[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        accepted = np.log(rng.random(n)) < power * (found - log_p)
    return np.where(accepted[:, None], tried, at), np.where(accepted, found, log_p)
