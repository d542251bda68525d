"""Tangential compliance: the contact gives way sideways, so impacts near the normal slip and spring back."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ifrfit.physics.angles import Array
from ifrfit.physics.closure import rotational_share
from ifrfit.physics.compliance import law
from ifrfit.physics.compliance.law import LARGEST_RATIO, LEAST_RATIO
from ifrfit.physics.effects.contact import Contact, Impacts, known
from ifrfit.physics.effects.impact_state import Bounce, Outcome
from ifrfit.physics.effects.protocol import Criterion, Effect, Stage, Validity
from ifrfit.physics.rebound import friction_impulse

# stiffness ratio from nu = 0.5 to nu = 0; a little more for rounding
_STIFFNESS = (LEAST_RATIO - 1e-9, LARGEST_RATIO + 1e-9)


def compliance_number(contact: Contact, impacts: Impacts) -> Array:
    """chi of each impact: as given, else of the materials."""
    if impacts.chi is not None:
        return impacts.chi
    ratio = known(contact.stiffness_ratio)
    return np.full_like(impacts.speed, 0.5 * ratio * (1.0 + 1.0 / contact.inertia_factor))


@dataclass(frozen=True)
class Compliance(Effect):
    """Maw-Barber-Fawcett; for e_n < 1 scaled with (1 + e_n)/2, which is exact in gross slip only."""

    name: str = "compliance"
    title: str = "compliance"
    stage: Stage = "tangential"
    replaces: Literal["tangential"] = "tangential"
    cost_ns: float = 70.0
    source: str = (
        "Maw, Barber & Fawcett (1976), Wear 38, 101; for e_n < 1 the scaling of Wu, Thornton & Li (2003), "
        "Adv. Powder Technol. 14, 435"
    )

    def lacks(self, contact: Contact, impacts: Impacts) -> str:
        """Elastic constants, or a possible chi."""
        if impacts.chi is None and (missing := contact.lacks("stiffness_ratio")):
            return missing
        ratio = 2.0 * compliance_number(contact, impacts) / (1.0 + 1.0 / contact.inertia_factor)
        low, high = _STIFFNESS
        fits = bool(np.all((ratio >= low) & (ratio <= high)))
        return "" if fits else "chi lies outside what Poisson's ratios from 0 to 0.5 give"

    def validity(self, contact: Contact, impacts: Impacts) -> Validity:
        """Remark where e_n < 1: the scaling is an approximation."""
        return Validity(True, "for e_n < 1 by scaling, good to about 0.1 in psi_2 at e_n = 0.9")

    def criterion(self, contact: Contact, impacts: Impacts, outcome: Outcome, accuracy: float) -> Criterion:
        """Smallest psi_1; from 4 chi - 1 on the whole contact slips and nothing is left of the effect."""
        chi = compliance_number(contact, impacts)
        kappa = friction_impulse(impacts.mu, outcome.e_n)
        _, number = self._law(contact).load(impacts.incidence, chi, kappa)
        return Criterion("psi_1", float(np.min(number)), float(np.max(4.0 * chi - 1.0)), above=False)

    def apply(self, contact: Contact, impacts: Impacts, bounce: Bounce) -> Bounce:
        """Put the compliant contact in the place of the closure."""
        chi = compliance_number(contact, impacts)
        kappa = friction_impulse(impacts.mu, bounce.e_n)
        return replace(bounce, impulse=self._law(contact).impulse(bounce.incidence, chi, kappa))

    @staticmethod
    def _law(contact: Contact) -> law.Compliance:
        return law.Compliance(rotational_share(contact.inertia_factor))
