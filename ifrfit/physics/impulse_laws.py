"""What a closure must give: the size of the tangential impulse.

Whatever the closure, the tangential impulse per mass is -k U_t, and k depends on the slip ratio
tau = |U_t|/U_n, the closure's own constant c, and kappa = mu (1 + e_n): e_n and mu enter no other way.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ifrfit.physics.angles import Array, Incidence

Bool = NDArray[np.bool_]

ROUNDING = 1e-12  # relative, by which kappa/tau may miss the bound of sticking where it lies on it


class Law(Protocol):
    """The impulse factor of one closure at one inertia factor. Arrays broadcast."""

    def impulse(self, incidence: Incidence, c: ArrayLike, kappa: ArrayLike) -> tuple[Array, Bool]:
        """k, finite without slip, and whether the impact sticks (at least at some time, over some area)."""
        ...

    def slopes(self, incidence: Incidence, c: ArrayLike, kappa: ArrayLike) -> tuple[Array, Array]:
        """Derivatives of k by c and by kappa, each in the regime that holds there."""
        ...

    def bound(self, c: ArrayLike) -> Array:
        """Kappa over the slip ratio at which sticking ends."""
        ...

    def bound_slope(self, c: ArrayLike) -> Array:
        """Derivative of `bound` by c."""
        ...

    def constant_at(self, bound: ArrayLike) -> Array:
        """The c with this `bound`; infinite where every one has a larger bound.

        Where `bound` does not depend on c: +inf above it, -inf below.
        """
        ...


@dataclass(frozen=True)
class Coefficients:
    """The bilinear law k = a + min(b, kappa/tau), with a = a0 + a1 c and b = b0 + b1 c.

    Both are linear in the closure constant, which least squares and the exact posterior rely on.
    """

    a0: float
    a1: float
    b0: float
    b1: float

    def impulse(self, incidence: Incidence, c: ArrayLike, kappa: ArrayLike) -> tuple[Array, Bool]:
        """k, and whether the impact sticks; see `Law`."""
        c = np.asarray(c)
        return impulse_factor(incidence, self.a0 + self.a1 * c, self.b0 + self.b1 * c, kappa)

    def slopes(self, incidence: Incidence, c: ArrayLike, kappa: ArrayLike) -> tuple[Array, Array]:
        """Derivatives of k by c and by kappa."""
        _, sticks = self.impulse(incidence, c, kappa)
        with np.errstate(divide="ignore"):
            inverse = np.where(sticks, 0.0, 1.0 / incidence.tau)
        return np.where(sticks, self.a1 + self.b1, self.a1), inverse

    def bound(self, c: ArrayLike) -> Array:
        """b, the frictional part in sticking."""
        return np.asarray(self.b0 + self.b1 * np.asarray(c))

    def bound_slope(self, c: ArrayLike) -> Array:
        """b1."""
        return np.full(np.shape(c), self.b1)

    def constant_at(self, bound: ArrayLike) -> Array:
        """(b - b0)/b1; with b1 = 0 that is +inf above b0, -inf below."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray((np.asarray(bound, dtype=float) - self.b0) / self.b1)


def impulse_factor(
    incidence: Incidence, a: ArrayLike, b: ArrayLike, kappa: ArrayLike
) -> tuple[Array, NDArray[np.bool_]]:
    """Evaluate k = a + min(b, kappa U_n/|U_t|), and whether the impact sticks.

    The smaller of the two frictions acts, so k is continuous at the transition and finite without slip. An
    impact on the transition itself sticks, whatever the last digit of its tau says.
    """
    friction, b = friction_factor(incidence, kappa), np.asarray(b)
    # on the transition itself rounding is not to decide
    return np.asarray(a + np.minimum(b, friction)), np.asarray(friction >= b - ROUNDING * np.abs(b))


def friction_factor(incidence: Incidence, kappa: ArrayLike) -> Array:
    """kappa U_n/|U_t|, the impulse factor of gross sliding; infinite without slip."""
    slip, cosine = incidence.slip, incidence.cosine
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        factor = np.asarray(np.asarray(kappa) * cosine / slip)
    return factor if np.all(slip) else np.where(slip == 0.0, np.inf, factor)
