"""Impulse balance of one impact with vectors, written from Newton's and Euler's laws alone.

It shares nothing with the formulas of `ifrfit.physics`, and takes numbers of any kind: with those of mpmath
it is exact to as many digits as one likes, which is what single and double precision are measured against.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[Any]
Impulse = Callable[[Any, Any, Any, Any, Any], Any]
STANDARD = np.eye(3)


def impact(gamma_deg: float, spin_x: float, spin_y: float, **constants: Any) -> dict[str, Any]:
    """State after an impact in double precision; constants as in `balance`."""
    # from 90 - gamma, because cos(radians(90)) is not zero and a huge mu would make friction of it
    sine, cosine = math.sin(math.radians(gamma_deg)), math.sin(math.radians(90.0 - gamma_deg))
    return balance(sine, cosine, spin_x, spin_y, **constants)


def exact_impact(
    gamma_deg: float, spin_x: float, spin_y: float, *, law: Impulse, **constants: float
) -> dict[str, Any]:
    """State after an impact in the digits that mpmath works with now, from the exact values of the floats.

    ``sine`` and ``cosine`` of the angle are in it as well; constants as in `balance`.
    """
    from mpmath import mpf, radians, sin

    gamma = mpf(float(gamma_deg))
    sine, cosine = sin(radians(gamma)), sin(radians(90 - gamma))
    numbers = {"inertia_factor": mpf(2) / 5}  # of a solid sphere: the double 0.4 is not quite that
    numbers |= {name: mpf(float(value)) for name, value in constants.items()}
    after = balance(sine, cosine, mpf(float(spin_x)), mpf(float(spin_y)), law=law, **numbers)
    return after | {"sine": sine, "cosine": cosine}


def balance(
    sine: Any,
    cosine: Any,
    spin_x: Any,
    spin_y: Any,
    *,
    law: Impulse,
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
    law : callable
        Magnitude of the tangential impulse against the slip, as `ifr`: from the law's own constant, the slip,
        mu times the normal impulse, mass and inertia factor.
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
    drag = law(constant, size, mu * push, mass, inertia_factor)
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


def ifr(constant: Any, slip: Any, limit: Any, mass: Any, inertia_factor: Any) -> Any:
    """Closure IFR: its restitution, and as friction at most what stops the contact by the rotation alone."""
    stop = mass * slip / (1 + 1 / inertia_factor)  # centre and rotation together cancel the slip
    return (1 + constant) * stop + min(mass * slip * inertia_factor, limit)
