"""A law of errors: logistic ones, whose tails lie between the Gaussian's and Student's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class Logistic:
    """Density exp(-z)/(1 + exp(-z))^2, where z is a residual over its sigma."""

    name: str = "logistic"
    default_dof: None = None  # no degrees of freedom

    def words(self, dof: float | None) -> str:
        """For results."""
        return "logistic errors"

    def log_density(self, z: Array, dof: float | None) -> Array:
        """Normalised, so that the evidence of two laws compares."""
        import numpy as np

        return np.asarray(-np.abs(z) - 2.0 * np.log1p(np.exp(-np.abs(z))))

    def cdf(self, z: Array, dof: float | None) -> Array:
        """For predictive checks."""
        import numpy as np
        from scipy import special

        return np.asarray(special.expit(z))

    def weight(self, z: Array, dof: float | None) -> Array:
        """tanh(z/2)/z, for iterated least squares."""
        import numpy as np

        return np.asarray(np.where(np.abs(z) < 1e-6, 0.5, np.tanh(0.5 * z) / np.where(z == 0.0, 1.0, z)))

    def information(self, dof: float | None) -> float:
        """About the location."""
        return 1.0 / 3.0

    def draw(self, rng: np.random.Generator, shape: tuple[int, ...], dof: float | None) -> Array:
        """For predictions."""
        return rng.logistic(size=shape)
