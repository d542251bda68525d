"""Closure MAW: Maw, Barber & Fawcett's solution as a table, and as the law of contact of an impact.

Below psi1 = 1 the contact begins by sticking, from 4 chi - 1 on it slips throughout, and at both the
solution has a kink in its curvature. So the table has one range of nodes from 0 to 1 and one from 1 to
4 chi - 1. Along the velocity it is a cubic spline, along chi the cubic with the slopes of central
differences; both have continuous slopes, which a search by derivatives needs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ifrfit.errors import UsageError
from ifrfit.physics.angles import Array, Incidence
from ifrfit.physics.impulse_laws import friction_factor

LEAST_RATIO, LARGEST_RATIO = 2.0 / 3.0, 1.0  # tangential over normal stiffness at nu = 0.5 and at nu = 0
Index = NDArray[np.intp]

_SLACK = 1e-5  # beyond the ends of chi, for differences taken there
LOWEST_CHI, HIGHEST_CHI = 0.65, 3.0  # ends of the table


def chi_of(nu: ArrayLike, inertia_factor: float = 0.4) -> Array:
    """Compliance number chi = khat (1 + 1/J)/2 of like materials.

    khat is the tangential over the normal stiffness, 2 (1 - nu)/(2 - nu).

    Parameters
    ----------
    nu : array_like
        Poisson ratio of sphere and wall, 0 to 0.5.
    inertia_factor : float
        J = I/(m R^2); 2/5 gives 7 (1 - nu)/(2 (2 - nu)).

    Returns
    -------
    ndarray

    Notes
    -----
    Maw, Barber & Fawcett (1976), Wear 38, 101. Unlike materials have khat = 4 G*/E*, with
    1/G* = sum of (2 - nu)/G and 1/E* = sum of (1 - nu^2)/E.
    """
    nu = np.asarray(nu, dtype=float)
    khat = 2.0 * (1.0 - nu) / (2.0 - nu)
    return np.asarray(0.5 * khat * (1.0 + 1.0 / inertia_factor))


def poisson_ratio(chi: ArrayLike, inertia_factor: float = 0.4) -> Array:
    """Poisson ratio of a sphere and a wall of one material that have this chi: the inverse of `chi_of`."""
    khat = 2.0 * np.asarray(chi, dtype=float) * inertia_factor / (1.0 + inertia_factor)
    return np.asarray(2.0 * (1.0 - khat) / (2.0 - khat))


@dataclass(frozen=True)
class Table:
    """Cubics of beta in every interval of the scaled velocity, at nodes of chi.

    Attributes
    ----------
    chi : ndarray, (m,)
        Nodes, evenly spaced.
    nodes : ndarray, (m + 2, intervals, 4)
        Coefficients of beta in powers of the place inside an interval, 0 to 1; one row more at either end.
    first : int
        Intervals between 0 and 1; the rest lies between 1 and 4 chi - 1.
    """

    chi: Array
    nodes: Array
    first: int

    def cubics(self, chi: float) -> Array:
        """Coefficients of all intervals at one chi, (intervals, 4)."""
        i, u = self._place(np.array([chi]))
        return np.asarray(np.tensordot(_weights(u)[:, 0], self.nodes[i[0] : i[0] + 4], axes=1))

    def _place(self, chi: Array) -> tuple[Index, Array]:
        """Interval of chi, and the place in it."""
        low, high = float(self.chi[0]), float(self.chi[-1])
        outside = (chi < low - _SLACK) | (chi > high + _SLACK)
        if outside.any():
            raise UsageError(
                f"chi = {float(chi[outside].flat[0]):g}: the table of closure MAW reaches from {low:g} to "
                f"{high:g}. A solid sphere of the wall's material has 1.167 to 1.75."
            )
        x = (chi - low) / (self.chi[1] - self.chi[0])
        i = np.minimum(np.fmax(x, 0.0), self.chi.size - 2.0).astype(np.intp)  # nan as 0
        return i, x - i

    def beta(self, psi1: Array, chi: Array) -> Array:
        """Restitution below gross slip; nan from 4 chi - 1 on, where it is 4 chi/psi1 - 1."""
        return self._evaluated(psi1, chi, slopes=False)[0]

    def slopes(self, psi1: Array, chi: Array) -> tuple[Array, Array, Array]:
        """beta, and its derivatives by psi1 and by chi; nan in gross slip."""
        beta, by_psi1, by_chi = self._evaluated(psi1, chi, slopes=True)
        return beta, by_psi1, by_chi

    def _evaluated(self, psi1: Array, chi: Array, *, slopes: bool) -> tuple[Array, ...]:
        if chi.size > 1 and (chi == chi.flat[0]).all():
            chi = chi.reshape(-1)[:1]
        row, v = self._place(chi)
        gross = 4.0 * chi - 1.0
        inside = psi1 < gross
        sticks_first = psi1 < 1.0
        second = self.nodes.shape[1] - self.first
        with np.errstate(invalid="ignore", over="ignore"):
            x = np.where(sticks_first, psi1 * self.first, self.first + (psi1 - 1.0) / (gross - 1.0) * second)
        x = np.where(inside, x, 0.0)
        i = np.minimum(x.astype(np.intp), self.nodes.shape[1] - 1)
        u = x - i
        c = self._cells(row, i, _weights(v))
        beta = np.where(inside, _horner(c, u), np.nan)
        if not slopes:
            return (beta,)
        along = _horner(c[..., 1:] * np.array([1.0, 2.0, 3.0]), u)
        per_psi1 = np.where(sticks_first, self.first, second / (gross - 1.0))
        by_chi = _horner(self._cells(row, i, _weight_slopes(v)), u) / (self.chi[1] - self.chi[0])
        # the nodes between 1 and 4 chi - 1 move with chi
        moved = np.where(sticks_first, 0.0, (x - self.first) * 4.0 / (gross - 1.0))
        nothing = np.where(inside, 0.0, np.nan)
        return beta, along * per_psi1 + nothing, by_chi - along * moved + nothing

    def _cells(self, row: Index, i: Index, weights: Array) -> Array:
        """Cubics of interval i, (..., 4): weights (4, ...) times those at the nodes of chi from `row` on."""
        n = self.nodes.shape[1]
        if row.size * n <= 2 * i.size:  # few chi: all their intervals first
            near = self.nodes.reshape(len(self.nodes), -1)[row.reshape(-1, 1) + np.arange(4)]
            near *= weights.reshape(4, -1).T[..., None]
            at = np.arange(row.size).reshape(row.shape) * n + i
            return np.asarray(near.sum(axis=1).reshape(-1, 4).take(at, axis=0))
        intervals, at = self.nodes.reshape(-1, 4), row * n + i
        total: Array = intervals.take(at, axis=0) * weights[0, ..., None]
        for k in range(1, 4):
            total += intervals.take(at + k * n, axis=0) * weights[k, ..., None]
        return total


def _horner(c: Array, u: Array) -> Array:
    """Polynomial with coefficients along the last axis, lowest first."""
    total = c[..., -1]
    for k in range(c.shape[-1] - 2, -1, -1):
        total = c[..., k] + u * total
    return np.asarray(total)


def _weights(v: Array) -> Array:
    """Weights (4, ...) of the neighbours: a cubic with the slopes of their central differences."""
    return 0.5 * np.stack(
        (v * (v * (2.0 - v) - 1.0), 2.0 + v * v * (3.0 * v - 5.0), v * (1.0 + v * (4.0 - 3.0 * v)),
         v * v * (v - 1.0))
    )  # fmt: skip


def _weight_slopes(v: Array) -> Array:
    """Derivatives of `_weights`."""
    return 0.5 * np.stack(
        (v * (4.0 - 3.0 * v) - 1.0, v * (9.0 * v - 10.0), 1.0 + v * (8.0 - 9.0 * v), v * (3.0 * v - 2.0))
    )


@cache
def compliance_table() -> Table:
    """The table that comes with the package: the cubics through the values of table.csv beside it."""
    path = files("ifrfit.physics.compliance") / "splines.npz"
    with path.open("rb") as file, np.load(file, allow_pickle=False) as kept:
        chi, nodes, first = kept["chi"], np.ascontiguousarray(kept["nodes"]), int(kept["first"])
    chi.flags.writeable = nodes.flags.writeable = False
    return Table(chi, nodes, first)


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
    """

    share: float

    def impulse(
        self, incidence: Incidence, c: ArrayLike, kappa: ArrayLike
    ) -> tuple[Array, NDArray[np.bool_]]:
        """k, and whether the contact sticks somewhere at some time, which it does below 4 chi - 1."""
        chi = np.asarray(c, dtype=float)
        friction, psi1 = self.load(incidence, chi, kappa)
        beta = compliance_table().beta(psi1, chi)
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
