"""What a method must know of the constants so that estimates, predictions and checks can be read from it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

LEVELS = (0.025, 0.16, 0.5, 0.84, 0.975)  # of the quantiles that a result keeps


class Distribution(Protocol):
    """A joint law of the free constants, of kappa and of free noises: from a quadrature, or from draws.

    Quantities go by the entries of `Problem.names` that are free; kappa, or kappa[SERIES] where e_n or mu is
    separate; noise[SERIES/OBSERVABLE], or noise where one factor is common to all.
    """

    @property
    def names(self) -> tuple[str, ...]:
        """Quantities that have a marginal."""
        ...

    @property
    def grain(self) -> float:
        """Width, in sd, over which the law can tell a density at the end of a domain."""
        ...

    @property
    def kept(self) -> float:
        """How many different draws it can give; infinite where there is no end to them."""
        ...

    def mean(self, name: str) -> float:
        """Mean."""
        ...

    def sd(self, name: str) -> float:
        """Standard deviation."""
        ...

    def quantile(self, name: str, p: ArrayLike) -> Any:
        """Quantiles; p scalar or array, 0 to 1."""
        ...

    def cdf(self, name: str, value: ArrayLike) -> Any:
        """Probability below a value: 0 at the lower end of the support and 1 at the upper one."""
        ...

    def covariance(self, names: Sequence[str]) -> Array:
        """Covariance, (n, n)."""
        ...

    def transition(self, series: str) -> Array:
        """Quantiles, at `LEVELS`, of the tau at which sticking ends in a series."""
        ...

    def draws(self, n: int, rng: np.random.Generator) -> dict[str, Array]:
        """Draws of everything together, each (n,)."""
        ...
