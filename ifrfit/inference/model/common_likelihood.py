"""The likelihood of rows that have errors in common, these integrated out.

Section "Errors in common" of ``docs/noise.md``. There are r of them, z ~ N(0, 1) each: z moves values by L z
and angles of incidence by G z. Given z the rows are independent. Without it, with the model linear in the
small turns G z about those at which z lies at the optimum, z0, residuals q have the law

    q ~ N(0, D + B B'),    B = L - f' G,    q = y - L z0 - f(gamma - G z0) + B z0

with f' the slope of each value by its angle, and D the independent part: sigma^2, and with errors of angles
by effective variance the square of slope times error. With M = 1 + B' D^-1 B (Woodbury)

    q' (D + B B')^-1 q = q' D^-1 q - |M^-1/2 B' D^-1 q|^2,    det(D + B B') = det(D) det(M).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Rows
from ifrfit.physics.angles import Incidence

_STEP = 1e-4  # of differences by angle (degrees) and spin
_AT_ONCE = 400_000  # loadings of rows held at once
_DENSE = 1000  # rows up to which a covariance that is the same everywhere is factorised once
_HALF_LOG_2PI = 0.5 * math.log(2.0 * math.pi)


@dataclass(frozen=True)
class CommonLikelihood:
    """The likelihood of all rows together with the common errors integrated out.

    Attributes
    ----------
    problem : Problem
        With common errors.
    about : ndarray, (r,)
        Where these lie about which the model is taken as linear in the angles.
    """

    problem: Problem
    about: Array

    def __call__(self, theta: Array, noise: Array) -> Array:
        """Log likelihood, (m,), at theta, (m, p), and unknown noises, (m, k)."""
        if self._is_constant:
            return self._of_dense(theta)
        found = [self._of_part(*part) for part in self._parts(theta, noise)]
        return np.concatenate(found) if found else np.empty(0)

    def standardised(self, theta: Array, noise: Array, rng: np.random.Generator) -> Array:
        """Residuals over their independent errors at common errors drawn given the data, (m, n).

        At the true constants they are independent standard normal numbers: z is drawn from its law given q.
        """
        found = []
        for residual, variance, loadings in self._parts(theta, noise):
            weighted, root = loadings / np.sqrt(variance)[:, :, None], residual / np.sqrt(variance)
            factor = _root(weighted)
            mean = _solved(factor, np.einsum("mnr,mn->mr", weighted, root))
            scatter = rng.standard_normal(mean.shape)
            drawn = _solved_transposed(factor, mean + scatter)
            found.append(root - np.einsum("mnr,mr->mn", weighted, drawn))
        return np.concatenate(found)

    def _parts(self, theta: Array, noise: Array) -> Iterator[tuple[Array, Array, Array]]:
        """q, the variance of its independent part, (m, n) each, and B, (m, n, r), some points at a time."""
        step = max(1, _AT_ONCE // max(self.problem.rows.value.size * self.about.size, 1))
        for first in range(0, len(theta), step):
            points, own = theta[first : first + step], noise[first : first + step]
            loadings = self.loadings(points)
            sigma = self.problem.noise.sigma_at(own, self.problem.noise_groups().values())
            residual = self._there.residual(points) + loadings @ self.about
            yield residual, self._variance(points, sigma), loadings

    @property
    def _is_constant(self) -> bool:
        """Whether the covariance of the rows is the same at all constants and noises."""
        common = self.problem.common
        assert common is not None
        exact = not common.turns_angles and self.problem.error_model.is_plain
        return exact and self.problem.noise.is_known and self.problem.rows.value.size <= _DENSE

    @cached_property
    def _dense_factor(self) -> Array:
        """Lower triangular factor of D + L L', (n, n)."""
        common = self.problem.common
        assert common is not None
        covariance = np.diag(self.problem.noise.sigma**2) + common.value @ common.value.T
        return np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)

    def _of_dense(self, theta: Array) -> Array:
        from scipy.linalg import solve_triangular  # no other fit needs it

        factor, found = self._dense_factor, np.empty(len(theta))
        log_root = float(np.log(np.diag(factor)).sum()) + len(factor) * _HALF_LOG_2PI
        step = max(1, _AT_ONCE // len(factor))
        for first in range(0, len(theta), step):
            residual = self.problem.residual(theta[first : first + step])
            z = solve_triangular(factor, residual.T, lower=True, check_finite=False)
            found[first : first + step] = -0.5 * np.einsum("nm,nm->m", z, z) - log_root
        return np.where(np.isnan(found), -np.inf, found)

    def _of_part(self, residual: Array, variance: Array, loadings: Array) -> Array:
        root = residual / np.sqrt(variance)
        square = np.einsum("mn,mn->m", root, root)
        weighted = loadings / np.sqrt(variance)[:, :, None]
        factor = _root(weighted)
        explained = _solved(factor, np.einsum("mnr,mn->mr", weighted, root))
        log_det = np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1)
        total = -0.5 * (square - np.einsum("mr,mr->m", explained, explained)) - log_det
        total -= 0.5 * np.log(variance).sum(axis=1) + variance.shape[1] * _HALF_LOG_2PI
        return np.where(np.isnan(total), -np.inf, total)

    def loadings(self, theta: Array) -> Array:
        """B at theta, (m, p), as (m, n, r)."""
        common = self.problem.common
        assert common is not None
        if not common.turns_angles:
            return np.broadcast_to(common.value, (len(theta), *common.value.shape))
        return np.asarray(common.value - self._by_angle(theta)[:, :, None] * common.gamma_deg)

    def _variance(self, theta: Array, sigma: Array) -> Array:
        """Of the independent part, (m, n)."""
        variance = np.broadcast_to(sigma**2, (len(theta), self.problem.rows.value.size))
        if self.problem.error_model.angles != "effective":
            return variance
        rows = self.problem.rows
        of_angle = np.where(
            np.isnan(rows.sigma_gamma_deg), self.problem.error_model.gamma or 0.0, rows.sigma_gamma_deg
        )
        for sd, of_slope in (
            (of_angle, self._by_angle),
            (rows.sigma_spin_x, self._by_spin_x),
            (rows.sigma_spin_y, self._by_spin_y),
        ):
            counts = np.where(rows.has_angle, sd, 0.0)
            if counts.any():
                variance = variance + (of_slope(theta) * counts) ** 2
        return variance

    @cached_property
    def _there(self) -> Problem:
        return self.problem.at_common(self.about)

    def _by_angle(self, theta: Array) -> Array:
        """Slope of each value by its angle, per degree, (m, n)."""
        return self._slope(theta, self._turned)

    def _by_spin_x(self, theta: Array) -> Array:
        return self._slope(theta, self._spun((1.0, 0.0)))

    def _by_spin_y(self, theta: Array) -> Array:
        return self._slope(theta, self._spun((0.0, 1.0)))

    def _slope(self, theta: Array, ends: tuple[Rows, Rows, Array]) -> Array:
        low, high, width = ends
        up, down = (replace(self._there, rows=rows).predict(theta) for rows in (high, low))
        return np.asarray((up - down) / width)

    @cached_property
    def _turned(self) -> tuple[Rows, Rows, Array]:
        """Rows with their angles a little smaller and larger, and by how much; never beyond 0 and 90."""
        rows = self._there.rows
        low = np.maximum(rows.gamma_deg - _STEP, np.minimum(rows.gamma_deg, 0.5 * _STEP))
        high = np.minimum(rows.gamma_deg + _STEP, np.maximum(rows.gamma_deg, 90.0 - 0.5 * _STEP))
        ends = (rows.turned(low - rows.gamma_deg), rows.turned(high - rows.gamma_deg))
        return *ends, np.maximum(high - low, 0.5 * _STEP)

    def _spun(self, along: tuple[float, float]) -> tuple[Rows, Rows, Array]:
        rows, ends = self._there.rows, []
        for step in (-_STEP, _STEP):
            i = rows.incidence
            moved = (i.spin_x + step * along[0], i.spin_y + step * along[1])
            spinning = Incidence.of(rows.gamma_deg, *moved, degrees=True)
            ends.append(replace(rows, incidence=spinning, tau=spinning.tau))
        return ends[0], ends[1], np.full(rows.value.size, 2.0 * _STEP)


