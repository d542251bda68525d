"""Likelihood times prior of the parameters of one series at all nodes of its integral.

Derivation: ``docs/theory/posterior.md``, sections 1 to 3.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.row_likelihood import At, RowLaw
from ifrfit.inference.posterior.closure_constant import (
    ConditionalCoordinate,
    ConditioningValues,
    conditional_coordinate,
)
from ifrfit.inference.posterior.density_grid import DensityGrid
from ifrfit.inference.posterior.nodes import Nodes
from ifrfit.inference.posterior.series_integral import SeriesIntegral, Values, sticking_bound
from ifrfit.inference.posterior.slabs import Slab
from ifrfit.inference.posterior.sum_of_squares import Quadratic, with_c_axis
from ifrfit.physics.impulse_laws import Coefficients
from ifrfit.physics.observables import OBSERVABLES

Array = NDArray[np.float64]

_TINY = 1e-300
_ROUNDING = 1e-12  # of the largest transition


def density_on_grid(series: SeriesIntegral, shared: Mapping[str, Array]) -> DensityGrid:
    """Likelihood times prior of one series at all nodes.

    Parameters
    ----------
    series : SeriesIntegral
    shared : mapping
        "e_n", "c", "mu" and "noise" (a common factor) to values at the outer nodes, (m,).
    """
    known = _known(series, shared)
    log_jacobian: Array = np.zeros((1, 1, 1))
    limits = None
    x = np.zeros((1, 1, 1))
    if series.x_axis is not None:
        t = series.x_axis.nodes()[None, None, :]
        x = series.to_x(t)
        limits = _limits(series, known)
        if series.is_unbounded:  # eq. (3)
            log_jacobian = log_jacobian + (math.log(series.unit) - 2.0 * np.log1p(-t))
    noise = shared["noise"][:, None, None, None] if "noise" in shared else None
    slabs = _slabs(series, known)
    if len(slabs) == 1:
        found = _density_at(series, known, x, log_jacobian, noise)
    else:
        # arithmetic on all nodes at once would take several times the memory of what is kept
        parts = (
            _density_at(
                series,
                Values(slab.of(known.e_n), slab.of(known.c), slab.of(known.mu)),
                slab.of(x),
                slab.of(log_jacobian),
                None if noise is None else slab.of(noise),
                len(slabs),
            )
            for slab in slabs
        )
        found = _NodeDensity.joined(parts, slabs)
    return DensityGrid.of(series, found.nodes, (found.with_c, found.without_c), limits)


@dataclass(frozen=True)
class _NodeDensity:
    """Log density at some nodes: what varies with the closure constant, (m, n_e, n_x, n_c), and the rest."""

    nodes: Nodes
    with_c: Array
    without_c: Array

    @classmethod
    def joined(cls, parts: Iterable[_NodeDensity], slabs: Sequence[Slab]) -> _NodeDensity:
        """That of all nodes, from slabs of them."""
        axis, n, made = slabs[0].axis, slabs[-1].nodes.stop, list[Array]()
        for part, slab in zip(parts, slabs, strict=True):
            arrays = part._arrays()
            if not made:  # what does not depend on the axis stays as it is
                made = [
                    np.empty((*own.shape[:axis], n, *own.shape[axis + 1 :])) if own.shape[axis] > 1 else own
                    for own in arrays
                ]
            for whole, own in zip(made, arrays, strict=True):
                if own.shape[axis] > 1:
                    slab.of(whole)[...] = own
        e_n, c, mu, x, with_c, without_c, *rest = made
        coordinate = ConditionalCoordinate(*rest) if rest else None
        nodes = replace(part.nodes, values=Values(e_n, c, mu), x=x, coordinate=coordinate)
        return cls(nodes, with_c, without_c)

    def _arrays(self) -> list[Array]:
        n, values, at = self.nodes, self.nodes.values, self.nodes.coordinate
        own = [values.e_n, values.c, values.mu, n.x, self.with_c, self.without_c]
        return own if at is None else [*own, at.mode, at.size, at.u_max]


def _slabs(series: SeriesIntegral, known: Values) -> list[Slab]:
    """Nodes at which the density is worked out at once."""
    shape = [max(known.e_n.shape[0], known.c.shape[0], known.mu.shape[0]), known.e_n.shape[1], 1]
    if series.x_axis is not None:
        shape[2] = series.x_axis.size
    if series.integrates_c:
        shape = [1 if axis in series.c_independent_axes else n for axis, n in enumerate(shape)]
    of_c = 2 * (series.c_order + 1) if series.integrates_c else 1
    return series.squares.slabs(shape, of_c * math.prod(shape))


def _density_at(
    series: SeriesIntegral, known: Values, x: Array, log_jacobian: Array, noise: Array | None, slabs: int = 1
) -> _NodeDensity:
    """Likelihood times prior at the nodes of one of a number of slabs."""
    values, x, log_role = series.role.solve(x, known)
    log_jacobian = log_jacobian + log_role
    squares = series.squares.quadratics(values.e_n, x)
    log_measure = log_jacobian[..., None]
    coordinate: ConditionalCoordinate | None = None
    c_nodes = values.c[..., None]
    if series.integrates_c and isinstance(series.c, FreeParameter):
        near = series.squares.with_mu(squares, values.e_n, x)
        at = ConditioningValues(near, values.e_n, x, None if noise is None else noise[..., 0])
        coordinate = conditional_coordinate(series, series.c, at)
        c_nodes, log_by_c = coordinate.nodes_and_measure(series.c_order)
        log_measure = log_measure + log_by_c
    mu = series.role.friction(values, x, c_nodes)
    with_c, without_c = _log_likelihood(series, squares, values.e_n, x, c_nodes, mu, noise, slabs)
    prior = _log_prior(series, values, x, c_nodes, mu)
    with_c, without_c = with_c + prior[0], without_c + prior[1] + series.log_norm
    if log_measure.shape[-1] == 1:
        without_c = without_c + log_measure[..., 0]
    else:
        with_c = with_c + log_measure
    return _NodeDensity(Nodes(series.role, values, x, coordinate, series.c_order), with_c, without_c)


def _known(series: SeriesIntegral, shared: Mapping[str, Array]) -> Values:
    """Parameters that are fixed, shared, or have nodes of their own; 0 in the place of the others."""

    def of(kind: str, known: FreeParameter | float | None) -> Array:
        if isinstance(known, FreeParameter):
            return np.zeros((1, 1, 1))
        return shared[kind][:, None, None] if known is None else np.full((1, 1, 1), known)

    e_n = of("e_n", series.e_n)
    if series.e_axis is not None:
        e_n = series.e_axis.nodes()[None, :, None]
    return Values(e_n, of("c", series.c), of("mu", series.mu))


def _limits(series: SeriesIntegral, known: Values) -> tuple[Array, Array] | None:
    """Ends of the transition's coordinate, (m, n_e), where the domain cuts panels; else None."""
    if series.x_axis is None:
        return None
    ends = (series.c.lower, series.c.upper) if isinstance(series.c, FreeParameter) else (known.c, known.c)
    k = series.squares.coefficients
    if k.b1 < 0.0:  # b falls as c rises
        ends = ends[::-1]
    with np.errstate(divide="ignore"):
        most, least = (1.0 / np.maximum(sticking_bound(k, end), _TINY) for end in ends)
    lowest, highest = series.role.kappa_ends(known)
    low, high = (series.to_t(end[..., 0]) for end in (lowest * least, highest * most))
    first, last = series.x_axis.panels[0, 0], series.x_axis.panels[-1, 1]
    if low.max() <= first + _ROUNDING * last and high.min() >= (1.0 - _ROUNDING) * last:
        return None
    low, high = np.broadcast_arrays(low, high)
    return low, high


