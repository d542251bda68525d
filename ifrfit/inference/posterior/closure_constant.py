"""The closure constant c given e_n and the transition: its mode, its spread, nodes and integrals.

Eq. (6) of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.error_law import GAUSSIAN
from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.rows import Index
from ifrfit.inference.posterior.noise_scale import KnownScale, NoiseScale, Scale
from ifrfit.inference.posterior.quadrature_axis import integral_of_some, rule
from ifrfit.inference.posterior.series_integral import SeriesIntegral
from ifrfit.inference.posterior.slabs import Slab
from ifrfit.inference.posterior.sum_of_squares import AT_ONCE, Quadratic, SumOfSquares

Array = NDArray[np.float64]

_STEPS = 4  # Gauss-Newton steps to the mode where rows are not linear
_DESCENTS = 6  # the same from a place that is likelier than that mode, at the noises of each step
_LIKELIER = 1.0  # log density by which it is
_DIFFERENCE = 1e-6  # of the closure constant, in derivatives
_CURVED = 3.0  # how much further the tails of rows are followed that are not linear


@dataclass(frozen=True)
class ConditioningValues:
    """What the density of the closure constant is conditional on: e_n, transition, common noise factor.

    All are (m, n_e, n_x), broadcastable; `squares` are the sums of squares of the noise groups there, by c.
    """

    squares: list[Quadratic]
    e_n: Array
    x: Array
    noise: Array | None


@dataclass(frozen=True)
class ConditionalCoordinate:
    """Coordinate of the closure constant at each node: c = mode -+ size sinh(u), u from 0 to u_max.

    Attributes
    ----------
    mode, size : ndarray, (m, n_e, n_x)
    u_max : ndarray, (m, n_e, n_x, 2)
        Below and above the mode.
    """

    mode: Array
    size: Array
    u_max: Array

    def nodes(self, order: int) -> Array:
        """Nodes on both sides, (m, n_e, n_x, 2 (order + 1))."""
        return self._places(*self._rising_and_falling(order))

    def nodes_and_measure(self, order: int) -> tuple[Array, Array]:
        """Nodes on both sides, and the log of dc/dv with v = u/u_max, (m, n_e, n_x, 2 (order + 1))."""
        rising, falling = self._rising_and_falling(order)
        nodes = self._places(rising, falling)
        with np.errstate(divide="ignore"):
            measure = (0.5 * self.size[..., None, None] * self.u_max[..., None]) * (rising + falling)  # cosh
            np.log(measure, out=measure)
        return nodes, measure.reshape(nodes.shape)

    def part(self, slab: Slab) -> ConditionalCoordinate:
        """The coordinate at some nodes."""
        return ConditionalCoordinate(slab.of(self.mode), slab.of(self.size), slab.of(self.u_max))

    def _rising_and_falling(self, order: int) -> tuple[Array, Array]:
        """exp(u) and exp(-u) at the nodes, (m, n_e, n_x, 2, order + 1)."""
        rising = np.exp(self.u_max[..., None] * rule(order).nodes)
        return rising, 1.0 / rising

    def _places(self, rising: Array, falling: Array) -> Array:
        half = 0.5 * np.array([-1.0, 1.0])[:, None] * self.size[..., None, None]
        nodes = rising - falling  # 2 sinh
        nodes *= half
        nodes += self.mode[..., None, None]
        return nodes.reshape(*self.mode.shape, -1)


def _domain(series: SeriesIntegral, c: FreeParameter, e_n: Array, x: Array) -> tuple[Array, Array]:
    """Ends of c, (m, n_e, n_x): its domain, less what the bounds of mu forbid where b depends on c."""
    lower, upper = np.full((1, 1, 1), c.lower), np.full((1, 1, 1), c.upper)
    k, mu = series.squares.coefficients, series.mu
    if k.b1 and isinstance(mu, FreeParameter):
        rises = k.b1 > 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            of_most = (mu.upper * (1.0 + e_n) / x - k.b0) / k.b1
            of_least: Array | float = c.lower if rises else c.upper
            if mu.lower:
                of_least = (mu.lower * (1.0 + e_n) / x - k.b0) / k.b1
        floor, ceiling = (of_least, of_most) if rises else (of_most, of_least)
        lower = np.maximum(lower, np.minimum(floor, c.upper))
        upper = np.maximum(np.minimum(upper, ceiling), lower)
    return lower, upper


def conditional_coordinate(
    series: SeriesIntegral, c: FreeParameter, given: ConditioningValues
) -> ConditionalCoordinate:
    """Find the conditional mode inside its domain, its spread, and how far both tails are followed.

    Parameters
    ----------
    series : SeriesIntegral
    c : FreeParameter
        Its closure constant.
    given : ConditioningValues
    """
    squares, noise, row_law, tail = series.squares, series.noise, series.row_law, series.tail
    lower, upper = domain = _domain(series, c, given.e_n, given.x)
    prior = _log_prior(series, c, given)
    at, d, curvature, count = _conditional_mode(series, prior, given, domain)
    reference = squares.reference.c
    reach: Array = np.zeros((1, 1, 1))
    if noise is not None and row_law is None:
        competing = CompetingNoises(squares, noise, prior, given, (lower - reference, upper - reference))
        places = np.asarray(series.c_places) - reference
        at, d, curvature, reach = competing.likeliest(at, d, curvature, places, tail)
    # rounding leaves a curvature a little below 0 where the constant takes no part
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.where(curvature > 0.0, 1.0 / np.sqrt(curvature), upper - lower)
    size = _broadcast(np.where(size > 0.0, size, 1.0), d.shape)  # any will do for a domain without width
    mode = np.clip(reference + d, lower, upper)
    slope = np.abs(reference + d - mode) / size  # of the log density at the bound, per size
    fall = tail
    if count:  # Student's tails: so far out that their mass does not count either
        fall = 0.5 * count * math.expm1(min(2.0 * tail / max(count - 1.0, 1.0), 30.0))
    far = size * 2.0 * fall / (slope + np.sqrt(slope * slope + 2.0 * fall))
    if count and squares.is_quadratic:
        far = np.minimum(far, _half_width_of_known(given.squares, noise or (), mode - reference, tail))
    if not squares.is_quadratic or row_law is not None:
        far = _CURVED * far  # an angle saturates, so its sum of squares rises more slowly than it begins
    if not squares.is_quadratic:  # where the steps have not come to rest inside, the mode may be anywhere
        far = np.where((slope > 0.0) | (np.abs(mode - at) > size), np.inf, far)
    if row_law is not None and row_law.error_model.tails != GAUSSIAN.name:
        far = np.full(far.shape, np.inf)  # rows that disagree keep places likely that are far from the mode
    far = np.maximum(far, 2.0 * reach)
    size = size / (1.0 + slope)
    room = np.stack((mode - lower, upper - mode), axis=-1)
    u_max = np.arcsinh(np.minimum(room, far[..., None]) / size[..., None])
    return ConditionalCoordinate(mode, size, u_max)


def _log_prior(series: SeriesIntegral, c: FreeParameter, given: ConditioningValues) -> tuple[Array, Array]:
    """Slope at the reference, and curvature, of minus the log of normal priors along the closure constant.

    That of mu is one of them where the bound of sticking depends on c, and with it mu at a transition.
    """
    slope, curvature = np.zeros((1, 1, 1)), np.zeros((1, 1, 1))
    k, mu, reference = series.squares.coefficients, series.mu, series.squares.reference.c
    if c.prior:
        mean, sd = c.prior
        slope, curvature = slope + (reference - mean) / sd**2, curvature + 1.0 / sd**2
    if k.b1 and isinstance(mu, FreeParameter) and mu.prior:
        mean, sd = mu.prior
        x = given.x / (1.0 + given.e_n)
        off, tilt = x * (k.b0 + k.b1 * reference) - mean, x * k.b1
        slope, curvature = slope + tilt * off / sd**2, curvature + (tilt / sd) ** 2
    return slope, curvature


def _conditional_mode(
    series: SeriesIntegral,
    prior: tuple[Array, Array],
    given: ConditioningValues,
    domain: tuple[Array, Array],
) -> tuple[Array, Array, Array, float]:
    """Where the last step began, distance of the mode from the reference, curvature, rows of free noise."""
    squares, noise = series.squares, series.noise
    weight: list[Array | float] = [1.0 / s**2 for s in series.sigma]
    lower, upper = domain
    reference = squares.reference.c
    d = np.zeros((1, 1, 1))
    factor = 1.0 if given.noise is None else 1.0 / given.noise**2
    count = 0.0  # rows behind the noises that widen the tails
    for number, group in enumerate(noise or ()):
        takes_part = np.ndim(given.squares[number].slope) > 0 or squares.curved_rows[number].size > 0
        count += group.n if takes_part and isinstance(group, NoiseScale) else 0
    for _ in range(_STEPS if not squares.is_quadratic else 1 + (noise is not None)):
        slope, curvature = -prior[0], prior[1]
        at = reference + np.clip(d, lower - reference, upper - reference)
        curved = [_gauss_newton(squares, rows, given, at)[1:] for rows in squares.curved_rows]
        for w, q, (more_slope, more_curvature) in zip(weight, given.squares, curved, strict=True):
            if np.ndim(q.slope) == np.ndim(more_slope) == 0:
                continue  # the closure constant takes no part in this group
            slope = slope + factor * w * (q.slope + more_slope + more_curvature * d)
            curvature = curvature + factor * w * (q.curvature + more_curvature)
        with np.errstate(divide="ignore", invalid="ignore"):
            d = np.where(curvature > 0.0, slope / curvature, 0.5 * (lower + upper) - reference)
        d = _broadcast(d, np.broadcast(d, lower).shape)
        if noise:
            inside = np.clip(d, lower - reference, upper - reference)
            weight = [
                group.n / np.maximum(q.at(inside), group.n * group.lower**2)
                if squares.is_quadratic and np.ndim(q.slope) and isinstance(group, NoiseScale)
                else w
                for group, q, w in zip(noise, given.squares, weight, strict=True)
            ]
    return at, d, np.asarray(curvature), count


@dataclass(frozen=True)
class CompetingNoises:
    """Groups of rows with noises of their own, which may disagree about the closure constant.

    Each is taken at its word about its own minimum, and the others are called noisy there: the conditional
    density may have a mode about each of them, and the one that follows from the noises at the optimum need
    not be the likeliest. Without this two of 42 tables with several noises (tables 124 and 233 of seed 12 in
    `benchmarks/strangers.py`) are off by 2.8 and 3.7 sd and claim 1e-4; the other 40 took 6 % less time.

    All places are distances d from the reference, (m, n_e, n_x).
    """

    squares: SumOfSquares
    noise: tuple[Scale, ...]
    prior: tuple[Array, Array]
    given: ConditioningValues
    ends: tuple[Array, Array]

    def likeliest(
        self, at: Array, d: Array, curvature: Array, places: Array, tail: float
    ) -> tuple[Array, Array, Array, Array]:
        """A likelier mode, where there is one, and how far from it other places count.

        Parameters
        ----------
        at : ndarray
            Where the last step to the mode began, as the constant itself.
        d, curvature : ndarray
            The mode that was found, and the curvature of minus the log density there.
        places : ndarray, (p,)
            Where else to look, beside the minima of the groups.
        tail : float
            Fall of the log density beyond which nothing is counted.
        """
        tried = [*self._minima(), *(np.full((1, 1, 1), place) for place in places)]
        if self._n_groups < 2 or not tried:
            return at, d, curvature, np.zeros((1, 1, 1))
        tried = [np.clip(place, *self.ends) for place in tried]
        density = [self._log_density(place) for place in tried]
        own = best = self._log_density(np.clip(d, *self.ends))
        chosen = d
        for place, its in zip(tried, density, strict=True):
            chosen, best = np.where(its > best, place, chosen), np.maximum(its, best)
        better = best > own + _LIKELIER
        if better.any():
            reference = self.squares.reference.c
            for _ in range(_DESCENTS):
                began = np.clip(chosen, *self.ends)
                chosen, steep = self._step(began)
            d, curvature = np.where(better, chosen, d), np.where(better, steep, curvature)
            at = np.where(better, reference + began, at)
        inside = np.clip(d, *self.ends)
        best = np.maximum(best, self._log_density(inside))
        away = [
            np.where(its > best - tail, np.abs(place - inside), 0.0)
            for place, its in zip(tried, density, strict=True)
        ]
        return at, d, curvature, np.max(np.broadcast_arrays(*away), axis=0)

    @property
    def _n_groups(self) -> int:
        """Number of groups that the constant takes part in."""
        return sum(
            np.ndim(q.slope) > 0 or rows.size > 0
            for q, rows in zip(self.given.squares, self.squares.curved_rows, strict=True)
        )

    def _minima(self) -> list[Array]:
        """Where each group's own sum of squares is least, of those whose rows are linear."""
        found = []
        for q, rows in zip(self.given.squares, self.squares.curved_rows, strict=True):
            if np.ndim(q.slope) and not rows.size:
                with np.errstate(divide="ignore", invalid="ignore"):
                    found.append(np.where(q.curvature > 0.0, q.slope / q.curvature, 0.0))
        return found

    def _log_density(self, d: Array) -> Array:
        """Log of the density of the constant, up to what does not depend on it."""
        total = -d * (self.prior[0] + 0.5 * self.prior[1] * d)
        for number, own in enumerate(self.noise):
            square, _, _ = self._group(number, d)
            if np.ndim(square):
                known = isinstance(own, KnownScale)
                total = total + own.log_likelihood(np.asarray(square if known else np.maximum(square, 0.0)))
        return total

    def _group(self, number: int, d: Array) -> tuple[Array | float, Array | float, Array | float]:
        """Sum of squares of a group at d, minus half its slope, half its curvature; 0 without a part."""
        q, rows = self.given.squares[number], self.squares.curved_rows[number]
        if not np.ndim(q.slope) and not rows.size:
            return 0.0, 0.0, 0.0
        more = _gauss_newton(self.squares, rows, self.given, self.squares.reference.c + d)
        # where sigma is known, what does not vary with d may vary with e_n, on whose nodes d has no axis
        known = isinstance(self.noise[number], KnownScale)
        square = d * (q.curvature * d - 2.0 * q.slope) if known else q.at(d)
        return square + more[0], q.slope - q.curvature * d + more[1], q.curvature + more[2]

    def _step(self, d: Array) -> tuple[Array, Array]:
        """A Gauss-Newton step, each noise at its likeliest, and the curvature of minus the log density."""
        slope, curvature = -self.prior[0] - self.prior[1] * d, self.prior[1]
        for number, own in enumerate(self.noise):
            square, down, steep = self._group(number, d)
            if not np.ndim(square):
                continue
            weight: Array | float = 1.0
            if isinstance(own, NoiseScale):
                weight = own.n / np.maximum(square, own.n * own.lower**2)
            slope, curvature = slope + weight * down, curvature + weight * steep
        with np.errstate(divide="ignore", invalid="ignore"):
            return d + np.where(curvature > 0.0, slope / curvature, 0.0), curvature