def _root(weighted: Array) -> Array:
    """Lower triangular factor of M, (m, r, r), of loadings over the roots of the variances, (m, n, r)."""
    information = np.einsum("mnr,mns->mrs", weighted, weighted) + np.eye(weighted.shape[2])
    return np.asarray(np.linalg.cholesky(information), dtype=np.float64)


def _solved(factor: Array, right: Array) -> Array:
    """Lower triangular factors, (m, r, r), out of vectors, (m, r)."""
    return np.asarray(np.linalg.solve(factor, right[:, :, None])[:, :, 0])


def _solved_transposed(factor: Array, right: Array) -> Array:
    return np.asarray(np.linalg.solve(np.swapaxes(factor, 1, 2), right[:, :, None])[:, :, 0])


def refuse_beside(problem: Problem) -> str:
    """Why common errors cannot be beside what else a problem says of its errors; empty where they can."""
    model = problem.error_model
    if model.tails != "gaussian":
        return _not_beside(model.option)
    if model.integrates:
        return _not_beside(model.option) + " For errors of angles --angle-errors effective goes with them."
    if model.offset is not None:
        return _not_beside("--angle-offset")
    if model.propagates and model.angles != "none":
        return _not_beside(f"--sigma-velocity with {model.option}")
    return ""


def _not_beside(option: str) -> str:
    return (
        f"{option} is not known beside errors that rows have in common (columns common1 and so on): leave it "
        "out, or leave these out of account with --common-errors ignored."
    )
