"""Let effects act on impacts, in their one order."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ifrfit.physics.angles import Array
from ifrfit.physics.effects.contact import Contact, Impacts
from ifrfit.physics.effects.impact_state import Bounce, Outcome
from ifrfit.physics.effects.protocol import ORDER
from ifrfit.physics.effects.registry import EFFECTS
from ifrfit.physics.rebound import Rebound, friction_impulse, rebound_with


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
    """The closure's impulse, unless an effect has given one, and velocities and spins after it.

    Without lateral spin components that are zero are not computed; the others are the same to the last bit.
    """
    k, sticking = bounce.impulse or _closure(contact, impacts, bounce)
    incidence, e_n, j = bounce.incidence, bounce.e_n, contact.inertia_factor
    if bounce.lateral:
        state = rebound_with(incidence, k, sticking, e_n, j)
    else:
        push, none = k * incidence.slip_x, np.broadcast_to(0.0, k.shape)
        state = Rebound(
            v_x=incidence.sine - push,
            v_y=none,
            v_n=e_n * incidence.cosine,
            spin_x=none,
            spin_y=incidence.spin_y - push / j,
            sticking=sticking,
            impulse_factor=k,
            incidence=incidence,
            e_n=e_n,
            inertia_factor=j,
        )
    return replace(bounce, outcome=Outcome(**vars(state), captured=bounce.captured, impulsive=state))


def _closure(contact: Contact, impacts: Impacts, bounce: Bounce) -> tuple[Array, NDArray[np.bool_]]:
    if impacts.constant is None:
        raise ValueError("the closure needs its constant where compliance is off")
    kappa = friction_impulse(impacts.mu, bounce.e_n)
    return impacts.closure.law(contact.inertia_factor).impulse(bounce.incidence, impacts.constant, kappa)
