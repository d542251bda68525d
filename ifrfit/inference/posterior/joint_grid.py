"""The whole integral: shared parameters outermost, each series inside, on panels that can be refined."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.posterior.density_grid import DensityGrid
from ifrfit.inference.posterior.panel_cdf import PanelCdf
from ifrfit.inference.posterior.quadrature_axis import QuadratureAxis
from ifrfit.inference.posterior.series_integral import SeriesIntegral
from ifrfit.inference.posterior.series_integrand import density_on_grid

Array = NDArray[np.float64]

_COARSE = 4  # order of a first look
_LARGEST_C_ORDER = 128
_REHEARSALS = 16  # rounds at most
_DOMINANT = 0.25  # share of the largest error from which on an axis is among those that carry it


@dataclass(frozen=True)
class Panels:
    """Panels and orders of all axes at one stage of refinement.

    Attributes
    ----------
    axes : tuple of (QuadratureAxis, ndarray, int)
        Each axis with its panels, (panels, 2), and its order.
    c_orders : tuple of (SeriesIntegral, int)
        Order along the closure constant of each series.
    """

    axes: tuple[tuple[QuadratureAxis, Array, int], ...]
    c_orders: tuple[tuple[SeriesIntegral, int], ...]


@dataclass(frozen=True)
class ErrorSource:
    """An axis with the masses and errors of its panels; the closure constant of a series where it is None."""

    series: SeriesIntegral | None
    axis: QuadratureAxis | None
    mass: Array
    error: Array


@dataclass
class SharedParameter:
    """A parameter that several series share: its panels, in the parameter itself or its logarithm."""

    kind: str  # e_n, c, mu or noise
    parameter: FreeParameter
    axis: QuadratureAxis
    log: bool = False

    def values(self) -> Array:
        """The parameter at the nodes."""
        nodes = self.axis.nodes()
        return np.asarray(np.exp(nodes)) if self.log else nodes

    def log_prior(self) -> Array:
        """Log density in the coordinate of the panels."""
        if self.log:  # a log-uniform prior is uniform there
            return np.full(self.axis.nodes().shape, self.parameter.log_scale)
        return np.asarray(self.parameter.log_prior(self.axis.nodes()) + np.zeros(self.axis.nodes().shape))


@dataclass
class JointIntegral:
    """Shared parameters, and the series inside them, which are independent given these."""

    shared: list[SharedParameter]
    series: list[SeriesIntegral]

    @property
    def axes(self) -> list[QuadratureAxis]:
        """Axes of the shared parameters, then of the series."""
        return [one.axis for one in self.shared] + [axis for s in self.series for axis in s.axes]

    def number_of(self, kind: str) -> int | None:
        """Which of the shared parameters is e_n, c, mu or noise; None where that is not shared."""
        return next((number for number, one in enumerate(self.shared) if one.kind == kind), None)

    def evaluate(self) -> JointDensity:
        """Integrate at the present nodes."""
        at: dict[str, Array] = {}
        m = [one.axis.nodes().size for one in self.shared]
        for number, one in enumerate(self.shared):
            shape = [1] * len(m)
            shape[number] = -1
            at[one.kind] = np.broadcast_to(one.values().reshape(shape), m).reshape(-1)
        grids = [density_on_grid(series, at) for series in self.series]
        log_f = np.zeros((2, math.prod(m)))
        for grid in grids:
            log_f = log_f + grid.log_mass
        weights = np.ones((2, 1))
        for number, one in enumerate(self.shared):
            shape = [1] * len(m)
            shape[number] = -1
            log_f = log_f + np.broadcast_to(one.log_prior().reshape(shape), m).reshape(-1)
            weights = (weights[:, :, None] * one.axis.weights()[:, None, :]).reshape(2, -1)
        shift = float(log_f.max())
        density = np.exp(log_f - shift)
        z = (weights * density).sum(axis=1)
        share = weights * density / z[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            log_z = np.log(z) + shift
        return JointDensity(self, at, grids, density / z[:, None], share, log_z)

    def size(self) -> int:
        """Values of the density that the present nodes ask for."""
        outer = math.prod(one.axis.nodes().size for one in self.shared)
        total = 0
        for series in self.series:
            axes = (series.e_axis, series.x_axis)
            shape = [outer, *(1 if axis is None else axis.nodes().size for axis in axes)]
            # two panels about the mode of c, whose density does not depend on every axis
            of_c = 2 * (series.c_order + 1) if series.integrates_c else 1
            seen = math.prod(n for axis, n in enumerate(shape) if axis not in series.c_independent_axes)
            total += max(of_c * seen, math.prod(shape))
        return total

    def panels(self) -> Panels:
        """The present panels and orders."""
        axes = tuple((axis, axis.panels, axis.order) for axis in self.axes)
        return Panels(axes, tuple((series, series.c_order) for series in self.series))

    def restore(self, panels: Panels) -> None:
        """Go back to earlier panels and orders."""
        for axis, edges, order in panels.axes:
            axis.panels, axis.order = edges, order
        for series, c_order in panels.c_orders:
            series.c_order = c_order

    def drop_empty_panels(self, negligible: float) -> None:
        """Drop the panels in which a look at a low order finds no more than a share of the mass."""
        with self._low_order(self.axes):
            density = self.evaluate()
            masses = [(one.axis, density.outer_errors(number)[0]) for number, one in enumerate(self.shared)]
            for grid in density.grids:
                masses += grid.panel_masses(density.share)
            for axis, mass in masses:
                axis.drop(mass, negligible)
        for series, grid in zip(self.series, density.grids, strict=True):
            series.c_independent_axes = tuple(axis for axis in range(3) if grid.f.shape[axis] == 1)

    def refine_transitions(self, allowed: float) -> None:
        """Refine the transitions as far as a low order along everything else shows their errors.

        Kinks along them take most rounds to resolve, and the other axes have little to do with these.
        """
        others = [one.axis for one in self.shared]
        others += [series.e_axis for series in self.series if series.e_axis is not None]
        with self._low_order(others):
            for _ in range(_REHEARSALS):
                changed = False
                for found in self._error_sources(self.evaluate()):
                    if found.axis is not None and not any(found.axis is axis for axis in others):
                        changed |= found.axis.refine(found.mass, found.error, allowed)
                if not changed:
                    break

    @contextmanager
    def _low_order(self, axes: Sequence[QuadratureAxis]) -> Iterator[None]:
        """Some axes at a low order for a while, the closure constants at twice that."""
        orders = [axis.order for axis in axes], [series.c_order for series in self.series]
        for axis in axes:
            axis.order = _COARSE
        for series in self.series:
            series.c_order = 2 * _COARSE
        yield
        for axis, own in zip(axes, orders[0], strict=True):
            axis.order = own
        for series, own in zip(self.series, orders[1], strict=True):
            series.c_order = own

    def refine(
        self,
        density: JointDensity,
        allowed: float,
        dominant_allowed: float = math.inf,
    ) -> bool:
        """Halve panels whose error is above its part of what is allowed; whether anything changed.

        Parameters
        ----------
        density : JointDensity
        allowed : float
        dominant_allowed : float
            What is allowed, if less, along the axes that carry most of the error.
        """
        changed = False
        sources = self._error_sources(density)
        most = max((float(found.error.sum()) for found in sources), default=0.0)
        for found in sources:
            is_dominant = found.error.sum() >= _DOMINANT * most
            bound = min(allowed, dominant_allowed) if is_dominant else allowed
            if found.axis is not None:
                changed |= found.axis.refine(found.mass, found.error, bound)
            elif (
                found.error[0] > bound
                and found.series is not None
                and found.series.c_order < _LARGEST_C_ORDER
            ):
                found.series.c_order += 2 * (found.series.c_order // 4)
                changed = True
        return changed

    def _error_sources(self, density: JointDensity) -> list[ErrorSource]:
        """Masses and errors of the panels of all axes, and of the closure constants."""
        sources = []
        for number, one in enumerate(self.shared):
            sources.append(ErrorSource(None, one.axis, *density.outer_errors(number)))
        for series, grid in zip(self.series, density.grids, strict=True):
            sources += [ErrorSource(series, *found) for found in grid.panel_errors(density.share)]
        return sources


@dataclass
class JointDensity:
    """All densities at one stage of refinement, at two levels: by the rules, and by the coarse rules inside.

    Attributes
    ----------
    integral : JointIntegral
    at : mapping
        Shared parameters at the outer nodes, (m,).
    grids : sequence of DensityGrid
        One a series.
    density : ndarray, (2, m)
        Posterior density of the outer nodes in the panels' coordinates.
    share : ndarray, (2, m)
        The same times the weights: their posterior probabilities.
    log_z : ndarray, (2,)
        Log evidence.
    """

    integral: JointIntegral
    at: Mapping[str, Array]
    grids: Sequence[DensityGrid]
    density: Array
    share: Array
    log_z: Array

    def shape(self) -> list[int]:
        """Nodes along each shared parameter."""
        return [one.axis.nodes().size for one in self.integral.shared]

    def size(self) -> int:
        """Values of the density that were worked out."""
        return sum(max(grid.f.size, grid.g[0].size) for grid in self.grids)

    def outer_marginal(self, number: int) -> PanelCdf:
        """Marginal of a shared parameter, one row a level."""
        axis = self.integral.shared[number].axis
        found = [self._outer_density(number, level).reshape(axis.shape) for level in (0, 1)]
        return PanelCdf.of_levels(axis.low[None], axis.width[None], np.stack(found))

    def outer_conditional(self, number: int, given: int, level: int) -> PanelCdf:
        """Density of a shared parameter, one row for each node of another one that is given."""
        axis = self.integral.shared[number].axis
        values = np.moveaxis(self._outer_density(number, level, given), (given, number), (-2, -1))
        values = values.reshape(values.shape[-2], *axis.shape)
        return PanelCdf.of(axis.low[None], axis.width[None], values, level)

    def _outer_density(self, number: int, level: int, given: int | None = None) -> Array:
        density = self.density[level].reshape(self.shape())
        for other, one in enumerate(self.integral.shared):
            if other not in (number, given):
                w = one.axis.weights()[level]
                shape = [1] * density.ndim
                shape[other] = -1
                density = (density * w.reshape(shape)).sum(axis=other, keepdims=True)
        return np.asarray(density)

    def outer_errors(self, number: int) -> tuple[Array, Array]:
        """Mass and error of the panels of a shared parameter."""
        axis = self.integral.shared[number].axis
        shape = self.shape()
        share = np.moveaxis(self.share[0].reshape(shape), number, -1).reshape(-1, *axis.shape)
        w = axis.weights()[0].reshape(axis.shape)
        density = np.divide(share, w, out=np.zeros_like(share), where=w > 0.0)
        return share.sum(axis=(0, 2)), axis.errors(density)

    def evidence_error(self) -> float:
        """Change of the log evidence between the two levels."""
        change = float(abs(self.log_z[0] - self.log_z[1]))
        return change if math.isfinite(change) else math.inf
