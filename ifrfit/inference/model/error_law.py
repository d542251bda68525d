"""Laws of the errors of values: what each must offer, the package's own, and the registry that holds them.

z is a residual over its sigma, the scale of the law. This module imports nothing heavy: its names are options
of the command line.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from ifrfit.registry import Registry

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_HALF_LOG_2PI = 0.5 * math.log(2.0 * math.pi)


@runtime_checkable
class ErrorLaw(Protocol):
    """A symmetric law of location and scale. `dof` is None for a law without degrees of freedom."""

    @property
    def name(self) -> str:
        """As in ``--tails``."""

    @property
    def default_dof(self) -> float | None:
        """Degrees of freedom where the user gives none; None for a law that has no such number."""

    def words(self, dof: float | None) -> str:
        """The law in a few words; empty for the Gaussian, which goes without saying."""

    def log_density(self, z: Array, dof: float | None) -> Array:
        """Log of the density of z, normalised."""

    def cdf(self, z: Array, dof: float | None) -> Array:
        """Probability below z."""

    def weight(self, z: Array, dof: float | None) -> Array:
        """-(1/z) d log_density/dz: the weight of z^2 in iterated least squares."""

    def information(self, dof: float | None) -> float:
        """Fisher information of the location, in 1/sigma^2."""

    def draw(self, rng: np.random.Generator, shape: tuple[int, ...], dof: float | None) -> Array:
        """Draws of z."""


@dataclass(frozen=True)
class Gaussian:
    """Independent Gaussian errors."""

    name: str = "gaussian"
    default_dof: None = None

    def words(self, dof: float | None) -> str:
        """Nothing: the default."""
        return ""

    def log_density(self, z: Array, dof: float | None) -> Array:
        """-z^2/2, normalised."""
        return -0.5 * z * z - _HALF_LOG_2PI

    def cdf(self, z: Array, dof: float | None) -> Array:
        """Of the standard normal law."""
        from scipy import special

        return special.ndtr(z)

    def weight(self, z: Array, dof: float | None) -> Array:
        """1 for all."""
        import numpy as np

        return np.ones(z.shape)

    def information(self, dof: float | None) -> float:
        """1."""
        return 1.0

    def draw(self, rng: np.random.Generator, shape: tuple[int, ...], dof: float | None) -> Array:
        """Standard normal draws."""
        return rng.standard_normal(shape)


@dataclass(frozen=True)
class StudentT:
    """Student's t: outliers have a weight of their own (Lange, Little & Taylor 1989)."""

    name: str = "student-t"
    # J. Am. Stat. Assoc. 84, 881: wide enough for most outliers
    default_dof: float = 4.0

    def words(self, dof: float | None) -> str:
        """Its name and its degrees of freedom."""
        return f"Student-t errors ({dof:g} degrees of freedom)"

    def log_density(self, z: Array, dof: float | None) -> Array:
        """Of Student's t with `dof` degrees of freedom."""
        import numpy as np
        from scipy import special

        nu = self._dof(dof)
        norm = special.gammaln(0.5 * (nu + 1.0)) - special.gammaln(0.5 * nu) - 0.5 * math.log(nu * math.pi)
        return np.asarray(norm - 0.5 * (nu + 1.0) * np.log1p(z * z / nu))

    def cdf(self, z: Array, dof: float | None) -> Array:
        """Of Student's t with `dof` degrees of freedom."""
        import numpy as np
        from scipy import special

        return np.asarray(special.stdtr(self._dof(dof), z), dtype=float)

    def weight(self, z: Array, dof: float | None) -> Array:
        """(nu + 1)/(nu + z^2)."""
        nu = self._dof(dof)
        return (nu + 1.0) / (nu + z * z)

    def information(self, dof: float | None) -> float:
        """(nu + 1)/(nu + 3)."""
        nu = self._dof(dof)
        return (nu + 1.0) / (nu + 3.0)

    def draw(self, rng: np.random.Generator, shape: tuple[int, ...], dof: float | None) -> Array:
        """Draws of Student's t."""
        import numpy as np

        return np.asarray(rng.standard_t(self._dof(dof), shape))

    def _dof(self, dof: float | None) -> float:
        return self.default_dof if dof is None else dof


GAUSSIAN, STUDENT_T = Gaussian(), StudentT()
ERROR_LAWS: Registry[ErrorLaw] = Registry("law of errors", ErrorLaw, (GAUSSIAN, STUDENT_T))
