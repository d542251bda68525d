"""An impact on its way through the effects, and what comes out of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.physics.angles import Array, Incidence
from ifrfit.physics.effects.contact import Impacts
from ifrfit.physics.rebound import Rebound


@dataclass(frozen=True)
class Outcome(Rebound):
    """A `Rebound` that effects have acted on.

    Attributes
    ----------
    captured : ndarray of bool
        The sphere does not leave the wall (v_n = 0). Velocities along the wall and spins are those at that
        instant; what becomes of them later is not computed.
    spin_loss : ndarray or None
        How much rolling friction took off |R Omega|/u; None without it.
    """

    captured: NDArray[np.bool_]
    spin_loss: Array | None = None

    @property
    def beta(self) -> Array:
        """Tangential restitution of the contact point, -V_t.U_t/|U_t|^2; nan without slip."""
        if self.spin_loss is None:
            return super().beta
        before = self.incidence
        along = self.contact_x * before.slip_x + self.contact_y * before.slip_y
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.where(before.slip == 0.0, np.nan, -along / before.slip**2))

    @property
    def energy_change(self) -> Array:
        """Change of kinetic energy, rotation included, over m u^2/2."""
        change = super().energy_change
        if self.spin_loss is None:
            return change
        left = np.hypot(self.spin_x, self.spin_y)
        return np.asarray(change - self.inertia_factor * self.spin_loss * (2.0 * left + self.spin_loss))


@dataclass(frozen=True)
class Bounce:
    """What is known of the impacts so far; every effect hands on a changed copy.

    Attributes
    ----------
    incidence : Incidence
        Without lateral spin until that effect puts it in.
    lateral : bool
        Whether motion across the plane of incidence is computed.
    e_n : ndarray
    captured : ndarray of bool
    unloading : ndarray
        R_p/R: radius of curvature on unloading over that of the sphere, 1 where nothing has yielded.
    impulse : (ndarray, ndarray of bool) or None
        k, and whether the impact sticks, where an effect has put another law in the place of the closure.
    outcome : Outcome or None
        From the tangential law on.
    """

    incidence: Incidence
    lateral: bool
    e_n: Array
    captured: NDArray[np.bool_]
    unloading: Array
    impulse: tuple[Array, NDArray[np.bool_]] | None = None
    outcome: Outcome | None = None

    @classmethod
    def before(cls, impacts: Impacts) -> Bounce:
        """Start, in the plane of incidence."""
        full = impacts.incidence
        zero = np.zeros_like(full.sine)
        planar = replace(full, spin_x=zero, slip_y=zero)
        nothing = np.zeros(full.sine.shape, dtype=bool)
        return cls(planar, False, impacts.e_n, nothing, np.ones_like(full.sine))

    @property
    def done(self) -> Outcome:
        """The outcome, for effects that come after the tangential law.

        Raises
        ------
        ValueError
            If the tangential law has not acted yet.
        """
        if self.outcome is None:
            raise ValueError("an effect was applied before the tangential law")
        return self.outcome
