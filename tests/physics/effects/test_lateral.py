"""Lateral spin: the planar kernel is the three-dimensional one where both apply."""

from __future__ import annotations

import numpy as np
import pytest
from factories import BILINEAR, own_constant
from hypothesis import given, settings
from hypothesis import strategies as st

from ifrfit.physics import CLOSURES, rebound
from ifrfit.physics.effects import Contact, compose

STATE = ("v_x", "v_y", "v_n", "spin_x", "spin_y", "contact_x", "contact_y", "beta", "beta_cm", "lambda_")
CONSTANT = {name: next(iter(own_constant(name).values()), 0.0) for name in BILINEAR}


@pytest.mark.parametrize("closure", list(CONSTANT))
@given(
    gamma=st.floats(0.0, 90.0),
    spin_y=st.one_of(st.floats(-2.0, 2.0), st.floats(-1e6, 1e6)),
    e_n=st.floats(0.0, 1.0),
    mu=st.floats(0.0, 2.0),
    j=st.sampled_from([0.4, 2.0 / 3.0, 0.5]),
)
@settings(max_examples=50, deadline=None)
def test_both_kernels_agree_to_the_last_bit(impacts, closure, gamma, spin_y, e_n, mu, j):
    given_impacts = impacts([gamma], 0.0, spin_y, closure=closure, e_n=e_n, mu=mu, constant=CONSTANT[closure])
    planar = compose(Contact(inertia_factor=j), given_impacts, [])
    full = compose(Contact(inertia_factor=j), given_impacts, ["lateral-spin"])
    for name in STATE:
        one, two = np.asarray(getattr(planar, name)), np.asarray(getattr(full, name))
        np.testing.assert_array_equal(one, two, err_msg=name)
        assert (np.signbit(one) == np.signbit(two)).all(), name


@pytest.mark.parametrize("closure", list(CONSTANT))
def test_without_effects_it_is_the_rebound(impacts, closure):
    rng = np.random.default_rng(1)
    gamma, spin_x, spin_y = rng.uniform(0, 90, 300), rng.normal(0, 1, 300), rng.normal(0, 1, 300)
    found = compose(
        Contact(),
        impacts(gamma, spin_x, spin_y, closure=closure, constant=CONSTANT[closure]),
        ["lateral-spin"],
    )
    own = CLOSURES[closure].constant
    constants = {own: CONSTANT[closure]} if own else {}
    expected = rebound(gamma, spin_x, spin_y, closure=closure, e_n=0.9, mu=0.1, degrees=True, **constants)
    for name in (*STATE, "sticking", "energy_change"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), err_msg=name)


def test_dropping_the_spin_changes_the_path(impacts):
    """Control: the planar kernel ignores a lateral spin that is there."""
    given_impacts = impacts([30.0], 0.3)
    assert compose(Contact(), given_impacts, []).v_y[0] == 0.0
    assert compose(Contact(), given_impacts, ["lateral-spin"]).v_y[0] < -0.05
