"""The posterior density of the constants alone, at many points at once: unknown noises are integrated out.

Eq. (13) and (14) of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.model.noise import noise_name
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.linear_families import LOWEST
from ifrfit.inference.posterior.lattice_rule import Array
from ifrfit.inference.posterior.noise_scale import NoiseScale

_AT_ONCE = 200_000  # predicted values held at once
_HALF_LOG_2PI = 0.5 * math.log(2.0 * math.pi)


@dataclass(frozen=True)
class _Coordinate:
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


@dataclass(frozen=True)
class ConstantsDensity:
    """Prior times likelihood of a problem over its free constants, unknown noises integrated out.

    A point holds the free entries of theta in their order, with kappa = mu (1 + e_n) in the place of mu where
    that is one to one, then the unknown offset of the set angles. Where errors are not plain a common factor
    of the noise has no closed form: its logarithm is a coordinate, before the offset. The ends of a
    coordinate depend on no more than those before it.

    Attributes
    ----------
    problem : Problem
    """

    problem: Problem

    @cached_property
    def coordinates(self) -> tuple[_Coordinate, ...]:
        """What the coordinates stand for."""
        parameters = self.problem.parameters
        place = np.cumsum(parameters.free) - 1  # among the free entries
        partner = dict(parameters.kappa_places)
        lifted = self.problem.rows.has_rebound_scale  # values over the outgoing velocity
        found = []
        for entry, unknown in zip(np.flatnonzero(parameters.free), self.problem.free_parameters, strict=True):
            e_n: int | float | None = None
            if int(entry) in partner:
                other = partner[int(entry)]
                fixed = parameters.entries[other].fixed
                e_n = int(place[other]) if fixed is None else float(fixed)
            if lifted and entry in parameters.positions["e_n"]:
                unknown = FreeParameter(
                    unknown.name, max(unknown.lower, LOWEST), unknown.upper, unknown.prior, unknown.log_scale
                )
            found.append(_Coordinate(unknown, e_n))
        if not self.problem.error_model.is_plain:
            for name, (low, high) in self.problem.noise_bounds().items():
                log_low, log_high = math.log(low), math.log(high)
                scale = -math.log(log_high - log_low)
                found.append(_Coordinate(FreeParameter(noise_name(name), log_low, log_high, None, scale)))
        if self.problem.offset is not None:
            found.append(_Coordinate(self.problem.offset))
        return tuple(found)

    @property
    def dimensions(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    @cached_property
    def noises(self) -> dict[str, NoiseScale]:
        """The noises that are integrated out, by the name of their group."""
        if not self.problem.error_model.is_plain:
            return {}
        bounds = self.problem.noise_bounds()
        return {
            name: NoiseScale(rows.size, *bounds[name]) for name, rows in self.problem.noise_groups().items()
        }

    def ends(self, place: int, at: Array) -> tuple[Array, Array]:
        """Ends of a coordinate, (m,) each, where the ones before it are those of points (m, d)."""
        own = self.coordinates[place]
        factor = own.factor(at) + np.zeros(at.shape[0])
        return own.domain.lower * factor, own.domain.upper * factor

    def values(self, at: Array) -> Array:
        """The parameters behind the coordinates, (m, d)."""
        return np.stack(
            [x / c.factor(at) for x, c in zip(at.T, self.coordinates, strict=True)], axis=1
        ).reshape(at.shape)

    def at(self, values: Array) -> Array:
        """Coordinates, (m, d), of parameters (m, d)."""
        columns = [x * c.factor(values) for x, c in zip(values.T, self.coordinates, strict=True)]
        return np.stack(columns, axis=1).reshape(values.shape)

    def theta(self, values: Array) -> Array:
        """All entries of theta, fixed ones included, (m, p), of parameters (m, d)."""
        free = self.problem.parameters.free
        fixed = [0.0 if each.fixed is None else each.fixed for each in self.problem.parameters.entries]
        theta = np.tile(fixed, (values.shape[0], 1))
        theta[:, free] = values[:, : int(free.sum())]
        return theta

    def __call__(self, at: Array) -> tuple[Array, Array]:
        """Log density over the coordinates, (m,), and the sum of squares of each noise group, (m, groups).

        Parameters
        ----------
        at : ndarray, (m, d)
            Inside the domain.
        """
        values = self.values(at)
        total = np.zeros(at.shape[0])
        for own, value in zip(self.coordinates, values.T, strict=True):
            total = total + own.domain.log_prior(value) - np.log(own.factor(at))
        if not self.problem.error_model.is_plain:
            return total + self._scattered(values), np.empty((at.shape[0], 0))
        squares = self._squares(values)
        for square, scale in zip(squares.T, self.noises.values(), strict=False):
            total = total + scale.log_likelihood(square)
        total = total - float(np.log(self.problem.noise.base).sum())
        total = total - 0.5 * squares[:, -1] - self._known.size * _HALF_LOG_2PI
        return np.where(np.isnan(total), -np.inf, total), squares[:, :-1]

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
        unknown = np.zeros(len(self.problem.rows), dtype=bool)
        for rows in self.problem.noise_groups().values():
            unknown[rows] = True
        return np.flatnonzero(~unknown)

    def _scattered(self, values: Array) -> Array:
        """Log likelihood where errors of angles or heavy tails make it other than plain."""
        return np.asarray(self._density.impacts(values).sum(axis=1))

    @cached_property
    def _density(self) -> Density:
        return Density(self.problem)
