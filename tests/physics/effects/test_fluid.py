"""Ambient fluid: the law against what its sources report, and where it is refused."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from ifrfit.physics.effects import EFFECTS, Contact, Fluid, compose
from ifrfit.physics.effects.fluid import stokes, wet_over_dry

FLUID = EFFECTS["fluid"]


def test_against_what_the_experiments_report():
    """Joseph et al. (2001): no rebound up to St = 10, dry values above about 500; within 2 % at 2000."""
    assert float(wet_over_dry(np.array(10.0))) == 0.0
    assert float(wet_over_dry(np.array(500.0))) > 0.9
    assert 0.98 < float(wet_over_dry(np.array(2000.0))) < 0.99
    assert float(wet_over_dry(np.array(np.inf))) == 1.0
    assert (np.diff(wet_over_dry(np.logspace(-6, 12, 500))) >= 0.0).all()


def test_stokes_number_of_a_homogeneous_sphere(impacts, glass):
    """rho D V/(9 eta)."""
    found = stokes(glass, impacts([60.0], speed=0.5, radius=1.5e-3))
    assert found[0] == pytest.approx(2563.0 * 3e-3 * 0.25 / (9.0 * 1e-3), rel=1e-12)


def test_a_hollow_ball_counts_by_its_mass(impacts):
    ball = Contact(inertia_factor=2.0 / 3.0, mass=2.7e-3, fluid=Fluid("water", 1e-3))
    assert FLUID.lacks(ball, impacts()) == ""
    found = stokes(ball, impacts([0.0], speed=1.0, radius=0.02))
    assert found[0] == pytest.approx(2.7e-3 / (6.0 * math.pi * 1e-3 * 4e-4), rel=1e-12)


def test_it_damps_the_normal_motion_only(impacts, glass):
    some = impacts([0.0, 50.0], speed=0.5, radius=1.5e-3)
    wet, dry = compose(glass, some, ["fluid"]), compose(glass, some, [])
    factor = wet_over_dry(stokes(glass, some))
    np.testing.assert_allclose(wet.v_n, dry.v_n * factor, rtol=1e-15)
    np.testing.assert_allclose(wet.e_n, dry.e_n * factor, rtol=1e-15)
    np.testing.assert_array_equal(wet.v_x, dry.v_x)
    np.testing.assert_array_equal(wet.spin_y, dry.spin_y)


def test_a_slow_sphere_stays_at_the_wall(impacts, glass):
    found = compose(glass, impacts([0.0, 90.0], speed=1e-4, radius=1e-3), ["fluid"])
    assert list(found.captured) == [True, False]
    assert found.v_n[0] == 0.0


def test_refused_in_a_gas_in_words(impacts, glass):
    air = replace(glass, fluid=Fluid("air", 1.81e-5, 66e-9))
    said = FLUID.validity(air, impacts())
    assert not said.holds
    assert "liquids" in said.words
    assert "66 nm" in said.words


def test_remark_where_friction_suffers_too(impacts, glass):
    assert "mu must be" in FLUID.validity(glass, impacts(speed=0.5)).words
    assert FLUID.validity(glass, impacts([0.0], speed=50.0, radius=5e-3)).words == ""


def test_number_is_the_smallest_of_those_that_approach(impacts, glass):
    some = impacts([0.0, 60.0, 90.0])
    found = FLUID.criterion(glass, some, compose(glass, some, []), 1e-3)
    assert found.value == pytest.approx(float(stokes(glass, some)[1]))
    assert found.threshold == pytest.approx(3.5e4)
    assert found.met
