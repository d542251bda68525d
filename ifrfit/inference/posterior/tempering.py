"""Points of the posterior to powers below one, from the whole domain down to its neighbourhood.

A tail of a millionth of the posterior, a thousand sd away, makes as much of a variance as all the rest, and a
law that is near to the posterior has no point in it; to a power of 1/16 it holds many of them. Section 9 of
``docs/theory/posterior.md``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ifrfit.inference.posterior.constants_density import ConstantsDensity
from ifrfit.inference.posterior.importance_weights import even_power

Array = NDArray[np.float64]

POWERS = 1.0 / 16.0, 1.0 / 4.0, 1.0  # at the first a tail of a millionth holds many of the points
_RATIO, _FAST = 2.0, 4.0  # from one power to the next; below the first of those that are asked for
_EFFECTIVE = 0.05  # share of uniform points that are effective at the first power
_WALKERS, _FEWEST = 512, 64  # where values are quick, and where they are slow
_ROWS = 10_000  # values that all walkers take at once, roughly
_SWEEPS, _LAST = 8, 3  # moves of every walker at a power; those after which points are kept
_FALL = 20.0  # of the log density to a power, to points that are kept
_NEIGHBOURS = 16  # share of the walkers that count as next to one
_LENGTHS = -2.5, 0.3  # of a move, in differences of two walkers: log10 of the shortest and the longest


def tempered_points(
    density: ConstantsDensity, at: Array, log_p: Array, powers: Sequence[float], rng: np.random.Generator
) -> list[Array]:
    """Points of the density to each of some powers, (m, d) each.

    Sequential Monte Carlo from uniform points, by powers that rise to the last one (Del Moral, Doucet &
    Jasra 2006, J. R. Statist. Soc. B 68, 411); walkers move by differences of two others (ter Braak 2006,
    Statistics and Computing 16, 239).

    Parameters
    ----------
    density : ConstantsDensity
    at : ndarray, (n, d)
        Uniform over the domain.
    log_p : ndarray, (n,)
        Their log density.
    powers : sequence of float
        Rising.
    rng : numpy.random.Generator
    """
    log_p = np.where(np.isfinite(log_p), log_p, -1e300)
    rows = len(density.problem.rows) * density.cost_of_row
    n = min(max(_ROWS // rows, _FEWEST), _WALKERS)
    kept, before = [], 0.0
    last = at, log_p
    for power in _rising(log_p, powers):
        # half of the walkers stay where they are: resampled, all come to descend from a few
        staying = n // 2 if power > powers[0] else 0
        chosen = _resampled((power - before) * log_p, n - staying, rng)
        at = np.concatenate((at[chosen], last[0][n - staying :][:staying]))
        log_p = np.concatenate((log_p[chosen], last[1][n - staying :][:staying]))
        others, found = at, []
        for _ in range(_SWEEPS):
            at, log_p = _moved(density, at, log_p, others, power, rng)
            found.append((at, log_p))
        last = at, log_p
        at, log_p = (np.concatenate(each) for each in zip(*found[-_LAST:], strict=True))
        if power in powers:
            best = np.argsort(-log_p)
            n_near = int(np.sum(power * (log_p - log_p.max()) > -_FALL))
            kept.append(at[best[: max(n_near, _FEWEST)]])
        before = power
    return kept


def _rising(log_p: Array, powers: Sequence[float]) -> list[float]:
    """Rising powers, from one at which uniform points hold the density to the last of those asked for."""
    first = even_power(log_p, _EFFECTIVE, powers[0])
    n_first = math.ceil(math.log(powers[0] / first) / math.log(_FAST) - 1e-6)
    found = [powers[0] * (first / powers[0]) ** (k / n_first) for k in range(n_first, 0, -1)]
    for power, before in zip(powers, (None, *powers), strict=False):
        if before is not None:
            n = round(math.log(power / before) / math.log(_RATIO))
            found += [before * (power / before) ** (k / n) for k in range(1, n)]
        found.append(power)
    return found


def _resampled(log_weights: Array, n: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Numbers of n of the points, by their weights."""
    places = (np.arange(n) + rng.random()) / n
    below = np.cumsum(special.softmax(log_weights))
    return np.minimum(np.searchsorted(below, places), log_weights.size - 1)


def _pairs(at: Array, others: Array, rng: np.random.Generator) -> NDArray[np.intp]:
    """Two of the others for each walker, (2, n): any, or of those next to it along a coordinate.

    On a thin curved ridge only differences of neighbours point along it. That a move back is chosen a little
    more or less often does no harm: points say where to look, and weights do not rest on them.
    """
    n = len(at)
    found = rng.integers(len(others), size=(2, n))
    axis = int(rng.integers(at.shape[1]))
    order = np.argsort(others[:, axis])
    place = np.searchsorted(others[order, axis], at[:, axis])
    reach = max(len(others) // _NEIGHBOURS, 2)
    near = np.clip(place + rng.integers(-reach, reach + 1, size=(2, n)), 0, len(others) - 1)
    return np.where(rng.random(n) < 0.5, order[near], found)


def _moved(
    density: ConstantsDensity, at: Array, log_p: Array, others: Array, power: float, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Each walker by a difference of two of the others, or where it was (Metropolis)."""
    n, d = at.shape
    one, other = _pairs(at, others, rng)
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
