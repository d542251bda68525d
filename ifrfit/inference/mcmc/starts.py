"""The coordinates in which walkers walk, and where they start: about each optimum within reach, widely."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.distributions.draws import kappa_draws
from ifrfit.inference.model.log_posterior import Density
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.laplace import gaussian_approximation
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, at_fitted_offset
from ifrfit.inference.optimize.noise_modes import noise_at_mode

Array = NDArray[np.float64]

ENSEMBLES = 4
_WALKERS, _PER_DIMENSION = 64, 6
_START_DISTANCE = 2.0  # sd from an optimum to an ensemble: R-hat needs starts wider than the posterior
_MAIN = 0.75  # share of an ensemble's walkers that start at its own optimum
_RISE = 12.0  # of minus twice the log likelihood; what lies higher has a weight below 0.3 %
_TRIES = 40  # each draws nearer to the optimum than the one before
_INSIDE = 1e-6  # of the domain's width, from its walls


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
        constants |= {name: drawn[name] for name in self.problem.parameters.varied_names}
        known = constants.keys() | set(self.problem.parameters.tied_names)
        others = {name: values for name, values in drawn.items() if name not in known}
        found = constants | kappa_draws(self.problem, drawn) | others
        return {name: np.reshape(values, at.shape[:-1]) for name, values in found.items()}


def starts(
    coordinates: Coordinates, found: LeastSquaresFit, rng: np.random.Generator, ensembles: int = ENSEMBLES
) -> Array:
    """Places of all walkers, (ensembles, walkers, d), inside the domain.

    About each optimum that least squares knows of (all local minima within 4 of the least; with unknown
    noises all modes within 12) walkers are drawn from its Gaussian, at its own noise, about a centre that
    lies 2 sd off, in another direction for each ensemble. Of several optima each ensemble has another as its
    own: three quarters of its walkers start there, and the others share the rest. So every ensemble can reach
    every mode, and if their weights do not settle, the ensembles disagree: R-hat sees it.

    Parameters
    ----------
    coordinates : Coordinates
    found : LeastSquaresFit
    rng : numpy.random.Generator
    ensembles : int
    """
    walkers = max(_WALKERS, _PER_DIMENSION * coordinates.dimensions)
    gaussians = [_gaussian(coordinates, found, theta) for theta in optima(found)]
    made = []
    for number in range(ensembles):
        own = number % len(gaussians)
        others = [(own + 1 + i) % len(gaussians) for i in range(len(gaussians) - 1)]
        n_own = walkers if not others else math.ceil(_MAIN * walkers)
        counts = {own: n_own} | {i: len(range(k, walkers - n_own, len(others))) for k, i in enumerate(others)}
        parts = [_about(coordinates, *gaussians[i], n, rng) for i, n in counts.items()]
        made.append(np.concatenate(parts))
    return np.stack(made)


def optima(found: LeastSquaresFit) -> list[Array]:
    """theta of every optimum that may carry weight, the best first."""
    if found.rivals:
        return [found.optimum.theta, *(theta for rise, theta in found.rivals if rise <= _RISE)]
    return [theta for _, theta in found.optimum.minima] or [found.optimum.theta]


def _gaussian(coordinates: Coordinates, found: LeastSquaresFit, theta: Array) -> tuple[Array, Array]:
    """Centre, (d,), and root of the covariance, (d, d), about an optimum."""
    problem, density = at_fitted_offset(coordinates.problem, found), coordinates.density
    low, high = problem.parameters.bounds()
    theta = np.where(np.isfinite(theta), theta, np.where(np.isfinite(low), low, high))
    free = problem.parameters.free
    sigma = noise_at_mode(problem, theta, 0.0).sigma if found.rivals else found.sigma
    common = None if found.common is None else found.common.loadings
    gaussian = gaussian_approximation(problem, sigma, theta, common=common)
    covariance = gaussian.covariance(capped=True)[np.ix_(free, free)]
    noise, spread = _noise(problem, sigma)
    offset = found.angle_offset
    point = np.concatenate((theta[free], noise, [] if offset is None else [offset.value]))
    inside = _INSIDE * (density.upper - density.lower)
    point = np.clip(point, density.lower + inside, density.upper - inside)
    n = int(free.sum())
    root = np.zeros((point.size, point.size))
    values, vectors = np.linalg.eigh(covariance)
    # the symmetric root is the only one that no rounding turns round: signs of eigenvectors are arbitrary
    root[:n, :n] = vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T
    root[n : n + spread.size, n : n + spread.size] = np.diag(spread)
    if offset is not None:  # constants go along with it
        root[:n, -1], root[-1, -1] = offset.carried[free] * offset.sd, offset.sd
    return coordinates.at(point), root


def _noise(problem: Problem, sigma: Array) -> tuple[Array, Array]:
    """Logarithm of each noise at the optimum, and its sd."""
    base = problem.noise.base
    centre, spread = [], []
    for rows in problem.noise_groups().values():
        centre.append(math.log(float(np.median(sigma[rows] / base[rows]))))
        spread.append(1.0 / math.sqrt(2.0 * max(rows.size - 1, 1)))
    return np.array(centre), np.array(spread)


def _about(coordinates: Coordinates, centre: Array, root: Array, n: int, rng: np.random.Generator) -> Array:
    """n places about a centre that lies 2 sd off; those that have no density are drawn again, nearer."""
    direction = rng.standard_normal(centre.size)
    away = _START_DISTANCE * direction / np.linalg.norm(direction)
    at = np.tile(centre, (n, 1))
    missing = np.arange(n)
    for attempt in range(_TRIES):
        nearer = 0.8**attempt
        # a tie may end the domain at the optimum, and all of one side lies beyond
        side = away if attempt < _TRIES // 2 else -away
        drawn = centre + nearer * (side + rng.standard_normal((missing.size, centre.size))) @ root.T
        at[missing] = coordinates.at(_reflected(coordinates, coordinates.points(drawn)))
        missing = missing[~np.isfinite(coordinates(at[missing]))]
        if missing.size == 0:
            break
    return at


def _reflected(coordinates: Coordinates, points: Array) -> Array:
    """Points folded back into the domain at its walls."""
    low, width = coordinates.density.lower, coordinates.density.upper - coordinates.density.lower
    inside = _INSIDE * width
    low, width = low + inside, width - 2.0 * inside
    turns = np.mod((points - low) / width, 2.0)
    return np.asarray(low + width * np.where(turns > 1.0, 2.0 - turns, turns))
