"""YADE, of Debian's package yade, which runs a script by its own Python."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from simulators.shots import GAP, RADIUS, Rebounds, Shots

_SCRIPT = """
O.bodies.append(wall((0, 0, 0), axis=2, material='wall'))
spheres = []
for i, (v_x, v_z, omega) in enumerate({rows}):
    k = O.bodies.append(sphere((0, {gap} * i, {radius} * 1.00001), {radius}, material='sphere'))
    O.bodies[k].state.vel = (v_x, 0, -v_z)
    O.bodies[k].state.angVel = (0, omega, 0)
    spheres.append(k)
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb(), Bo1_Wall_Aabb()]),
    InteractionLoop(
        [Ig2_Wall_Sphere_ScGeom()], [Ip2_ViscElMat_ViscElMat_ViscElPhys()], [Law2_ScGeom_ViscElPhys_Basic()]
    ),
    NewtonIntegrator(damping=0, gravity=(0, 0, 0)),
]
O.dt = contact['tc'] / 2000
O.run(10000, True)
for k in spheres:
    s = O.bodies[k].state
    print('REBOUND', repr(s.pos[2]), repr(s.vel[0]), repr(s.vel[2]), repr(s.angVel[1]))
"""


def version() -> str:
    """What runs here; empty without it."""
    if shutil.which("yade") is None:
        return ""
    said = subprocess.run(["yade", "--version"], capture_output=True, text=True, check=False)
    found = re.search(r"version: (\S+)", said.stdout + said.stderr)
    return found.group(1) if found else ""


def shoot(lines: Sequence[str], shots: Shots) -> Rebounds:
    """All at once, with the exported lines as they are."""
    rows = np.column_stack([shots.along, shots.approach, shots.omega]).tolist()
    text = "\n".join(lines) + _SCRIPT.format(rows=rows, gap=GAP, radius=RADIUS)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "shoot.py").write_text(text, encoding="utf-8")
        run = subprocess.run(
            ["yade", "-n", "-x", "-j1", "shoot.py"], cwd=folder, capture_output=True, text=True, check=False
        )
    told = [line.split()[1:] for line in run.stdout.splitlines() if line.startswith("REBOUND")]
    if len(told) != shots.angle.size:
        raise RuntimeError(f"YADE stopped: {run.stdout[-2000:]}{run.stderr[-2000:]}")
    z, v_x, v_z, omega = np.array(told, dtype=float).T
    if (z < RADIUS).any() or (v_z < 0.0).any():
        raise RuntimeError("YADE: a sphere has not left the wall.")
    return shots.rebounds(v_x, v_z, omega)
