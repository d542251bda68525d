"""Simulators that tests and the script of docs/simulators can run, by the name of their export target."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from simulators import drake, lammps, liggghts, mujoco, openfoam, pybullet, yade, yade_mindlin
from simulators.shots import Rebounds, Shots


class Simulator(Protocol):
    """A module with two functions."""

    def version(self) -> str:
        """What runs here; empty without it."""
        ...

    def shoot(self, lines: Sequence[str], shots: Shots) -> Rebounds:
        """Rebounds with the exported lines as they are."""
        ...


SIMULATORS: dict[str, Simulator] = {
    "lammps": lammps,
    "liggghts": liggghts,
    "yade": yade,
    "yade-mindlin": yade_mindlin,
    "openfoam": openfoam,
    "mujoco": mujoco,
    "pybullet": pybullet,
    "drake": drake,
}
