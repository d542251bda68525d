"""Rolling friction: a couple that resists the spin during the contact."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ifrfit.physics.effects.contact import Contact, ContactNumber, Impacts
from ifrfit.physics.effects.impact_state import Bounce, Outcome
from ifrfit.physics.effects.protocol import Criterion, Effect, Stage

# coefficient mu_r of the resisting couple
ROLLING_FRICTION = ContactNumber("rolling_friction", 0.0, 10.0)


@dataclass(frozen=True)
class Rolling(Effect):
    """A couple impulse of at most mu_r R |P_n| against the spin that the impact leaves; it never reverses it.

    R Omega falls by mu_r (1 + e_n) u_n/J. This option is ours; the equations of the paper that adds rolling
    friction to IFR (Doménech-Carbó 2019, Phys. Fluids 31, 043302) are not those.
    """

    name: str = "rolling"
    title: str = "rolling"
    stage: Stage = "rolling"
    cost_ns: float = 22.0
    numbers: tuple[ContactNumber, ...] = (ROLLING_FRICTION,)
    source: str = "our own option: balance of angular momentum with a Coulomb-like couple"

    def lacks(self, contact: Contact, impacts: Impacts) -> str:
        """Coefficient of rolling friction."""
        return contact.lacks(ROLLING_FRICTION, hertzian=False)

    def criterion(self, contact: Contact, impacts: Impacts, outcome: Outcome, accuracy: float) -> Criterion:
        """Largest mu_r/mu_app: change of spin by the couple over that by friction."""
        friction = np.asarray(outcome.mu_app_magnitude)
        friction = friction[friction > 0.0]
        ratio = contact.number(ROLLING_FRICTION) / float(np.min(friction)) if friction.size else 0.0
        return Criterion("mu_r/mu_app", ratio, accuracy)

    def apply(self, contact: Contact, impacts: Impacts, bounce: Bounce) -> Bounce:
        """Slow the spin; the contact point follows."""
        out = bounce.done
        spin = np.hypot(out.spin_x, out.spin_y)
        couple = contact.number(ROLLING_FRICTION) * (1.0 + out.e_n) * out.incidence.cosine
        loss = np.minimum(couple / contact.inertia_factor, spin)
        with np.errstate(divide="ignore", invalid="ignore"):
            kept = np.where(spin > 0.0, 1.0 - loss / spin, 0.0)
        return replace(bounce, outcome=replace(out, spin_x=kept * out.spin_x, spin_y=kept * out.spin_y))
