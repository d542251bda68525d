"""Impulse balance of one impact with vectors, written from Newton's and Euler's laws alone."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
STANDARD = np.eye(3)


def tangential_impulse(
    law: str, constant: float, slip: float, limit: float, mass: float, inertia_factor: float
) -> float:
    """Magnitude against the slip; `limit` is mu times the normal impulse."""
    stop_contact = mass * slip / (1.0 + 1.0 / inertia_factor)  # centre and rotation together cancel the slip
    turn_contact = mass * slip * inertia_factor  # the rotation alone cancels it
    if law == "f":
        return min(stop_contact, limit)
    if law == "fr":
        return min((1.0 + constant) * stop_contact, limit)
    restitution = (1.0 + constant) * stop_contact
    if law == "ifr":
        return restitution + min(turn_contact, limit)
    if law == "ifr-contact":
        return restitution + min(stop_contact, limit)
    raise AssertionError(law)


def impact(
    gamma_deg: float,
    spin_x: float,
    spin_y: float,
    *,
    law: str,
    constant: float,
    e_n: float,
    mu: float,
    inertia_factor: float = 0.4,
    speed: float = 1.0,
    radius: float = 1.0,
    mass: float = 1.0,
    frame: Vector = STANDARD,
) -> dict[str, float]:
    """State after, per speed, components along the frame's columns (x, y, into the wall), paper's signs."""
    x, y, normal = frame.T
    # from 90 - gamma, because cos(radians(90)) is not zero and a huge mu would make friction of it
    approach = math.sin(math.radians(90.0 - gamma_deg))
    velocity = speed * (math.sin(math.radians(gamma_deg)) * x + approach * normal)
    # the paper's omega_x is minus the right-handed component
    turn = speed / radius * (spin_y * y - spin_x * x)
    arm = radius * normal
    contact = velocity + np.cross(turn, arm)
    slip = contact - (contact @ normal) * normal
    size = float(np.linalg.norm(slip))
    push = mass * (1.0 + e_n) * float(velocity @ normal)
    drag = tangential_impulse(law, constant, size, mu * push, mass, inertia_factor)
    impulse = -push * normal
    if size > 0.0:
        impulse = impulse - drag * slip / size
    after = velocity + impulse / mass
    turn_after = turn + np.cross(arm, impulse) / (inertia_factor * mass * radius**2)
    contact_after = after + np.cross(turn_after, arm)
    return {
        "v_x": float(after @ x) / speed,
        "v_y": float(after @ y) / speed,
        "v_n": float(-(after @ normal)) / speed,
        "spin_x": float(-(turn_after @ x)) * radius / speed,
        "spin_y": float(turn_after @ y) * radius / speed,
        "contact_x": float(contact_after @ x) / speed,
        "contact_y": float(contact_after @ y) / speed,
    }
