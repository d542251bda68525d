"""An optimum of a problem, and what is proven about it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.diagnostics.thresholds import GAP
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.parameter_group import Constants

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Optimum:
    """Best constants at given noise.

    Attributes
    ----------
    theta : ndarray
        All constants of the problem, fixed ones included.
    objective : float
        chi2 plus prior_chi2.
    gap : float or None
        objective minus a proven lower bound over everything else; None where no bound is known.
    minima : tuple of (float, ndarray)
        Objective and theta of the distinct local minima within `NEAR`, best first.
    extremes : tuple of ndarray
        theta at outlying places whose objective lies within 3.84, infinite entries where nothing limits them;
        empty where the method does not tell.
    method : str
        How it was found.
    tolerance : float or None
        Largest gap that counts as a proof; None for `GAP` relative to the objective.
    is_local : bool
        Whether it was looked for near a given place alone.
    """

    theta: Array
    objective: float
    gap: float | None
    minima: tuple[tuple[float, Array], ...]
    method: str
    extremes: tuple[Array, ...] = ()
    tolerance: float | None = None
    is_local: bool = False

    @property
    def n_same(self) -> int:
        """Local minima within 1e-6 of the objective."""
        return sum(value <= self.objective + 1e-6 for value, _ in self.minima)

    @property
    def n_near(self) -> int:
        """Local minima within `NEAR` of the objective."""
        return len(self.minima)

    @property
    def outlying(self) -> list[Array]:
        """Constants elsewhere that describe the data nearly as well."""
        return [theta for _, theta in self.minima[1:]] + list(self.extremes)

    @property
    def certified(self) -> bool:
        """Whether the optimum is proven to be global."""
        if self.gap is None:
            return False
        limit = GAP * max(1.0, abs(self.objective)) if self.tolerance is None else self.tolerance
        return self.gap <= limit


def thetas_of(problem: Problem, combinations: list[list[Constants]]) -> Array:
    """Several thetas, (m, p), each from the (e_n, c, mu) of its series."""
    return _inside(problem, np.array(combinations)[:, *problem.parameters.sources])


def thetas_of_all(problem: Problem, constants: list[Constants]) -> Array:
    """Several thetas, (m, p), each from the (e_n, c, mu) that all series have."""
    return _inside(problem, np.array(constants).take(problem.parameters.sources[1], axis=1))


def _inside(problem: Problem, theta: Array) -> Array:
    """Thetas moved into the bounds, but for entries without end."""
    lower, upper = problem.parameters.bounds()
    inside = np.minimum(np.maximum(theta, lower), upper)
    endless = np.isinf(theta)
    return np.where(endless, theta, inside)


def objective_at(problem: Problem, sigma: Array, theta: Array) -> float:
    """chi2 plus prior_chi2 at theta, from the rows themselves."""
    residual = problem.residual(theta) / sigma
    prior = problem.parameters.prior_residuals(theta)
    return float(residual @ residual + prior @ prior)
