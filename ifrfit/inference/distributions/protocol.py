"""The joint distribution of the parameters, whatever method it comes from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

LEVELS = (0.025, 0.16, 0.5, 0.84, 0.975)  # of the quantiles that a result keeps
BANDS = {
    "lo68": 0.16,
    "hi68": 0.84,
    "lo95": 0.025,
    "hi95": 0.975,
}  # columns of bands to levels


class Distribution(Protocol):
    """Joint distribution of the free parameters, of kappa, of the transition and of free noises.

    Implementations: the quadrature posterior, `WeightedDraws` (importance sampling), `Draws` (chains,
    replicates, a file that was read) and `TruncatedGaussian` (least squares). Quantities go by name: the
    entries of theta that are free; kappa, or kappa[SERIES] where e_n or mu is separate;
    noise[SERIES/OBSERVABLE], or noise where one factor is common to all. Besides these,
    transition_tau[SERIES], the slip ratio |U_t|/U_n at which sticking ends, has quantiles (but no mean, for
    it may be infinite).
    """

    @property
    def names(self) -> tuple[str, ...]:
        """Quantities that have a mean, a standard deviation and a distribution function."""
        ...

    @property
    def resolution(self) -> float:
        """Width, in standard deviations, over which a density can be told at the end of a domain."""
        ...

    @property
    def n_draws(self) -> float:
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

    def draws(self, n: int, rng: np.random.Generator) -> dict[str, Array]:
        """Draws of everything in `names` together, each (n,)."""
        ...


def transition_name(series: str) -> str:
    """Name of the slip ratio at which sticking ends in a series."""
    return f"transition_tau[{series}]"
