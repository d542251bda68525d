"""Simulators read the export as it is and rebound as it says; each is skipped where it does not run."""

from __future__ import annotations

from functools import cache

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
# 0.023 and 0.0007 (MindlinPhys: 0.004) of the radius; v_x/u changes by less than half of that, and by steps.
# Drake's friction is regularised below 1e-4 m/s.
TOLERANCES = {
    "lammps": 1e-4,
    "liggghts": 0.01,
    "yade": 1e-3,
    "yade-mindlin": 3e-3,
    "openfoam": 1e-6,
    "pybullet": 1e-6,
    "drake": 3e-3,
}


def constants():
    return ExportedConstants(get_closure("fr"), 0.4, {"e_n": 0.9, "beta0": 0.4, "mu": 0.15})


@cache
def translated(target):
    """What is exported of the constants, which each test reads and none changes."""
    exporter = EXPORTERS[target]
    at = Conditions(40.0 if "angle" in exporter.takes else None, SPEED if "speed" in exporter.takes else None)
    return exporter.translate(constants(), at)


def shot(target, approach=SPEED, changed=None, laterals=(0.0,), twists=(0.0,)):
    """The simulator's rebounds, and those of the law that the export states."""
    simulator = SIMULATORS[target]
    if not simulator.version():
        pytest.skip(f"{target} is not installed here")
    found = translated(target)
    spins = [0.0] if target == "openfoam" else [-0.55, 0.0, 0.55]
    shots = Shots.over(ANGLES, [approach], spins, laterals, twists)
    lines = list(found.lines) if changed is None else [line.replace(*changed) for line in found.lines]
    return simulator.shoot(lines, shots), found.response(shots.incidence)


# PyBullet and MuJoCo are themselves the law of their export
@pytest.mark.parametrize("target", ["lammps", "liggghts", "yade", "yade-mindlin", "openfoam", "drake"])
def test_the_simulator_does_what_the_export_says(target):
    found, law = shot(target)
    # of a normal velocity: the clamp of YADE's contact ends it within its step of a 2000th
    np.testing.assert_allclose(found.v_n, law.v_n, atol=1e-4)
    np.testing.assert_allclose(found.v_x, law.v_x, atol=TOLERANCES[target])


@pytest.mark.parametrize("target", ["lammps", "liggghts", "yade", "yade-mindlin", "openfoam", "drake"])
def test_another_friction_would_be_seen(target):
    said = {
        "lammps": (" 0.15 ", " 0.25 "),
        "liggghts": (" 0.15", " 0.25"),
        "yade": ("atan(0.15)", "atan(0.25)"),
        "yade-mindlin": ("atan(0.15)", "atan(0.25)"),
        "openfoam": ("mu      0.", "mu      0.1"),
        "drake": (">0.15<", ">0.25<"),
    }
    found, law = shot(target, changed=said[target])
    assert np.max(np.abs(found.v_x - law.v_x)) > 5.0 * TOLERANCES[target]


@pytest.mark.parametrize("target", ["lammps", "liggghts", "yade", "yade-mindlin"])
def test_the_law_of_soft_spheres_has_no_speed(target):
    """But for the shorter arm, whose overlap grows with the speed: half of it at half the speed, or less."""
    found, law = shot(target, approach=0.5)
    np.testing.assert_allclose(found.v_x, law.v_x, atol=TOLERANCES[target])


def across(law, shots):
    """Velocity across the plane of motion, and the spin about x, of a law whose beta is given."""
    push = (2.0 / 7.0) * (1.0 + law.beta) * shots.incidence.slip_y
    return -push, shots.lateral - 2.5 * push


@pytest.mark.parametrize("target", ["lammps", "liggghts", "yade", "yade-mindlin", "drake"])
def test_a_spin_along_the_motion_pushes_across_it(target):
    """As the vector of the slip says: spins about x and y together, in the codes' own three dimensions."""
    found, law = shot(target, laterals=[-0.4, 0.4])
    v_y, lateral = across(law, found.shots)
    np.testing.assert_allclose(found.v_n, law.v_n, atol=1e-4)
    np.testing.assert_allclose(found.v_x, law.v_x, atol=TOLERANCES[target])
    np.testing.assert_allclose(found.v_y, v_y, atol=TOLERANCES[target])
    np.testing.assert_allclose(found.lateral, lateral, atol=3.0 * TOLERANCES[target])
    assert np.max(np.abs(v_y)) > 10.0 * TOLERANCES[target]


@pytest.mark.parametrize(
    "target", ["lammps", "liggghts", "yade", "yade-mindlin", "mujoco", "pybullet", "drake"]
)
def test_a_spin_about_the_normal_changes_nothing(target):
    """It moves no contact point; YADE turns its spring by it for as long as a contact lasts."""
    found, _ = shot(target, twists=[0.0, 0.5])
    still, twisted = (getattr(found, name).reshape(-1, 2).T for name in ("v_x", "v_n"))
    for pair in (still, twisted):
        np.testing.assert_allclose(pair[1], pair[0], atol=1e-3)
    np.testing.assert_allclose(found.twist, found.shots.twist, atol=1e-6)


def test_asking_for_a_version_leaves_no_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for simulator in SIMULATORS.values():
        simulator.version()
    assert list(tmp_path.iterdir()) == []


def test_bullet_stops_the_slip_and_no_more():
    """Brach's closure in single impacts, spins about x and y included."""
    found, _ = shot("pybullet", laterals=[0.0, 0.4])
    fitted = ExportedConstants(get_closure("f"), 0.4, {"e_n": 0.9, "mu": 0.15}).rebound(found.shots.incidence)
    np.testing.assert_allclose(found.v_n, fitted.v_n, atol=1e-6)
    np.testing.assert_allclose(found.v_x, fitted.v_x, atol=TOLERANCES["pybullet"])
    np.testing.assert_allclose(found.v_y, fitted.v_y, atol=TOLERANCES["pybullet"])
    np.testing.assert_allclose(found.spin, fitted.spin_y, atol=3.0 * TOLERANCES["pybullet"])
    np.testing.assert_allclose(found.lateral, fitted.spin_x, atol=3.0 * TOLERANCES["pybullet"])


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
