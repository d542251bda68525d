"""A friction that its default prior cuts off: told in posteriors, with the room that it needs."""

from __future__ import annotations

import numpy as np
import pytest

import ifrfit


def table(mu, seed, n=25, sigma=0.02):
    """Impacts by IFR, written out: e_n 0.6 and e_t -0.9."""
    rng = np.random.default_rng(seed)
    gamma = np.radians(rng.uniform(40.0, 88.0, n))
    friction = 3.5 * mu * 1.6 / np.tan(gamma)
    return {
        "gamma_deg": np.degrees(gamma),
        "beta": -0.9 + np.minimum(1.4, friction) + rng.normal(0.0, sigma, n),
        "e_n": 0.6 + rng.normal(0.0, sigma, n),
        "sigma_beta": np.full(n, sigma),
        "sigma_e_n": np.full(n, sigma),
    }


def test_a_friction_beyond_its_prior_is_told_and_room_mends_it():
    data = table(2.6, 3)
    stated = ifrfit.fit(data)
    fact = stated.facts["friction_beyond_prior"]
    assert not fact.ok
    assert fact.says.endswith("--bounds mu=0,4")
    assert 'bounds={"mu": (0, 4)}' in str(stated)
    assert fact.figures["optimum"]["mu"] == pytest.approx(2.65, abs=0.01)
    # what it is told for: e_t, called determined, is 4 sd and more off
    e_t = stated.constants["e_t"]
    assert (e_t.value + 0.9) / e_t.stderr > 4.0
    assert stated.constants["mu"].reason == "not told from its bound 2"
    with_room = ifrfit.fit(data, bounds={"mu": (0.0, 4.0)})
    assert "friction_beyond_prior" not in with_room.facts
    assert abs(with_room.constants["e_t"].value + 0.9) < 3.0 * with_room.constants["e_t"].stderr


def test_least_squares_have_no_prior_of_friction():
    found = ifrfit.fit(table(2.6, 3), method="lsq")
    assert "friction_beyond_prior" not in found.facts
    assert found.constants["mu"].value > 2.5


def test_a_friction_that_no_contact_has_gets_no_room():
    fact = ifrfit.fit("wang-2018-limestone", closure="maw").facts["friction_beyond_prior"]
    assert "No contact has such a friction" in fact.says
    assert "--bounds" not in fact.says


@pytest.mark.parametrize("mu", [0.3, 1.2, 1.8])
def test_frictions_within_the_prior_are_not_called(mu):
    for seed in range(20):
        assert "friction_beyond_prior" not in ifrfit.fit(table(mu, seed, n=12)).facts
