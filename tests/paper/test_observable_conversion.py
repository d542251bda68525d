from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ifrfit.paper.build_scene import convert_observable
from ifrfit.physics import OBSERVABLES, rebound

TANGENTIAL = ("beta", "beta_cm", "spin_y_after", "tan_psi_after")
SHOWN = ("beta", "psi_after_deg", "mu_app", "delta_deg")


@pytest.mark.parametrize("wanted", SHOWN)
@pytest.mark.parametrize("measured", TANGENTIAL)
@settings(max_examples=40)
@given(
    gamma=st.floats(5.0, 85.0),
    spin_y=st.floats(0.0, 0.8),
    e_n=st.floats(0.3, 1.0),
    e_t=st.floats(-1.0, -0.4),
    mu=st.floats(0.02, 0.6),
)
def test_what_one_measurement_says_the_impact_says(measured, wanted, gamma, spin_y, e_n, e_t, mu):
    """Of any impact: no closure is needed to get from the one to the other."""
    r = rebound(np.array([gamma]), spin_y=spin_y, e_n=e_n, e_t=e_t, mu=mu, degrees=True)
    value = OBSERVABLES[measured].value(r, np.array([mu]))
    found, _ = convert_observable(wanted, measured, value, np.array([0.01]), r.incidence, e_n=e_n)
    truth = OBSERVABLES[wanted].value(r, np.array([mu]))
    assert found == pytest.approx(truth, rel=1e-9, abs=1e-9)


def test_sigma_is_carried_to_first_order():
    r = rebound(np.array([30.0]), e_n=0.98, e_t=-1.0, mu=0.1, degrees=True)
    value = np.asarray(r.beta_cm)
    found, sigma = convert_observable("beta", "beta_cm", value, np.array([0.003]), r.incidence, e_n=0.98)
    assert sigma == pytest.approx([3.5 * 0.003])  # beta = 5/2 + (7/2) beta_cm without spin
    assert found == pytest.approx(2.5 + 3.5 * value)


def test_a_wrong_inertia_would_be_seen():
    r = rebound(np.array([30.0]), e_n=0.98, e_t=-1.0, mu=0.1, degrees=True)
    found, _ = convert_observable(
        "beta",
        "beta_cm",
        np.asarray(r.beta_cm),
        np.array([0.003]),
        r.incidence,
        e_n=0.98,
        inertia_factor=2 / 3,
    )
    assert abs(float(found[0] - r.beta[0])) > 0.05
