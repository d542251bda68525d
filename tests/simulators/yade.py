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
for i, (v_x, v_z, *omega) in enumerate({rows}):
    k = O.bodies.append(sphere((0, {gap} * i, {radius} * 1.00001), {radius}, material='sphere'))
    O.bodies[k].state.vel = (v_x, 0, -v_z)
    O.bodies[k].state.angVel = omega
    spheres.append(k)
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb(), Bo1_Wall_Aabb()]),
    InteractionLoop([Ig2_Wall_Sphere_ScGeom()], [{physics}], [{law}]),
    NewtonIntegrator(damping=0, gravity=(0, 0, 0)),
]
O.dt = {time} / 2000
O.run(10000, True)
for k in spheres:
    s = O.bodies[k].state
    print('REBOUND', *(repr(x) for x in (s.pos[2], *s.vel, *s.angVel)))
"""


def version() -> str:
    """What runs here; empty without it."""
    if shutil.which("yade") is None:
        return ""
    said = subprocess.run(["yade", "--version"], capture_output=True, text=True, check=False)
    found = re.search(r"version: (\S+)", said.stdout + said.stderr)
    return found.group(1) if found else ""


def shoot(
    lines: Sequence[str],
    shots: Shots,
    *,
    physics: str = "Ip2_ViscElMat_ViscElMat_ViscElPhys()",
    law: str = "Law2_ScGeom_ViscElPhys_Basic()",
    time: str = "contact['tc']",
) -> Rebounds:
    """All at once, with the exported lines as they are, and the time that a contact takes, s."""
    rows = np.column_stack([shots.along, shots.approach, shots.omega]).tolist()
    text = "\n".join(lines) + _SCRIPT.format(
        rows=rows, gap=GAP, radius=RADIUS, physics=physics, law=law, time=time
    )
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "shoot.py").write_text(text, encoding="utf-8")
        run = subprocess.run(
            ["yade", "-n", "-x", "-j1", "shoot.py"], cwd=folder, capture_output=True, text=True, check=False
        )
    told = [line.split()[1:] for line in run.stdout.splitlines() if line.startswith("REBOUND")]
    if len(told) != shots.angle.size:
        raise RuntimeError(f"YADE stopped: {run.stdout[-2000:]}{run.stderr[-2000:]}")
    found = np.array(told, dtype=float)
    z, velocity, omega = found[:, 0], found[:, 1:4], found[:, 4:]
    if not ((z > RADIUS).all() and (velocity[:, 2] > 0.0).all()):
        raise RuntimeError("YADE: a sphere has not left the wall.")
    return shots.rebounds(velocity, omega)
