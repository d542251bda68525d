"""The whole integral: shared parameters outermost, each series inside, on panels that can be refined."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.posterior.density_grid import DensityGrid, PanelErrors
from ifrfit.inference.posterior.likelihood_times_prior import density_on_grid
from ifrfit.inference.posterior.quadrature_axis import PanelCdf, QuadratureAxis
from ifrfit.inference.posterior.series_integral import SeriesIntegral

Array = NDArray[np.float64]

_COARSE = 4  # order of a first look
_LARGEST_C_ORDER = 128
_BLIND = 3.0  # change of the log evidence at which a first look has seen nothing
_REHEARSALS = 16  # rounds at most
_LEAST_LOG = -1e300  # log density told from none


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
        at = dict(
            zip([one.kind for one in self.shared], _crossed(one.values() for one in self.shared), strict=True)
        )
        grids = [density_on_grid(series, at) for series in self.series]
        log_f: Array = np.zeros((2, 1))
        for term in (*(grid.log_mass for grid in grids), *_crossed(one.log_prior() for one in self.shared)):
            log_f = log_f + term
        weights = np.stack(
            [
                math.prod(_crossed(one.axis.weights()[level] for one in self.shared), start=np.ones(1))
                for level in (0, 1)
            ]
        )
        shift = max(float(log_f.max()), _LEAST_LOG)
        density = np.exp(log_f - shift)
        z = (weights * density).sum(axis=1)
        # the coarse rules may miss all that there is, in a first panel with its mass at an end
        per_z = np.divide(1.0, z, out=np.zeros(2), where=z > 0.0)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            log_z = np.log(z) + shift
        return JointDensity(self, at, grids, density * per_z, weights * density * per_z, log_z)

    def size(self) -> int:
        """Values of the density that the present nodes ask for."""
        return sum(self._sizes())

    def work(self) -> float:
        """What these values cost, in those of a series whose rows are all summed up beforehand."""
        return self._cost(self._sizes())

    def is_within(self, size: float, work: float) -> bool:
        """Whether the present nodes ask for no more values, and for no more work."""
        sizes = self._sizes()
        return sum(sizes) <= size and self._cost(sizes) <= work

    def _cost(self, sizes: Sequence[int]) -> float:
        return sum(size * series.cost for size, series in zip(sizes, self.series, strict=True))

    def _sizes(self) -> list[int]:
        """Values of the density of each series."""
        outer = math.prod(one.axis.size for one in self.shared)
        sizes = []
        for series in self.series:
            axes = (series.e_axis, series.x_axis)
            shape = [outer, *(1 if axis is None else axis.size for axis in axes)]
            # two panels about the mode of c, whose density does not depend on every axis
            of_c = 2 * (series.c_order + 1) if series.integrates_c else 1
            seen = math.prod(n for axis, n in enumerate(shape) if axis not in series.c_independent_axes)
            sizes.append(max(of_c * seen, math.prod(shape)))
        return sizes

    def remembered(self) -> Callable[[], None]:
        """The present panels and orders: a call goes back to them."""
        axes = [(axis, axis.panels, axis.order) for axis in self.axes]
        c_orders = [(series, series.c_order) for series in self.series]

        def restore() -> None:
            for axis, panels, order in axes:
                axis.panels, axis.order = panels, order
            for series, c_order in c_orders:
                series.c_order = c_order

        return restore

    def drop_empty_panels(self, negligible: float) -> float:
        """Drop the panels in which a look at a low order finds no more than a share of the mass.

        Gives the change of the log evidence in that look.

        Without it the grids of 9 of 43 drawn tables were too large, and the others took 1.2 times as long in
        the median, 3.8 times at most.
        """
        with self.low_order(self.axes):
            density = self.evaluate()
            masses = [(one.axis, density.outer_errors(number)[0]) for number, one in enumerate(self.shared)]
            for grid in density.grids:
                masses += grid.panel_masses(density.share)
        error = density.evidence_error()
        for axis, mass in masses if error <= _BLIND else ():
            axis.drop(mass, negligible)
        for series, grid in zip(self.series, density.grids, strict=True):
            series.c_independent_axes = tuple(axis for axis in range(3) if grid.f.shape[axis] == 1)
        return error

    def refine_transitions(self, allowed: float, most_work: float) -> float:
        """Refine the transitions as far as a low order along everything else shows their errors.

        Kinks along them take most rounds to resolve, and the other axes have little to do with these: without
        it the grid of reagle-2013 under closure FR becomes more than twice as large. It ends where the grid
        that comes of it would take too much work.

        Returns
        -------
        float
            The work that this took: little more than `most_work`.
        """
        done, whole = 0.0, self.work()
        others = [axis for axis in self.axes if not any(axis is series.x_axis for series in self.series)]
        with self.low_order(others):
            per_work = whole / self.work()  # panels of the transitions make both larger alike
            for _ in range(_REHEARSALS):
                done += self.work()
                found = self.error_sources(self.evaluate())
                changed = [
                    place.refine(mass, error, allowed)
                    for place, mass, error in found
                    if any(place is series.x_axis for series in self.series)
                    if isinstance(place, QuadratureAxis)
                ]
                if not any(changed) or done + max(1.0, per_work) * self.work() > most_work:
                    break
        return done

    @contextmanager
    def low_order(self, axes: Sequence[QuadratureAxis]) -> Iterator[None]:
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

    def refine(self, sources: Sequence[PanelErrors], allowed: float) -> bool:
        """Halve panels whose error is above its part of what is allowed; whether anything changed.

        Parameters
        ----------
        sources : sequence of (axis or series, masses, errors)
            Of the present panels, by `error_sources`.
        allowed : float
        """
        changed = False
        for place, mass, error in sources:
            if isinstance(place, QuadratureAxis):
                changed |= place.refine(mass, error, allowed)
            elif error[0] > allowed and place.c_order < _LARGEST_C_ORDER:
                place.c_order += 2 * (place.c_order // 4)
                changed = True
        return changed

    def error_sources(self, density: JointDensity, more: Sequence[PanelErrors] = ()) -> list[PanelErrors]:
        """Masses and errors of the panels of all axes, and of the closure constants.

        Parameters
        ----------
        density : JointDensity
        more : sequence of (axis or series, masses, errors)
            Errors found otherwise.
        """
        found: list[PanelErrors] = [
            (one.axis, *density.outer_errors(number)) for number, one in enumerate(self.shared)
        ]
        for grid in density.grids:
            found += grid.panel_errors(density.share)
        return [
            (place, mass, np.max([error, *(e for p, _, e in more if p is place)], axis=0))
            for place, mass, error in found
        ]


def _crossed(parts: Iterable[Array]) -> list[Array]:
    """Values along several axes, each at the nodes of their product, (m,)."""
    along = list(parts)
    if len(along) < 2:  # most integrals: one series, which shares nothing
        return along
    return [part.reshape(-1) for part in np.meshgrid(*along, indexing="ij")]


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
        return [one.axis.size for one in self.integral.shared]

    def size(self) -> int:
        """Values of the density that were worked out."""
        return sum(max(grid.f.size, grid.g[0].size) for grid in self.grids)

    def outer_marginal(self, number: int) -> PanelCdf:
        """Marginal of a shared parameter, one row a level."""
        found = [self.outer_density(level, number) for level in (0, 1)]
        return PanelCdf.of_levels(self.integral.shared[number].axis, np.stack(found))

    def outer_density(self, level: int, *numbers: int) -> Array:
        """Density of some of the shared parameters, in ascending order, integrated over the others."""
        density = self.density[level].reshape(self.shape())
        for other in reversed(range(density.ndim)):
            if other not in numbers:
                weights = self.integral.shared[other].axis.weights()[level]
                density = np.tensordot(density, weights, axes=(other, 0))
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
