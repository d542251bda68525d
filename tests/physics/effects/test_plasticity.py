"""Elastic-plastic restitution against its own force law, integrated."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import brentq

from ifrfit.physics.effects import EFFECTS, compose
from ifrfit.physics.effects.plasticity import restitution, unloading_radius, yield_speed


def integrated(speed_ratio: float) -> tuple[float, float]:
    """e and R_p/R at V/V_y in units E* = R = p_y = 1, from work of loading and unloading."""
    a_y = math.pi / 2.0  # Hertz: p_0 = 2 E* a/(pi R) = p_y
    d_y, f_y = a_y**2, 4.0 / 3.0 * a_y**3

    def load(d: float) -> float:
        return 4.0 / 3.0 * d**1.5 if d <= d_y else f_y + math.pi * (d - d_y)

    def work(d: float) -> float:
        return quad(load, 0.0, min(d, d_y))[0] + (quad(load, d_y, d)[0] if d > d_y else 0.0)

    wanted = work(d_y) * speed_ratio**2
    most = brentq(lambda d: work(d) - wanted, 0.5 * d_y, 10.0 * d_y * (1.0 + speed_ratio))
    a, force = math.sqrt(most), load(most)
    radius = 4.0 * a**3 / (3.0 * force)  # of Hertz unloading from this contact and load
    return math.sqrt(0.4 * force * a**2 / radius / wanted), radius


@pytest.mark.parametrize("speed", [1.0, 1.01, 1.5, 3.0, 10.0, 100.0])
def test_closed_form_is_the_integral(speed):
    e, radius = integrated(speed)
    assert float(restitution(np.array(1.0 / speed))) == pytest.approx(e, abs=1e-6)
    assert float(unloading_radius(np.array(1.0 / speed))) == pytest.approx(radius, rel=1e-6)


def test_yield_speed_of_a_sphere_on_a_plane(glass):
    """V_y = 1.5605 (p_y^5/(E*^4 rho))^(1/2), whatever the size."""
    expected = 1.5605 * math.sqrt(5.6e9**5 / (38.3e9**4 * 2563.0))
    np.testing.assert_allclose(yield_speed(glass, np.array([1e-9, 1e-3, 1.0])), expected, rtol=1e-4)


def test_reaches_the_pressure_just_there(glass):
    """Hertz' largest pressure at V_y is p_y."""
    r = 1e-3
    mass, v = float(glass.masses(np.array([r]))[0]), float(yield_speed(glass, np.array([r]))[0])
    overlap = (15.0 * mass * v**2 / (16.0 * 38.3e9 * math.sqrt(r))) ** 0.4
    assert 2.0 * 38.3e9 / math.pi * math.sqrt(overlap / r) == pytest.approx(5.6e9, rel=1e-12)


@pytest.mark.parametrize("ratio", [1.0 - 1e-12, 1.0, 1.0 + 1e-12])
def test_continuous_at_the_yield_speed(ratio):
    assert float(restitution(np.array(ratio))) == pytest.approx(1.0, abs=1e-11)
    assert float(unloading_radius(np.array(ratio))) == pytest.approx(1.0, abs=1e-11)


def test_far_beyond_yield_it_falls_with_a_quarter_power():
    ratio = np.logspace(-300, -4, 100)
    np.testing.assert_allclose(restitution(ratio), 1.1854 * ratio**0.25, rtol=1e-2)
    assert np.isfinite(unloading_radius(np.logspace(-320, 0, 100))).all()


@given(st.floats(1e-9, 1.0), st.floats(1e-9, 1e150))
@settings(max_examples=80, deadline=None)
def test_between_zero_and_one_at_any_size_and_speed(impacts, glass, radius, speed):
    e_n = compose(glass, impacts([0.0, 45.0, 90.0], speed=speed, radius=radius), ["plasticity"]).e_n
    assert ((e_n >= 0.0) & (e_n <= 1.0)).all()
    assert e_n[2] == 1.0  # at grazing incidence nothing yields


def test_remark_where_flow_is_fast(impacts, glass):
    effect = EFFECTS["plasticity"]
    assert effect.validity(glass, impacts(speed=10.0)).words == ""
    assert "not quasi-static" in effect.validity(glass, impacts(speed=100.0)).words
    assert effect.lacks(glass.with_numbers(limiting_pressure=None), impacts()).startswith(
        "not given: contact.limiting"
    )
