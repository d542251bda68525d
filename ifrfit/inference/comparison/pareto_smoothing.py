"""Importance weights whose tail is smoothed by a generalised Pareto law (PSIS), of many impacts together."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import special

Array = NDArray[np.float64]

_PRIOR_DRAWS, _PRIOR_SHAPE = 10.0, 0.5  # what the shape is drawn towards, and by how many draws
_OF_THE_QUARTILE = 3.0  # scale of the prior, over the lower quartile of the tail
_FEWEST_SCALES = 30  # of which the mean is taken; the root of the number of draws is added
_NEGLIGIBLE = 10.0 * float(np.finfo(float).eps)
_AT_ONCE = 64  # impacts


def smoothed(log_likelihood: Array) -> tuple[Array, Array]:
    """Log of the density that the other impacts predict for each one, and the shape k of its weights' tail.

    The weights of draws without an impact are 1/likelihood; the 3 sqrt(m) largest give way to quantiles of
    the Pareto law that is fitted to them. Where no law fits, as for tails of few distinct values, the log
    density or k is nan.

    Parameters
    ----------
    log_likelihood : ndarray, (m, impacts)
        Of m independent draws, 225 at least.

    References
    ----------
    Vehtari, Simpson, Gelman, Yao & Gabry (2024), Journal of Machine Learning Research 25(72); Zhang &
    Stephens (2009), Technometrics 51, 316.
    """
    blocks = np.array_split(log_likelihood, math.ceil(log_likelihood.shape[1] / _AT_ONCE), axis=1)
    elpd, k = zip(*map(_of_few, blocks), strict=True)
    return np.concatenate(elpd), np.concatenate(k)


def _of_few(log_likelihood: Array) -> tuple[Array, Array]:
    log_weights = log_likelihood.min(axis=0) - log_likelihood
    m = log_weights.shape[0]
    count = math.floor(3.0 * math.sqrt(m))
    order = np.argpartition(log_weights, m - count - 1, axis=0)
    cutoff = np.exp(np.take_along_axis(log_weights, order[m - count - 1 : m - count], axis=0))
    places = order[m - count :]
    places = np.take_along_axis(
        places, np.argsort(np.take_along_axis(log_weights, places, axis=0), axis=0, kind="stable"), axis=0
    )
    tail = np.take_along_axis(log_weights, places, axis=0)
    with np.errstate(all="ignore"):
        k, scale = _pareto(np.exp(tail) - cutoff)
        p = np.arange(0.5, count)[:, None] / count
        excess = np.where(k == 0.0, -np.log1p(-p), np.expm1(-k * np.log1p(-p)) / k)
        quantiles = np.log(cutoff + np.where(scale > 0.0, scale, np.nan) * excess)
    quantiles = np.where(quantiles > 0.0, 0.0, quantiles)  # none above the largest weight
    np.put_along_axis(log_weights, places, np.where(np.isfinite(k), quantiles, tail), axis=0)
    elpd = special.logsumexp(log_weights + log_likelihood, axis=0) - special.logsumexp(log_weights, axis=0)
    return np.asarray(elpd), np.asarray(k)


def _pareto(x: Array) -> tuple[Array, Array]:
    """Shape and scale of the generalised Pareto law of each column of ascending excesses, (n, columns)."""
    n = x.shape[0]
    scales = _FEWEST_SCALES + int(math.sqrt(n))
    b = 1.0 - np.sqrt(scales / (np.arange(scales) + 0.5))
    b = b[:, None] / (_OF_THE_QUARTILE * x[int(0.25 * n + 0.5) - 1]) + 1.0 / x[-1]
    shape = np.array([np.log1p(-each * x).mean(axis=0) for each in b])
    weights = special.softmax(n * (np.log(-b / shape) - shape - 1.0), axis=0)
    weights = np.where(weights >= _NEGLIGIBLE, weights, 0.0)
    total = np.maximum(weights.sum(axis=0), _NEGLIGIBLE)
    best = np.where(weights > 0.0, b * weights, 0.0).sum(axis=0) / total
    k = np.log1p(-best * x).mean(axis=0)
    return (n * k + _PRIOR_DRAWS * _PRIOR_SHAPE) / (n + _PRIOR_DRAWS), -k / best
