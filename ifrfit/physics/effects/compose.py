"""Let effects act on impacts, in their one order."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from ifrfit.physics.effects.contact import Contact, Impacts
from ifrfit.physics.effects.impact_state import Bounce, Outcome
from ifrfit.physics.effects.lateral import kernel
from ifrfit.physics.effects.protocol import ORDER
from ifrfit.physics.effects.registry import EFFECTS


def compose(contact: Contact, impacts: Impacts, on: Collection[str]) -> Outcome:
    """Compute impacts with these effects and no others.

    Parameters
    ----------
    contact : Contact
    impacts : Impacts
    on : collection of str
        Names of effects.

    Returns
    -------
    Outcome
        Of the shape of the impacts.

    Notes
    -----
    The order is plane of motion, normal restitution, adhesion, tangential law, rolling friction, fluid. So
    friction presses with the normal impulse of the dry contact, adhesion included.
    """
    bounce = Bounce.before(impacts)
    for stage in ORDER:
        for name, effect in EFFECTS.items():
            if name in on and effect.stage == stage:
                bounce = effect.apply(contact, impacts, bounce)
        if stage == "tangential":
            bounce = _after_contact(contact, impacts, bounce)
    return bounce.done


def with_effect(names: Collection[str], more: str) -> list[str]:
    """These effects and one more, which takes the place of any that replaces the same constant."""
    same = EFFECTS[more].replaces
    return [n for n in names if n != more and (not same or EFFECTS[n].replaces != same)] + [more]


def _after_contact(contact: Contact, impacts: Impacts, bounce: Bounce) -> Bounce:
    """The closure's impulse, unless an effect has given one, and the motion after it."""
    if bounce.impulse_factor is None:
        bounce = _closure(contact, impacts, bounce)
    return replace(bounce, outcome=kernel(bounce, contact))


def _closure(contact: Contact, impacts: Impacts, bounce: Bounce) -> Bounce:
    if impacts.constant is None:
        raise ValueError("the closure needs its constant where compliance is off")
    law = impacts.closure.law(contact.inertia_factor)
    with np.errstate(over="ignore"):
        kappa = np.minimum(impacts.mu * (1.0 + bounce.e_n), np.finfo(float).max)
    k, sticking = law.impulse(bounce.incidence, impacts.constant, kappa)
    return replace(bounce, impulse_factor=k, sticking=sticking)
