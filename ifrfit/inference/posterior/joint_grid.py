"""The whole integral: what series share outermost, each series inside, refined until nothing moves."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.posterior.density_grid import DensityGrid
from ifrfit.inference.posterior.panel_cdf import PanelCdf
from ifrfit.inference.posterior.quadrature_axis import QuadratureAxis
from ifrfit.inference.posterior.series_integrand import SeriesIntegrand

Array = NDArray[np.float64]

_COARSE = 4  # order of the first look
_FINEST = 128  # order along the closure constant
_REHEARSALS = 16  # rounds at most
_CARRIES = 0.25  # share of the largest error from which on an axis is among those that carry it

ErrorsByAxis = Sequence[
    tuple[QuadratureAxis | SeriesIntegrand, Array]
]  # of the panels of an axis, or of a closure constant

Layout = tuple[list[tuple[QuadratureAxis, Array, int]], list[tuple[SeriesIntegrand, int]]]


@dataclass
class SharedParameter:
    """An unknown that several series share: its panels, in the unknown itself or its logarithm."""

    kind: str  # e_n, c, mu or noise
    unknown: FreeParameter
    axis: QuadratureAxis
    log: bool = False

    def values(self) -> Array:
        """The unknown at the nodes."""
        nodes = self.axis.nodes()
        return np.asarray(np.exp(nodes)) if self.log else nodes

    def log_prior(self) -> Array:
        """Log density in the coordinate of the panels."""
        if self.log:  # a log-uniform prior is uniform there
            return np.full(self.axis.nodes().shape, self.unknown.log_scale)
        return np.asarray(self.unknown.log_prior(self.axis.nodes()) + np.zeros(self.axis.nodes().shape))


@dataclass
class JointIntegral:
    """Shared unknowns and the series inside them."""

    shared: list[SharedParameter]
    series: list[SeriesIntegrand]

    def evaluate(self) -> JointDensity:
        """Integrate at the present nodes."""
        at: dict[str, Array] = {}
        m = [s.axis.nodes().size for s in self.shared]
        for number, one in enumerate(self.shared):
            shape = [1] * len(m)
            shape[number] = -1
            at[one.kind] = np.broadcast_to(one.values().reshape(shape), m).reshape(-1)
        tensors = [series.evaluate(at) for series in self.series]
        total = int(np.prod(m)) if m else 1
        log_f = np.zeros((2, total))
        for tensor in tensors:
            log_f = log_f + tensor.log_mass
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
        return JointDensity(self, at, tensors, density / z[:, None], share, log_z)

    def size(self) -> int:
        """Values of the density that the present nodes ask for."""
        outer = math.prod(one.axis.nodes().size for one in self.shared)
        total = 0
        for series in self.series:
            axes = (series.e_axis, series.x_axis)
            shape = [outer, *(1 if axis is None else axis.nodes().size for axis in axes)]
            # two panels about the mode of c, of which not every axis takes notice
            of_c = 2 * (series.c_order + 1) if series.has_c else 1
            seen = math.prod(n for axis, n in enumerate(shape) if axis not in series.unseen)
            total += max(of_c * seen, math.prod(shape))
        return total

    def layout(self) -> Layout:
        """The present panels and orders."""
        axes = [one.axis for one in self.shared]
        axes += [axis for s in self.series for axis in (s.e_axis, s.x_axis) if axis is not None]
        return [(axis, axis.panels, axis.order) for axis in axes], [(s, s.c_order) for s in self.series]

    def lay_out(self, layout: Layout) -> None:
        """Go back to earlier panels and orders."""
        for axis, panels, order in layout[0]:
            axis.panels, axis.order = panels, order
        for series, c_order in layout[1]:
            series.c_order = c_order

    def scout(self, nothing: float) -> None:
        """Drop the panels in which a coarse look finds next to nothing."""
        axes = [one.axis for one in self.shared]
        axes += [axis for s in self.series for axis in (s.e_axis, s.x_axis) if axis is not None]
        with self._coarser(axes):
            grid = self.evaluate()
            masses = [(one.axis, grid.outer_errors(number)[0]) for number, one in enumerate(self.shared)]
            for tensor in grid.tensors:
                masses += tensor.panel_masses(grid.share)
            for axis, mass in masses:
                axis.drop(mass, nothing)
        for series, tensor in zip(self.series, grid.tensors, strict=True):
            series.unseen = tuple(axis for axis in range(3) if tensor.f.shape[axis] == 1)

    def rehearse(self, allowed: float) -> None:
        """Refine the transitions as far as a coarse look along everything else can tell.

        Kinks along them take most rounds to resolve, and the rest has little to do with these.
        """
        axes = [one.axis for one in self.shared] + [s.e_axis for s in self.series if s.e_axis is not None]
        with self._coarser(axes):
            for _ in range(_REHEARSALS):
                grid = self.evaluate()
                changed = False
                for found in self._found(grid):
                    if found.axis is not None and not any(found.axis is axis for axis in axes):
                        changed |= found.axis.refine(found.mass, found.error, allowed)
                if not changed:
                    break

    @contextmanager
    def _coarser(self, axes: Sequence[QuadratureAxis]) -> Iterator[None]:
        """Some axes at a lower order for a while, the closure constants at twice that."""
        orders = [axis.order for axis in axes], [s.c_order for s in self.series]
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
        self, grid: JointDensity, allowed: float, more: ErrorsByAxis = (), carried: float = math.inf
    ) -> bool:
        """Halve panels whose error is above its part of what is allowed; whether anything changed.

        Parameters
        ----------
        grid : JointDensity
        allowed : float
        more : sequence
            Errors found otherwise.
        carried : float
            What is allowed, if less, along the axes that carry most of the error.
        """
        changed = False
        every = self._found(grid, more)
        most = max((float(found.error.sum()) for found in every), default=0.0)
        for found in every:
            bound = min(allowed, carried) if found.error.sum() >= _CARRIES * most else allowed
            if found.axis is not None:
                changed |= found.axis.refine(found.mass, found.error, bound)
            elif found.error[0] > bound and found.series is not None and found.series.c_order < _FINEST:
                found.series.c_order += 2 * (found.series.c_order // 4)
                changed = True
        return changed

    def _found(self, grid: JointDensity, more: ErrorsByAxis = ()) -> list[PanelErrors]:
        """Masses and errors of the panels of all axes, and of the closure constants."""
        every = []
        for number, one in enumerate(self.shared):
            every.append(PanelErrors(None, one.axis, *grid.outer_errors(number)))
        for series, tensor in zip(self.series, grid.tensors, strict=True):
            every += [PanelErrors(series, *found) for found in tensor.panel_errors(grid.share)]
        for number, found in enumerate(every):
            place = found.series if found.axis is None else found.axis
            own = [error for at, error in more if at is place]
            if own:
                every[number] = replace(found, error=np.max([found.error, *own], axis=0))
        return every


@dataclass(frozen=True)
class PanelErrors:
    """Masses and errors of the panels of one axis; of a closure constant as a whole where it is None."""

    series: SeriesIntegrand | None
    axis: QuadratureAxis | None
    mass: Array
    error: Array


@dataclass
class JointDensity:
    """All densities at one stage of refinement.

    Attributes
    ----------
    at : mapping
        Shared unknowns at the outer nodes.
    density : ndarray, (2, m)
        Posterior density of the outer nodes in the panels' coordinates, by the rules and the coarse ones.
    share : ndarray, (2, m)
        The same times the weights: their posterior probabilities.
    log_z : ndarray, (2,)
        Log evidence.
    """

    joint: JointIntegral
    at: Mapping[str, Array]
    tensors: Sequence[DensityGrid]
    density: Array
    share: Array
    log_z: Array

    def shape(self) -> list[int]:
        """Nodes along each shared unknown."""
        return [s.axis.nodes().size for s in self.joint.shared]

    def outer_marginal(self, number: int) -> PanelCdf:
        """Marginal of a shared unknown, one row a level."""
        axis = self.joint.shared[number].axis
        found = [self._outer_density(number, level).reshape(axis.shape) for level in (0, 1)]
        return PanelCdf.of_levels(axis.low[None], axis.width[None], np.stack(found))

    def outer_rows(self, number: int, level: int, rows: int) -> PanelCdf:
        """Density of a shared unknown at each node of another one, `rows`."""
        axis = self.joint.shared[number].axis
        values = np.moveaxis(self._outer_density(number, level, rows), (rows, number), (-2, -1))
        values = values.reshape(values.shape[-2], *axis.shape)
        return PanelCdf.of(axis.low[None], axis.width[None], values, level)

    def _outer_density(self, number: int, level: int, rows: int | None = None) -> Array:
        density = self.density[level].reshape(self.shape())
        for other, one in enumerate(self.joint.shared):
            if other not in (number, rows):
                w = one.axis.weights()[level]
                shape = [1] * density.ndim
                shape[other] = -1
                density = (density * w.reshape(shape)).sum(axis=other, keepdims=True)
        return np.asarray(density)

    def outer_errors(self, number: int) -> tuple[Array, Array]:
        """Mass and error of the panels of a shared unknown."""
        axis = self.joint.shared[number].axis
        shape = self.shape()
        share = np.moveaxis(self.share[0].reshape(shape), number, -1).reshape(-1, *axis.shape)
        w = axis.weights()[0].reshape(axis.shape)
        density = np.divide(share, w, out=np.zeros_like(share), where=w > 0.0)
        return share.sum(axis=(0, 2)), axis.errors(density)

    def evidence_error(self) -> float:
        """Change of the log evidence between the rules."""
        change = float(abs(self.log_z[0] - self.log_z[1]))
        return change if math.isfinite(change) else math.inf
