"""Adhesion: the work of separation, the sticking speed, capture."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from ifrfit.physics.effects import EFFECTS, compose
from ifrfit.physics.effects.adhesion import SEPARATION, sticking_speed
from ifrfit.physics.effects.plasticity import restitution, unloading_radius, yield_speed


def test_work_of_separation_is_the_integral_of_the_force():
    """Johnson-Kendall-Roberts with E* = R = Gamma = 1: from no overlap to where the overlap turns."""

    def power(a: float) -> float:
        force = 4.0 / 3.0 * a**3 - math.sqrt(8.0 * math.pi * a**3)
        return force * (2.0 * a - math.sqrt(math.pi / (2.0 * a)))

    start, end = (2.0 * math.pi) ** (1.0 / 3.0), (math.pi / 8.0) ** (1.0 / 3.0)
    assert quad(power, start, end)[0] == pytest.approx(SEPARATION, abs=1e-4)


def test_sticking_speed_of_a_sphere_on_a_plane(glass):
    """V_s = 1.840 [(Gamma/R)^5/(rho^3 E*^2)]^(1/6)."""
    radius = np.array([1e-9, 2.5e-6, 1.0])
    expected = 1.840 * ((0.1 / radius) ** 5 / (2563.0**3 * 38.3e9**2)) ** (1.0 / 6.0)
    np.testing.assert_allclose(sticking_speed(glass, radius), expected, rtol=1e-3)


def test_elastic_sphere_follows_the_closed_form(impacts, glass):
    v_s = float(sticking_speed(glass, np.array([2.5e-6]))[0])
    ratio = np.array([1.0001, 1.5, 3.0, 15.0, 1e6])
    found = compose(glass, impacts(0.0, speed=v_s * ratio, radius=2.5e-6, e_n=1.0), ["adhesion"])
    np.testing.assert_allclose(found.e_n, np.sqrt(1.0 - 1.0 / ratio**2), rtol=1e-10)
    assert not found.captured.any()


def test_just_below_it_is_captured_and_just_above_it_is_not(impacts, glass):
    v_s = float(sticking_speed(glass, np.array([2.5e-6]))[0])
    speed = v_s * np.array([1.0 - 1e-9, 1.0 + 1e-9])
    found = compose(glass, impacts(0.0, speed=speed, radius=2.5e-6, e_n=1.0), ["adhesion"])
    assert list(found.captured) == [True, False]
    assert found.v_n[0] == 0.0
    assert 0.0 < found.e_n[1] < 1e-4


def test_grazing_impacts_do_not_approach_and_are_not_captured(impacts, glass):
    found = compose(glass, impacts([90.0], speed=1e-3, radius=2.5e-6), ["adhesion"])
    assert not found.captured.any()
    assert EFFECTS["adhesion"].criterion(glass, impacts([90.0]), found, 1e-3).value == 0.0


def test_after_yield_it_acts_with_the_radius_of_unloading(impacts, glass):
    speed, radius = 100.0, 5e-8
    ratio = yield_speed(glass, np.array([radius])) / speed
    e_c, factor = restitution(ratio), unloading_radius(ratio) ** (4.0 / 3.0)
    expected = np.sqrt(e_c**2 - factor * (sticking_speed(glass, np.array([radius])) / speed) ** 2)
    found = compose(glass, impacts(0.0, speed=speed, radius=radius), ["plasticity", "adhesion"])
    np.testing.assert_allclose(found.e_n, expected, rtol=1e-10)


@given(st.floats(1e-9, 1.0), st.floats(1e-9, 1e150), st.floats(0.0, 1.0), st.floats(0.0, 1e3), st.booleans())
@settings(max_examples=100, deadline=None)
def test_it_only_ever_takes(impacts, glass, radius, speed, e_n, energy, yields):
    contact = glass.with_numbers(interface_energy=energy)
    some = impacts([0.0, 60.0, 90.0], speed=speed, radius=radius, e_n=e_n)
    before = ["plasticity"] if yields else []
    with_it, without = compose(contact, some, [*before, "adhesion"]), compose(contact, some, before)
    assert (with_it.e_n <= without.e_n).all()
    assert (with_it.e_n >= 0.0).all()
    assert (with_it.v_n[with_it.captured] == 0.0).all()
    if energy == 0.0:
        np.testing.assert_allclose(with_it.e_n, without.e_n, rtol=1e-14)
        assert not with_it.captured.any()


def test_remark_for_small_and_stiff_bodies(impacts, glass):
    effect = EFFECTS["adhesion"]
    assert "Tabor's number" in effect.validity(glass, impacts(radius=1e-9)).words
    assert effect.validity(replace(glass, modulus=1e6), impacts(radius=1e-3)).words == ""
