"""Impulse balance of one impact with vectors, written from Newton's and Euler's laws alone.

It shares nothing with the formulas of `ifrfit.physics`, and takes numbers of any kind: with those of mpmath
it is exact to as many digits as one likes, which is what single and double precision are measured against.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[Any]
STANDARD = np.eye(3)


def impact(gamma_deg: float, spin_x: float, spin_y: float, **constants: Any) -> dict[str, Any]:
    """State after an impact in double precision; constants as in `balance`."""
    # from 90 - gamma, because cos(radians(90)) is not zero and a huge mu would make friction of it
    sine, cosine = math.sin(math.radians(gamma_deg)), math.sin(math.radians(90.0 - gamma_deg))
    return balance(sine, cosine, spin_x, spin_y, **constants)


def exact_impact(gamma_deg: float, spin_x: float, spin_y: float, **constants: Any) -> dict[str, Any]:
    """State after an impact in the digits that mpmath works with now, from the exact values of the floats.

    ``sine`` and ``cosine`` of the angle are in it as well; constants as in `balance`.
    """
    from mpmath import mpf, radians, sin

    gamma = mpf(float(gamma_deg))
    sine, cosine = sin(radians(gamma)), sin(radians(90 - gamma))
    numbers = {"inertia_factor": mpf(2) / 5}  # of a solid sphere: the double 0.4 is not quite that
    numbers |= {
        name: value if isinstance(value, str) else mpf(float(value)) for name, value in constants.items()
    }
    after = balance(sine, cosine, mpf(float(spin_x)), mpf(float(spin_y)), **numbers)
    return after | {"sine": sine, "cosine": cosine}


def balance(
    sine: Any,
    cosine: Any,
    spin_x: Any,
    spin_y: Any,
    *,
    law: str,
    constant: Any,
    e_n: Any,
    mu: Any,
    inertia_factor: Any = 0.4,
    speed: Any = 1.0,
    radius: Any = 1.0,
    mass: Any = 1.0,
    frame: Vector = STANDARD,
) -> dict[str, Any]:
    """State after an impact, per speed, in numbers of the kind that came in.

    Parameters
    ----------
    sine, cosine : number
        Of the incidence angle.
    spin_x, spin_y : number
        R omega/u before, in the paper's signs.
    law : {"f", "fr", "ifr", "ifr-contact"}
    constant, e_n, mu : number
        The law's own constant, normal restitution, friction.
    inertia_factor, speed, radius, mass : number
    frame : ndarray, (3, 3)
        Columns x, y and into the wall.

    Returns
    -------
    dict of str to number
        v_x, v_y, v_n (away from the wall), spin_x, spin_y, contact_x, contact_y.
    """
    x, y, normal = frame.T
    velocity = speed * (sine * x + cosine * normal)
    # the paper's omega_x is minus the right-handed component
    turn = speed / radius * (spin_y * y - spin_x * x)
    arm = radius * normal
    contact = velocity + np.cross(turn, arm)
    slip = contact - (contact @ normal) * normal
    size = (slip @ slip) ** 0.5
    push = mass * (1 + e_n) * (velocity @ normal)
    drag = tangential_impulse(law, constant, size, mu * push, mass, inertia_factor)
    impulse = -push * normal
    if size > 0:
        impulse = impulse - drag * slip / size
    after = velocity + impulse / mass
    turn_after = turn + np.cross(arm, impulse) / (inertia_factor * mass * radius**2)
    contact_after = after + np.cross(turn_after, arm)
    return {
        "v_x": after @ x / speed,
        "v_y": after @ y / speed,
        "v_n": -(after @ normal) / speed,
        "spin_x": -(turn_after @ x) * radius / speed,
        "spin_y": turn_after @ y * radius / speed,
        "contact_x": contact_after @ x / speed,
        "contact_y": contact_after @ y / speed,
    }


def tangential_impulse(law: str, constant: Any, slip: Any, limit: Any, mass: Any, inertia_factor: Any) -> Any:
    """Magnitude against the slip; `limit` is mu times the normal impulse.

    Raises
    ------
    ValueError
        For a law that is not one of F, FR, IFR and IFR-contact.
    """
    stop_contact = mass * slip / (1 + 1 / inertia_factor)  # centre and rotation together cancel the slip
    turn_contact = mass * slip * inertia_factor  # the rotation alone cancels it
    if law == "f":
        return min(stop_contact, limit)
    if law == "fr":
        return min((1 + constant) * stop_contact, limit)
    restitution = (1 + constant) * stop_contact
    if law == "ifr":
        return restitution + min(turn_contact, limit)
    if law == "ifr-contact":
        return restitution + min(stop_contact, limit)
    raise ValueError(f"no impulse balance for the law '{law}'")
