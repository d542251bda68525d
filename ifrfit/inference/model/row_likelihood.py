"""Likelihood of rows whose scatter is not plain, at many constants at once."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.latent_incidence import HALF_WIDTH, Latent
from ifrfit.inference.model.latent_quadrature import At, LatentRows, pieces, slopes
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index

Array = NDArray[np.float64]

_AT_ONCE = 400_000  # values held at once
_STEEPEST = 60.0  # slope in the angle, in sigma a sd, up to which the nodes follow
_HALF_LOG_2PI = 0.5 * math.log(2.0 * math.pi)


@dataclass(frozen=True)
class RowLaw(LatentRows):
    """Likelihood of rows whose true angles or heavy tails are integrated."""

    @classmethod
    def of(cls, problem: Problem, rows: Index, reference: Array | None = None) -> RowLaw:
        """Law of some rows of a problem.

        Parameters
        ----------
        problem : Problem
        rows : ndarray of int
        reference : ndarray, optional
            Entries of theta near which it is asked for. The steeper the values are there in the angle, the
            more nodes are taken.
        """
        own = problem.rows.take(rows)
        has_angle = own.has_angle
        sd = [np.where(has_angle, x, 0.0) for x in (own.sigma_spin_x, own.sigma_spin_y)]
        of_angle = np.where(
            np.isnan(own.sigma_gamma_deg), problem.error_model.gamma or 0.0, own.sigma_gamma_deg
        )
        gamma = np.where(has_angle, own.gamma_deg, 0.0)
        columns = np.column_stack((gamma, own.incidence.spin_x, own.incidence.spin_y))
        columns = np.column_stack((columns, np.where(has_angle, of_angle, 0.0), *sd))
        key = np.column_stack((own.impacts, columns))
        _, first, unit = np.unique(key, axis=0, return_index=True, return_inverse=True)
        order = np.argsort(unit, kind="stable")
        gamma, spin_x, spin_y, sd_gamma, sd_x, sd_y = columns[first].T
        ends = problem.error_model.population or (0.0, 90.0)
        latent = Latent(gamma, spin_x, spin_y, sd_gamma, sd_x, sd_y, ends, np.ones(gamma.size, dtype=np.intp))
        own = own.take(order) if rows.size > 1 else own
        law = cls(
            problem.error_model, own.names, own.which, unit[order], own.value,
            problem.noise.sigma[rows][order], own.incidence, latent, problem.inertia_factor, order,
        )  # fmt: skip
        return law if reference is None else law._fine_enough(problem, reference)

    def _fine_enough(self, problem: Problem, theta: Array) -> RowLaw:
        """Nodes for the narrower of the two laws whose product is integrated: of the angle, of the value."""
        steep = np.zeros(self.latent.gamma.size)  # squared
        for sd, slope in slopes(self, at_theta(problem, theta[None])):
            np.add.at(steep, self.unit, (slope[0, 0, :, 0] * sd / self.sigma) ** 2)
        widths = 2.0 * HALF_WIDTH * np.sqrt(1.0 + np.minimum(steep, _STEEPEST**2))
        # few different numbers, so that impacts are done together
        order = 16.0 * 1.5 ** np.ceil(np.log((6.0 + 0.9 * widths) / 16.0) / math.log(1.5))
        return replace(self, latent=replace(self.latent, order=np.ceil(order).astype(np.intp)))

    def log_likelihood(self, at: At) -> Array:
        """Log likelihood of all rows together, (P, C)."""
        total = np.zeros((at.x.size, at.width))
        for points in self._chunks(at):
            total[points] = self._log_units(at.take(points)).sum(axis=-1)
        return total

    def log_units(self, at: At) -> Array:
        """Log likelihood of each unit, (P, C, U)."""
        found = np.empty((at.x.size, at.width, self.latent.gamma.size))
        for points in self._chunks(at):
            found[points] = self._log_units(at.take(points))
        return found

    def below(self, at: At) -> Array:
        """Probability of a value below the measured one, row by row, (P, C, n)."""
        found = np.empty((at.x.size, at.width, self.value.size))
        for points in self._chunks(at):
            part = at.take(points)
            for piece in pieces(self, part):
                share = self._law_cdf((self.value[piece.rows, None] - piece.value) / piece.sigma)
                share = (share * np.exp(piece.log_weight[..., piece.of_rows, :])).sum(axis=-1)
                if piece.first:
                    found[points][..., piece.rows] = 0.0
                found[points][..., piece.rows] += share
        return found

    def _chunks(self, at: At) -> Iterator[slice]:
        nodes = int(self.latent.order[self.unit].sum()) if self.error_model.integrates else self.value.size
        step = max(1, _AT_ONCE // (at.width * nodes))
        yield from (slice(start, start + step) for start in range(0, at.x.size, step))

    def _log_units(self, at: At) -> Array:
        out = np.full((at.x.size, at.width, self.latent.gamma.size), -np.inf)
        for piece in pieces(self, at):
            log_p = self._log_density((self.value[piece.rows, None] - piece.value) / piece.sigma)
            log_p = log_p - np.log(piece.sigma)
            if piece.rows.size > piece.units.size:
                log_p = np.add.reduceat(log_p, np.flatnonzero(np.diff(piece.of_rows, prepend=-1)), axis=-2)
            log_p = log_p + piece.log_weight
            if log_p.shape[-1] > 1:
                top = log_p.max(axis=-1)
                top = np.where(np.isfinite(top), top, 0.0)
                with np.errstate(divide="ignore"):
                    log_p = top + np.log(np.exp(log_p - top[..., None]).sum(axis=-1))
            else:
                log_p = log_p[..., 0]
            out[..., piece.units] = log_p if piece.first else np.logaddexp(out[..., piece.units], log_p)
        return out

    def _log_density(self, z: Array) -> Array:
        return self.error_model.law.log_density(z, self.error_model.dof)

    def _law_cdf(self, z: Array) -> Array:
        return self.error_model.law.cdf(z, self.error_model.dof)


def at_theta(problem: Problem, theta: Array, factor: Array | float = 1.0, series: int = 0) -> At:
    """Constants of one series at many theta, (m, p); m points of one constant set each."""
    at = [places[series] for places in problem.parameters.positions.values()]
    by_name = dict(zip(problem.parameters.positions, theta[:, at].T, strict=True))
    own = problem.closure.constant
    c = by_name[own] if own else np.zeros(theta.shape[0])
    k = problem.closure.coefficients(problem.inertia_factor)
    e_n, mu, b = by_name["e_n"], by_name["mu"], k.b0 + k.b1 * c
    with np.errstate(divide="ignore", invalid="ignore"):
        x = np.where(b > 0.0, mu * (1.0 + e_n) / b, np.inf)
    scale = np.broadcast_to(np.asarray(factor, dtype=float), theta.shape[0])
    return At(x, *(part[:, None] for part in (k.a0 + k.a1 * c, b, e_n, mu, scale)))
