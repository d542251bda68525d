"""Panels along one coordinate, refined where the data ask for it, with Clenshaw-Curtis rules on them.

The nodes of a rule include both ends (bounds and kinks are hit exactly), every second node makes the rule of
half the order (its change is the error estimate, at no further cost), and the values at the nodes are a
polynomial whose integral up to any point is known (which makes distribution functions).

Section 5 of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray
from scipy import special

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_FEW = 128  # points below which cosines are cheaper than the steps of Clenshaw's recurrence
_NARROWEST = 1e-300  # width of a panel
_FEW_VALUES = 12  # values up to which a table is made for themselves
_BRACKET = 0.25  # in sd, either side of them
_LEAST = 1e-15  # probability told from none
_STEPS = 60  # of the safe search at most
_SECANTS = 6  # after which a distribution function is none for secants
_SPACING = 0.02  # between places at which a polynomial takes it, where a normal law is a straight line
# relative error of a slope: the polynomial's, and that of a secant over the miss before; of 900 marginals of
# 150 random tables the largest were 0.11 and 11.5
_OF_POLYNOMIAL, _OF_SECANTS = 0.2, 20.0
_RESOLVED = 0.1  # of the slope before, below which a secant is rounding
# where distribution functions are tabled, in sd about the mean
_SUPPORT = np.concatenate((np.linspace(-3.6, 3.6, 25), [-30.0, -12.0, -7.0, -5.0, 5.0, 7.0, 12.0, 30.0]))


@dataclass(frozen=True)
class Rule:
    """A rule of order n with the rule of order n/2 inside it.

    Attributes
    ----------
    nodes : ndarray, (n + 1,)
        Ascending, from 0 to 1.
    weights : ndarray, (2, n + 1)
        Of the rule, and of the coarse one (zero at odd nodes).
    antiderivative : ndarray, (2, n + 2, n + 1)
        From values at the nodes to Chebyshev coefficients of the integral from 0; fine and coarse.
    differences : ndarray, (4, n + 1)
        Fine less coarse integral, from 0 to a quarter, a half, three quarters and the whole.
    """

    nodes: Array
    weights: Array
    antiderivative: Array
    differences: Array


@cache
def rule(order: int) -> Rule:
    """Rule of an even order."""
    fine, coarse = _antiderivative(order), _antiderivative(order // 2)
    padded = np.zeros_like(fine)
    padded[: coarse.shape[0], ::2] = coarse
    both = np.stack((fine, padded))
    nodes = 0.5 - 0.5 * np.cos(np.pi * np.arange(order + 1) / order)
    quarters = chebyshev.chebvander(np.array([-0.5, 0.0, 0.5, 1.0]), order + 1)
    return Rule(nodes, both.sum(axis=1), both, quarters @ (both[0] - both[1]))


def _antiderivative(order: int) -> Array:
    nodes = -np.cos(np.pi * np.arange(order + 1) / order)
    coefficients = np.linalg.inv(chebyshev.chebvander(nodes, order))
    return np.asarray(0.5 * chebyshev.chebint(coefficients, lbnd=-1.0, axis=0))


def integral_up_to(coefficients: Array, v: Array) -> Array:
    """Integral from 0 to v in [0, 1], from the coefficients of the antiderivative along the last axis."""
    y = 2.0 * v - 1.0
    if y.size <= _FEW:  # all polynomials at once
        polynomials = np.cos(_orders(coefficients.shape[-1]) * np.arccos(y)[..., None])
        return np.asarray(np.vecdot(coefficients, polynomials))
    shape = np.broadcast_shapes(coefficients.shape[:-1], v.shape)
    return _clenshaw(lambda j: coefficients[..., j], coefficients.shape[-1], y, shape)


@cache
def _orders(count: int) -> Index:
    return np.arange(count)


def integral_of_some(coefficients: Array, which: Index, v: Array) -> Array:
    """The same with coefficients along the first axis, of the polynomial (n,) that each v (n,) asks for."""
    return _clenshaw(lambda j: coefficients[j].take(which), coefficients.shape[0], 2.0 * v - 1.0, v.shape)


def _clenshaw(coefficient: Callable[[int], Array], count: int, y: Array, shape: tuple[int, ...]) -> Array:
    """Clenshaw's recurrence for a sum of Chebyshev polynomials; numpy's chebval takes half as long again."""
    twice = 2.0 * y
    ahead, second, free = np.zeros(shape), np.zeros(shape), np.empty(shape)
    for j in range(count - 1, 0, -1):
        np.multiply(twice, ahead, out=free)
        free += coefficient(j)
        free -= second
        ahead, second, free = free, ahead, second
    return np.asarray(coefficient(0) + y * ahead - second)


@dataclass
class QuadratureAxis:
    """Panels along one coordinate, (low, high) each, and the order of the rule on them."""

    panels: Array
    order: int

    @classmethod
    def of(cls, edges: Array, order: int) -> QuadratureAxis:
        """Panels between neighbouring edges."""
        edges = np.sort(edges)
        panels = np.empty((edges.size - 1, 2))
        panels[:, 0], panels[:, 1] = edges[:-1], edges[1:]
        return cls(panels[edges[1:] > edges[:-1]], order)

    @property
    def low(self) -> Array:
        """Lower ends."""
        return self.panels[:, 0]

    @property
    def width(self) -> Array:
        """Widths."""
        return self.panels[:, 1] - self.panels[:, 0]

    @property
    def shape(self) -> tuple[int, int]:
        """Panels, and nodes on each."""
        return self.panels.shape[0], self.order + 1

    @property
    def size(self) -> int:
        """Nodes on all panels."""
        return math.prod(self.shape)

    def errors(self, density: Array) -> Array:
        """Largest difference between the rules in each panel, up to its end or inside.

        Parameters
        ----------
        density : ndarray, (rows, panels, nodes)
        """
        difference = np.abs(density @ rule(self.order).differences.T).sum(axis=0)
        return np.asarray(difference.max(axis=-1) * self.width)

    def nodes(self) -> Array:
        """All nodes in turn."""
        return np.asarray((self.low[:, None] + self.width[:, None] * rule(self.order).nodes).reshape(-1))

    def weights(self) -> Array:
        """Weights (2, nodes): fine and coarse."""
        return np.asarray((self.width[:, None] * rule(self.order).weights[:, None, :]).reshape(2, -1))

    def weights_between(self, limits: tuple[Array, Array] | None) -> Array:
        """Weights (2, m, n, nodes) of integrals between limits (m, n); None for the whole axis.

        A panel that a limit cuts keeps its nodes: the polynomial through them is integrated up to the limit.
        """
        if limits is None:
            return self.weights()[:, None, None, :]
        r = rule(self.order)
        share = [np.clip((end[..., None] - self.low) / self.width, 0.0, 1.0) for end in limits]
        chebyshev = [np.cos(np.arange(self.order + 2) * np.arccos(2.0 * v[..., None] - 1.0)) for v in share]
        between = (chebyshev[1] - chebyshev[0]) * self.width[:, None]
        found = np.stack([between @ r.antiderivative[level] for level in (0, 1)])
        return np.asarray(found.reshape(*found.shape[:3], -1))

    def refine(self, mass: Array, error: Array, allowed: float) -> bool:
        """Halve the panels whose error is not allowed, drop those without mass; whether any was halved."""
        if not (error > allowed / error.size).any():
            return False
        # masses whose errors are larger say nothing of where there is none
        keep = (mass > 1e-8 * allowed / mass.size * mass.sum()) | (error.sum() > mass.sum())
        self.panels, error = self.panels[keep], error[keep]
        worst = error > allowed / mass.size
        halved = self.panels[worst]
        middle = halved.mean(axis=1)
        parts = [
            self.panels[~worst],
            np.column_stack((halved[:, 0], middle)),
            np.column_stack((middle, halved[:, 1])),
        ]
        panels = np.concatenate(parts)
        self.panels = panels[np.argsort(panels[:, 0])]
        return True

    def drop(self, mass: Array, share: float) -> None:
        """Drop the panels that hold less than a share of the mass."""
        keep = mass > share * mass.sum()
        if keep.any():
            self.panels = self.panels[keep]

    def split(self, points: Array) -> bool:
        """Split the panels that hold one of the points well inside, there; whether there were any."""
        before = self.panels.shape[0]
        for point in points:
            low, high = self.panels[:, 0], self.panels[:, 1]
            margin = 1e-4 * (high - low)
            for i in np.flatnonzero((point > low + margin) & (point < high - margin)):
                parts = np.array([[low[i], point], [point, high[i]]])
                self.panels = np.concatenate((self.panels[:i], parts, self.panels[i + 1 :]))
        return bool(self.panels.shape[0] > before)


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
        """From densities at the nodes, (2, ...): rows by the rules, and as many by the coarse ones."""
        of_levels, (panels, nodes) = rule(axis.order).antiderivative.swapaxes(1, 2), axis.shape
        made = values.reshape(2, -1, nodes) @ of_levels  # rows and panels in turn
        return cls._of(axis, made.reshape(-1, panels, made.shape[-1]))

    @classmethod
    def _of(cls, axis: QuadratureAxis, made: Array) -> PanelCdf:
        made *= axis.width[:, None]
        cumulative = np.zeros((made.shape[0], made.shape[1] + 1))
        np.cumsum(made.sum(axis=-1), axis=1, out=cumulative[:, 1:])
        # its panels as they are: the axis goes on to be refined
        return cls(QuadratureAxis(axis.panels, axis.order), made, cumulative)

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
        low, high, width = self._panels
        at = np.minimum(high.searchsorted(t), low.size - 1)
        share = (t - low[at]) / width[at]
        return at, np.minimum(np.maximum(share, 0.0), 1.0)

    @cached_property
    def _panels(self) -> tuple[Array, Array, Array]:
        """Ends and widths of the panels, each in one piece."""
        low, width = self.axis.low.copy(), self.axis.width
        return low, low + width, np.maximum(width, _NARROWEST)


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
    if p.size <= _FEW_VALUES:  # about where a normal law has them, and far out
        z = _normal(p)
        reach = np.concatenate((z - _BRACKET, z + _BRACKET, [-30.0, z.min() - 2.0, z.max() + 2.0, 30.0]))
    inside = np.minimum(np.maximum(mean + sd * reach, low), high)
    grid = np.unique(np.concatenate(([low], inside, [high])))
    table = np.maximum.accumulate(cdf(grid))
    right = np.minimum(np.maximum(table.searchsorted(p), 1), grid.size - 1)
    a, b = grid[right - 1], grid[right]
    # a normal law is a straight line in this measure of probability, and others are nearly one
    target = _normal(p)
    wa, wb = _normal(table[right - 1]) - target, _normal(table[right]) - target
    kept = np.zeros(p.shape, dtype=int)
    x = b
    for _ in range(_STEPS):  # regula falsi, where an end that stays twice counts half (Illinois)
        with np.errstate(divide="ignore", invalid="ignore"):
            x = np.where(wb > wa, b - wb * (b - a) / (wb - wa), 0.5 * (a + b))
        x = np.minimum(np.maximum(x, a), b)
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


def quantiles_near_normal(
    cdf: Callable[[Array], Array],
    p: Array,
    ends: tuple[float, float],
    at: Array,
    reached: Array,
    accuracy: float,
) -> Array | None:
    """Invert a distribution function that is known at some places already, and is nearly normal.

    In the measure of probability in which a normal law is a straight line, the inverse is a polynomial
    through these places; secants do the rest, with a fraction of the values that `quantiles` takes.

    Parameters
    ----------
    cdf : callable
        From thresholds (n,) to probabilities.
    p : ndarray
    ends : (float, float)
        Of the support.
    at, reached : ndarray, (k,)
        Places, ascending, and the probabilities below them.
    accuracy : float
        Of the probabilities: of what the last step leaves, by the error of its slope.

    Returns
    -------
    ndarray or None
        None where the polynomial says nothing: for the safe search.
    """
    target, known = _normal(p), _normal(reached)
    places, least, largest = known.tolist(), target[target.argmin()], target[target.argmax()]
    apart = all(after - before > _SPACING for before, after in itertools.pairwise(places))
    if not (apart and least > places[0] and largest < places[-1]):
        return None
    x, slope = _polynomial_through(places, at.tolist(), target)
    before: tuple[Array, Array] | None = None
    slope_error = _OF_POLYNOMIAL
    for _ in range(_SECANTS):
        is_inside = x[x.argmin()] > ends[0] and x[x.argmax()] < ends[1]
        if not (slope[slope.argmin()] > 0.0 and is_inside):
            return None
        found = cdf(x)
        own = _normal(found)
        if before is not None:
            rise, run = own - before[0], x - before[1]
            is_resolved = rise * run > _RESOLVED * run * run / slope  # else a difference is rounding
            slope = np.where(is_resolved, run / np.where(is_resolved, rise, 1.0), slope)
        before = own, x
        x = x + (target - own) * slope
        off = np.abs(found - p)
        worst = float(off[off.argmax()])
        # what this step leaves
        if worst * slope_error <= accuracy:
            return np.asarray(np.minimum(np.maximum(x, ends[0]), ends[1]))
        slope_error = min(_OF_SECANTS * worst, _OF_POLYNOMIAL)
    return None


def _polynomial_through(places: list[float], values: list[float], at: Array) -> tuple[Array, Array]:
    """Value and slope, (n,) each, of the polynomial through some points: Newton's divided differences."""
    coefficients = list(values)
    for order in range(1, len(places)):
        for i in range(len(places) - 1, order - 1, -1):
            rise = coefficients[i] - coefficients[i - 1]
            coefficients[i] = rise / (places[i] - places[i - order])
    slope = np.zeros(at.shape)
    value = slope + coefficients.pop()
    for place in places[-2::-1]:
        beyond = at - place
        slope = slope * beyond + value
        value = value * beyond + coefficients.pop()
    return value, slope


def _normal(p: Array) -> Array:
    """Where a normal law has these probabilities below."""
    return np.asarray(special.ndtri(np.minimum(np.maximum(p, _LEAST), 1.0 - _LEAST)))
