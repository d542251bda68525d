"""Simulators read the export as it is and rebound as it says; each is skipped where it does not run."""

from __future__ import annotations

import numpy as np
import pytest
from simulators.registry import SIMULATORS
from simulators.shots import Shots

from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import Conditions
from ifrfit.exporters.registry import EXPORTERS
from ifrfit.physics.closures import get_closure

ANGLES = [5.0, 20.0, 45.0, 75.0]
SPEED = 2.0
# of velocities over the incoming speed. LAMMPS, OpenFOAM, PyBullet: their law in double precision, and
# its steps. LIGGGHTS and YADE shorten the arm of friction by half of the overlap, which here is up to
# 0.023 and 0.0007 of the radius; v_x/u changes by less than half of that. Drake's friction is
# regularised below 1e-4 m/s.
TOLERANCES = {
    "lammps": 1e-4,
    "liggghts": 0.01,
    "yade": 1e-3,
    "openfoam": 1e-6,
    "pybullet": 1e-6,
    "drake": 3e-3,
}


def constants():
    return ExportedConstants(get_closure("fr"), 0.4, {"e_n": 0.9, "beta0": 0.4, "mu": 0.15})


def shot(target, approach=SPEED, changed=None):
    """The simulator's rebounds, and those of the law that the export states."""
    simulator = SIMULATORS[target]
    if not simulator.version():
        pytest.skip(f"{target} is not installed here")
    exporter = EXPORTERS[target]
    at = Conditions(40.0 if "angle" in exporter.takes else None, SPEED if "speed" in exporter.takes else None)
    found = exporter.translate(constants(), at)
    shots = Shots.over(ANGLES, [approach], [0.0] if target == "openfoam" else [-0.55, 0.0, 0.55])
    lines = list(found.lines) if changed is None else [line.replace(*changed) for line in found.lines]
    return simulator.shoot(lines, shots), found.response(shots.incidence)


# PyBullet and MuJoCo are themselves the law of their export
@pytest.mark.parametrize("target", ["lammps", "liggghts", "yade", "openfoam", "drake"])
def test_the_simulator_does_what_the_export_says(target):
    found, law = shot(target)
    # of a normal velocity: the clamp of YADE's contact ends it within its step of a 2000th
    np.testing.assert_allclose(found.v_n, law.v_n, atol=1e-4)
    np.testing.assert_allclose(found.v_x, law.v_x, atol=TOLERANCES[target])


@pytest.mark.parametrize("target", ["lammps", "liggghts", "yade", "openfoam", "drake"])
def test_another_friction_would_be_seen(target):
    said = {
        "lammps": (" 0.15 ", " 0.25 "),
        "liggghts": (" 0.15", " 0.25"),
        "yade": ("atan(0.15)", "atan(0.25)"),
        "openfoam": ("mu      0.", "mu      0.1"),
        "drake": (">0.15<", ">0.25<"),
    }
    found, law = shot(target, changed=said[target])
    assert np.max(np.abs(found.v_x - law.v_x)) > 5.0 * TOLERANCES[target]


@pytest.mark.parametrize("target", ["lammps", "liggghts", "yade"])
def test_the_law_of_soft_spheres_has_no_speed(target):
    """But for the shorter arm, whose overlap grows with the speed: half of it at half the speed, or less."""
    found, law = shot(target, approach=0.5)
    np.testing.assert_allclose(found.v_x, law.v_x, atol=TOLERANCES[target])


def test_bullet_stops_the_slip_and_no_more():
    """Brach's closure in single impacts, spins included."""
    found, _ = shot("pybullet")
    fitted = ExportedConstants(get_closure("f"), 0.4, {"e_n": 0.9, "mu": 0.15}).rebound(found.shots.incidence)
    np.testing.assert_allclose(found.v_n, fitted.v_n, atol=1e-6)
    np.testing.assert_allclose(found.v_x, fitted.v_x, atol=TOLERANCES["pybullet"])
    np.testing.assert_allclose(found.spin, fitted.spin_y, atol=3.0 * TOLERANCES["pybullet"])


def test_drakes_time_step_damps_in_proportion():
    """Of the first order: ten times as many steps, a tenth of the loss."""
    drake = SIMULATORS["drake"]
    if not drake.version():
        pytest.skip("drake is not installed here")
    lines = EXPORTERS["drake"].translate(constants(), Conditions(speed=SPEED)).lines
    head_on = Shots.over([0.0], [SPEED], [0.0])
    off = [drake.shoot(lines, head_on, time_step=drake.DURATION / n).v_n[0] - 0.9 for n in (100, 1000)]
    assert off[0] < 0.0
    assert off[0] / off[1] == pytest.approx(10.0, rel=0.1)
