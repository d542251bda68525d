"""The closure constant given e_n and the transition: its mode, its size, and nodes on both sides of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.row_likelihood import RowLaw
from ifrfit.inference.model.rows import Index
from ifrfit.inference.posterior.clenshaw_curtis import rule
from ifrfit.inference.posterior.noise_scale import NoiseScale
from ifrfit.inference.posterior.quadratic_sums import Quadratic
from ifrfit.inference.posterior.sum_of_squares import AT_ONCE, SumOfSquares
from ifrfit.physics.closures import Coefficients

Array = NDArray[np.float64]

_STEPS = 4  # Gauss-Newton steps to the mode where rows are not linear
_STEP = 1e-6  # of differences by the closure constant
_MANY = 10_000_000  # values of curved rows beyond which the mode is looked for at
_FEW = 16  # nodes of e_n
_CURVED = 3.0  # how much further the tails of rows are followed that are not linear


@dataclass(frozen=True)
class ConditioningValues:
    """Where the closure constant is asked for: e_n, transition, and a common noise factor.

    All are (m, n_e, n_x), broadcastable; `squares` are the sums of squares of the noise groups there.
    """

    squares: list[Quadratic]
    e_n: Array
    x: Array
    noise: Array | None

    def thinned(self, nodes: NDArray[np.intp]) -> ConditioningValues:
        """The same at some of the nodes of e_n."""

        def part(values: Array) -> Array:
            return _thin(values, nodes, self.e_n.shape[1])

        squares = [Quadratic(part(q.square), part(q.slope), part(q.curvature)) for q in self.squares]
        return ConditioningValues(
            squares, part(self.e_n), part(self.x), None if self.noise is None else part(self.noise)
        )


@dataclass(frozen=True)
class ConditionalCoordinate:
    """Coordinate of the closure constant at each place: c = mode -+ size sinh(u), u from 0 to reach.

    Attributes
    ----------
    mode, size : ndarray, (m, n_e, n_x)
    reach : ndarray, (m, n_e, n_x, 2)
        Below and above the mode.
    """

    mode: Array
    size: Array
    reach: Array

    def nodes(self, order: int) -> tuple[Array, Array]:
        """Nodes on both sides, and the log of dc/dv with v = u/reach, (m, n_e, n_x, 2 (order + 1))."""
        u = self.reach[..., None] * rule(order).nodes
        sign = np.array([-1.0, 1.0])[:, None]
        size = self.size[..., None, None]
        rising = np.exp(u)
        falling = 1.0 / rising
        nodes = self.mode[..., None, None] + (0.5 * sign * size) * (rising - falling)  # sinh
        with np.errstate(divide="ignore"):
            jacobian = np.log((0.5 * size * self.reach[..., None]) * (rising + falling))  # cosh
        shape = (*self.mode.shape, -1)
        return nodes.reshape(shape), jacobian.reshape(shape)


def c_domain(
    c: FreeParameter, k: Coefficients, mu_ends: tuple[float, float] | None, e_n: Array, x: Array
) -> tuple[Array, Array]:
    """Domain of the closure constant, less what the bounds of mu forbid where the bound is tilted."""
    lower, upper = np.full((1, 1, 1), c.lower), np.full((1, 1, 1), c.upper)
    if k.b1 and mu_ends is not None:
        with np.errstate(divide="ignore", invalid="ignore"):
            wall = (mu_ends[1] * (1.0 + e_n) / x - k.b0) / k.b1
            floor = (mu_ends[0] * (1.0 + e_n) / x - k.b0) / k.b1 if mu_ends[0] else c.lower
        lower = np.maximum(lower, np.minimum(floor, c.upper))
        upper = np.maximum(np.minimum(upper, wall), lower)
    return lower, upper


def conditional_coordinate(
    misfit: SumOfSquares,
    noise: tuple[NoiseScale, ...] | None,
    sigma: Array,
    c: FreeParameter,
    place: ConditioningValues,
    limits: tuple[Array, Array],
    tail: float,
    law: RowLaw | None = None,
) -> ConditionalCoordinate:
    """Find the conditional mode inside its limits, its size, and how far both tails reach.

    Parameters
    ----------
    misfit : SumOfSquares
    noise : tuple of UnknownNoise or None
        Integrated inside, one a noise group.
    sigma : ndarray
        Likely noise of each group, relative to the weights.
    c : FreeParameter
    place : ConditioningValues
    limits : (ndarray, ndarray)
    tail : float
        Fall of the log density beyond which nothing is counted.
    law : RowLaw, optional
        Of the rows, where `misfit` is no more than near to it.
    """
    lower, upper = limits
    weight = [1.0 / s**2 for s in sigma]
    few = _few(misfit, place)
    if few is None:
        at, d, curvature, count = _conditional_mode(misfit, noise, weight, c, place, limits)
    else:
        # where rows are dear, the mode moves smoothly enough to be found at some of the nodes of e_n
        n_e = place.e_n.shape[1]
        some = _thin(lower, few, n_e), _thin(upper, few, n_e)
        at, d, curvature, count = _conditional_mode(misfit, noise, weight, c, place.thinned(few), some)
        at, d, curvature = (_between(y, place.e_n, few) for y in (at, d, curvature))
    reference = misfit.reference.c
    with np.errstate(divide="ignore"):
        size = np.where(curvature > 0.0, 1.0 / np.sqrt(curvature), upper - lower)
    size = np.maximum(_spread_over(size, d.shape), 1e-300)
    mode = np.clip(reference + d, lower, upper)
    pull = np.abs(reference + d - mode) / size  # slope of the log density at the bound, per size
    fall = tail
    if count:  # Student's tails: so far out that their mass does not count either
        fall = 0.5 * count * math.expm1(min(2.0 * tail / max(count - 1.0, 1.0), 30.0))
    far = size * 2.0 * fall / (pull + np.sqrt(pull * pull + 2.0 * fall))
    if not misfit.is_quadratic or law is not None:
        far = _CURVED * far  # an angle saturates, so its misfit rises more slowly than it begins
    if not misfit.is_quadratic:  # where the steps have not come to rest inside, the mode may be anywhere
        far = np.where((pull > 0.0) | (np.abs(mode - at) > size), np.inf, far)
    if law is not None and law.error_model.dof is not None:
        far = np.full(far.shape, np.inf)  # rows that disagree keep places likely that are far from the mode
    size = size / (1.0 + pull)
    room = np.stack((mode - lower, upper - mode), axis=-1)
    reach = np.arcsinh(np.minimum(room, far[..., None]) / size[..., None])
    return ConditionalCoordinate(mode, size, reach)


def _conditional_mode(
    misfit: SumOfSquares,
    noise: tuple[NoiseScale, ...] | None,
    weight: list[Array | float],
    c: FreeParameter,
    place: ConditioningValues,
    limits: tuple[Array, Array],
) -> tuple[Array, Array, Array, int]:
    """Where the last step began, distance of the mode from the reference, curvature, rows of free noise."""
    lower, upper = limits
    reference = misfit.reference.c
    added = 1.0 / c.prior[1] ** 2 if c.prior else 0.0
    mean = c.prior[0] - reference if c.prior else 0.0
    d = np.zeros((1, 1, 1))
    factor = 1.0 if place.noise is None else 1.0 / place.noise**2
    count = 0  # rows behind the noises that widen the tails
    for number, group in enumerate(noise or ()):
        takes_part = np.ndim(place.squares[number].slope) > 0 or misfit.curved_rows[number].size > 0
        count += group.n if takes_part else 0
    for _ in range(_STEPS if not misfit.is_quadratic else 1 + (noise is not None)):
        slope: Array = np.asarray(added * mean)
        curvature: Array = np.asarray(added)
        at = reference + np.clip(d, lower - reference, upper - reference)
        curved = [_gauss_newton(misfit, rows, place, at) for rows in misfit.curved_rows]
        for w, q, (more_slope, more_curvature) in zip(weight, place.squares, curved, strict=True):
            if np.ndim(q.slope) == np.ndim(more_slope) == 0:
                continue  # the closure constant takes no part in this group
            slope = slope + factor * w * (q.slope + more_slope + more_curvature * d)
            curvature = curvature + factor * w * (q.curvature + more_curvature)
        with np.errstate(divide="ignore", invalid="ignore"):
            d = np.where(curvature > 0.0, slope / curvature, 0.5 * (lower + upper) - reference)
        d = _spread_over(d, np.broadcast(d, lower).shape)
        if noise:
            inside = np.clip(d, lower - reference, upper - reference)
            weight = [
                group.n / np.maximum(q.at(inside), group.n * group.lower**2)
                if misfit.is_quadratic and np.ndim(q.slope)
                else w
                for group, q, w in zip(noise, place.squares, weight, strict=True)
            ]
    return at, d, np.asarray(curvature), count


def _few(misfit: SumOfSquares, place: ConditioningValues) -> NDArray[np.intp] | None:
    """Nodes of e_n at which the mode is looked for; None for all of them."""
    n_e = place.e_n.shape[1]
    values = sum(rows.size for rows in misfit.curved_rows) * n_e * place.x.shape[2]
    if values < _MANY or n_e < 2 * _FEW or place.x.shape[1] > 1:
        return None
    return np.unique(np.linspace(0, n_e - 1, _FEW).round().astype(np.intp))


def _thin(values: Array, nodes: NDArray[np.intp], n_e: int) -> Array:
    return values[:, nodes] if np.ndim(values) == 3 and values.shape[1] == n_e else values


def _between(values: Array, e_n: Array, nodes: NDArray[np.intp]) -> Array:
    """Linear along e_n between its nodes."""
    if values.ndim < 3 or values.shape[1] != nodes.size:
        return values
    at = e_n[0, :, 0]
    right = np.clip(np.searchsorted(at[nodes], at), 1, nodes.size - 1)
    share = ((at - at[nodes[right - 1]]) / (at[nodes[right]] - at[nodes[right - 1]]))[None, :, None]
    return np.asarray((1.0 - share) * values[:, right - 1] + share * values[:, right])


def _spread_over(values: Array, shape: tuple[int, ...]) -> Array:
    return values if values.shape == shape else np.broadcast_to(values, shape)


def _gauss_newton(
    misfit: SumOfSquares, rows: Index, place: ConditioningValues, c: Array
) -> tuple[Array | float, Array | float]:
    """Slope and curvature by c of the sum of squares of curved rows; zeros where there are none."""
    if not rows.size:
        return 0.0, 0.0
    shape = np.broadcast_shapes(place.e_n.shape, place.x.shape, c.shape)
    e, x, c = (np.broadcast_to(y, shape).reshape(-1) for y in (place.e_n, place.x, c))
    slope, curvature = np.empty(e.size), np.empty(e.size)
    step = max(1, AT_ONCE // rows.size)
    for start in range(0, slope.size, step):
        at = slice(start, start + step)
        left = misfit.curved_values(rows, e[at], x[at], c[at])
        right = misfit.curved_values(rows, e[at], x[at], c[at] + _STEP)
        by_c = (left - right) / _STEP
        slope[at] = np.einsum("ij,ij->i", by_c, left)
        curvature[at] = np.einsum("ij,ij->i", by_c, by_c)
    return slope.reshape(shape), curvature.reshape(shape)
