"""LIGGGHTS, of Debian's package liggghts, as a program of its own."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from simulators.shots import DENSITY, GAP, RADIUS, Rebounds, Shots


def version() -> str:
    """What runs here; empty without it."""
    if shutil.which("liggghts") is None:
        return ""
    # without "-log none" its help leaves a log.liggghts in the working directory
    call = ["liggghts", "-log", "none", "-help"]
    said = subprocess.run(call, capture_output=True, text=True, check=False).stdout
    found = re.search(r"Version LIGGGHTS-PUBLIC ([\d.]+)", said)
    return found.group(1) if found else ""


def shoot(lines: Sequence[str], shots: Shots) -> Rebounds:
    """All at once, with the exported lines as they are."""
    n = shots.angle.size
    rows = zip(shots.along, shots.approach, shots.omega, strict=True)
    text = "\n".join(
        [
            "units si",
            "atom_style granular",
            "atom_modify map array",
            "boundary f f f",
            "newton off",
            "communicate single vel yes",
            f"region box block -5 5 -1 {GAP * n + 1} -0.1 1 units box",
            "create_box 2 box",
            *(f"create_atoms 1 single 0 {GAP * i} {RADIUS * 1.00001} units box" for i in range(n)),
            f"set group all diameter {2 * RADIUS} density {DENSITY}",
            *(
                f"set atom {i} vx {x:.15g} vz {-z:.15g} omegax {w[0]:.15g} omegay {w[1]:.15g} "
                f"omegaz {w[2]:.15g}"
                for i, (x, z, w) in enumerate(rows, 1)
            ),
            *lines,
            "neighbor 0.01 bin",
            "neigh_modify delay 0",
            "fix move all nve/sphere",
            "timestep 5e-8",
            "thermo 1000000",
            "run 40000",
            "dump out all custom 1 out.txt id z vx vy vz omegax omegay omegaz",
            'dump_modify out sort id format "%d' + " %.15g" * 7 + '"',
            "run 0",
            "",
        ]
    )
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "in.txt").write_text(text, encoding="utf-8")
        run = subprocess.run(
            ["liggghts", "-in", "in.txt"], cwd=folder, capture_output=True, text=True, check=False
        )
        if run.returncode:
            raise RuntimeError(f"LIGGGHTS stopped: {run.stdout[-2000:]}{run.stderr[-2000:]}")
        found = np.loadtxt(Path(folder) / "out.txt", skiprows=9, ndmin=2)[:, 1:]
    z, velocity, omega = found[:, 0], found[:, 1:4], found[:, 4:]
    if (z < RADIUS).any() or (velocity[:, 2] < 0.0).any():
        raise RuntimeError("LIGGGHTS: a sphere has not left the wall.")
    return shots.rebounds(velocity, omega)
