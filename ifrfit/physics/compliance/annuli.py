"""Maw, Barber & Fawcett's own scheme: a contact circle of equal annuli, each of which sticks or slips.

It converges with the reciprocal of the number of annuli, and shares nothing with the memory function: the
one is a check of the other.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from ifrfit.physics.angles import Array
from ifrfit.physics.compliance.contact import loading

ANNULI = 80
_ROUNDS = 60  # in which the division into sticking and slipping annuli settles


def annuli_ratio(psi1: Array, chi: Array, annuli: int = ANNULI) -> Array:
    """Scaled contact velocity after, psi2, of an elastic impact.

    Parameters
    ----------
    psi1, chi : ndarray, (n,)
        Scaled contact velocity before, 0 or more, and compliance number.
    annuli : int
        The contact grows and shrinks by one annulus a step.

    Returns
    -------
    ndarray, (n,)

    Notes
    -----
    Maw, Barber & Fawcett (1976), Wear 38, 101.
    """
    one = [_collision(float(p), float(x), annuli) for p, x in zip(psi1, chi, strict=True)]
    return np.array(one).reshape(np.shape(psi1))


@cache
def _kernel(n: int) -> tuple[Array, Array, Array, Array]:
    """Radii, displacements (i, j) and tractions (i, j) of unit distributions over circles j, their forces.

    With the effective modulus, the radius of the sphere and the largest approach 1; a unit distribution is
    sqrt(1 - r^2/a_j^2).
    """
    outer = np.arange(1, n + 1) / n
    middle = (outer - 0.5 / n)[:, None]
    inside = middle <= outer
    with np.errstate(invalid="ignore", divide="ignore"):
        within = 0.25 * np.pi / outer * (2.0 * outer**2 - middle**2)
        sine = np.minimum(outer / middle, 1.0)
        root = np.sqrt(np.maximum(middle**2 - outer**2, 0.0))
        beyond = 0.5 / outer * ((2.0 * outer**2 - middle**2) * np.arcsin(sine) + outer * root)
        traction = np.sqrt(np.maximum(1.0 - (middle / outer) ** 2, 0.0))
    force = 2.0 / 3.0 * np.pi * outer**2
    return middle[:, 0], np.where(inside, within, beyond), np.where(inside, traction, 0.0), force


def _collision(psi1: float, chi: float, n: int) -> float:
    middle, displacement, traction, force = _kernel(n)
    radius = np.arange(n + 1) / n
    part = loading(np.arcsin(radius**2))
    times = np.concatenate((part.time, part.time[::-1]))
    contacts = np.concatenate((np.arange(1, n + 1), np.arange(n - 1, -1, -1)))
    mass = 16.0 / 15.0  # for which the deepest approach is 1
    unit, velocity, total = np.zeros(n), psi1, 0.0
    slips = np.zeros(n)  # of each annulus: -1, 0 or 1, the direction of its traction
    for h, k in zip(times, contacts, strict=True):
        old = displacement @ unit
        rate = chi / mass * h
        unit = np.zeros(n)
        if k:
            pressure = 2.0 / np.pi * np.sqrt(radius[k] ** 2 - middle[:k] ** 2)
            active = displacement[:k, :k], traction[:k, :k], force[:k]
            path = h * velocity - 0.5 * h * rate * total
            unit[:k], slips[:k] = _step(active, pressure, old[:k], path, 0.5 * h * rate, slips[:k])
        new = float(force @ unit)
        velocity -= rate * (total + new)
        total = new
    return velocity


def _step(
    active: tuple[Array, Array, Array], pressure: Array, old: Array, path: float, drag: float, slips: Array
) -> tuple[Array, Array]:
    """Distributions after a step, with the set of slipping annuli that is consistent with them.

    `path` less `drag` times the new force is how far the contact moves.
    """
    displacement, traction, force = active
    unit = np.zeros(pressure.size)
    for _ in range(_ROUNDS):
        sticks = slips == 0.0
        matrix = np.where(sticks[:, None], displacement + drag * force, traction)
        unit = np.linalg.solve(matrix, np.where(sticks, old + path, slips * pressure))
        shear = traction @ unit
        moved = path - drag * float(force @ unit) - (displacement @ unit - old)
        too_much = sticks & (np.abs(shear) > pressure * (1.0 + 1e-12))
        backwards = ~sticks & (moved * slips < 0.0)
        if not (too_much.any() or backwards.any()):
            break
        slips = np.where(too_much, np.sign(shear), np.where(backwards, 0.0, slips))
    return unit, slips
