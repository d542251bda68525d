"""A fit by hand, with nothing of the certified solver in it: MINPACK from one start."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import leastsq

from ifrfit.inference.model.problem import Problem
from ifrfit.physics.observables import OBSERVABLES

Array = NDArray[np.float64]


class Local:
    """The problem written out by hand for MINPACK: k = a + min(b, kappa U_n/|U_t|).

    Bounds are built into the unknowns: sines between two bounds, hyperbolas above one.
    """

    def __init__(self, problem: Problem) -> None:
        rows = problem.rows
        self.problem = problem
        self.weight = 1.0 / problem.noise.sigma
        self.linear = problem.closure.coefficients(problem.inertia_factor)
        with np.errstate(divide="ignore"):
            self.cot = 1.0 / rows.tau
        n, ones = rows.value.size, np.ones(rows.value.size)
        scale = np.array([OBSERVABLES[x].scale for x in rows.names])[rows.which]
        self.tangential, self.friction = rows.of_kind("tangential"), rows.of_kind("friction")
        # the rebound at k = 0 and k = 1 with e_n = 1 fixes the straight line in k
        self.offset = problem.values_with(np.zeros(n), ones, 0.0 * ones)
        self.slope = problem.values_with(ones, ones, 0.0 * ones) - self.offset
        self.normal = np.where(rows.of_kind("normal"), self.offset, 0.0)
        self.offset = np.where(self.tangential, self.offset, 0.0)
        self.slope = np.where(self.tangential, self.slope, 0.0)
        self.impulse, self.rebound = scale == "impulse", scale == "rebound"
        self.lower, self.upper = problem.parameters.bounds()
        self.free = np.flatnonzero(problem.parameters.free)
        self.low, high = self.lower[self.free], self.upper[self.free]
        self.closed = np.isfinite(high)
        self.half = np.where(self.closed, 0.5 * (high - self.low), 0.0)
        self.held = np.array([math.nan if c.fixed is None else c.fixed for c in problem.parameters.entries])
        priors = [(i, *c.prior) for i, c in enumerate(problem.parameters.entries) if c.prior is not None]
        self.prior_at = np.array([i for i, _, _ in priors], dtype=np.intp)
        self.prior_mean = np.array([mean for _, mean, _ in priors])
        self.prior_sd = np.array([sd for _, _, sd in priors])
        self.column = {name: places[rows.series] for name, places in problem.parameters.positions.items()}
        self.spare = max(0, self.free.size - n - len(priors))  # MINPACK wants as many residuals as unknowns

    def theta(self, x: Array) -> Array:
        """Constants behind the unknowns."""
        theta = self.held.copy()
        inside = self.half * (1.0 + np.sin(x))
        theta[self.free] = self.low + np.where(self.closed, inside, np.sqrt(x * x + 1.0) - 1.0)
        return theta

    def unknowns(self, theta: Array) -> Array:
        """Unknowns behind the constants."""
        above = theta[self.free] - self.low
        share = np.where(self.closed, above / np.where(self.closed, self.half, 1.0) - 1.0, 0.0)
        return np.where(self.closed, np.arcsin(np.clip(share, -1.0, 1.0)), np.sqrt((above + 1.0) ** 2 - 1.0))

    def residuals(self, x: Array) -> Array:
        """Standardised residuals at the unknowns."""
        theta = self.theta(x)
        e_n, mu = theta[self.column["e_n"]], theta[self.column["mu"]]
        own = self.problem.closure.constant
        c = theta[self.column[own]] if own else 0.0
        friction = np.minimum(self.linear.b0 + self.linear.b1 * c, mu * (1.0 + e_n) * self.cot)
        k = self.linear.a0 + self.linear.a1 * c + friction
        # a factor of each row that e_n alone decides
        scale = np.where(self.rebound, 1.0 / np.maximum(e_n, 1e-12), 1.0)
        scale = np.where(self.impulse, 2.0 / (1.0 + e_n), scale)
        model = (self.offset + self.slope * k) * scale + self.normal * e_n + self.friction * mu
        data = (model - self.problem.rows.value) * self.weight
        prior = (theta[self.prior_at] - self.prior_mean) / self.prior_sd
        return np.concatenate((data, prior, np.zeros(self.spare)))

    def start(self, rng: np.random.Generator) -> Array:
        """Draw constants inside the domain; mu up to 2, half of them with equal chance for each magnitude."""
        theta = self.held.copy()
        for i in self.free:
            low, high = self.lower[i], self.upper[i]
            if math.isfinite(high):
                theta[i] = rng.uniform(low, high)
            elif rng.random() < 0.5:
                theta[i] = low + rng.uniform(0.0, 2.0)
            else:
                theta[i] = low + math.exp(rng.uniform(math.log(5e-3), math.log(2.0)))
        return theta

    def search(self, theta: Array) -> tuple[float, Array]:
        """Sum of squares and constants where Levenberg-Marquardt ends from a start."""
        x, *_ = leastsq(
            self.residuals,
            self.unknowns(theta),
            xtol=1e-11,
            ftol=1e-11,
            maxfev=150,
            full_output=True,
        )
        r = self.residuals(x)
        return float(r @ r), self.theta(x)
