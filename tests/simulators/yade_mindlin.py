"""YADE with the contact law of Hertz and Mindlin."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from simulators import yade
from simulators.shots import DENSITY, RADIUS, Rebounds, Shots

_MASS = 4.0 / 3.0 * np.pi * RADIUS**3 * DENSITY
version = yade.version


def shoot(lines: Sequence[str], shots: Shots) -> Rebounds:
    """Speed by speed, with the exported lines as they are: the faster, the shorter a contact of Hertz."""
    found = np.empty((shots.angle.size, 6))
    for speed in np.unique(shots.approach):
        rows = shots.approach == speed
        # 3.218 (m^2/(k^2 u))^(1/5) with k = 4/3 E* sqrt(R/2), where YADE has R/2 at a wall
        stiffness = f"(2/3*contact['young']/(1 - contact['poisson']**2)*{(0.5 * RADIUS) ** 0.5})"
        back = yade.shoot(
            lines,
            shots.take(rows),
            physics="contactPhysics",
            law="Law2_ScGeom_MindlinPhys_Mindlin()",
            time=f"3.218*({_MASS}**2/{stiffness}**2/{speed})**0.2",
        )
        found[rows] = (
            np.column_stack([back.v_x, back.v_y, back.v_n, back.lateral, -back.spin, back.twist])
            * back.shots.speed[:, None]
        )
    return shots.rebounds(found[:, :3], found[:, 3:] / RADIUS)
