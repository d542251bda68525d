"""PyBullet, from the Python index, which executes the exported lines as they are."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version as version_of

import numpy as np
from simulators.shots import RADIUS, Rebounds, Shots

_TIME_STEP = 1.0 / 240.0  # s, Bullet's default
_BEFORE = 20.4  # time steps


def version() -> str:
    """What runs here; empty without it."""
    try:
        import pybullet  # noqa: F401
    except ImportError:
        return ""
    return version_of("pybullet")


def shoot(lines: Sequence[str], shots: Shots) -> Rebounds:
    """One after the other, a world each."""
    rows = [_one(lines, *row) for row in zip(shots.along, shots.approach, shots.omega, strict=True)]
    return shots.rebounds(*np.hsplit(np.array(rows), 2))


def _one(lines: Sequence[str], along: float, down: float, omega: np.ndarray) -> np.ndarray:
    import pybullet

    pybullet.connect(pybullet.DIRECT)
    try:
        pybullet.setTimeStep(_TIME_STEP)
        wall = pybullet.createMultiBody(0, pybullet.createCollisionShape(pybullet.GEOM_PLANE))
        shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=RADIUS)
        height = RADIUS + _BEFORE * down * _TIME_STEP
        sphere = pybullet.createMultiBody(0.3, shape, basePosition=[0.0, 0.0, height])
        exec("\n".join(lines), {"pybullet": pybullet, "wall": wall, "sphere": sphere})
        pybullet.resetBaseVelocity(sphere, [along, 0.0, -down], omega.tolist())
        for _ in range(60):
            pybullet.stepSimulation()
            velocity, spin = pybullet.getBaseVelocity(sphere)
            if velocity[2] > 0.0:
                break
    finally:
        pybullet.disconnect()
    return np.array([*velocity, *spin])
