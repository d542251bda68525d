"""Inertia factors J = I/(m R^2) that a ball can have."""

from __future__ import annotations

# from a core that holds nearly all of the mass to a thin shell
LEAST, GREATEST = 0.1, 2.0 / 3.0

BALLS = (2.0 / 5.0, GREATEST)
BODIES = {2.0 / 5.0: "solid sphere", GREATEST: "thin hollow ball", 1.0 / 2.0: "disc on its edge"}

_SLACK = 0.025  # relative error of an inertia factor that follows from measured velocities


def is_plausible(inertia_factor: float) -> bool:
    """Whether a ball can have it, but for the error of what it follows from."""
    return LEAST <= inertia_factor <= GREATEST * (1.0 + _SLACK)
