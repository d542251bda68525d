"""Target chrono: its documented form, and the cone complementarity problem against its own fixed point."""

from __future__ import annotations

import re

import numpy as np
import pytest
from refusals import refused

from ifrfit.errors import UsageError
from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import Conditions
from ifrfit.exporters.registry import EXPORTERS
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closures import get_closure


def translated(e_n=0.8, mu=0.2, j=0.4, speed=None):
    given = ExportedConstants(get_closure("fr"), j, {"e_n": e_n, "beta0": 0.4, "mu": mu})
    return EXPORTERS["chrono"].translate(given, Conditions(speed=speed))


def projected(e_n, mu, j, u_n, slip):
    """Normal and tangential impulse per mass by projection onto the friction cone, until nothing changes."""
    normal, push = 0.0, 0.0
    for _ in range(20000):
        p = normal - 0.1 * (normal - u_n - e_n * u_n)
        q = push - 0.1 * ((1.0 + 1.0 / j) * push - slip)
        if abs(q) <= mu * p:
            normal, push = p, q
        else:
            normal = max((mu * abs(q) + p) / (1.0 + mu**2), 0.0)
            push = np.copysign(mu * normal, q)
    return normal, push


@pytest.mark.parametrize("j", [0.4, 2.0 / 3.0])
@pytest.mark.parametrize(("angle", "spin"), [(5.0, 0.0), (20.0, -0.55), (50.0, 0.0), (75.0, 0.55)])
def test_the_law_is_the_fixed_point_of_the_projection(angle, spin, j):
    at = Incidence.of([angle], 0.0, [spin], degrees=True)
    normal, push = projected(0.8, 0.2, j, at.cosine[0], at.slip_x[0])
    law = translated(j=j).response(at)
    assert law.v_n[0] == pytest.approx(normal - at.cosine[0], abs=1e-9)
    assert law.v_x[0] == pytest.approx(at.sine[0] - push, abs=1e-9)
    after = at.slip_x[0] - (1.0 + 1.0 / j) * push
    assert law.beta[0] == pytest.approx(-after / at.slip_x[0], abs=1e-9)


def test_the_text_has_the_documented_form():
    text = "\n".join(translated().lines)
    assert "make_shared<ChContactMaterialNSC>();" in text
    assert re.search(r"^material->SetRestitution\(0\.8\);$", text, re.MULTILINE)
    assert re.search(r"^material->SetFriction\(0\.2\);$", text, re.MULTILINE)


def test_what_does_not_bounce_is_refused():
    with refused(UsageError, r"--speed 0\.1: Chrono lets nothing bounce off below 0\.15 m/s by default"):
        translated(speed=0.1)
    assert translated(speed=1.0).lines
