"""Tracks of a ball that flies, hits a floor and flies on: what a camera sees, and what there was."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

GRAVITY = 9.81


@dataclass(frozen=True)
class Bounce:
    """m/s, rad/s and s; z out of the floor, the angle of a mark from x towards z."""

    before: tuple[float, float] = (3.0, -4.0)
    after: tuple[float, float] = (2.0, 3.2)
    spin: tuple[float, float] = (-40.0, -120.0)
    at: float = 0.01234
    contact: float = 0.0
    gravity: float = GRAVITY


def track(bounce, *, fps=1000.0, frames=(8, 8), noise=0.0, angle_noise=0.0, rng=None):
    """Number, time, x, z and angle of each frame.

    The flights meet at time `at`. The ball is in contact before and after it, as long as it takes to fly the
    same height h, and follows quarters of a sine there, as a spring has it.
    """
    rng = np.random.default_rng(0) if rng is None else rng
    height = bounce.contact / (1.0 / abs(bounce.before[1]) + 1.0 / bounce.after[1])
    comes, leaves = height / abs(bounce.before[1]), height / bounce.after[1]
    first = int(np.ceil((bounce.at - comes) * fps)) - frames[0]
    last = int(np.floor((bounce.at + leaves) * fps)) + frames[1]
    number = np.arange(first, last + 1)
    t = number / fps - bounce.at
    x = np.where(t < 0, bounce.before[0], bounce.after[0]) * t
    z = np.where(t < 0, bounce.before[1], bounce.after[1]) * t - 0.5 * bounce.gravity * t**2
    if bounce.contact:
        quarter = 0.5 * np.pi * t / np.where(t < 0, comes, leaves)
        pressed = height * (1.0 - 2.0 / np.pi * np.cos(quarter))
        z = np.where((t > -comes) & (t < leaves), pressed, z)
    angle = np.where(t < 0, bounce.spin[0], bounce.spin[1]) * t + 0.7
    x, z = (each + noise * rng.standard_normal(len(t)) for each in (x, z))
    angle = angle + angle_noise * rng.standard_normal(len(t))
    return number, t + bounce.at, x, z, np.angle(np.exp(1j * angle))


def table(bounces, *, header="run,t [s],x [m],z [m],angle [rad]", **given):
    """Text of a table with a run for each bounce."""
    lines = [header]
    for run, bounce in enumerate(bounces, start=1):
        _, t, x, z, angle = track(bounce, **given)
        lines += [
            f"{run},{a!r},{b!r},{c!r},{d!r}"
            for a, b, c, d in zip(*(each.tolist() for each in (t, x, z, angle)), strict=True)
        ]
    return "\n".join(lines) + "\n"
