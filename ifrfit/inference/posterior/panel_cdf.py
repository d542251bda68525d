"""Distribution functions made of panels, and quantiles of any distribution function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ifrfit.inference.posterior.quadrature_axis import QuadratureAxis, integral_up_to, rule

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_NARROWEST = 1e-300  # width of a panel
_FEW = 12  # values up to which a table is made for themselves
_BRACKET = 0.25  # in sd, either side of them
_LEAST = 1e-15  # probability told from none
_STEPS = 60  # of the safe search at most
# where distribution functions are tabled, in sd about the mean
_SUPPORT = np.concatenate((np.linspace(-3.6, 3.6, 25), [-30.0, -12.0, -7.0, -5.0, 5.0, 7.0, 12.0, 30.0]))


@dataclass(frozen=True)
class PanelCdf:
    """Densities along panels, one a row, and their integrals.

    Attributes
    ----------
    axis : QuadratureAxis
        The panels.
    coefficients : ndarray, (rows, panels, order + 2)
        Of the integral inside each panel.
    cumulative : ndarray, (rows, panels + 1)
        Mass of the panels before.
    """

    axis: QuadratureAxis
    coefficients: Array
    cumulative: Array

    @classmethod
    def of(cls, axis: QuadratureAxis, values: Array, level: int = 0) -> PanelCdf:
        """From densities at the nodes, (rows, ...) with panels and nodes in turn, by the rule of a level."""
        return cls._of(axis, values.reshape(-1, *axis.shape) @ rule(axis.order).antiderivative[level].T)

    @classmethod
    def of_levels(cls, axis: QuadratureAxis, values: Array) -> PanelCdf:
        """From densities at the nodes, (2, ...): one row by the rules, one by the coarse ones."""
        return cls._of(axis, values.reshape(2, *axis.shape) @ rule(axis.order).antiderivative.swapaxes(1, 2))

    @classmethod
    def _of(cls, axis: QuadratureAxis, made: Array) -> PanelCdf:
        made *= axis.width[:, None]
        cumulative = np.zeros((made.shape[0], made.shape[1] + 1))
        np.cumsum(made.sum(axis=-1), axis=1, out=cumulative[:, 1:])
        return cls(replace(axis), made, cumulative)  # its panels as they are: the axis goes on to be refined

    @property
    def total(self) -> Array:
        """Mass of each row."""
        return np.asarray(self.cumulative[:, -1])

    def below(self, threshold: Array) -> Array:
        """Mass below a threshold, (..., rows); thresholds broadcast against rows along the last axis."""
        rows = self.cumulative.shape[0]
        if rows == 1:
            return np.asarray(self.below_in_all(threshold, 1)[0])
        at, v = self._place(np.broadcast_to(threshold, (*threshold.shape[:-1], rows)))
        row = np.broadcast_to(np.arange(rows), at.shape)
        return np.asarray(self.cumulative[row, at] + integral_up_to(self.coefficients[row, at], v))

    def below_in_all(self, t: Array, rows: int) -> Array:
        """Mass below each threshold in the first rows, (rows, ...)."""
        at, v = self._place(t)
        return np.asarray(self.cumulative[:rows, at] + integral_up_to(self.coefficients[:rows, at], v))

    def _place(self, t: Array) -> tuple[Index, Array]:
        """Panel of each threshold, and the place in it from 0 to 1."""
        low, width = self.axis.low, self.axis.width
        at = np.minimum(np.searchsorted(low + width, t), low.size - 1)
        return at, np.clip((t - low[at]) / np.maximum(width[at], _NARROWEST), 0.0, 1.0)


def quantiles(
    cdf: Callable[[Array], Array], p: Array, low: float, high: float, mean: float, sd: float, accuracy: float
) -> Array:
    """Invert a distribution function.

    A table brackets the values; the secant inside the brackets does the rest, all values at once.

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
    ndarray
    """
    if not sd > 0.0:
        return np.full(p.shape, mean)
    reach = _SUPPORT
    if p.size <= _FEW:  # about where a normal law has them, and far out
        z = _normal(p)
        reach = np.concatenate((z - _BRACKET, z + _BRACKET, [-30.0, z.min() - 2.0, z.max() + 2.0, 30.0]))
    grid = np.unique(np.concatenate(([low], np.clip(mean + sd * reach, low, high), [high])))
    table = np.maximum.accumulate(cdf(grid))
    right = np.clip(np.searchsorted(table, p), 1, grid.size - 1)
    a, b = grid[right - 1], grid[right]
    # a normal law is a straight line in this measure of probability, and others are nearly one
    target = _normal(p)
    wa, wb = _normal(table[right - 1]) - target, _normal(table[right]) - target
    kept = np.zeros(p.shape, dtype=int)
    x = b
    for _ in range(_STEPS):  # regula falsi, where an end that stays twice counts half (Illinois)
        with np.errstate(divide="ignore", invalid="ignore"):
            x = np.where(wb > wa, b - wb * (b - a) / (wb - wa), 0.5 * (a + b))
        x = np.clip(x, a, b)
        reached = cdf(x)
        if float(np.abs(reached - p).max()) <= accuracy or float((b - a).max()) <= 1e-13 * sd:
            break
        w = _normal(reached) - target
        above = w > 0.0
        wa, wb = (
            np.where(above, np.where(kept < 0, 0.5, 1.0) * wa, w),
            np.where(above, w, np.where(kept > 0, 0.5, 1.0) * wb),
        )
        a, b = np.where(above, a, x), np.where(above, x, b)
        kept = np.where(above, -1, 1)
    return np.asarray(x)


def _normal(p: Array) -> Array:
    """Where a normal law has these probabilities below."""
    return np.asarray(special.ndtri(np.clip(p, _LEAST, 1.0 - _LEAST)))
