"""Lateral spin: motion across the plane of incidence, or the planar kernel where there is none."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ifrfit.physics.angles import Incidence
from ifrfit.physics.effects.contact import Contact, ContactNumber, Impacts
from ifrfit.physics.effects.impact_state import Bounce, Outcome
from ifrfit.physics.effects.protocol import Criterion, Stage, Validity
from ifrfit.physics.rebound import rebound_with


@dataclass(frozen=True)
class LateralSpin:
    """Spin about the direction of motion, which turns the path in the plane of the wall.

    It is no choice of accuracy: it is on where any impact has such a spin.
    """

    name: str = "lateral-spin"
    title: str = "lateral spin"
    stage: Stage = "plane"
    replaces: Literal[""] = ""
    cost_ns: float = 36.0
    numbers: tuple[ContactNumber, ...] = ()
    source: str = "Doménech-Carbó (2023), appendix A2"

    def lacks(self, contact: Contact, impacts: Impacts) -> str:
        """Nothing."""
        return ""

    def validity(self, contact: Contact, impacts: Impacts) -> Validity:
        """Holds always."""
        return Validity()

    def criterion(self, contact: Contact, impacts: Impacts, outcome: Outcome, accuracy: float) -> Criterion:
        """Largest |R omega_x|/u."""
        return Criterion("|R omega_x|/u", float(np.max(np.abs(impacts.incidence.spin_x))), 0.0)

    def apply(self, contact: Contact, impacts: Impacts, bounce: Bounce) -> Bounce:
        """Take the spin in."""
        return replace(bounce, incidence=impacts.incidence, lateral=True)


def kernel(bounce: Bounce, contact: Contact) -> Outcome:
    """Velocities and spins after, planar or in three dimensions.

    Where there is no lateral spin both give the same numbers to the last bit; the planar one does not
    compute the components that are zero.

    Returns
    -------
    Outcome
        With k and sticking as `bounce` holds them.
    """
    k, sticking = bounce.impulse_factor, bounce.sticking
    if k is None or sticking is None:
        raise ValueError("the kernel needs an impulse factor")
    j = contact.inertia_factor
    if bounce.lateral:
        full = rebound_with(bounce.incidence, k, sticking, bounce.e_n, j)
        return Outcome(**vars(full), captured=bounce.captured)
    return _planar(bounce.incidence, bounce, k, j)


def _planar(incidence: Incidence, bounce: Bounce, k: np.ndarray, j: float) -> Outcome:
    push = k * incidence.slip_x
    none = np.broadcast_to(0.0, push.shape)
    return Outcome(
        v_x=incidence.sine - push,
        v_y=none,
        v_n=bounce.e_n * incidence.cosine,
        spin_x=none,
        spin_y=incidence.spin_y - push / j,
        contact_x=incidence.slip_x - push / (j / (1.0 + j)),
        contact_y=none,
        sticking=np.asarray(bounce.sticking),
        impulse_factor=k,
        incidence=incidence,
        e_n=bounce.e_n,
        inertia_factor=j,
        captured=bounce.captured,
    )
