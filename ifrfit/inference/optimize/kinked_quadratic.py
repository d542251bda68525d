"""Quadratic models of an objective at many places, with the kinks that cross them.

A step is Newton's with the Hessian of Gauss and Newton, less what the logarithm of a sum of squares takes
from it where it stays positive; it can be damped after Levenberg and Marquardt. Optima lie on kinks, too,
where the model of neither side points: there a step leads along the kink. Derivations stand in
docs/theory/search.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ifrfit.inference.model.rows import Array, Index
from ifrfit.inference.optimize.search_objective import Bool, SearchObjective

_LOOSE = 1e-11  # eigenvalue, relative, of a direction that the data do not see: it stays where it is
_CONVEX = 0.05  # least eigenvalue with which the logarithm's part of the Hessian is kept
_ROOM = 1e-12  # from a bound, relative to the range, within which a constant lies on it
_ON_KINK = 1e-3  # distance from a kink, in standard deviations


@dataclass(frozen=True)
class KinkedQuadratic:
    """Quadratic models of the objective at m places, in units of the constants' own sizes.

    Attributes
    ----------
    vectors, values : ndarray, (m, q, q), (m, q)
        Eigenvectors and eigenvalues of the scaled Hessian.
    gradient : ndarray, (m, q)
        By the eigenvectors.
    unit : ndarray, (m, q)
        Of each free constant; 0 where a bound stops it.
    margin, slopes : ndarray, (m, kinks), (m, kinks, q)
        Of the kinks, by the free constants; nothing where there are none.
    is_on_bound : ndarray of bool, (m,)
        Whether some free constant lies on a bound.
    """

    vectors: Array
    values: Array
    gradient: Array
    unit: Array
    margin: Array
    slopes: Array
    is_on_bound: Bool

    @classmethod
    def of(cls, objective: SearchObjective, theta: Array, z: Array, dof: Array, x: Array) -> KinkedQuadratic:
        """The models at theta."""
        gradient, hessian, whole = objective.derivatives(theta, z, dof, x)
        lower, upper = (end[:, objective.free] for end in objective.bounds(x))
        here = theta[:, objective.free]
        room = _ROOM * np.minimum(upper - lower, 1.0)
        is_low, is_high = here <= lower + room, here >= upper - room
        stopped = (is_low & (gradient > 0.0)) | (is_high & (gradient < 0.0))
        q = here.shape[1]
        diagonal = hessian[:, range(q), range(q)]
        unit = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        unit = np.where(stopped, 0.0, unit)
        scale = unit[:, :, None] * unit[:, None, :]
        values, vectors = np.linalg.eigh(whole * scale)
        bent = values[:, 0] < _CONVEX
        if stopped.any():  # what is stopped has an eigenvalue of 0
            bent = (values < -_LOOSE).any(axis=1) | (_least_moving(values, stopped) < _CONVEX)
        if bent.any():
            values[bent], vectors[bent] = np.linalg.eigh((hessian * scale)[bent])
        along = (np.swapaxes(vectors, 1, 2) @ (unit * gradient)[..., None])[..., 0]
        if objective.problem.closure.bilinear and objective.problem.has_oblique:
            margin, slopes = objective.margins(theta, x)
        else:
            margin, slopes = np.zeros((len(theta), 0)), np.zeros((len(theta), 0, q))
        is_on_bound = np.asarray((is_low | is_high).any(axis=1))
        return cls(vectors, values, along, unit, margin, slopes, is_on_bound)

    def take(self, which: Bool | Index) -> KinkedQuadratic:
        """Some of them."""
        return KinkedQuadratic(*(getattr(self, name)[which] for name in self.__dataclass_fields__))

    @cached_property
    def _inverse(self) -> Array:
        """Reciprocal eigenvalues, 0 of directions that the data do not see."""
        seen = self.values > _LOOSE * np.maximum(self.values[:, -1:], 1e-300)
        return np.where(seen, 1.0 / np.where(seen, self.values, 1.0), 0.0)

    @cached_property
    def promised(self) -> Array:
        """Fall of the model from here to its minimum, (m,)."""
        return np.asarray(0.5 * (self._inverse * self.gradient**2).sum(axis=1))

    def step(self, damping: Array) -> Array:
        """To the minimum of each model with its damping, (m, q)."""
        inverse = self._damped_inverse(damping)
        return -self.unit * (self.vectors @ (inverse * self.gradient)[..., None])[..., 0]

    def _damped_inverse(self, damping: Array | float) -> Array:
        seen, more = self._inverse > 0.0, np.broadcast_to(damping, len(self.unit))[:, None]
        return np.where(seen, 1.0 / np.where(seen, self.values + more, 1.0), 0.0)

    def _across(self, damping: Array | float = 0.0) -> tuple[Array, Array, Array]:
        """Of each kink: H^-1 a by the eigenvectors, a H^-1 a, and how far the damped step goes across it."""
        scaled = (self.slopes * self.unit[:, None, :]) @ self.vectors
        turned = scaled * self._damped_inverse(damping)[:, None, :]
        return turned, (turned * scaled).sum(axis=2), -(turned @ self.gradient[..., None])[..., 0]

    @cached_property
    def _nearest(self) -> tuple[Index, Array, Array]:
        """The nearest kink, its distance in standard deviations, and the fall across it, (m,) each."""
        _, size, moved = self._across()
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = np.where(size > 0.0, np.abs(self.margin) / np.sqrt(size), np.inf)
            fall = np.where(size > 0.0, 0.5 * moved**2 / size, 0.0)
        kink = distance.argmin(axis=1)
        at = np.arange(kink.size), kink
        return kink, distance[at], fall[at]

    @property
    def kinks_ahead(self) -> list[Index]:
        """The first kink that Newton's step meets, and the nearest one."""
        if not self.margin.shape[1]:
            return []
        _, size, moved = self._across()
        with np.errstate(divide="ignore", invalid="ignore"):
            share = -self.margin / moved
        share = np.where((share >= 0.0) & (size > 0.0), share, np.inf)
        return [share.argmin(axis=1), self._nearest[0]]

    def step_along(self, kink: Index, damping: Array) -> Array:
        """To the minimum of the damped model on a kink each, (m, q); eq. (3)."""
        turned, size, moved = self._across(damping)
        at = np.arange(kink.size), kink
        with np.errstate(divide="ignore", invalid="ignore"):
            back = (moved[at] + self.margin[at]) / size[at]
        back = np.where((size[at] > 0.0) & np.isfinite(back), back, 0.0)
        toward = self.unit * (self.vectors @ turned[at][..., None])[..., 0]
        return self.step(damping) - back[:, None] * toward

    @property
    def step_along_nearest_kink(self) -> Array:
        """To the minimum on the nearest kink, (m, q)."""
        nothing = np.zeros(len(self.unit))
        return self.step_along(self._nearest[0], nothing) if self.margin.shape[1] else self.step(nothing)

    @property
    def is_on_kink(self) -> Bool:
        """Whether a place lies on a kink, (m,)."""
        return self._nearest[1] <= _ON_KINK if self.margin.shape[1] else np.zeros(len(self.unit), dtype=bool)

    @property
    def promised_along(self) -> Array:
        """Fall of the model along the nearest kink, (m,)."""
        return self.promised - self._nearest[2] if self.margin.shape[1] else self.promised


def _least_moving(values: Array, stopped: Bool) -> Array:
    """Least eigenvalue beside the zeros of constants that a bound stops, (m,)."""
    q = values.shape[1]
    number = np.minimum(stopped.sum(axis=1), q - 1)
    return np.asarray(values[np.arange(len(values)), number])
