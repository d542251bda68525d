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

    An effect replaces velocities and spins; what follows from them (the velocity of the contact point, beta,
    the apparent friction, the energy) is computed from them. v_n and e_n are replaced together.

    Attributes
    ----------
    captured : ndarray of bool
        The sphere does not leave the wall (v_n = 0). Velocities along the wall and spins are those at that
        instant; what becomes of them later is not computed.
    impulsive : Rebound
        The state that the tangential law left, before any further effect.
    """

    captured: NDArray[np.bool_]
    impulsive: Rebound

    def _gain(self, name: str) -> Array:
        """What effects have added to a velocity or a spin since the tangential law; exactly 0 for nothing."""
        now, then = getattr(self, name), getattr(self.impulsive, name)
        return np.zeros(()) if now is then else np.asarray(now - then)

    @property
    def _contact_gain(self) -> tuple[Array, Array]:
        x, y = self._gain("v_x") + self._gain("spin_y"), self._gain("v_y") + self._gain("spin_x")
        return np.asarray(x), np.asarray(y)

    @property
    def contact_x(self) -> Array:
        """Tangential velocity of the contact point along x, V_x/u."""
        return np.asarray(super().contact_x + self._contact_gain[0])

    @property
    def contact_y(self) -> Array:
        """Tangential velocity of the contact point along y, V_y/u."""
        return np.asarray(super().contact_y + self._contact_gain[1])

    @property
    def _push(self) -> tuple[Array, Array]:
        x, y = super()._push
        return np.asarray(x - self._gain("v_x")), np.asarray(y - self._gain("v_y"))

    @property
    def beta(self) -> Array:
        """Tangential restitution of the contact point, -V_t.U_t/|U_t|^2; nan without slip."""
        before, (x, y) = self.incidence, self._contact_gain
        if not (np.any(x) or np.any(y)):
            return super().beta
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(super().beta - (x * before.slip_x + y * before.slip_y) / before.slip**2)

    @property
    def energy_change(self) -> Array:
        """Change of kinetic energy, rotation included, over m u^2/2."""
        change = super().energy_change
        for names, inertia in ((("v_x", "v_y"), 1.0), (("spin_x", "spin_y"), self.inertia_factor)):
            for name in names:
                both = getattr(self, name) + getattr(self.impulsive, name)
                change = change + inertia * self._gain(name) * both
        if self.v_n is not self.impulsive.v_n:
            change = change + (self.v_n**2 - (self.e_n * self.incidence.cosine) ** 2)
        return np.asarray(change)


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