def _log_prior(
    series: SeriesIntegral, values: Values, x: Array, c: Array, mu: Array
) -> tuple[Array | float, Array | float]:
    """Log prior of the free parameters of the series: the part that varies with c, and the rest."""
    with_c, without_c = series.role.log_prior(values, x, c, mu)
    if isinstance(series.e_n, FreeParameter):
        without_c = without_c + series.e_n.log_prior(values.e_n)
    if series.friction_count:
        without_c = without_c - series.friction_count * np.log1p(values.e_n)
    if isinstance(series.c, FreeParameter):
        with_c = with_c + series.c.log_prior(c)
    return with_c, without_c


def _log_likelihood(
    series: SeriesIntegral,
    squares: list[Quadratic],
    e_n: Array,
    x: Array,
    c: Array,
    mu: Array,
    noise: Array | None,
    slabs: int,
) -> tuple[Array, Array]:
    """Log likelihood of the rows: the part that varies with c, (m, n_e, n_x, n_c), and the rest, 3 axes.

    Where e_n takes no part in the first one, that one has size 1 along e_n.
    """
    with_c: Array = np.zeros((1, 1, 1, 1))
    without_c: Array = np.zeros((1, 1, 1))
    if series.row_law is not None:
        k = series.squares.coefficients
        return error_model_log_likelihood(series.row_law, k, e_n, x, c, mu, noise), without_c
    d = c - series.squares.reference.c
    curved = series.squares.curved(e_n[..., None], x[..., None], c, mu, slabs)
    for number, (q, more) in enumerate(zip(squares, curved, strict=True)):
        n = series.squares.groups[number].size
        if not n:
            continue
        varying = d * (with_c_axis(q.curvature) * d - 2.0 * with_c_axis(q.slope)) if np.ndim(q.slope) else 0.0
        varying = varying + more
        if series.noise is not None:  # eq. (5)
            own = series.noise[number]
            if np.ndim(varying):
                with_c = with_c + own.log_likelihood(np.maximum(with_c_axis(q.square) + varying, 0.0))
            else:
                without_c = without_c + own.log_likelihood(np.maximum(q.square, 0.0))
        elif noise is not None:
            with_c = with_c - 0.5 * varying / noise**2
            without_c = without_c - 0.5 * q.square / noise[..., 0] ** 2 - n * np.log(noise[..., 0])
        else:
            with_c = with_c - 0.5 * varying
            without_c = without_c - 0.5 * q.square
    return with_c, without_c


