"""Target pybullet: PyBullet itself reads the exported lines and is shot at."""

from __future__ import annotations

import numpy as np
import pytest
from refusals import refused

from ifrfit.errors import UsageError
from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import Conditions
from ifrfit.exporters.registry import EXPORTERS
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closures import get_closure


def constants(e_n=0.9, mu=0.1):
    return ExportedConstants(get_closure("f"), 0.4, {"e_n": e_n, "mu": mu})


def translated(speed=2.0, **changed):
    return EXPORTERS["pybullet"].translate(constants(**changed), Conditions(speed=speed))


def rebound_of_the_export(pybullet, lines, speed, radius=0.02):
    """Normal restitution of another sphere, in a world that ran the exported lines as they are."""
    pybullet.connect(pybullet.DIRECT)
    try:
        wall = pybullet.createMultiBody(0, pybullet.createCollisionShape(pybullet.GEOM_PLANE))
        shape = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=radius)
        sphere = pybullet.createMultiBody(0.3, shape, basePosition=[0, 0, radius + 0.1234])
        exec("\n".join(lines), {"pybullet": pybullet, "wall": wall, "sphere": sphere})
        pybullet.resetBaseVelocity(sphere, [0, 0, -speed], [0, 0, 0])
        for _ in range(400):
            pybullet.stepSimulation()
        return pybullet.getBaseVelocity(sphere)[0][2] / speed
    finally:
        pybullet.disconnect()


@pytest.mark.parametrize("e_n", [0.3, 0.7, 0.95])
@pytest.mark.parametrize("speed", [0.5, 3.0])
def test_what_comes_back_is_the_fitted_restitution(e_n, speed):
    pybullet = pytest.importorskip("pybullet")
    found = translated(speed, e_n=e_n)
    assert rebound_of_the_export(pybullet, found.lines, speed) == pytest.approx(e_n, rel=0.01)
    assert "time step: within 1 %" in found.mapping[0]


@pytest.mark.parametrize("speed", [0.5, 3.0, 100.0])
def test_it_is_closure_f(speed):
    """Friction that at most stops the contact point is Brach's closure, also beyond PyBullet's limit."""
    pytest.importorskip("pybullet")
    at = Incidence.of([5.0, 20.0, 50.0, 80.0], degrees=True)
    found, fitted = translated(speed).response(at), constants().rebound(at)
    np.testing.assert_allclose(found.v_x, fitted.v_x, atol=1e-6)
    np.testing.assert_allclose(found.v_n, fitted.v_n, atol=1e-6)


def test_oblique_restitution_is_said():
    pytest.importorskip("pybullet")
    said = translated(2.0).mapping[0]
    assert said.endswith("; in oblique impacts without spin, from 5 to 80 degrees, 0.9.")


def test_a_speed_is_needed():
    with refused(UsageError, r"name the normal speed of approach with --speed M_S"):
        EXPORTERS["pybullet"].translate(constants(), Conditions())
