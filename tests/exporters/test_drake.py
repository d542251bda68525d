"""Target drake: the dissipation against an impact that is integrated step by step."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from refusals import refused
from scipy.integrate import solve_ivp

from ifrfit.errors import UsageError
from ifrfit.exporters.drake import reduced_dissipation, restitution
from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import Conditions
from ifrfit.exporters.registry import EXPORTERS
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closures import get_closure


def constants(j=0.4, **changed):
    values = {"e_n": 0.9, "beta0": 0.4, "mu": 0.1} | changed
    return ExportedConstants(get_closure("fr"), j, values)


def translated(speed=2.0, **changed):
    return EXPORTERS["drake"].translate(constants(**changed), Conditions(speed=speed))


def written(found):
    """The numbers in the exported text, by their names."""
    text = "\n".join(found.lines)
    top = ET.fromstring(f'<collision xmlns:drake="d">{text}</collision>')
    return {each.tag.removeprefix("{d}"): float(each.text) for each in top[0]}


def integrated(d, speed, stiffness, mass):
    """Restitution of f = k x (1 + d x') from contact to contact."""

    def leaves(t, y):
        return y[0]

    leaves.terminal, leaves.direction = True, -1.0
    found = solve_ivp(
        lambda t, y: [y[1], -stiffness / mass * y[0] * (1.0 + d * y[1])],
        (0.0, 100.0 * np.sqrt(mass / stiffness)), [0.0, speed], events=leaves, rtol=1e-11, atol=1e-14,
    )  # fmt: skip
    return -found.y_events[0][0][1] / speed


@pytest.mark.parametrize("e_n", [0.2, 0.5, 0.9, 0.99])
@pytest.mark.parametrize(("speed", "stiffness", "mass"), [(2.0, 1.0, 1.0), (0.3, 50.0, 0.2)])
def test_the_dissipation_gives_the_restitution(e_n, speed, stiffness, mass):
    d = written(translated(speed, e_n=e_n))["hunt_crossley_dissipation"]
    assert integrated(d, speed, stiffness, mass) == pytest.approx(e_n, abs=1e-7)


def test_other_speeds_are_said():
    found = translated(2.0, e_n=0.8)
    d = written(found)["hunt_crossley_dissipation"]
    slower, faster = (integrated(d, speed, 1.0, 1.0) for speed in (1.0, 4.0))
    assert f"{slower:.4g} at half that normal speed, {faster:.4g} at twice" in found.mapping[0]


@pytest.mark.parametrize("e", [1e-6, 0.01, 0.03, 0.3, 0.999, 0.9999999])
def test_there_and_back(e):
    assert restitution(reduced_dissipation(e)) == pytest.approx(e, rel=1e-9, abs=1e-10)


def test_friction_stops_the_contact_point_also_of_a_shell():
    found = translated(j=2.0 / 3.0)
    at = Incidence.of([5.0, 60.0], degrees=True)
    state = ExportedConstants(get_closure("f"), 2.0 / 3.0, {"e_n": 0.9, "mu": 0.1}).rebound(at)
    np.testing.assert_allclose(found.response(at).v_x, state.v_x)
    assert written(found)["mu_dynamic"] == written(found)["mu_static"] == 0.1


def test_refusals():
    with refused(UsageError, r"found at one: name the normal speed of approach with --speed M_S"):
        EXPORTERS["drake"].translate(constants(), Conditions())
    with refused(UsageError, r"Drake takes a normal restitution above 0 "):
        translated(e_n=0.0)
