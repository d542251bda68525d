"""Marginal of an unknown noise: its law given the sum of squares, averaged over the posterior of that sum.

Eq. (11) of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.posterior.marginals import Marginal
from ifrfit.inference.posterior.noise_scale import NoiseScale
from ifrfit.inference.posterior.panel_cdf import PanelCdf
from ifrfit.inference.posterior.quadrature_axis import QuadratureAxis

Array = NDArray[np.float64]

_ORDER = 24  # of the rules in the logarithm of sigma
_WIDTH = 3.0  # of their panels, in sd of the law given the sum of squares: exact to rounding
_FALL = 40.0  # of the log density beyond which that law is not followed
_FEWEST, _MOST = 16, 96  # nodes for functions of a sum of squares


def noise_over_squares(
    own: NoiseScale, square: Array, weight: Array, negligible: float, name: str
) -> Marginal:
    """The unknown sigma of a group, where a discrete law of its sum of squares is known.

    Parameters
    ----------
    own : NoiseScale
        The law of sigma given the sum of squares.
    square : ndarray, (m,)
    weight : ndarray, (2, m)
        Probability of each, at both levels.
    negligible : float
        Probability of sums of squares that are left out.
    name : str
    """
    square, weight = _compressed(square, weight, own.n, negligible)
    axis = QuadratureAxis.of(_edges(own, float(square.min()), float(square.max())), _ORDER)
    nodes = axis.nodes()
    density = weight @ own.density(nodes, square[:, None])
    sigma, rule = np.exp(nodes), axis.weights()[0]
    panels = PanelCdf.of(axis, density)

    @cache
    def moments(level: int) -> tuple[float, float]:
        probability = rule * density[level]
        mean = float(probability @ sigma)
        return mean, math.sqrt(max(float(probability @ (sigma - mean) ** 2), 0.0))

    def cdf(t: Array, levels: int) -> Array:
        return panels.below_in_all(np.log(np.maximum(t, 1e-300)), levels)

    return Marginal(name, own.lower, own.upper, moments, cdf)


def _edges(own: NoiseScale, least: float, most: float) -> Array:
    """Edges in the logarithm of sigma, about the laws given sums of squares from the least to the most."""
    low, high = math.log(own.lower), math.log(own.upper)
    # without bounds the log density is -n s - square/2 exp(-2 s)
    modes = [0.5 * math.log(max(square, 1e-300) / own.n) for square in (least, most)]
    inside = [min(max(mode, low), high) for mode in modes]
    r = 2.0 * _FALL / own.n
    start = max(inside[0] - 0.5 * math.log1p(r + math.sqrt(r * (r + 2.0))), low)
    end = min(inside[1] + _FALL / own.n + 0.5, high)
    width = _WIDTH / math.sqrt(2.0 * own.n)
    edges = np.linspace(start, end, 2 + int((end - start) / width))
    # a bound that cuts the law off leaves it steep there
    growing = 2.0 ** np.arange(60)
    if modes[0] < low:
        edges = np.concatenate((edges, low + _WIDTH / own.n * growing))
    if modes[1] > high:
        edges = np.concatenate((edges, high - _WIDTH * own.upper**2 / most * growing))
    return edges[(edges >= start) & (edges <= end)]


def _compressed(square: Array, weight: Array, n: int, negligible: float) -> tuple[Array, Array]:
    """A discrete law of sums of squares, probabilities (2, m), with the same moments on a few nodes.

    What follows from a sum of squares is smooth in its logarithm: the probabilities of all nodes are shared
    out over interpolation nodes, exactly for polynomials. Nodes that hold no more than `negligible` all
    together are left out.
    """
    kept = np.abs(weight[0]) > negligible / weight.shape[1]
    log_q, weight = np.log(np.maximum(square[kept], 1e-300)), weight[:, kept]
    low, high = float(log_q.min()), float(log_q.max())
    if high - low < 1e-9:
        return np.exp(np.array([low])), weight.sum(axis=1, keepdims=True)
    # the law given a sum of squares has the sd sqrt(2/n) in its logarithm
    count = min(_FEWEST + int(4.0 * (high - low) / math.sqrt(2.0 / n)), _MOST)
    y = np.clip((2.0 * log_q - low - high) / (high - low), -1.0, 1.0)
    # sum over the nodes of each Chebyshev polynomial, then the weights that have the same sums
    sums = np.empty((2, count))
    before, now, twice = np.ones_like(y), y, 2.0 * y
    sums[:, 0] = weight.sum(axis=1)
    for j in range(1, count):
        sums[:, j] = weight @ now
        before, now = now, twice * now - before
    angle = np.pi * (np.arange(count) + 0.5) / count
    sums[:, 1:] *= 2.0
    at = np.cos(np.arange(count)[:, None] * angle) / count
    return np.exp(0.5 * (low + high) + 0.5 * (high - low) * np.cos(angle)), sums @ at
