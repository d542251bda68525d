"""Target mujoco: inverted by simulation; here MuJoCo reads the export itself and is shot at."""

from __future__ import annotations

import builtins
import re

import numpy as np
import pytest
from refusals import refused

from ifrfit.errors import UsageError
from ifrfit.exporters.comment_block import residual_words
from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import Conditions
from ifrfit.exporters.registry import EXPORTERS
from ifrfit.physics.closures import get_closure


def constants(e_n=0.9, mu=0.1):
    return ExportedConstants(get_closure("fr"), 0.4, {"e_n": e_n, "beta0": 0.4, "mu": mu})


def translated(speed=2.0, **changed):
    return EXPORTERS["mujoco"].translate(constants(**changed), Conditions(speed=speed))


def rebound_of_the_export(mujoco, lines, speed, radius=0.02, mass=0.3):
    """Normal restitution of another sphere, by a model that holds the exported lines as they are."""
    option = re.search(r"within option: (.*) -->", lines[0]).group(1)
    pair = "\n".join(lines[1:])
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option gravity="0 0 0" {option}/><worldbody>
        <geom name="wall" type="plane" size="1 1 1"/>
        <body><freejoint/><geom name="sphere" type="sphere" size="{radius}" mass="{mass}"/></body>
        </worldbody>{pair}</mujoco>"""
    )
    data = mujoco.MjData(model)
    data.qpos[2], data.qvel[2] = radius + 1.234e-3, -speed
    for _ in range(4000):
        mujoco.mj_step(model, data)
    return data.qvel[2] / speed


@pytest.mark.parametrize("e_n", [0.5, 0.7, 0.95])
@pytest.mark.parametrize("speed", [0.5, 3.0])
def test_what_comes_back_is_the_fitted_restitution(e_n, speed):
    mujoco = pytest.importorskip("mujoco")
    found = translated(speed, e_n=e_n)
    assert rebound_of_the_export(mujoco, list(found.lines), speed) == pytest.approx(e_n, rel=0.01)
    assert "within 1 %" in found.mapping[0]
    assert "NOT" not in found.mapping[0]
    assert found.ran == f"MuJoCo {mujoco.__version__}"


def test_oblique_restitution_is_said_as_it_comes_back():
    pytest.importorskip("mujoco")
    from ifrfit.physics.angles import Incidence

    found = translated(2.0, mu=0.5)
    at = Incidence.of(found.angles, degrees=True)
    back = found.response(at).v_n / at.cosine
    low = int(np.argmin(back))
    assert back[low] < 0.8  # friction takes much from it
    assert f"from 5 to 80 degrees, {back[low]:.4g} ({found.angles[low]:g} degrees) to" in found.mapping[0]


def test_what_cannot_come_back_is_said():
    pytest.importorskip("mujoco")
    said = translated(2.0, e_n=0.0).mapping[0]
    assert "NOT within 1 %: take what came back" in said


def test_the_residual_is_run():
    pytest.importorskip("mujoco")
    said = residual_words(constants(), translated())
    assert said.startswith("Residual of the target's law (run) against the fitted curve, without spin, at 9")


def test_sliding_is_coulombs():
    pytest.importorskip("mujoco")
    from ifrfit.physics.angles import Incidence

    at = Incidence.of([70.0, 80.0], degrees=True)
    np.testing.assert_allclose(translated().response(at).v_x, constants().rebound(at).v_x, atol=0.01)


def test_a_speed_is_needed():
    with refused(UsageError, r"found at one: name the normal speed of approach with --speed M_S"):
        EXPORTERS["mujoco"].translate(constants(), Conditions())


def test_without_mujoco_the_remedy_is_said(monkeypatch):
    real = builtins.__import__

    def absent(name, *rest):
        if name == "mujoco":
            raise ImportError(name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", absent)
    with refused(UsageError, "MuJoCo, which is not installed: 'pip install mujoco'"):
        translated()
