"""Stronge's lumped model: one tangential spring behind one Coulomb slider, from event to event.

Scaled as in `ifrfit.physics.compliance.contact`, with the normal frequency 1: while the contact sticks it
swings with the frequency sqrt(2 chi), and the friction saturates where the stretch of the spring is the sine
of the normal phase.
"""

from __future__ import annotations

import numpy as np

from ifrfit.physics.angles import Array

_LOOKS = 256  # at a swing of the spring, to see where it first saturates
_HALVINGS = 50


def stronge_ratio(psi1: Array, chi: Array, e_n: Array) -> Array:
    """Scaled contact velocity after, psi2.

    Parameters
    ----------
    psi1, chi, e_n : ndarray, (n,)
        Scaled contact velocity before (0 or more), compliance number, normal restitution.

    Returns
    -------
    ndarray, (n,)

    Notes
    -----
    Stronge (2000), Impact Mechanics, chapter 5; Stronge, James & Ravani (2001), Phil. Trans. R. Soc. A 359,
    2447.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        limit = 2.0 * chi * (1.0 + e_n) - np.where(e_n > 0.0, 1.0 / e_n, 0.0)
    # below 2 chi the contact sticks while it is pressed together, whatever the rebound
    gross = psi1 >= np.maximum(limit, np.maximum(2.0 * chi, 1.0))
    out = psi1 - 2.0 * chi * (1.0 + e_n)
    at = np.flatnonzero(~gross)
    if at.size:
        out[at] = _with_sticking(psi1[at], chi[at], e_n[at])
    return out


def _with_sticking(psi1: Array, chi: Array, e_n: Array) -> Array:
    frequency = np.sqrt(2.0 * chi)
    end = 0.5 * np.pi * (1.0 + e_n)
    start, velocity, stretch = _first_stick(psi1, chi, e_n)

    def swing(t: Array) -> tuple[Array, Array]:
        """Stretch and velocity of the spring at a time."""
        angle = frequency * (t - start)
        cosine, sine = np.cos(angle), np.sin(angle)
        return (
            stretch * cosine + velocity / frequency * sine,
            velocity * cosine - frequency * stretch * sine,
        )

    def excess(t: Array) -> Array:
        return np.asarray(np.abs(swing(t)[0]) - np.sin(_phase(t, e_n)))

    low, high = start, end
    found = np.zeros(start.size, dtype=bool)
    for share in np.arange(1, _LOOKS) / _LOOKS:
        t = start + share * (end - start)
        # the contact begins to stick just where the spring is saturated: rounding is no slip
        now = ~found & (excess(t) > 1e-12)
        high = np.where(now, t, high)
        low = np.where(found | now, low, t)
        found |= now
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        saturated = excess(middle) > 0.0
        low, high = np.where(saturated, low, middle), np.where(saturated, middle, high)
    stretched, velocity = swing(high)
    return np.asarray(velocity - np.sign(stretched) * 2.0 * chi * (e_n - _normal(high, e_n)))


def _first_stick(psi1: Array, chi: Array, e_n: Array) -> tuple[Array, Array, Array]:
    """When the contact first sticks, its velocity there, and the stretch of the spring."""
    slips = psi1 >= 1.0
    with np.errstate(divide="ignore", invalid="ignore"):
        early = (psi1 - 2.0 * chi) / (1.0 - 2.0 * chi)
        late = (psi1 - 2.0 * chi) * e_n / (1.0 - 2.0 * chi * e_n**2)
        while_pressing = np.arccos(np.clip(early, -1.0, 1.0))
        phase = np.arccos(np.clip(late, -1.0, 1.0))
    in_compression = psi1 <= 2.0 * chi
    time = np.where(in_compression, while_pressing, e_n * phase + 0.5 * np.pi * (1.0 - e_n))
    start = np.where(slips, time, 0.0)
    phase = _phase(start, e_n)
    velocity = psi1 - 2.0 * chi * (1.0 + _normal(start, e_n))
    return start, np.where(slips, velocity, psi1), np.where(slips, np.sin(phase), 0.0)


def _phase(t: Array, e_n: Array) -> Array:
    """Phase of the normal motion, pi/2 at the deepest point and pi at the end."""
    with np.errstate(divide="ignore", invalid="ignore"):
        later = 0.5 * np.pi + np.where(e_n > 0.0, (t - 0.5 * np.pi) / e_n, 0.0)
    return np.asarray(np.where(t <= 0.5 * np.pi, t, np.minimum(later, np.pi)))


def _normal(t: Array, e_n: Array) -> Array:
    """Normal velocity away from the wall, -1 at the beginning and e_n at the end."""
    pressing = t <= 0.5 * np.pi
    return np.asarray(-np.cos(_phase(t, e_n)) * np.where(pressing, 1.0, e_n))