def _half_width_of_known(squares: list[Quadratic], noise: tuple[Scale, ...], d: Array, tail: float) -> Array:
    """How far from d the density is followed, where rows of known sigma end it.

    Those of unknown noise can gain no more than from d to their own minimum: with A the curvature of those of
    known sigma and p the distance to their minimum, A ((t - p)^2 - p^2)/2 is at most that gain plus the tail.
    """
    gain, half_width = np.asarray(tail), np.asarray(np.inf)
    for group, q in zip(noise, squares, strict=True):
        if isinstance(group, NoiseScale) and np.ndim(q.slope):
            with np.errstate(divide="ignore", invalid="ignore"):
                least = q.square - np.where(q.curvature > 0.0, q.slope**2 / q.curvature, 0.0)
            least = np.maximum(least, group.n * group.lower**2)
            gain = gain + 0.5 * group.n * np.log(np.maximum(q.at(d), least) / least)
    for group, q in zip(noise, squares, strict=True):
        if isinstance(group, KnownScale) and np.ndim(q.slope):
            with np.errstate(divide="ignore", invalid="ignore"):
                away = np.where(q.curvature > 0.0, q.slope / q.curvature - d, 0.0)
                found = np.abs(away) + np.sqrt(away**2 + 2.0 * gain / q.curvature)
            half_width = np.where(q.curvature > 0.0, found, np.inf)
    return np.asarray(half_width)


