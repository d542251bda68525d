"""The law of contact of closure MAW: the table, in the variables of an impact."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ifrfit.physics.angles import Array, Incidence
from ifrfit.physics.compiling import available
from ifrfit.physics.compliance.materials import LARGEST_RATIO, LEAST_RATIO
from ifrfit.physics.compliance.table import compliance_table
from ifrfit.physics.impulse_laws import friction_factor

_MANY = 10_000_000  # evaluations: a second of numpy's time
LOWEST_CHI, HIGHEST_CHI = 0.65, 3.0  # ends of the table


@dataclass(frozen=True)
class Compliance:
    """Impulse factor k = share (1 + beta) with the beta of Maw, Barber & Fawcett; kappa/tau in gross slip.

    The scaled velocity is psi1 = 4 chi share tau/kappa, which holds the scaling to e_n < 1: psi1 and psi2 of
    an elastic impact stand for 2/(1 + e_n) times those of an inelastic one. So e_n and mu enter through kappa
    alone, as they do in the bilinear laws, and gross slip stays exact.

    Attributes
    ----------
    share : float
        J/(1 + J).
    compiled : bool
        Take the table's compiled loop.
    """

    share: float
    compiled: bool = False

    def impulse(
        self, incidence: Incidence, c: ArrayLike, kappa: ArrayLike
    ) -> tuple[Array, NDArray[np.bool_]]:
        """k, and whether the contact sticks somewhere at some time, which it does below 4 chi - 1."""
        chi = np.asarray(c, dtype=float)
        friction, psi1 = self.load(incidence, chi, kappa)
        table = compliance_table()
        beta = table.beta_of_many(psi1, chi) if self.compiled else table.beta(psi1, chi)
        sticks = psi1 < 4.0 * chi - 1.0
        k = np.where(sticks, self.share * (1.0 + beta), friction)
        return np.where(np.isnan(chi), np.nan, k), sticks

    def slopes(self, incidence: Incidence, c: ArrayLike, kappa: ArrayLike) -> tuple[Array, Array]:
        """Derivatives of k by chi and by kappa."""
        chi, kappa = np.asarray(c, dtype=float), np.asarray(kappa, dtype=float)
        _, psi1 = self.load(incidence, chi, kappa)
        _, by_psi1, by_chi = compliance_table().slopes(psi1, chi)
        sticks = psi1 < 4.0 * chi - 1.0
        with np.errstate(divide="ignore", invalid="ignore"):
            less = np.where(psi1 > 0.0, -self.share * by_psi1 * psi1 / kappa, 0.0)
            by_kappa = np.where(sticks, less, 1.0 / incidence.tau)
            by_c = np.where(sticks, self.share * (by_chi + by_psi1 * psi1 / chi), 0.0)
        return by_c, by_kappa

    def bound(self, c: ArrayLike) -> Array:
        """kappa/tau where gross slip begins, psi1 = 4 chi - 1."""
        chi = np.asarray(c, dtype=float)
        return np.asarray(4.0 * chi * self.share / (4.0 * chi - 1.0))

    def bound_slope(self, c: ArrayLike) -> Array:
        """Derivative of `bound` by chi."""
        chi = np.asarray(c, dtype=float)
        return np.asarray(-4.0 * self.share / (4.0 * chi - 1.0) ** 2)

    def constant_at(self, bound: ArrayLike) -> Array:
        """The chi whose `bound` this is; infinite where every one is larger."""
        over = np.asarray(bound, dtype=float) / self.share - 1.0
        with np.errstate(divide="ignore"):
            return np.where(over > 0.0, 0.25 * (1.0 + 1.0 / np.maximum(over, 0.0)), np.inf)

    def for_many(self, count: int) -> Compliance:
        """The same with the compiled loop, where it is there and pays for its import."""
        return replace(self, compiled=True) if count >= _MANY and available() else self

    def load(self, incidence: Incidence, chi: Array, kappa: ArrayLike) -> tuple[Array, Array]:
        """kappa/tau, and the scaled velocity psi1, infinite without friction."""
        friction = friction_factor(incidence, kappa)
        with np.errstate(divide="ignore", over="ignore"):
            return friction, 4.0 * self.share * chi / friction


def chi_range(inertia_factor: float) -> tuple[float, float]:
    """chi of like materials with a Poisson ratio from 0.5 to 0, as far as the table has any of it."""
    per_stiffness = 0.5 * (1.0 + 1.0 / inertia_factor)
    low, high = LEAST_RATIO * per_stiffness, LARGEST_RATIO * per_stiffness
    if low >= HIGHEST_CHI or high <= LOWEST_CHI:
        return low, high
    return max(low, LOWEST_CHI), min(high, HIGHEST_CHI)
