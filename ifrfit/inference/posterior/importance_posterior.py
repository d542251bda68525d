"""The posterior by weighted draws, with the standard error of what they tell.

Eq. (14) to (18) of ``docs/theory/posterior.md``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ifrfit.inference.diagnostics.thresholds import (
    LARGEST_WEIGHT,
    LEAST_EFFECTIVE,
)
from ifrfit.inference.distributions.draws import WeightedDraws
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.posterior.importance_weights import believed_evidence
from ifrfit.inference.posterior.marginals import Marginal

Array = NDArray[np.float64]

TARGET = 0.02  # standard error at which sampling ends
ROUGHLY = 1e-2  # accuracy of quantiles of noises: a hundredth of a standard error


@dataclass(frozen=True)
class ImportancePosterior(WeightedDraws):
    """What the data and the priors say of every constant, by weighted draws with their standard error.

    Attributes
    ----------
    problem : Problem
    log_evidence : float
        Log of the integral of the normalised likelihood times the normalised prior.
    error : float
        Largest standard error of a mean, a standard deviation or a quantile at 2.5, 16, 50, 84 and 97.5 %,
        in posterior standard deviations.
    error_evidence : float
        Standard error of the log evidence.
    tolerance : float
        Standard error that counts as converged.
    largest_weight : float
        Of a draw.
    noises : mapping
        Marginal of each noise that is integrated out given the constants, by its name.
    parts : tuple of WeightedDraws
        Draws of some of the quantities with weights of their own, which are more even than those of all
        together: of what series share, and of each series.
    """

    problem: Problem = field(repr=False)
    log_evidence: float
    error: float
    error_evidence: float
    tolerance: float
    largest_weight: float
    noises: Mapping[str, Marginal] = field(repr=False)
    parts: tuple[WeightedDraws, ...] = field(default=(), repr=False)

    @cached_property
    def n_draws(self) -> float:
        """Number of draws of equal weight that tell as much, of the part that has fewest."""
        return min((part.n_draws for part in self.parts), default=super().n_draws)

    @cached_property
    def _part_of(self) -> Mapping[str, WeightedDraws]:
        """The part that knows a quantity, by name."""
        return {name: part for part in self.parts for name in (*part.values, *part.transitions)}

    def mean(self, name: str) -> float:
        """Mean."""
        if name in self.noises:
            return self.noises[name].moments(0)[0]
        return self._part_of[name].mean(name) if name in self._part_of else super().mean(name)

    def sd(self, name: str) -> float:
        """Standard deviation."""
        if name in self.noises:
            return self.noises[name].moments(0)[1]
        return self._part_of[name].sd(name) if name in self._part_of else super().sd(name)

    def quantile(self, name: str, p: ArrayLike) -> Array | float:
        """Quantiles; p scalar or array, 0 to 1."""
        if name in self._part_of:
            return self._part_of[name].quantile(name, p)
        if name not in self.noises:
            return super().quantile(name, p)
        found = self.noises[name].quantiles(np.atleast_1d(np.asarray(p, dtype=float)), ROUGHLY)
        return float(found[0]) if np.ndim(p) == 0 else found

    def cdf(self, name: str, value: ArrayLike) -> Array | float:
        """Probability below a value."""
        if name in self._part_of:
            return self._part_of[name].cdf(name, value)
        if name not in self.noises:
            return super().cdf(name, value)
        found = self.noises[name].below(np.atleast_1d(np.asarray(value, dtype=float)))
        return float(found[0]) if np.ndim(value) == 0 else found

    def share_of(self, inside: NDArray[np.bool_]) -> tuple[float, float]:
        """Probability of some of the draws, and the standard error of its logarithm.

        The error is infinite where few draws carry the weight.
        """
        weights = np.where(inside, self.weights, 0.0)
        if not weights.any():
            return 0.0, math.inf
        with np.errstate(divide="ignore"):
            found, error = believed_evidence(np.log(weights))
        return self.weights.size * math.exp(found), error

    @property
    def converged(self) -> bool:
        """Whether errors are small, and enough draws carry the weight for these to be believed."""
        is_even = self.largest_weight <= LARGEST_WEIGHT and self.n_draws >= LEAST_EFFECTIVE
        return is_even and max(self.error, self.error_evidence) <= self.tolerance
