"""Settings of the first grid: the modes that least squares knows, and the fineness for a tolerance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Index
from ifrfit.inference.optimize.laplace import gaussian_approximation
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.optimize.noise_modes import noise_at_mode

_MOST = 8
Array = NDArray[np.float64]

_RISE = 50.0  # of minus twice the log likelihood up to which a mode may hold mass that its width makes up for
LADDER = np.array([1.5, 4.0, 8.0, 16.0, 40.0, 120.0, 400.0, 2e3, 1e4, 1e5])  # first panels, in sd


def fits_at_modes(problem: Problem, start: LeastSquaresFit, rise: float) -> list[LeastSquaresFit]:
    """The fit, and the same at each further mode: its constants, its noise, its Gaussian.

    Parameters
    ----------
    problem : Problem
        Without an offset of the angles, or at the fitted one.
    start : LeastSquaresFit
    rise : float
        Of minus twice the log likelihood over the best mode, up to which other modes of the noise count.

    Returns
    -------
    list of LeastSquaresFit
        The best first; at most 8. An end of the domain stands where a mode has no finite value.
    """
    thetas = [start.optimum.theta, *(theta for above, theta in start.rivals if above <= rise)]
    if not start.rivals:
        thetas += [theta for _, theta in start.optimum.minima[1:]]
    low, high = problem.parameters.bounds()
    found = []
    for theta in thetas[:_MOST]:
        theta = np.where(np.isfinite(theta), theta, np.where(np.isfinite(low), low, high))
        sigma = noise_at_mode(problem, theta, 0.0).sigma if start.rivals else start.sigma
        loadings = None if start.common is None else start.common.loadings
        gaussian = gaussian_approximation(problem, sigma, theta, common=loadings)
        found.append(
            replace(start, optimum=replace(start.optimum, theta=theta), sigma=sigma, gaussian=gaussian)
        )
    return found


@dataclass(frozen=True)
class GridSettings:
    """The problem, its optimum with the local spread, and the tolerance."""

    problem: Problem
    start: LeastSquaresFit
    tolerance: float

    @cached_property
    def covariance(self) -> Array:
        """Of theta in the Gaussian approximation; loose directions as wide as the prior, (p, p)."""
        return self.start.gaussian.covariance(capped=True)

    @cached_property
    def bounds(self) -> Mapping[str, tuple[float, float]]:
        """Of the noises' priors."""
        return self.problem.noise_bounds()

    @cached_property
    def groups(self) -> Mapping[str, Index]:
        """Rows that share a noise."""
        return self.problem.noise_groups()

    @property
    def order(self) -> int:
        """Order of the rules on panels."""
        return next(
            (order for order, least in ((8, 1e-2), (12, 1e-3), (16, 1e-6)) if self.tolerance >= least), 32
        )

    @property
    def c_order(self) -> int:
        """Order along the closure constant, either side of its mode."""
        return next(
            (order for order, least in ((16, 1e-2), (24, 1e-3), (32, 1e-5)) if self.tolerance >= least), 64
        )

    @property
    def kink_distance(self) -> float:
        """Distance, in sd, below which two kinks go into one panel; refinement sees to what that leaves."""
        return next((d for d, least in ((0.6, 1e-2), (0.2, 1e-5)) if self.tolerance >= least), 0.02)

    @property
    def tail(self) -> float:
        """Fall of the log density whose mass is far below the tolerance."""
        return 6.0 - 2.0 * math.log(self.tolerance)

    def parameter(self, kind: str) -> Parameter:
        """e_n, mu or the closure constant c, which closure F has fixed at 0."""
        name = self.problem.closure.constant if kind == "c" else kind
        return Parameter("", 0.0, 0.0, fixed=0.0) if name is None else self.problem.parameters[name]

    def place(self, kind: str, block: int) -> int | None:
        """Index of e_n, c or mu of a block in theta; None for c of a closure that has none."""
        name = self.problem.closure.constant if kind == "c" else kind
        return None if name is None else int(self.problem.parameters.positions[name][block])

    def optimum(self, kind: str, block: int) -> float:
        """e_n, c, mu or kappa of a block at the optimum."""
        if kind == "kappa":
            return self.optimum("mu", block) * (1.0 + self.optimum("e_n", block))
        at = self.place(kind, block)
        return 0.0 if at is None else float(self.start.optimum.theta[at])

    @cached_property
    def at_modes(self) -> tuple[GridSettings, ...]:
        """The same about each mode of the noises that is known; about the optimum itself first.

        Other minima at one noise are met by refinement, and about those between kinks panels lie anyway. From
        the optimum alone one of 42 drawn tables with several noises was off by 3.7 sd; no time was saved.
        """
        others = fits_at_modes(self.problem, self.start, _RISE)[1:] if self.start.rivals else []
        return self, *(replace(self, start=one) for one in others)

    def spreads(self, kind: str, block: int) -> list[tuple[float, float]]:
        """`spread` about each mode, without those that are next to another one."""
        return distinct_places([one.spread(kind, block) for one in self.at_modes])

    def spread(self, kind: str, block: int) -> tuple[float, float]:
        """Optimum and local standard deviation of e_n, c, mu or kappa in a block."""
        value, to_theta = self.optimum(kind, block), self.start.gaussian.to_theta
        if kind == "kappa":
            by_mu, by_e_n = (to_theta[self.place(name, block)] for name in ("mu", "e_n"))
            functional = (1.0 + self.optimum("e_n", block)) * by_mu + self.optimum("mu", block) * by_e_n
            prior_sd = 1.0
        else:
            at = self.place(kind, block)
            if at is None:
                return 0.0, 0.0
            functional = to_theta[at]
            prior_sd = self.parameter(kind).prior_sd
        sd = math.sqrt(max(float(functional @ self.covariance @ functional), 0.0))
        return value, min(max(sd, 1e-9 * max(abs(value), 1.0)), prior_sd)


def ladder(places: Sequence[tuple[float, float]], lower: float, upper: float) -> Array:
    """Edges at growing distances from centres, each with its sd, out to both ends."""
    reach = [center + np.concatenate((-sd * LADDER, [0.0], sd * LADDER)) for center, sd in places]
    edges = np.unique(np.concatenate(reach))
    edges = edges[(edges > lower) & (edges < upper)]
    return np.concatenate(([lower], edges, [upper]))


def distinct_places(places: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Centres with their sd, without those that are within an sd of an earlier one, and alike in it."""

    def next_to(one: tuple[float, float], other: tuple[float, float]) -> bool:
        return abs(one[0] - other[0]) <= min(one[1], other[1]) and 0.2 * other[1] < one[1] < 5.0 * other[1]

    kept: list[tuple[float, float]] = []
    for place in places:
        if not any(next_to(place, other) for other in kept):
            kept.append(place)
    return kept
