"""Lateral spin: motion across the plane of incidence."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ifrfit.physics.effects.contact import Contact, Impacts
from ifrfit.physics.effects.impact_state import Bounce, Outcome
from ifrfit.physics.effects.protocol import Criterion, Effect, Stage


@dataclass(frozen=True)
class LateralSpin(Effect):
    """Spin about the direction of motion, which turns the path in the plane of the wall.

    It is no choice of accuracy: it is on where any impact has such a spin.
    """

    name: str = "lateral-spin"
    title: str = "lateral spin"
    stage: Stage = "plane"
    cost_ns: float = 36.0
    source: str = "Doménech-Carbó (2023), appendix A2"

    def lacks(self, contact: Contact, impacts: Impacts) -> str:
        """Nothing."""
        return ""

    def criterion(self, contact: Contact, impacts: Impacts, outcome: Outcome, accuracy: float) -> Criterion:
        """Largest |R omega_x|/u."""
        return Criterion("|R omega_x|/u", float(np.max(np.abs(impacts.incidence.spin_x))), 0.0)

    def apply(self, contact: Contact, impacts: Impacts, bounce: Bounce) -> Bounce:
        """Take the spin in."""
        return replace(bounce, incidence=impacts.incidence, lateral=True)
