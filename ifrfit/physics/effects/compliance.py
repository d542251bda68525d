"""Tangential compliance: the contact gives way sideways, so impacts near the normal slip and spring back."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ifrfit.physics.angles import Array
from ifrfit.physics.closure import rotational_share
from ifrfit.physics.compliance import rebound_ratio
from ifrfit.physics.effects.contact import Contact, ContactNumber, Impacts, known
from ifrfit.physics.effects.impact_state import Bounce, Outcome
from ifrfit.physics.effects.protocol import Criterion, Stage, Validity

# of chi = stiffness ratio (1 + 1/J)/2, from nu = 0.5 to nu = 0; a little more for rounding
_STIFFNESS = (2.0 / 3.0 - 1e-9, 1.0 + 1e-9)


def stiffness_ratio(contact: Contact, impacts: Impacts) -> Array:
    """Tangential over normal contact stiffness of each impact, from chi where that is given."""
    if impacts.chi is not None:
        return np.asarray(2.0 * impacts.chi / (1.0 + 1.0 / contact.inertia_factor))
    return np.full_like(impacts.speed, known(contact.stiffness_ratio))


@dataclass(frozen=True)
class Compliance:
    """Maw-Barber-Fawcett; for e_n < 1 scaled with (1 + e_n)/2, which is exact in gross slip only."""

    name: str = "compliance"
    title: str = "compliance"
    stage: Stage = "tangential"
    replaces: Literal["tangential"] = "tangential"
    cost_ns: float = 70.0
    numbers: tuple[ContactNumber, ...] = ()
    source: str = (
        "Maw, Barber & Fawcett (1976), Wear 38, 101; for e_n < 1 the scaling of Wu, Thornton & Li (2003), "
        "Adv. Powder Technol. 14, 435"
    )

    def lacks(self, contact: Contact, impacts: Impacts) -> str:
        """Elastic constants, or a possible chi."""
        if impacts.chi is None and (missing := contact.lacks("stiffness_ratio")):
            return missing
        ratio, (low, high) = stiffness_ratio(contact, impacts), _STIFFNESS
        fits = bool(np.all((ratio >= low) & (ratio <= high)))
        return "" if fits else "chi lies outside what Poisson's ratios from 0 to 0.5 give"

    def validity(self, contact: Contact, impacts: Impacts) -> Validity:
        """Remark where e_n < 1: the scaling is an approximation."""
        return Validity(True, "for e_n < 1 by scaling, good to about 0.1 in psi_2 at e_n = 0.9")

    def number(self, contact: Contact, impacts: Impacts, e_n: Array, slip: Array) -> Array:
        """psi_1 = (k_t/k_n) |U_t|/(mu U_n), scaled by 2/(1 + e_n); infinite without friction."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            tau = np.where(slip == 0.0, 0.0, slip / impacts.incidence.cosine)
            scaled = 2.0 * stiffness_ratio(contact, impacts) * tau / ((1.0 + e_n) * impacts.mu)
        return np.asarray(np.where(slip == 0.0, 0.0, scaled))

    def criterion(self, contact: Contact, impacts: Impacts, outcome: Outcome, accuracy: float) -> Criterion:
        """Smallest psi_1; from 4 chi - 1 on the whole contact slips and nothing is left of the effect."""
        number = self.number(contact, impacts, outcome.e_n, impacts.incidence.slip)
        chi = 0.5 * stiffness_ratio(contact, impacts) * (1.0 + 1.0 / contact.inertia_factor)
        return Criterion("psi_1", float(np.min(number)), float(np.max(4.0 * chi - 1.0)), above=False)

    def apply(self, contact: Contact, impacts: Impacts, bounce: Bounce) -> Bounce:
        """Put the compliant contact in the place of the closure."""
        share = rotational_share(contact.inertia_factor)
        number = self.number(contact, impacts, bounce.e_n, bounce.incidence.slip)
        chi = 0.5 * stiffness_ratio(contact, impacts) * (1.0 + 1.0 / contact.inertia_factor)
        slides = number >= 4.0 * chi - 1.0
        # gross slip in closed form: the table need not reach to infinity
        inside = np.where(slides, 1.0, np.maximum(number, 1e-6))
        after = np.asarray(rebound_ratio(inside, chi))
        with np.errstate(divide="ignore", invalid="ignore"):
            sliding = np.where(np.isinf(number), 0.0, 4.0 * chi / number)
        k = share * np.where(slides, sliding, 1.0 - after / inside)
        return replace(bounce, impulse_factor=k, sticking=~slides)
