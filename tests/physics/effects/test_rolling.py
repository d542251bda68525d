"""Rolling friction: our own couple, and what it does to the balance of angular momentum."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ifrfit.physics.effects import EFFECTS, Contact, compose

ON = ["lateral-spin", "rolling"]


def test_angular_momentum_about_the_contact_changes_by_the_couple(impacts, glass):
    """v_t - J R Omega, kept by every closure, grows by mu_r (1 + e_n) u_n along the spin."""
    some = impacts([20.0, 50.0, 70.0], 0.3, 0.2)
    out, plain = compose(glass, some, ON), compose(glass, some, ["lateral-spin"])
    spin = np.hypot(plain.spin_x, plain.spin_y)
    couple = 1e-3 * 1.9 * some.incidence.cosine
    for velocity, axis, other in (("v_x", "spin_y", "spin_y"), ("v_y", "spin_x", "spin_x")):
        kept = getattr(out, velocity) - 0.4 * getattr(out, axis)
        before = getattr(plain, velocity) - 0.4 * getattr(plain, axis)
        np.testing.assert_allclose(kept - before, couple * getattr(plain, other) / spin, atol=1e-15)


def test_it_never_reverses_the_spin(impacts, glass):
    strong = glass.with_numbers(rolling_friction=10.0)
    out = compose(strong, impacts([5.0, 60.0], 0.1, -0.3), ON)
    assert (out.spin_x == 0.0).all()
    assert (out.spin_y == 0.0).all()


@given(
    st.floats(0.0, 90.0),
    st.floats(-5.0, 5.0),
    st.floats(-5.0, 5.0),
    st.floats(0.0, 10.0),
    st.floats(0.0, 1.0),
    st.sampled_from([0.4, 2.0 / 3.0, 0.5]),
)
@settings(max_examples=120, deadline=None)
def test_energy_is_that_of_the_velocities_and_falls(impacts, gamma, s_x, s_y, mu_r, e_n, j):
    contact = Contact(inertia_factor=j).with_numbers(rolling_friction=mu_r)
    some = impacts([gamma], s_x, s_y, e_n=e_n, constant=-0.9)
    out, plain = compose(contact, some, ON), compose(contact, some, ["lateral-spin"])
    after = out.v_x**2 + out.v_y**2 + out.v_n**2 + j * (out.spin_x**2 + out.spin_y**2)
    expected = after - 1.0 - j * (s_x**2 + s_y**2)
    scale = 1.0 + s_x**2 + s_y**2
    np.testing.assert_allclose(out.energy_change, expected, atol=1e-13 * scale)
    assert out.energy_change[0] <= plain.energy_change[0] + 1e-15
    np.testing.assert_allclose(out.contact_x, out.v_x + out.spin_y, atol=1e-14 * scale)
    np.testing.assert_allclose(out.contact_y, out.v_y + out.spin_x, atol=1e-14 * scale)


def test_its_number_is_friction_over_apparent_friction(impacts, glass):
    some = impacts([40.0, 80.0], mu=0.1, constant=-1.0)
    out = compose(glass, some, ["rolling"])
    assert EFFECTS["rolling"].criterion(glass, some, out, 1e-3).value == pytest.approx(1e-3 / 0.1)
    still = impacts([0.0])
    assert EFFECTS["rolling"].criterion(glass, still, compose(glass, still, []), 1e-3).value == 0.0