def _broadcast(values: Array, shape: tuple[int, ...]) -> Array:
    return values if values.shape == shape else np.broadcast_to(values, shape)


def _gauss_newton(
    squares: SumOfSquares, rows: Index, given: ConditioningValues, c: Array
) -> tuple[Array | float, Array | float, Array | float]:
    """Sum of squares of curved rows, minus half its slope and half its curvature by c; zeros without any."""
    if not rows.size:
        return 0.0, 0.0, 0.0
    shape = np.broadcast_shapes(given.e_n.shape, given.x.shape, c.shape)
    e, x, c = (np.broadcast_to(y, shape).reshape(-1) for y in (given.e_n, given.x, c))
    square, slope, curvature = np.empty(e.size), np.empty(e.size), np.empty(e.size)
    step = max(1, AT_ONCE // rows.size)
    for start in range(0, slope.size, step):
        at = slice(start, start + step)
        left = squares.curved_values(rows, e[at], x[at], c[at])
        right = squares.curved_values(rows, e[at], x[at], c[at] + _DIFFERENCE)
        by_c = (left - right) / _DIFFERENCE
        square[at] = np.einsum("ij,ij->i", left, left)
        slope[at] = np.einsum("ij,ij->i", by_c, left)
        curvature[at] = np.einsum("ij,ij->i", by_c, by_c)
    return square.reshape(shape), slope.reshape(shape), curvature.reshape(shape)


@dataclass(frozen=True)
class TwoSidedIntegrals:
    """Integrals of the densities of c on either side of the mode, at the nodes that have any mass.

    Polynomials by the rules are kept; the coarse ones, which few queries ask for, are made for each.

    Attributes
    ----------
    node : ndarray of int, (n,)
        The nodes, ascending, counted along (outer nodes, e_n, transition) of the density.
    sides : ndarray, (nodes, 2, order + 1)
        Density below the mode, then above it, at all nodes.
    coefficients : ndarray, (order + 2, 2, n)
        Of the integrals.
    total : ndarray, (2 levels, 2 sides, n)
    mode, size, u_max : ndarray, (n,), (n,), (2, n)
        Of the coordinate, as in `ConditionalCoordinate`.
    """

    node: Index
    sides: Array
    coefficients: Array
    total: Array
    mode: Array
    size: Array
    u_max: Array

    @classmethod
    def of(cls, f: Array, coordinate: ConditionalCoordinate, order: int, node: Index) -> TwoSidedIntegrals:
        """Integrate a density in the coordinate, (m, n_e, n_x, 2 (order + 1)), at some nodes."""
        shape = f.shape[:3]
        sides = f.reshape(-1, 2, order + 1)
        coefficients = np.empty((order + 2, 2, node.size))
        total = np.empty((2, 2, node.size))
        step = max(1, AT_ONCE // order)
        for part in (slice(start, start + step) for start in range(0, node.size, step)):
            for side in (0, 1):
                density = sides[node[part], side]
                coefficients[:, side, part] = _integrated(density, 0)
                total[:, side, part] = rule(order).weights @ density.T
        mode, size = (np.broadcast_to(y, shape).reshape(-1)[node] for y in (coordinate.mode, coordinate.size))
        u_max = np.broadcast_to(coordinate.u_max, (*shape, 2)).reshape(-1, 2)[node].T
        return cls(node, sides, coefficients, total, mode, size, u_max)

    def below(self, c: Array, which: Index, levels: int) -> Array:
        """Integrals up to values of c, (levels, n, k).

        Parameters
        ----------
        c : ndarray, (n, k)
        which : ndarray of int, (k,)
            Which of the nodes.
        levels : int
            1 for the rules alone, 2 for the coarse ones too.
        """
        distance = c - self.mode[which]
        is_above = distance >= 0.0
        distance = np.abs(distance)
        below, above = self._half_width[:, which]
        inside = np.flatnonzero(distance < np.where(is_above, above, below))
        side, own = is_above.reshape(-1)[inside], inside % which.size
        node = which.take(own)
        column = side * self.mode.size + node
        at = np.arcsinh(distance.reshape(-1)[inside] / self.size[node]) / self.u_max.reshape(-1)[column]
        np.minimum(at, 1.0, out=at)
        found = np.empty((levels, *c.shape))
        for level in range(levels):
            left, right = self.total[level][:, which]
            found[level] = np.where(is_above, left + right, 0.0)  # beyond u_max all of a side
            if level == 0:
                amount = integral_of_some(self.coefficients.reshape(-1, 2 * self.mode.size), column, at)
            else:
                coarse = _integrated(self.sides[self.node[which]].reshape(2 * which.size, -1), level)
                amount = integral_of_some(coarse, 2 * own + side, at)
            found[level].reshape(-1)[inside] = left[own] + np.where(side, amount, -amount)
        return found

    @cached_property
    def _half_width(self) -> Array:
        """Distance from the mode at which u is u_max, (2, n)."""
        with np.errstate(over="ignore", invalid="ignore"):
            return np.where(self.u_max > 0.0, self.size * np.sinh(self.u_max), 0.0)


def _integrated(density: Array, level: int) -> Array:
    """Coefficients of the integrals, (coefficients, k), of densities at a rule's nodes, (k, order + 1)."""
    order = density.shape[1] - 1
    to_integral = rule(order).antiderivative[level]
    if level:  # the coarse integral is of half the order, by every other node
        to_integral, density = to_integral[: order // 2 + 2, ::2], density[:, ::2]
    return np.asarray(to_integral @ density.T)
