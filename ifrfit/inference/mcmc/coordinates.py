"""The coordinates in which walkers walk: kappa in the place of mu, noise by its logarithm, angle offset."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.distributions.draws import kappa_draws
from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.model.problem import Problem

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Coordinates:
    """The posterior of a problem as a `Target`.

    Oblique impacts determine kappa = mu (1 + e_n) far better than mu where e_n is loose. In (e_n, mu) that is
    a thin bent ridge, along which ensembles crawl; in (e_n, kappa) it is straight. The density has the
    factor d mu / d kappa = 1/(1 + e_n), so that the law is the same.

    Attributes
    ----------
    density : Density
    """

    density: Density

    @property
    def problem(self) -> Problem:
        """The question."""
        return self.density.problem

    @property
    def dimensions(self) -> int:
        """Number of coordinates."""
        return len(self.density.names)

    def points(self, at: Array) -> Array:
        """Points of the density, (..., d), at coordinates (..., d)."""
        points = np.array(at, dtype=float)
        for mu, e_n, value in self.problem.parameters.free_kappas:
            points[..., mu] = at[..., mu] / (1.0 + (value if e_n is None else at[..., e_n]))
        return points

    def at(self, points: Array) -> Array:
        """Coordinates, (..., d), of points of the density, (..., d)."""
        at = np.array(points, dtype=float)
        for mu, e_n, value in self.problem.parameters.free_kappas:
            at[..., mu] = points[..., mu] * (1.0 + (value if e_n is None else points[..., e_n]))
        return at

    def __call__(self, at: Array) -> Array:
        """Log density, (m,); -inf outside the domain."""
        with np.errstate(all="ignore"):  # outside the domain anything may come out, and is not used
            found = self.density(self.points(at))
            for _, e_n, _ in self.problem.parameters.free_kappas:
                if e_n is not None:
                    found = found - np.log(np.maximum(1.0 + at[:, e_n], np.finfo(float).tiny))
        return np.where(np.isnan(found), -np.inf, found)

    def quantities(self, at: Array) -> Mapping[str, Array]:
        """Free constants, kappa, noises and the angle offset, each (...)."""
        flat = self.points(at).reshape(-1, self.dimensions)
        drawn = self.density.draws(flat)
        constants = {unknown.name: drawn[unknown.name] for unknown in self.density.unknowns}
        others = {name: values for name, values in drawn.items() if name not in constants}
        found = constants | kappa_draws(self.problem, drawn) | others
        return {name: np.reshape(values, at.shape[:-1]) for name, values in found.items()}
