"""Gaussian (Laplace) approximation at an optimum: covariance, rank, undetermined combinations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.diagnostics.thresholds import HALF, RANK
from ifrfit.inference.model.common_errors import whitening
from ifrfit.inference.model.problem import Problem

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]

_HALF = 1.0 / HALF  # singular value (prior sd over sd) at which a combination counts as determined
_LOADED = 1e-7  # share of the prior sd below which a constant does not take part in a combination


@dataclass(frozen=True)
class GaussianApproximation:
    """Second-order expansion of the objective about theta.

    Attributes
    ----------
    names : tuple of str
        Coordinates of the expansion: those of theta, with kappa in the place of mu where that
        is one to one.
    phi : ndarray
        theta in these coordinates.
    to_theta : ndarray
        Derivative of theta by phi, (p, p).
    vectors : ndarray
        Directions in phi, one a column, orthogonal in units of the prior sd; zero in fixed entries.
    singular : ndarray
        Singular value of each direction: prior sd over sd.
    gradient : ndarray
        Derivative of the objective by phi.
    leverage : ndarray
        Of each row: how much of its own value it fits.
    """

    names: tuple[str, ...]
    phi: Array
    to_theta: Array
    vectors: Array
    singular: Array
    gradient: Array
    leverage: Array

    @property
    def tight(self) -> Bool:
        """Directions that the data (with auxiliary measurements) determine."""
        largest = self.singular.max(initial=0.0)
        return np.asarray((self.singular > RANK * largest) & (self.singular > _HALF))

    @property
    def seen(self) -> Bool:
        """Directions that the data see at all, however weakly."""
        return np.asarray(self.singular > RANK * self.singular.max(initial=0.0))

    @property
    def rank(self) -> int:
        """Number of constants, or combinations of them, that the data determine."""
        return int(self.tight.sum())

    def variance(self, functional: Array, prior_sd: float) -> float:
        """Variance of functional @ phi; infinite if it leans on a direction that the data do not see."""
        loading = functional @ self.vectors
        unseen = ~self.seen & (np.abs(loading) > _LOADED * prior_sd)
        if unseen.any():
            return float("inf")
        seen = self.seen
        return float(((loading[seen] / self.singular[seen]) ** 2).sum())

    @property
    def decrease(self) -> float:
        """Fall of the objective from theta to the least of the expansion."""
        slope = self.gradient @ self.vectors[:, self.seen]
        return float(0.25 * ((slope / self.singular[self.seen]) ** 2).sum())

    def tells(self, places: NDArray[np.intp]) -> bool:
        """Whether the data determine each of some entries of theta, not only combinations of them."""
        loading = (self.to_theta @ self.vectors)[places]
        size = np.linalg.norm(loading, axis=1, keepdims=True)
        return bool((np.abs(loading[:, ~self.tight]) <= _LOADED * size).all())

    @property
    def theta_sd(self) -> Array:
        """Standard deviation of each entry of theta, loose directions capped by the default prior, (p,)."""
        covariance = self.to_theta @ self.covariance(capped=True) @ self.to_theta.T
        return np.asarray(np.sqrt(np.diag(covariance)))

    def covariance(self, *, capped: bool) -> Array:
        """Covariance of phi; loose directions have at most the variance of the default prior if `capped`."""
        seen = self.seen
        inverse = np.where(seen, 1.0 / np.where(seen, self.singular, 1.0), 1.0 if capped else np.inf)
        if capped:
            inverse = np.minimum(inverse, 1.0)
        spread = self.vectors * inverse
        return np.asarray(spread @ spread.T)


def gaussian_approximation(
    problem: Problem,
    sigma: Array,
    theta: Array,
    *,
    with_priors: bool = True,
    common: Array | None = None,
) -> GaussianApproximation:
    """Expand the objective at theta.

    Parameters
    ----------
    problem : Problem
    sigma : ndarray
        Standard uncertainty of each row.
    theta : ndarray
    with_priors : bool
        Count the user's priors as measurements.
    common : ndarray, (n, r), optional
        Errors that the rows have in common: they are off by each column times one standard normal number.
        These are integrated out.
    """
    names, phi, to_theta, by_phi, residual = weighted_jacobian(problem, sigma, theta, with_priors=with_priors)
    n = problem.rows.value.size
    gradient = -2.0 * (by_phi.T @ residual)
    if common is not None:
        unit, size = whitening(common, sigma)
        shrunk = unit * (1.0 - 1.0 / np.sqrt(1.0 + size**2))
        by_phi[:n] -= shrunk @ (unit.T @ by_phi[:n])
    free = problem.parameters.free
    scale = problem.parameters.prior_sd / np.abs(np.diag(to_theta))
    carried = _carried(problem, theta, to_theta)
    scaled = (by_phi @ carried) * scale[free]
    left, singular, right = np.linalg.svd(scaled, full_matrices=False)
    p = int(free.sum())
    if singular.size < p:  # fewer rows than constants: the rest of the directions are loose
        _, _, right = np.linalg.svd(scaled, full_matrices=True)
        singular = np.concatenate((singular, np.zeros(p - singular.size)))
    vectors = np.zeros((theta.size, p))
    vectors[:] = carried @ (scale[free, None] * right.T)
    seen = singular[: left.shape[1]] > RANK * singular.max(initial=0.0)
    fitted = left[:n, seen]
    if common is None:
        leverage = (fitted * fitted).sum(axis=1)
    else:
        leverage = ((fitted - shrunk @ (unit.T @ fitted)) ** 2).sum(axis=1)
        leverage += unit**2 @ (size**2 / (1.0 + size**2))
    return GaussianApproximation(names, phi, to_theta, vectors, singular, gradient, leverage)


def _carried(problem: Problem, theta: Array, to_theta: Array) -> Array:
    """Derivative of the coordinates of the expansion by those of the free entries, (p, k).

    Tied entries go along with them.
    """
    free = problem.parameters.free
    if not problem.parameters.is_tied:
        return np.asarray(np.eye(theta.size)[:, free])
    moved = np.linalg.solve(to_theta, problem.parameters.by_free(theta))
    return np.asarray(moved @ np.linalg.inv(moved[free]))


def weighted_jacobian(
    problem: Problem, sigma: Array, theta: Array, *, with_priors: bool = True
) -> tuple[tuple[str, ...], Array, Array, Array, Array]:
    """Derivatives of the rows over their sigma, and of the priors, by the coordinates of the expansion.

    Returns
    -------
    names, phi, to_theta
        As `kappa_coordinates`.
    by_phi : ndarray, (n + priors, p)
    residual : ndarray, (n + priors,)
    """
    names, phi, to_theta = kappa_coordinates(problem, theta)
    jacobian = problem.jacobian(theta) / sigma[:, None]
    residual = problem.residual(theta) / sigma
    if with_priors:
        place, _, sd = problem.parameters.priors
        extra = np.zeros((place.size, theta.size))
        extra[np.arange(place.size), place] = 1.0 / sd
        jacobian = np.concatenate((jacobian, extra))
        residual = np.concatenate((residual, -problem.parameters.prior_residuals(theta)))
    return names, phi, to_theta, jacobian @ to_theta, residual


def first_order_move(
    problem: Problem, sigma: Array, theta: Array, change: Array, common: Array | None = None
) -> tuple[Array, Array]:
    """By how much the optimum moves where every row's value is predicted larger by a change, (n,).

    Errors that the rows have in common, (n, r), as of `gaussian_approximation`, take a part of it.

    Returns
    -------
    moved : ndarray, (p,)
        In the coordinates of the expansion.
    rest : ndarray, (n + priors,)
        What is left of the change over sigma.
    """
    _, _, to_theta, by_phi, _ = weighted_jacobian(problem, sigma, theta)
    free = problem.parameters.free
    scale = (problem.parameters.prior_sd / np.abs(np.diag(to_theta)))[free]
    columns, weighted = by_phi[:, free] * scale, np.zeros(len(by_phi))
    weighted[: sigma.size] = change / sigma
    if common is not None:
        unit, size = whitening(common, sigma)
        shrunk = unit * (1.0 - 1.0 / np.sqrt(1.0 + size**2))
        n = sigma.size
        columns[:n] -= shrunk @ (unit.T @ columns[:n])
        weighted[:n] -= shrunk @ (unit.T @ weighted[:n])
    share, *_ = np.linalg.lstsq(columns, weighted, rcond=RANK)
    moved = np.zeros(theta.size)
    moved[free] = -share * scale
    return moved, weighted - columns @ share


def kappa_coordinates(problem: Problem, theta: Array) -> tuple[tuple[str, ...], Array, Array]:
    """Names, values and derivative of theta by (e_n, c, kappa).

    kappa = mu (1 + e_n) takes the place of mu, because it is what tangential data determine; mu stays where
    one mu goes with several e_n.
    """
    derivative = np.eye(theta.size)
    phi = theta.copy()
    names = list(problem.parameters.names)
    for i_mu, i_e in problem.parameters.kappa_places:
        factor = 1.0 + theta[i_e]
        phi[i_mu] = theta[i_mu] * factor
        names[i_mu] = names[i_mu].replace("mu", "kappa", 1)
        if problem.parameters.entries[i_mu].fixed is None:
            derivative[i_mu, i_mu] = 1.0 / factor
            derivative[i_mu, i_e] = -theta[i_mu] / factor
    return tuple(names), phi, derivative
