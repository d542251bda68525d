"""The posterior density as a product over the series, given what these share.

Eq. (19) of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.posterior.constants_density import ConstantsDensity, Coordinate, log_prior, values_of
from ifrfit.inference.posterior.lattice_rule import Array
from ifrfit.inference.posterior.noise_scale import NoiseScale


@dataclass(frozen=True)
class CoordinateDomain:
    """Where some of the coordinates of a density may lie.

    Attributes
    ----------
    coordinates : tuple of Coordinate
        An e_n that a kappa needs stands before it.
    """

    coordinates: tuple[Coordinate, ...]

    @property
    def dimensions(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    def ends(self, place: int, at: Array) -> tuple[Array, Array]:
        """Ends of a coordinate, (m,) each, where the ones before it are those of points (m, d)."""
        return self.coordinates[place].ends(at)


@dataclass(frozen=True)
class SeriesFactor:
    """Prior of the constants of one series times the likelihood of its rows, given what series share.

    A point holds the shared coordinates, then those of the series.

    Attributes
    ----------
    whole : ConstantsDensity
        Of all series.
    number : int
        Of the series.
    shared, own : tuple of int
        Places of the coordinates in a point of all series.
    """

    whole: ConstantsDensity
    number: int
    shared: tuple[int, ...]
    own: tuple[int, ...]

    @cached_property
    def places(self) -> list[int]:
        """Places of the coordinates of a point of this series in one of all series."""
        return [*self.shared, *self.own]

    @cached_property
    def domain(self) -> CoordinateDomain:
        """Where the coordinates may lie."""
        return CoordinateDomain(_taken(self.whole.coordinates, self.places))

    @cached_property
    def _of_rows(self) -> ConstantsDensity:
        problem = self.whole.problem
        rows = np.flatnonzero(problem.rows.series == self.number)
        return ConstantsDensity(problem.with_rows(rows), self.whole.sampled)

    @property
    def noises(self) -> dict[str, NoiseScale]:
        """The noises of this series that are integrated out, by the name of their group."""
        return self._of_rows.noises

    def __call__(self, at: Array) -> tuple[Array, Array]:
        """Log of the factor, (m,), and the sum of squares of each of `noises`, (m, groups).

        Parameters
        ----------
        at : ndarray, (m, d)
            Inside the domain.
        """
        own = log_prior(self.domain.coordinates, at, len(self.shared))
        values = np.zeros((at.shape[0], self.whole.dimensions))
        values[:, self.places] = values_of(self.domain.coordinates, at)
        if self.whole.problem.error_model.is_plain:
            likelihood, squares = self._of_rows.log_likelihood(values)
            return own + likelihood, squares
        return own + self._density.series(values, self.number), np.empty((at.shape[0], 0))

    @cached_property
    def _density(self) -> Density:
        return Density(self.whole.problem)


@dataclass(frozen=True)
class FactorisedDensity:
    """A posterior density over shared coordinates, times one factor for each series.

    Noises of one series are integrated out in its factor; a noise that several series have is a shared
    coordinate.

    Attributes
    ----------
    problem : Problem
        With a constant of each series.
    """

    problem: Problem

    @cached_property
    def whole(self) -> ConstantsDensity:
        """The density over the coordinates of all series."""
        series = self.problem.rows.series
        groups = self.problem.noise_groups().items()
        return ConstantsDensity(
            self.problem, tuple(name for name, rows in groups if np.unique(series[rows]).size > 1)
        )

    @cached_property
    def _series_of(self) -> tuple[int | None, ...]:
        """Series of each coordinate; None of what all share."""
        parameters = self.problem.parameters
        found: list[int | None] = [None] * self.whole.dimensions
        for parameter in parameters:
            if not parameter.separate:
                continue
            for number, entry in enumerate(parameters.positions[parameter.name]):
                if parameters.free[entry]:
                    found[int(parameters.free_places[entry])] = number
        return tuple(found)

    @cached_property
    def shared(self) -> tuple[int, ...]:
        """Places of the coordinates that series share."""
        return tuple(place for place, series in enumerate(self._series_of) if series is None)

    @cached_property
    def domain(self) -> CoordinateDomain:
        """Where shared coordinates may lie."""
        return CoordinateDomain(_taken(self.whole.coordinates, self.shared))

    def log_prior(self, at: Array) -> Array:
        """Log of the prior density of shared coordinates (m, k), (m,)."""
        return log_prior(self.domain.coordinates, at)

    @cached_property
    def factors(self) -> tuple[SeriesFactor, ...]:
        """One for each series."""
        return tuple(
            SeriesFactor(
                self.whole,
                number,
                self.shared,
                tuple(place for place, series in enumerate(self._series_of) if series == number),
            )
            for number in range(len(self.problem.series))
        )


def factorises(problem: Problem) -> bool:
    """Whether a problem has free constants of each of several series."""
    entries = zip(problem.parameters.names, problem.parameters.free, strict=True)
    free = {name for name, is_free in entries if is_free}
    shared = {parameter.name for parameter in problem.parameters}
    return len(problem.series) > 1 and bool(free - shared)


def _taken(coordinates: Sequence[Coordinate], places: Sequence[int]) -> tuple[Coordinate, ...]:
    """Some of the coordinates, with the places that their e_n have among them."""
    order = list(places)
    found = []
    for place in order:
        own = coordinates[place]
        if isinstance(own.e_n, int):
            own = replace(own, e_n=order.index(own.e_n))
        found.append(own)
    return tuple(found)
