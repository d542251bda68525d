"""The least sum of squares of a piecewise problem as a function of one of its unknowns.

In a cell a sum of squares is a quadratic. With one unknown given, and a second one at its best between the
constraints of the cell, it is a parabola over each interval of the given one in which the same constraint, or
none, holds the second: what parametric programming calls a critical region. Section 8 of
docs/theory/certificate.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.optimize.piecewise import Array, PiecewiseBatch, PiecewiseProblem
from ifrfit.inference.optimize.piecewise_quadratic import FLAT, Bool, Index, cell_constraints, quadratic_of

_AT_ONCE = 1_000_000  # constraints met at once
_SLACK = 1e-9  # of a constraint that the other unknown cannot move, relative to its terms
_ROUNDED = 1e-14  # relative, by which an end of an interval may be off


class PiecewiseProfile:
    """Least sum of squares at given values x of one unknown, and its slope there.

    In a cell it is that of a parabola between two ends, for all cells and many places at once. That is quick,
    and good for finding the way; what is found is taken again by the certified solver.

    Parameters
    ----------
    problem : PiecewiseProblem
        In one unknown or two.
    center : ndarray, (q,)
        Its minimum: sums about it keep their digits.
    unknown : int
        The one that is given.
    """

    def __init__(self, problem: PiecewiseProblem, center: Array, unknown: int) -> None:
        problem = problem.sorted_by_tau().about(center)
        quadratic = quadratic_of(PiecewiseBatch(problem))
        self._center, self._rounding = float(center[unknown]), quadratic.rounding
        constraints, self._limits = cell_constraints(problem, quadratic.low, quadratic.high)
        gram, slope = quadratic.gram[:, :, 0], quadratic.slope[:, 0]
        self._constraint, self._gram = constraints[:, :, unknown], gram[unknown, unknown]
        self._slope, self._square = slope[unknown], quadratic.square[0]
        if slope.shape[0] == 1:
            nothing = np.zeros(quadratic.n_cells)
            self._other_constraint, self._mixed = np.zeros_like(self._constraint), nothing
            self._other_gram, self._other_slope = nothing, nothing
        else:
            other = 1 - unknown
            self._other_constraint, self._mixed = constraints[:, :, other], gram[unknown, other]
            self._other_gram, self._other_slope = gram[other, other], slope[other]

    def __call__(self, x: Array) -> tuple[Array, Array]:
        """Least sum of squares at each x, and its derivative in the cell that holds it, both (n,)."""
        step = max(1, _AT_ONCE // self._limits.size)
        parts = [self._evaluate(x[i : i + step]) for i in range(0, x.size, step)]
        return np.concatenate([value for value, _ in parts]), np.concatenate([slope for _, slope in parts])

    def _evaluate(self, x: Array) -> tuple[Array, Array]:
        d = (x - self._center)[:, None]
        low, high, infeasible = self._ends(self._limits - self._constraint * d[..., None])
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.where(
                self._other_gram > 0.0, (self._other_slope - self._mixed * d) / self._other_gram, 0.0
            )
        t = np.minimum(np.maximum(t, low), high)
        value = self._square + d * (self._gram * d - 2.0 * self._slope)
        value = value + t * (2.0 * self._mixed * d + self._other_gram * t - 2.0 * self._other_slope)
        value = np.where(infeasible, np.inf, value)
        at = np.arange(x.size), value.argmin(axis=1)
        return value[at], (2.0 * (self._gram * d + self._mixed * t - self._slope))[at]

    def _ends(self, limits: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Between what the constraints leave the other unknown, (n, m), and where they leave it nothing."""
        normal = self._other_constraint
        with np.errstate(divide="ignore", invalid="ignore"):
            edge = limits / normal
        low = np.where(normal < 0.0, edge, -np.inf).max(axis=-1, initial=-np.inf)
        high = np.where(normal > 0.0, edge, np.inf).min(axis=-1, initial=np.inf)
        violated = limits < -_SLACK * (1.0 + np.abs(self._limits))
        empty = low > high + _SLACK * (1.0 + np.abs(high))
        return low, high, ((normal == 0.0) & violated).any(axis=-1) | empty

    def parabolas(self) -> PiecewiseParabola:
        """The same as parabolas: along the best of the other unknown, and along each constraint on it.

        Along a line t = t0 + t1 d the sum of squares is no less than the profile wherever the constraints
        allow the line, and the profile is one of these: the least of all is the profile, eq. (19).
        """
        m, p = self._limits.shape
        step = max(1, _AT_ONCE // (p + 1) ** 2)
        parts = [self._parabolas_of(slice(i, i + step)) for i in range(0, m, step)]
        pieces, sizes = zip(*parts, strict=True)
        if len(parts) > 1:
            joined = BoundedParabolas(*(np.concatenate(x) for x in zip(*pieces, strict=True)))
            return PiecewiseParabola(self._center, joined, np.concatenate(sizes, axis=1), self._rounding)
        return PiecewiseParabola(self._center, pieces[0], sizes[0], self._rounding)

    def _parabolas_of(self, cells: slice) -> tuple[BoundedParabolas, Array]:
        """Those of some cells, and the sizes of what makes up a, b and s."""
        of = (self._gram, self._mixed, self._other_gram, self._slope, self._other_slope, self._square)
        g, mixed, other, slope, other_slope, square = (each[cells][:, None] for each in of)
        limits, own, normal = self._limits[cells], self._constraint[cells], self._other_constraint[cells]
        # not the last constraint, the upper kink: along it the next cell has the same values
        bounding = np.flatnonzero((normal[:, :-1] != 0.0).any(axis=0))
        is_line = normal[:, bounding] != 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            unbounded = np.where(other > 0.0, np.stack((other_slope, -mixed)) / other, 0.0)
            along = np.stack((limits, -own))[..., bounding] / normal[:, bounding]
        t0, t1 = np.concatenate((unbounded, np.where(is_line, along, 0.0)), axis=2)
        low, high = _allowed(t0, t1, np.concatenate(([-1], bounding)), own, normal, limits)
        low[:, 1:][~is_line] = np.inf
        size = (abs(self._center) + np.where(np.isfinite(x), np.abs(x), 0.0) for x in (low, high))
        low, high = (
            x + side * _ROUNDED * each for x, side, each in zip((low, high), (-1, 1), size, strict=True)
        )
        terms = g, 2.0 * mixed * t1, other * t1 * t1
        half_slopes = -slope, mixed * t0, other * t0 * t1, -other_slope * t1
        constants = square, other * t0 * t0, -2.0 * other_slope * t0
        every = [np.array(np.broadcast_arrays(*x)) for x in (terms, half_slopes, constants)]
        a, b, s = (x.sum(axis=0) for x in every)
        sizes = np.array([np.abs(x).sum(axis=0) for x in every])
        a = np.where(a > FLAT * sizes[0], a, 0.0)
        kept = (low <= high) & (low < np.inf)
        return BoundedParabolas(a, b, s, low, high).take(kept), sizes[:, kept]


def _allowed(
    t0: Array, t1: Array, along: Index, own: Array, normal: Array, limits: Array
) -> tuple[Array, Array]:
    """Values d at which constraints own d + normal t <= limits allow t = t0 + t1 d, (m, lines) each.

    Line j lies along constraint `along[j]`, which it meets whatever rounding says; -1 for along none.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        turned = own[:, None] + normal[:, None] * t1[..., None]
        left = limits[:, None] - normal[:, None] * t0[..., None]
        edge = left / turned
    others = np.arange(limits.shape[1]) != along[:, None]
    low = np.where((turned < 0.0) & others, edge, -np.inf).max(axis=2, initial=-np.inf)
    high = np.where((turned > 0.0) & others, edge, np.inf).min(axis=2, initial=np.inf)
    size = np.abs(limits)[:, None] + np.abs(normal[:, None] * t0[..., None])
    never = (turned == 0.0) & (left < -_ROUNDED * size) & others
    low[never.any(axis=2)] = np.inf
    return low, high


class BoundedParabolas(NamedTuple):
    """Parabolas a d^2 + 2 b d + s, a >= 0, each from `low` to `high`; nowhere if that is less.

    All are arrays of one shape, or broadcast to it.
    """

    a: Array
    b: Array
    s: Array
    low: Array
    high: Array

    def at(self, d: Array) -> Array:
        """Value at d, whatever the ends are."""
        return np.asarray((self.a * d + 2.0 * self.b) * d + self.s)

    def lowest(self) -> tuple[Array, Array]:
        """Least value of each, and its d; infinite where it is nowhere.

        A parabola that is flat has no slope either: of its places the nearest to 0 will do.
        """
        d = np.clip(-self.b / np.where(self.a > 0.0, self.a, np.inf), self.low, self.high)
        with np.errstate(invalid="ignore"):
            return np.where(self.low <= self.high, self.at(d), np.inf), d

    def within(self, low: Array, high: Array) -> BoundedParabolas:
        """The same between further ends."""
        return self._replace(low=np.maximum(self.low, low), high=np.minimum(self.high, high))

    def plus(self, a: Array | float, b: Array | float, s: Array | float) -> BoundedParabolas:
        """The same with another added to each."""
        return self._replace(a=self.a + a, b=self.b + b, s=self.s + s)

    def take(self, which: tuple[Index, ...] | Bool) -> BoundedParabolas:
        """Some of them."""
        return BoundedParabolas(*(each[which] for each in self))


@dataclass(frozen=True)
class PiecewiseParabola:
    """A function that is the least of some bounded parabolas in d = x - center.

    Attributes
    ----------
    center : float
    pieces : BoundedParabolas, (k,)
    sizes : ndarray, (3, k)
        Sums of the sizes of the terms that make up a, b and s.
    rounding : float
        Relative error of a term.
    """

    center: float
    pieces: BoundedParabolas
    sizes: Array
    rounding: float

    def __call__(self, x: Array) -> Array:
        """Value at each x, (n,); infinite where no interval holds it."""
        return self._by_parts(self._at, x)

    def _at(self, x: Array) -> Array:
        d, own = (x - self.center)[:, None], self.pieces
        value = np.where((d >= own.low) & (d <= own.high), own.at(d), np.inf)
        return np.asarray(value.min(axis=1, initial=np.inf))

    def least_between(self, low: Array, high: Array) -> Array:
        """Least value over each of several intervals of x, (n,); infinite where there is none."""
        return self._by_parts(self._between, low - self.center, high - self.center)

    def _between(self, low: Array, high: Array) -> Array:
        value, _ = self.pieces.within(low[:, None], high[:, None]).lowest()
        return np.asarray(value.min(axis=1, initial=np.inf))

    def _by_parts(self, of: Callable[..., Array], *x: Array) -> Array:
        """What is asked at each x, at some of them at a time."""
        step = max(1, _AT_ONCE // max(1, self.pieces.a.size))
        parts = [of(*(each[i : i + step] for each in x)) for i in range(0, x[0].size, step)]
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def along(self, factor: Array, start: float) -> BoundedParabolas:
        """The pieces as parabolas in t, where x = factor (start + t), (n, k) for n factors."""
        own, factor = self.pieces, factor[:, None]
        d = factor * start - self.center
        with np.errstate(divide="ignore", invalid="ignore"):
            low, high = (own.low - d) / factor, (own.high - d) / factor
        # x stays where it is at a factor of 0: everywhere in t, or nowhere
        low, high = np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high)
        b = own.a * d + own.b
        return BoundedParabolas(own.a * factor**2, b * factor, (own.b + b) * d + own.s, low, high)

    @cached_property
    def minima(self) -> tuple[Array, Array]:
        """Least value of each piece, and its rounding error, (k,) each."""
        value, d = self.pieces.lowest()
        a, b, s = self.sizes
        return value, self.rounding * (s + 2.0 * b * np.abs(d) + a * d * d)