def error_model_log_likelihood(
    law: RowLaw, k: Coefficients, e_n: Array, x: Array, c: Array, mu: Array, noise: Array | None
) -> Array:
    """Log likelihood, broadcast over (m, n_e, n_x, n_c) as far as the rows see these axes.

    Parameters
    ----------
    law : RowLaw
    k : Coefficients
    e_n, x : ndarray, (m, n_e, n_x), broadcastable
    c, mu : ndarray, (m, n_e, n_x, n_c), broadcastable
    noise : ndarray or None
        Common factor on sigma, (m, 1, 1, 1).
    """
    seen = [OBSERVABLES[law.names[which]] for which in np.unique(law.which)]
    by_x = any(o.kind in ("tangential", "curved") for o in seen)
    by_mu = any(o.kind == "friction" for o in seen)
    by_e = any(o.kind == "normal" or o.ties_e_n for o in seen)
    nothing = np.zeros((1, 1, 1, 1))
    e_n, mu = (e_n[..., None] if by_e else nothing), (mu if by_mu else nothing)
    x, c = (x[..., None], c) if by_x else (nothing, nothing)
    factor = nothing + 1.0 if noise is None else noise
    shape = np.broadcast_shapes(e_n.shape, x.shape, c.shape, mu.shape, factor.shape)
    flat = [
        np.broadcast_to(part, (*shape[:3], part.shape[3])).reshape(-1, part.shape[3])
        for part in (c, e_n, mu, factor)
    ]
    along_x = np.broadcast_to(x, (*shape[:3], 1)).reshape(-1)
    own_c, own_e, own_mu, own_factor = flat
    at = At(along_x, k.a0 + k.a1 * own_c, k.b0 + k.b1 * own_c, own_e, own_mu, own_factor)
    return law.log_likelihood(at).reshape(*shape[:3], -1)
