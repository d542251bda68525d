"""The posterior density itself, at many points at once: for samplers, and for what leaves impacts out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.common_errors import refuse
from ifrfit.inference.model.common_likelihood import CommonLikelihood
from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.row_likelihood import At, RowLaw, at_theta
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.least_squares import least_squares

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Density:
    """Prior and likelihood of a problem over its free unknowns.

    A point holds the free entries of theta, then the logarithm of each unknown noise, then the offset of the
    set angles, degrees, where it is unknown: in the coordinates of constants and noises the default prior is
    flat between `lower` and `upper`, which are finite. The prior is the one of the exact
    posterior, normalised, so that the densities of two closures compare.

    Attributes
    ----------
    problem : Problem
    """

    problem: Problem

    @property
    def unknowns(self) -> tuple[FreeParameter, ...]:
        """Free entries of theta."""
        return self.problem.free_parameters

    @property
    def names(self) -> tuple[str, ...]:
        """What the coordinates of a point stand for: free constants, then noises, then the angle offset."""
        return tuple(each.name for each in self.problem.coordinates)

    @cached_property
    def of_noise(self) -> slice:
        """Coordinates of the noises."""
        return slice(len(self.unknowns), len(self.unknowns) + len(self.problem.noise_groups()))

    @cached_property
    def lower(self) -> Array:
        """Lower ends of the coordinates, (d,)."""
        return np.array([each.lower for each in self.problem.coordinates])

    @cached_property
    def upper(self) -> Array:
        """Upper ends of the coordinates, (d,)."""
        return np.array([each.upper for each in self.problem.coordinates])

    def __call__(self, points: Array) -> Array:
        """Log of prior times likelihood, (m,); -inf outside the domain.

        Parameters
        ----------
        points : ndarray, (m, d)
        """
        prior = self.log_prior(points)
        inside = np.isfinite(prior)
        prior[inside] += self.log_likelihood(points[inside])
        return prior

    def log_likelihood(self, points: Array) -> Array:
        """Log likelihood of all rows together, (m,); errors that they have in common are integrated out."""
        if self.problem.common is not None:
            return self.with_common_errors(self.theta(points), np.exp(points[:, self.of_noise]))
        rows = self.rows if self.problem.error_model.is_plain else self.impacts
        return np.asarray(rows(points).sum(axis=1))

    @cached_property
    def with_common_errors(self) -> CommonLikelihood:
        """The likelihood of rows with errors in common, about those of least squares."""
        found = least_squares(self.problem, proven=False).common
        assert found is not None
        return CommonLikelihood(self.problem, found.value)

    def log_prior(self, points: Array) -> Array:
        """Log of the normalised prior density, (m,); -inf outside the domain."""
        inside = ((points >= self.lower) & (points <= self.upper)).all(axis=1)
        total = np.where(inside, 0.0, -np.inf)
        for each, at in zip(self.problem.coordinates, points.T, strict=True):
            total = total + each.log_prior(at)
        if self.problem.parameters.is_tied:
            inside = self.problem.parameters.ties_inside(self.theta(points))
            total = np.where(inside, total, -np.inf)
        return np.asarray(total)

    def rows(self, points: Array) -> Array:
        """Log likelihood of each row where rows are independent, (m, n)."""
        noise = np.exp(points[:, self.of_noise])
        return self.at_offsets(points).row_log_likelihood(self.theta(points), noise)

    def at_offsets(self, points: Array) -> Problem:
        """The problem at the angle offset of each point; as it is where none is unknown."""
        return self.problem if self.problem.offset is None else self.problem.at_offset(points[:, -1:])

    def impacts(self, points: Array) -> Array:
        """Log likelihood of each impact, (m, n_impacts), in the order of `impact`."""
        if self.problem.common is not None:
            raise refuse("The likelihood of single impacts")
        n = int(self.impact.max()) + 1
        if not self.problem.error_model.is_plain:
            return self._scattered(points, n)
        if n == self.impact.size:
            return self.rows(points)
        order = np.argsort(self.impact, kind="stable")
        first = np.searchsorted(self.impact[order], np.arange(n))
        return np.asarray(np.add.reduceat(self.rows(points)[:, order], first, axis=1))

    @cached_property
    def impact(self) -> Index:
        """Impact of each row, (n,), numbered as they first occur; a row without an impact_id is its own."""
        return self.problem.rows.impacts

    def _scattered(self, points: Array, n: int) -> Array:
        """The same where angles or tails make the scatter other than plain."""
        found = np.zeros((points.shape[0], n))
        for law, at in self._laws_at(points):
            units = law.log_units(at)[:, 0]
            first = np.searchsorted(law.unit, np.arange(units.shape[1]))
            for impact, own in zip(self.impact[law.order[first]], units.T, strict=True):
                found[:, impact] += own
        return found

    def series(self, points: Array, number: int) -> Array:
        """Log likelihood of the rows of one series, (m,), where angles or tails make the scatter not plain.

        For problems with constants of each series.

        Parameters
        ----------
        points : ndarray, (m, d)
            Constants of other series do not count.
        number : int
            Of the series.
        """
        total = np.zeros(points.shape[0])
        for law, at in self._laws_at(points, number):
            total = total + law.log_units(at)[:, 0].sum(axis=1)
        return total

    def below(self, points: Array) -> Array:
        """Probability of a value below the measured one, row by row, (m, n)."""
        if self.problem.common is not None:
            raise refuse("The distribution of single rows")
        found = np.empty((points.shape[0], self.impact.size))
        for law, at in self._laws_at(points):
            found[:, law.order] = law.below(at)[:, 0]
        return found

    def _laws_at(self, points: Array, only: int | None = None) -> Iterator[tuple[RowLaw, At]]:
        """Law of each series with the constants at the points; its `order` counts the problem's rows."""
        theta = self.theta(points)
        scaled = self.problem.noise.is_scaled
        factor: Array | float = np.exp(points[:, len(self.unknowns)]) if scaled else 1.0
        for series, law in self._laws:
            if only in (None, series):
                yield law, at_theta(self.problem, theta, factor, series)

    @cached_property
    def _laws(self) -> list[tuple[int, RowLaw]]:
        reference = least_squares(self.problem).optimum.theta
        one = not any(c.separate for c in self.problem.parameters)
        found = []
        for series in range(1 if one else len(self.problem.series)):
            rows = np.arange(self.impact.size) if one else np.flatnonzero(self.problem.rows.series == series)
            law = RowLaw.of(self.problem, rows, reference)
            found.append((series, replace(law, order=rows[law.order])))
        return found

    def theta(self, points: Array) -> Array:
        """Entries of theta, fixed ones included, (m, p)."""
        return self.problem.parameters.theta(points[:, : len(self.unknowns)])

    def sigma(self, points: Array) -> Array:
        """Noise of each row, (m, n) or (1, n)."""
        noise = np.exp(points[:, self.of_noise])
        return self.problem.noise.sigma_at(noise, self.problem.noise_groups().values())

    def points(self, draws: Mapping[str, Array], n_draws: int = 1) -> Array:
        """Points from draws as `draws` names them, of any shape, (m, d); (n_draws, 0) without unknowns."""
        noises = self.names[self.of_noise]
        columns = [np.log(draws[name]) if name in noises else draws[name] for name in self.names]
        return np.stack(columns, axis=-1).reshape(-1, len(columns)) if columns else np.empty((n_draws, 0))

    def impacts_in_parts(self, points: Array, most: int) -> Array:
        """`impacts` of so few points at a time that no array holds more than about `most` numbers."""
        parts = 1 + points.shape[0] * self.impact.size // most
        return np.concatenate([self.impacts(part) for part in np.array_split(points, parts)])

    def draws(self, points: Array) -> dict[str, Array]:
        """The points as the exact posterior names its draws, noises as they are; without kappa."""
        columns = points.T.copy()
        columns[self.of_noise] = np.exp(columns[self.of_noise])
        drawn = dict(zip(self.names, columns, strict=True))
        return drawn | self.problem.parameters.tied_draws(drawn)
