"""The posterior density of the constants alone, at many points at once: unknown noises are integrated out.

Where series have constants of their own it is a product over the series, given what these share. Eq. (14) and
(19) of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.entry_names import quantity_of
from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.model.noise import noise_name
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.posterior.noise_scale import NoiseScale

Array = NDArray[np.float64]

_LATENT = 40  # nodes over a true angle, roughly
_AT_ONCE = 200_000  # predicted values held at once
_OF_IMPACTS = 4_000_000  # log likelihoods of impacts held at once
_HALF_LOG_2PI = 0.5 * math.log(2.0 * math.pi)


@dataclass(frozen=True)
class Coordinate:
    """One coordinate: its domain, and the e_n that a kappa needs.

    Attributes
    ----------
    domain : FreeParameter
        Of the parameter behind it; of mu where kappa takes its place.
    e_n : int, float or None
        Place of the coordinate of the e_n that goes with a kappa, or its fixed value; None of any other one.
    """

    domain: FreeParameter
    e_n: int | float | None = None

    def factor(self, at: Array) -> Array | float:
        """1 + e_n of a kappa at coordinates (m, d); 1 of any other one."""
        if self.e_n is None:
            return 1.0
        return 1.0 + (at[:, self.e_n] if isinstance(self.e_n, int) else self.e_n)

    def ends(self, at: Array) -> tuple[Array, Array]:
        """Ends, (m,) each, where the coordinates before it are those of points (m, d)."""
        factor = self.factor(at) + np.zeros(at.shape[0])
        return self.domain.lower * factor, self.domain.upper * factor


@dataclass(frozen=True)
class Coordinates:
    """Coordinates of points: their domain, and the parameters behind them.

    Attributes
    ----------
    each : tuple of Coordinate
        An e_n that a kappa needs stands before it.
    """

    each: tuple[Coordinate, ...]

    @property
    def dimensions(self) -> int:
        """Number of coordinates."""
        return len(self.each)

    def ends(self, place: int, at: Array) -> tuple[Array, Array]:
        """Ends of a coordinate, (m,) each, where the ones before it are those of points (m, d)."""
        return self.each[place].ends(at)

    def values(self, at: Array) -> Array:
        """The parameters behind the coordinates, (m, d)."""
        found = np.empty(at.shape)
        for place, own in enumerate(self.each):
            found[:, place] = at[:, place] / own.factor(at)
        return found

    def named(self, at: Array, first: int = 0) -> dict[str, Array]:
        """The parameters by name, without the first ones; noises themselves, not their logarithms."""
        columns = list(zip(self.each, self.values(at).T, strict=True))[first:]
        return {
            own.domain.name: np.exp(value) if own.domain.name.startswith("noise") else value
            for own, value in columns
        }

    def at(self, values: Array) -> Array:
        """Coordinates, (m, d), of parameters (m, d)."""
        columns = [x * c.factor(values) for x, c in zip(values.T, self.each, strict=True)]
        return np.stack(columns, axis=1).reshape(values.shape)

    def log_prior(self, at: Array, first: int = 0) -> Array:
        """Log of the prior density over coordinates (m, d), the first ones of which are given, (m,)."""
        total = np.zeros(at.shape[0])
        for value, own in list(zip(self.values(at).T, self.each, strict=True))[first:]:
            total = total + own.domain.log_prior(value) - np.log(own.factor(at))
        return total

    def taken(self, places: Sequence[int]) -> Coordinates:
        """Some of the coordinates, with the places that their e_n have among them."""
        order = list(places)
        each = [self.each[place] for place in order]
        return Coordinates(
            tuple(replace(c, e_n=order.index(c.e_n)) if isinstance(c.e_n, int) else c for c in each)
        )


@dataclass(frozen=True)
class ConstantsDensity:
    """Prior times likelihood of a problem over its free constants, unknown noises integrated out.

    A point holds the free entries of theta in their order, with kappa = mu (1 + e_n) in the place of mu where
    that is one to one, then the logarithms of noises that are not integrated out, then the unknown offset of
    the set angles. The ends of a coordinate depend on no more than those before it.

    Attributes
    ----------
    problem : Problem
    sampled : tuple of str
        Noise groups whose logarithms are coordinates although errors are plain. Where errors are not plain,
        or rows have errors in common, the integral over a noise has no closed form, and it is a coordinate in
        any case.
    """

    problem: Problem
    sampled: tuple[str, ...] = ()

    @cached_property
    def coordinates(self) -> Coordinates:
        """What the coordinates stand for."""
        parameters = self.problem.parameters
        e_n_of = {mu: value if e_n is None else e_n for mu, e_n, value in parameters.free_kappas}
        found = []
        for place, unknown in enumerate(self.problem.free_parameters):
            if quantity_of(unknown.name) == "e_n":
                unknown = replace(unknown, lower=max(unknown.lower, self.problem.rows.lowest_e_n))
            found.append(Coordinate(unknown, e_n_of.get(place)))
        bounds = self.problem.noise_bounds() if self.sampled_noises else {}
        for name in self.sampled_noises:
            log_low, log_high = map(math.log, bounds[name])
            scale = -math.log(log_high - log_low)
            found.append(Coordinate(FreeParameter(noise_name(name), log_low, log_high, None, scale)))
        if self.problem.offset is not None:
            found.append(Coordinate(self.problem.offset))
        return Coordinates(tuple(found))

    @cached_property
    def sampled_noises(self) -> tuple[str, ...]:
        """Groups of noises whose logarithms are coordinates."""
        has_closed_form = self.problem.error_model.is_plain and self.problem.common is None
        return self.sampled if has_closed_form else tuple(self.problem.noise_groups())

    @cached_property
    def noises(self) -> dict[str, NoiseScale]:
        """The noises that are integrated out, by the name of their group."""
        bounds = self.problem.noise_bounds()
        return {
            name: NoiseScale(self.problem.noise.count(rows), *bounds[name])
            for name, rows in self.problem.noise_groups().items()
            if name not in self.sampled_noises
        }

    @property
    def cost_of_row(self) -> int:
        """How many rows of exact incidence a row takes as long as."""
        return _LATENT if self.problem.error_model.integrates else 1

    def theta(self, values: Array) -> Array:
        """All entries of theta, fixed ones included, (m, p), of parameters (m, d)."""
        return self.problem.parameters.theta(values[:, : self.free])

    @cached_property
    def free(self) -> int:
        """Number of free constants."""
        return int(self.problem.parameters.free.sum())

    def __call__(self, at: Array) -> tuple[Array, Array]:
        """Log density over the coordinates, (m,), and the sum of squares of each noise group, (m, groups).

        Parameters
        ----------
        at : ndarray, (m, d)
            Inside the domain.
        """
        likelihood, squares = self.log_likelihood(self.coordinates.values(at))
        return likelihood + self.coordinates.log_prior(at), squares

    def log_likelihood(self, values: Array) -> tuple[Array, Array]:
        """Log likelihood, (m,), and the sum of squares of each noise that is integrated out, (m, groups).

        Parameters
        ----------
        values : ndarray, (m, d)
            The parameters behind the coordinates.
        """
        if self.problem.common is not None:
            return self.scattered.log_likelihood(values), np.empty((values.shape[0], 0))
        if not self.problem.error_model.is_plain:
            parts = np.array_split(values, 1 + values.shape[0] * len(self.problem.rows) // _OF_IMPACTS)
            scattered = np.concatenate([self.scattered.impacts(part).sum(axis=1) for part in parts])
            return scattered, np.empty((values.shape[0], 0))
        total = np.zeros(values.shape[0])
        squares, found = self._squares(values), []
        for square, (name, rows) in zip(squares.T, self.problem.noise_groups().items(), strict=False):
            if name in self.noises:
                total = total + self.noises[name].log_likelihood(square)
                found.append(square)
                continue
            log_sigma = values[:, self.free + self.sampled_noises.index(name)]
            count = self.problem.noise.count(rows)
            total = total - 0.5 * square * np.exp(-2.0 * log_sigma) - count * (log_sigma + _HALF_LOG_2PI)
        total = total - float(np.log(self.problem.noise.base).sum())
        total = total - 0.5 * squares[:, -1] - self._known.size * _HALF_LOG_2PI
        integrated = np.array(found).reshape(len(found), values.shape[0]).T
        return np.where(np.isnan(total), -np.inf, total), integrated

    def _squares(self, values: Array) -> Array:
        """Sum of squared residuals, in units of the base, of each noise group and of the rows in none."""
        problem = self.problem
        groups = [*problem.noise_groups().values(), self._known]
        found = np.empty((values.shape[0], len(groups)))
        step = max(1, _AT_ONCE // len(problem.rows))
        for start in range(0, values.shape[0], step):
            part = values[start : start + step]
            there = problem if problem.offset is None else problem.at_offset(part[:, -1:])
            residual = (problem.rows.value - there.predict(self.theta(part))) / problem.noise.base
            for number, rows in enumerate(groups):
                own = residual if rows.size == len(problem.rows) else residual[:, rows]
                found[start : start + step, number] = np.einsum("ij,ij->i", own, own)
        return found

    @cached_property
    def _known(self) -> Index:
        """Rows whose sigma is known."""
        return np.flatnonzero(self.problem.noise.is_given)

    @cached_property
    def scattered(self) -> Density:
        """The density where errors of angles or heavy tails make it other than plain."""
        return Density(self.problem)


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
    def coordinates(self) -> Coordinates:
        """Of a point."""
        return self.whole.coordinates.taken(self.places)

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
        own = self.coordinates.log_prior(at, len(self.shared))
        values = np.zeros((at.shape[0], self.whole.coordinates.dimensions))
        values[:, self.places] = self.coordinates.values(at)
        if self.whole.problem.error_model.is_plain:
            likelihood, squares = self._of_rows.log_likelihood(values)
            return own + likelihood, squares
        return own + self.whole.scattered.series(values, self.number), np.empty((at.shape[0], 0))


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
        found: list[int | None] = [None] * self.whole.coordinates.dimensions
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
    def coordinates(self) -> Coordinates:
        """Those that series share."""
        return self.whole.coordinates.taken(self.shared)

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
    """Whether a problem has free constants of each of several series, and no errors that tie these."""
    entries = zip(problem.parameters.names, problem.parameters.free, strict=True)
    free = {name for name, is_free in entries if is_free}
    shared = {parameter.name for parameter in problem.parameters}
    return len(problem.series) > 1 and bool(free - shared) and problem.common is None
