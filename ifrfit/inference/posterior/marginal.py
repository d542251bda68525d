"""Distribution functions made of panels, and quantiles of any distribution function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.posterior.rule import partial, rule

Array = NDArray[np.float64]

_STEPS = 60  # of the safe search at most
# where distribution functions are tabled, in sd about the mean
_REACH = np.concatenate((np.linspace(-3.6, 3.6, 25), [-30.0, -12.0, -7.0, -5.0, 5.0, 7.0, 12.0, 30.0]))


@dataclass(frozen=True)
class Panels:
    """Densities along panels, one a row, and their integrals.

    Attributes
    ----------
    low, width : ndarray, (rows or 1, panels)
    coefficients : ndarray, (rows, panels, order + 2)
        Of the integral inside each panel.
    cumulative : ndarray, (rows, panels + 1)
        Mass of the panels before.
    """

    low: Array
    width: Array
    coefficients: Array
    cumulative: Array

    @classmethod
    def of(cls, low: Array, width: Array, values: Array, level: int = 0) -> Panels:
        """From densities at the nodes."""
        made = values @ rule(values.shape[-1] - 1).antiderivative[level].T
        made *= width[..., None]
        mass = made.sum(axis=-1)
        cumulative = np.concatenate((np.zeros((mass.shape[0], 1)), np.cumsum(mass, axis=1)), axis=1)
        return cls(low, width, made, cumulative)

    @property
    def total(self) -> Array:
        """Mass of each row."""
        return np.asarray(self.cumulative[:, -1])

    def below(self, threshold: Array) -> Array:
        """Mass below a threshold, (..., rows); thresholds broadcast against rows along the last axis."""
        rows = self.cumulative.shape[0]
        t = np.broadcast_to(threshold, (*threshold.shape[:-1], rows))
        high = self.low + self.width
        if self.low.shape[0] == 1:
            at = np.minimum(np.searchsorted(high[0], t), high.shape[1] - 1)
            low, width = self.low[0][at], self.width[0][at]
        else:
            at = np.minimum((t[..., None] > high).sum(axis=-1), high.shape[1] - 1)
            row = np.arange(rows)
            low, width = self.low[row, at], self.width[row, at]
        row = np.broadcast_to(np.arange(rows), at.shape)
        with np.errstate(divide="ignore", invalid="ignore"):
            v = np.where(width > 0.0, np.clip((t - low) / width, 0.0, 1.0), (t >= low) * 1.0)
        return np.asarray(self.cumulative[row, at] + partial(self.coefficients[row, at], v))


@dataclass(frozen=True)
class Quantiles:
    """Where a distribution function takes some values, and its density there."""

    values: Array
    density: Array


def quantiles(
    cdf: Callable[[Array], Array], p: Array, low: float, high: float, mean: float, sd: float, accuracy: float
) -> Quantiles:
    """Invert a distribution function.

    A table is interpolated inversely; what is then left is divided by the density. Values that are still
    off after a few such steps are searched for inside their brackets.

    Parameters
    ----------
    cdf : callable
        From thresholds (n,) to probabilities.
    p : ndarray
    low, high : float
        Support.
    mean, sd : float
        Where the mass is, to begin with.
    accuracy : float
        Of the probabilities.

    Returns
    -------
    Quantiles
    """
    from scipy.interpolate import PchipInterpolator

    if sd == 0.0:
        return Quantiles(np.full(p.shape, mean), np.full(p.shape, np.inf))
    grid = np.unique(np.concatenate(([low], np.clip(mean + sd * _REACH, low, high), [high])))
    table = np.maximum.accumulate(cdf(grid))
    right = np.clip(np.searchsorted(table, p), 1, grid.size - 1)
    forward = PchipInterpolator(grid, table)
    x = _inside(forward, p, grid[right - 1], grid[right])
    density = np.maximum(forward(x, 1), 1e-12 / sd)
    for _ in range(3):
        w = cdf(x) - p
        if float(np.abs(w).max()) <= accuracy:
            return Quantiles(x, density)
        x = np.clip(x - w / density, grid[right - 1], grid[right])
    x = _searched(cdf, p, x, grid[right - 1], grid[right], table[right - 1], table[right], accuracy, sd)
    return Quantiles(x, density)


def _inside(forward: Callable[[Array], Array], p: Array, a: Array, b: Array) -> Array:
    """Where a cheap rising function takes the values p, by halving."""
    for _ in range(30):
        x = 0.5 * (a + b)
        above = forward(x) > p
        a, b = np.where(above, a, x), np.where(above, x, b)
    return np.asarray(0.5 * (a + b))


def _searched(
    cdf: Callable[[Array], Array],
    p: Array,
    x: Array,
    a: Array,
    b: Array,
    fa: Array,
    fb: Array,
    accuracy: float,
    sd: float,
) -> Array:
    """Regula falsi (Illinois) inside the brackets, all values at once."""
    wa, wb = fa - p, fb - p
    kept = np.zeros(p.shape, dtype=int)
    for _ in range(_STEPS):
        w = cdf(x) - p
        if float(np.abs(w).max()) <= accuracy or float((b - a).max()) <= 1e-13 * sd:
            break
        above = w > 0.0
        wa, wb = (
            np.where(above, np.where(kept < 0, 0.5, 1.0) * wa, w),
            np.where(above, w, np.where(kept > 0, 0.5, 1.0) * wb),
        )
        a, b = np.where(above, a, x), np.where(above, x, b)
        kept = np.where(above, -1, 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            x = np.where(wb > wa, b - wb * (b - a) / (wb - wa), 0.5 * (a + b))
        x = np.clip(x, a, b)
    return x
