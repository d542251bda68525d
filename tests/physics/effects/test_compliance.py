"""Tangential compliance: what surrounds the table of rebounds, with tables that are known exactly."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ifrfit.errors import DataError
from ifrfit.physics.compliance import law
from ifrfit.physics.effects import EFFECTS, Contact, compose, make_plan

COMPLIANCE = EFFECTS["compliance"]


@pytest.fixture
def stopping(monkeypatch):
    """A table in which every contact that does not slip throughout stops: closure F."""
    table = SimpleNamespace(beta=lambda psi, chi: np.zeros(np.broadcast_shapes(psi.shape, chi.shape)))
    monkeypatch.setattr(law, "compliance_table", lambda: table)


@pytest.mark.usefixtures("stopping")
@pytest.mark.parametrize("e_n", [1.0, 0.8, 0.0])
def test_gross_slip_is_coulomb_sliding_exactly(impacts, glass, e_n):
    some = impacts([75.0, 80.0, 85.0, 89.9999], 0.4, closure="f", constant=0.0, e_n=e_n)
    found = compose(glass, some, ["lateral-spin", "compliance"])
    sliding = compose(glass, some, ["lateral-spin"])
    assert not found.sticking.any()
    np.testing.assert_allclose(found.impulse_factor, sliding.impulse_factor, rtol=1e-13)


@pytest.mark.usefixtures("stopping")
def test_below_gross_slip_the_table_is_used(impacts, glass):
    found = compose(glass, impacts([0.0, 1.0, 20.0], constant=None), ["compliance"])
    assert found.sticking.all()
    np.testing.assert_allclose(found.contact_x, 0.0, atol=1e-16)


@pytest.mark.usefixtures("stopping")
def test_hard_cases_are_finite(impacts, glass):
    some = impacts([0.0, 45.0, 90.0], mu=[0.0, 1e-300, 0.0], constant=None)
    found = compose(glass, some, ["compliance"])
    for name in ("v_x", "spin_y", "impulse_factor"):
        assert np.isfinite(getattr(found, name)).all(), name
    for nu in (0.0, 0.5):
        contact = replace(glass, stiffness_ratio=2.0 * (1.0 - nu) / (2.0 - nu))
        assert COMPLIANCE.lacks(contact, some) == ""
        assert COMPLIANCE.criterion(contact, some, found, 1e-3).threshold == pytest.approx(
            7.0 * contact.stiffness_ratio - 1.0
        )


@pytest.mark.usefixtures("stopping")
def test_chi_beside_the_materials_or_instead(impacts, glass):
    bare = replace(glass, stiffness_ratio=None, modulus=None)
    assert COMPLIANCE.lacks(bare, impacts()).startswith("not given: Poisson's ratios")
    with_chi = impacts([30.0], constant=None, chi=1.75 * 2 * (1 - 0.222) / (2 - 0.222))
    assert COMPLIANCE.lacks(bare, with_chi) == ""
    one = compose(bare, with_chi, ["compliance"])
    two = compose(glass, impacts([30.0], constant=None), ["compliance"])
    np.testing.assert_allclose(one.v_x, two.v_x, rtol=1e-14)


@pytest.mark.usefixtures("stopping")
def test_impossible_chi_is_refused(impacts, glass):
    assert "lies outside" in COMPLIANCE.lacks(glass, impacts(chi=3.0))
    assert COMPLIANCE.lacks(glass, impacts(chi=1.5)) == ""


def test_near_the_normal_the_contact_point_does_not_spring_back(impacts, glass):
    """Maw, Barber & Fawcett at nu = 0.3: beta is negative below psi_1 = 0.85 and 0.46 at psi_1 = 2.6."""
    stiffness = 2.0 * (1.0 - 0.3) / (2.0 - 0.3)
    contact = replace(glass, stiffness_ratio=stiffness)
    tau = np.array([0.1, 2.6]) * 0.1 / stiffness
    some = impacts(np.degrees(np.arctan(tau)), mu=0.1, e_n=1.0, constant=None)
    found = compose(contact, some, ["compliance"])
    np.testing.assert_allclose(found.beta, [-0.206, 0.467], atol=3e-3)


@pytest.mark.usefixtures("stopping")
def test_without_a_constant_it_is_on_and_with_one_it_only_warns(impacts, glass):
    near = {"gamma": [1.0, 20.0], "e_n": 0.95}
    bare = make_plan(
        glass, impacts(**near, constant=None), ("beta",), accuracy=1e-3, given={"e_n": "constants.e_n"}
    )
    assert "compliance" in bare.on
    given = {"e_n": "constants.e_n", "tangential": "constants.e_t"}
    held = make_plan(glass, impacts(**near), ("beta",), accuracy=1e-3, given=given)
    found = next(line for line in held.lines if line.effect == "compliance")
    assert found.state == "constant"
    assert found.alarm
    assert found.change == pytest.approx(0.45, abs=0.01)  # 7/5 - 0.95 against 0
    assert found.reason == "constants.e_t is given and stays; remove constants.e_t to compute it"
    listed = {"requested": ("compliance",), "accuracy": 1e-3}
    with pytest.raises(DataError, match=r"lists compliance, which computes what constants\.e_t gives"):
        make_plan(glass, impacts(**near), ("beta",), given=given, **listed)


def test_without_either_the_scene_is_refused(impacts):
    with pytest.raises(DataError, match=r"constants\.e_t is missing, and compliance cannot .* Poisson's"):
        make_plan(
            Contact(),
            impacts(constant=None),
            ("beta",),
            accuracy=1e-3,
            given={"e_n": "constants.e_n"},
        )
