"""Maw, Barber & Fawcett's solution by a memory function: the limit of infinitely many annuli.

Every approach d' that the contact went through carries a value D(d') between -1 and 1: how far the
tangential traction that came with it is towards slipping. Displacement and force are the integrals of D and
of D P'(d') from 0 to the present approach. A step writes D at the rim of the contact only, so the history is
a pile of runs of one value each, and a whole collision costs a number of operations proportional to its
steps.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from ifrfit.physics.angles import Array
from ifrfit.physics.compiling import compiled
from ifrfit.physics.compliance.contact import loading

STEPS = 4000


def memory_ratio(psi1: Array, chi: Array, steps: int = STEPS) -> Array:
    """Scaled contact velocity after, psi2, of an elastic impact.

    Parameters
    ----------
    psi1, chi : ndarray, (n,)
        Scaled contact velocity before, 0 or more, and compliance number.
    steps : int
        Time steps of a collision; the error falls about with their square.

    Returns
    -------
    ndarray, (n,)

    Notes
    -----
    Maw, Barber & Fawcett (1976), Wear 38, 101, in the limit of the memory integral of Mindlin & Deresiewicz.
    """
    depth, load, time, speed = _steps(max(steps // 2, 2))
    solve = compiled(_collision)
    one = np.array(
        [solve(float(p), float(x), depth, load, time, speed) for p, x in zip(psi1, chi, strict=True)]
    )
    return one.reshape(np.shape(psi1))


@cache
def _steps(n: int) -> tuple[Array, Array, Array, Array]:
    """Depth and load at the ends of steps, their times, and the normal velocity in their middles."""
    part = loading(np.linspace(0.0, 0.5 * np.pi, n + 1))
    depth = np.concatenate((part.depth, part.depth[-2::-1]))
    load = np.concatenate((part.load, part.load[-2::-1]))
    speed = np.concatenate((part.speed, -part.speed[::-1]))
    return depth, load, np.concatenate((part.time, part.time[::-1])), speed


def _collision(  # pragma: no cover - compiled where numba is there
    psi1: float, chi: float, depth: Array, load: Array, time: Array, speed: Array
) -> float:
    """One collision. Runs of the memory lie on a pile: where each begins, and its value."""
    n = time.size
    begins = np.empty(n + 2)
    values = np.empty(n + 2)
    top = 0
    force = 0.0
    velocity = psi1
    for i in range(n):
        path = velocity * time[i]
        end = depth[i + 1]
        if end > depth[i]:
            gained = end - depth[i]
            value = path / gained
            if value > 1.0:
                value = 1.0
            elif value < -1.0:
                value = -1.0
            begins[top] = depth[i]
            values[top] = value
            top += 1
            force += value * (load[i + 1] - load[i])
            left = path - value * gained
        else:
            left = path
            last, last_load = depth[i], load[i]
            while top > 0 and begins[top - 1] >= end:
                top -= 1
                begin_load = 1.25 * begins[top] * np.sqrt(begins[top])
                left += values[top] * (last - begins[top])
                force -= values[top] * (last_load - begin_load)
                last, last_load = begins[top], begin_load
            if top > 0:
                left += values[top - 1] * (last - end)
                force -= values[top - 1] * (last_load - load[i + 1])
        if left != 0.0 and top > 0:
            sign = 1.0 if left > 0.0 else -1.0
            left = abs(left)
            last, last_load = end, load[i + 1]
            while top > 0:
                begin, room = begins[top - 1], 1.0 - sign * values[top - 1]
                if room * (last - begin) > left:
                    cut = last - left / room
                    cut_load = 1.25 * cut * np.sqrt(cut)
                    force += sign * room * (last_load - cut_load)
                    last = cut
                    break
                left -= room * (last - begin)
                begin_load = 1.25 * begin * np.sqrt(begin)
                force += sign * room * (last_load - begin_load)
                last, last_load = begin, begin_load
                top -= 1
            begins[top] = last
            values[top] = sign
            top += 1
        if i + 1 < n:
            # the share of the normal impulse that goes along the wall: exact where all of the contact slips
            velocity -= 2.0 * chi * (force / load[i + 1]) * (speed[i] - speed[i + 1])
    return velocity
