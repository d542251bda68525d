"""From the modes that least squares knows to a law close to the posterior: incremental mixture sampling.

A population of points begins with the uniform law and one component about each mode. As long as its weights
are uneven, a component is added about the point of the largest weight, with the covariance of the points near
it (IMIS: Raftery & Bao 2010, Biometrics 66, 1162). In the end the components are fitted to the weighted
population (M-PMC: Cappé, Douc, Guillin, Marin & Robert 2008, Statistics and Computing 18, 447).

What makes most of a variance may hold a millionth of the posterior. So the population holds points of the
posterior to powers below one, too, and a part of the law is fitted to weights times squared distances.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from ifrfit.inference.posterior.constants_density import ConstantsDensity, Coordinates
from ifrfit.inference.posterior.importance_weights import effective_share, tempered
from ifrfit.inference.posterior.mixture_proposal import (
    Beside,
    Component,
    MixtureProposal,
    Uniform,
    lattice,
)
from ifrfit.inference.posterior.tempering import POWERS, tempered_points

Array = NDArray[np.float64]

DEFENDED = Beside(wide=0.1, factor=5.0, long=0.05, uniform=0.1)
FITTED = replace(DEFENDED, wide=0.0)  # what is fitted to squared distances is wide
_UNIFORM, _BY_MODES, _EACH = 2048, 2048, 512  # points of the first laws, and of each further component
_MOST = 24  # components that are added
_TEMPERED = 512  # points of the laws of each power of the posterior
_CLOUD, _KEPT_CLOUD = 768, 5  # of those that they are fitted to, and laws of each power at most
_EVEN = 0.4  # effective share of the points at which the weights are even enough
_MOST_FAR, _EVEN_FAR = 8, 0.15  # the same of weights times squared distances, over all points
_NEAR = 256  # points that give a component its covariance
RESAMPLED = 4096  # points that the components are fitted to
STEPS = 20  # of expectation and maximisation
_LEAST = 0.01  # share of a component that is kept
_POINTS = 3.0  # effective points of a component for each of its dimensions
KEPT = 10  # components at most
_SEEDS = 8  # components to begin with at points of much weight, where a law is fitted again
_FLAT = 1e-5  # of the domain's width: least sd of a component
_FAR, _KEPT_FAR = 0.2, 3  # share of components that are fitted to squared distances; how many at most
_RESAMPLED_FAR, _STEPS_FAR = 1024, 10  # points and steps of their fit
_LEAST_FAR = 0.05  # effective share of the points that they are fitted to, by a power of their weights

Gaussian = tuple[Array, Array]  # centre (d,) and covariance (d, d)


def adapted_proposal(
    density: ConstantsDensity, modes: Sequence[Gaussian], rng: np.random.Generator
) -> MixtureProposal:
    """A law near to the posterior, a tenth of which is uniform over the domain.

    Parameters
    ----------
    density : ConstantsDensity
    modes : sequence of (ndarray, ndarray)
        Centre and covariance of the posterior about each known mode.
    rng : numpy.random.Generator
    """
    population = _Population(density, rng)
    population.add(Uniform(), _UNIFORM)
    for centre, covariance in modes:
        n = 2 ** round(math.log2(_BY_MODES / len(modes)))
        population.add(component_about(density.coordinates, centre, covariance), n)
    population.add_tempered()
    for _ in range(_MOST):
        if population.effective_share >= _EVEN:
            break
        population.add(population.component_at_largest_weight(population.log_weights), _EACH)
    for _ in range(_MOST_FAR):
        log_weights = population.log_weights
        log_weights = log_weights + _log_distances(density.coordinates.values(population.at), log_weights)
        if effective_share(log_weights) >= _EVEN_FAR:
            break
        population.add(population.component_at_largest_weight(log_weights), _EACH)
    return fitted_proposal(
        density.coordinates,
        population.at,
        population.log_weights,
        rng,
        population.gaussians,
        population.tempered,
    )


def refitted(
    proposal: MixtureProposal,
    density: ConstantsDensity,
    at: Array,
    log_weights: Array,
    rng: np.random.Generator,
) -> MixtureProposal:
    """A law fitted to weighted points that were drawn from one, with further components to begin with.

    Parameters
    ----------
    proposal : MixtureProposal
    density : ConstantsDensity
    at : ndarray, (m, d)
    log_weights : ndarray, (m,)
    rng : numpy.random.Generator
    """
    gaussians = further_seeds(proposal.all_components, at, log_weights, rng)
    return fitted_proposal(density.coordinates, at, log_weights, rng, gaussians)


def fitted_proposal(
    domain: Coordinates,
    at: Array,
    log_weights: Array,
    rng: np.random.Generator,
    start: Sequence[Gaussian],
    far: Sequence[Gaussian] = (),
    *,
    beside: Beside = FITTED,
    resampled: int = RESAMPLED,
    steps: int = STEPS,
) -> MixtureProposal:
    """Components fitted to weighted points, some to their squared distances, and the uniform law beside them.

    Parameters
    ----------
    domain : Coordinates
    at : ndarray, (m, d)
    log_weights : ndarray, (m,)
    rng : numpy.random.Generator
    start : sequence of (ndarray, ndarray)
        Centre and covariance of each component to begin with.
    far : sequence of (ndarray, ndarray)
        Further ones of the components that are fitted to squared distances.
    beside : Beside
        What the law has beside the components.
    resampled, steps : int
        Points that are fitted to; of expectation and maximisation.
    """
    shares, near = fitted_components(domain, at, log_weights, rng, start, resampled=resampled, steps=steps)
    away_shares, away = fitted_components(
        domain,
        at,
        tempered(log_weights + _log_distances(domain.values(at), log_weights), _LEAST_FAR),
        rng,
        [*start, *far],
        resampled=_RESAMPLED_FAR,
        steps=_STEPS_FAR,
        most=_KEPT_FAR,
    )
    both = np.concatenate(((1.0 - _FAR) * shares, _FAR * away_shares))
    return MixtureProposal(domain, (*near, *away), both, beside)


def proposal_about(domain: Coordinates, modes: Sequence[Gaussian]) -> MixtureProposal:
    """Components about known modes, as they are, and the uniform law beside them.

    Parameters
    ----------
    domain : Coordinates
    modes : sequence of (ndarray, ndarray)
        Centre and covariance of the posterior about each of them.
    """
    near = [component_about(domain, *each) for each in modes]
    return MixtureProposal(domain, tuple(near), np.full(len(near), 1.0 / len(near)), DEFENDED)


def fitted_components(
    domain: Coordinates,
    at: Array,
    log_weights: Array,
    rng: np.random.Generator,
    start: Sequence[Gaussian],
    *,
    resampled: int = RESAMPLED,
    steps: int = STEPS,
    most: int = KEPT,
) -> tuple[Array, list[Component]]:
    """Shares, and components, fitted to weighted points by expectation and maximisation.

    Parameters
    ----------
    domain : Coordinates
    at : ndarray, (m, d)
    log_weights : ndarray, (m,)
    rng : numpy.random.Generator
    start : sequence of (ndarray, ndarray)
        Centre and covariance of each component to begin with.
    resampled, steps, most : int
        Points that are fitted to; of expectation and maximisation; components.
    """
    weights = special.softmax(log_weights)
    places = (np.arange(resampled) + rng.random()) / resampled
    drawn = at[np.minimum(np.searchsorted(np.cumsum(weights), places), weights.size - 1)]
    effective = float(1.0 / np.sum(weights**2))
    # fewer points tell no covariance
    least = max(_LEAST, _POINTS * (domain.dimensions + 1.0) / min(effective, resampled))
    shares, fitted = _gaussian_mixture(drawn, start, _least_sd(domain, at), least, steps, most)
    return shares, [component_about(domain, *each) for each in fitted]


def further_seeds(
    components: Sequence[Component], at: Array, log_weights: Array, rng: np.random.Generator
) -> list[Gaussian]:
    """Components that a fit begins with: those of a law before it, and some at points of much weight."""
    weights = special.softmax(log_weights)
    centres = at[rng.choice(weights.size, _SEEDS, p=weights)]
    centre = weights @ at
    covariance = ((at - centre) * weights[:, None]).T @ (at - centre) / _SEEDS
    return [(each.centre, each.root @ each.root.T) for each in components] + [
        (each, covariance) for each in centres
    ]


def _log_distances(values: Array, log_weights: Array) -> Array:
    """Log of 1 + the sum of squared distances from the means, in sd, (m,)."""
    weights = special.softmax(log_weights)
    square = (values - weights @ values) ** 2
    variance = weights @ square
    in_sd = np.divide(square, variance, out=np.zeros_like(square), where=variance > 0.0)
    return np.asarray(np.log1p(in_sd.sum(axis=1)))


class _Population:
    """Weighted points of all laws that were tried so far, each weighed by the mixture of all of them."""

    def __init__(self, density: ConstantsDensity, rng: np.random.Generator) -> None:
        self._density, self._rng = density, rng
        self.gaussians: list[Gaussian] = []
        self.tempered: list[Gaussian] = []  # of powers of the posterior
        self._components: list[Component | Uniform] = []
        self._counts: list[int] = []
        self._exploring = 0  # points that were not drawn near to the posterior
        self.at = np.empty((0, density.coordinates.dimensions))
        self._log_p = np.empty(0)
        self._log_q = np.empty((0, 0))  # of each law at each point

    def add_tempered(self) -> None:
        """Draw points of laws of powers of the posterior, and begin at those of itself if modes miss it."""
        uniform = self.at[: self._counts[0]], self._log_p[: self._counts[0]]
        for points in tempered_points(self._density, *uniform, POWERS, self._rng):
            laws = self._laws_of(points)
            n = 2 ** round(math.log2(_TEMPERED / len(laws)))
            for law in laws:
                self._draw(law, n)
            self._exploring += n * len(laws)
            self.tempered += map(_gaussian, laws)
        if self.effective_share < _EVEN:
            self.gaussians += self.tempered[-len(laws) :]

    def _laws_of(self, points: Array) -> list[Component]:
        """Components fitted to points."""
        domain = self._density.coordinates
        points = points[self._rng.permutation(len(points))[:_CLOUD]]
        covariance = np.atleast_2d(np.cov(points, rowvar=False)) / _SEEDS
        start = [(each, covariance) for each in points[:_SEEDS]]
        _, fitted = _gaussian_mixture(
            points, start, _least_sd(domain, self.at), _LEAST, _STEPS_FAR, _KEPT_CLOUD
        )
        return [component_about(domain, *each) for each in fitted]

    def add(self, component: Component | Uniform, n: int) -> None:
        """Draw n points of a law, which is one to begin a fit with."""
        self._draw(component, n)
        if isinstance(component, Component):
            self.gaussians.append(_gaussian(component))
        else:
            self._exploring += n

    def _draw(self, component: Component | Uniform, n: int) -> None:
        """Draw n points of a law."""
        domain = self._density.coordinates
        new = component.draw(domain, lattice(n, self._rng.random(domain.dimensions)))
        of_new = [each.log_density(domain, new) for each in self._components]
        before = np.concatenate((self._log_q, np.reshape(of_new, (len(self._components), n))), axis=1)
        self.at = np.concatenate((self.at, new))
        self._log_q = np.concatenate((before, component.log_density(domain, self.at)[None]))
        self._log_p = np.concatenate((self._log_p, self._density(new)[0]))
        self._components.append(component)
        self._counts.append(n)

    @property
    def log_weights(self) -> Array:
        """Log of density over the mixture of all laws, (m,)."""
        shares = np.log(np.array(self._counts) / sum(self._counts))
        return np.asarray(self._log_p - special.logsumexp(self._log_q + shares[:, None], axis=0))

    @property
    def effective_share(self) -> float:
        """Effective points over those that were drawn near to the posterior."""
        n = sum(self._counts)
        return effective_share(self.log_weights) * n / max(n - self._exploring, 1)

    def component_at_largest_weight(self, log_weights: Array) -> Component:
        """A component about the point of the largest weight, as wide as the points near it are spread."""
        weights = special.softmax(log_weights)
        centre = self.at[int(weights.argmax())]
        nearest = 1 + int(self._log_q[1:, int(weights.argmax())].argmax())
        own = self._components[nearest]
        assert isinstance(own, Component)
        z = np.linalg.solve(own.root, (self.at - centre).T)
        near = np.argsort(np.einsum("ij,ij->j", z, z))[:_NEAR]
        share = weights[near] + 1.0 / weights.size
        share /= share.sum()
        away = self.at[near] - centre
        return component_about(self._density.coordinates, centre, (away * share[:, None]).T @ away)


def _gaussian(component: Component) -> Gaussian:
    """Centre and covariance of a component."""
    return component.centre, component.root @ component.root.T


def component_about(domain: Coordinates, centre: Array, covariance: Array) -> Component:
    """A component with a centre inside the domain, and a covariance that is positive definite."""
    inside = centre[None].copy()
    for j in range(centre.size):
        low, high = domain.ends(j, inside)
        inside[:, j] = np.clip(inside[:, j], low, high)
    return Component(inside[0], _root(covariance, _least_sd(domain, inside)))


def _root(covariance: Array, least_sd: Array) -> Array:
    """Lower triangular roots of covariances that may be singular but for rounding, (..., d, d)."""
    size = np.sqrt(np.maximum(np.diagonal(covariance, axis1=-2, axis2=-1), least_sd**2))
    values, vectors = np.linalg.eigh(covariance / (size[..., :, None] * size[..., None, :]))
    repaired = (vectors * np.maximum(values, 1e-10)[..., None, :]) @ vectors.swapaxes(-1, -2)
    return np.asarray(size[..., :, None] * np.linalg.cholesky(repaired))


def _least_sd(domain: Coordinates, at: Array) -> Array:
    """Least sd of components along each coordinate, (d,)."""
    ends = [domain.ends(j, at) for j in range(domain.dimensions)]
    return np.array([_FLAT * float((high - low).max()) for low, high in ends])


def _gaussian_mixture(
    at: Array, start: Sequence[Gaussian], least_sd: Array, least: float, steps: int, most: int
) -> tuple[Array, list[Gaussian]]:
    """Shares, centres and covariances of normal components, by expectation and maximisation.

    Those with less than the `least` share are dropped, but for the largest.
    """
    shares = np.full(len(start), 1.0 / len(start))
    centres, covariances = (np.stack(each) for each in zip(*start, strict=True))
    for step in range(steps):
        log_q = _log_normal(at, centres, covariances, least_sd) + np.log(shares)[:, None]
        share_of = special.softmax(log_q, axis=0)
        shares = share_of.mean(axis=1)
        kept = shares >= min(least, float(shares.max()))
        if step > steps // 2 and kept.sum() > most:
            kept &= shares >= np.sort(shares)[-most]
        shares, share_of = shares[kept] / shares[kept].sum(), share_of[kept]
        share_of /= share_of.sum(axis=1, keepdims=True)
        centres = share_of @ at
        away = at - centres[:, None]
        covariances = (away * share_of[..., None]).swapaxes(1, 2) @ away + np.diag(least_sd**2)
    return shares, list(zip(centres, covariances, strict=True))


def _log_normal(at: Array, centres: Array, covariances: Array, least_sd: Array) -> Array:
    """Log densities of normal laws up to the constant that all share, (laws, m)."""
    roots = _root(covariances, least_sd)
    z = np.linalg.inv(roots) @ (at - centres[:, None]).swapaxes(1, 2)
    size = np.log(np.diagonal(roots, axis1=1, axis2=2)).sum(axis=1)
    return np.asarray(-0.5 * np.einsum("kij,kij->kj", z, z) - size[:, None])
