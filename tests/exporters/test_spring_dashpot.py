"""The integrated impact against solutions that do not step through time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ifrfit.exporters.mercurydpm import linear_contact
from ifrfit.exporters.spring_dashpot import STEPS, SpringDashpot, impact, log_decrement, response
from ifrfit.physics.angles import Incidence
from ifrfit.physics.closure import rotational_share
from ifrfit.physics.compliance.solvers import rebound_ratio

J = 0.4
SHARE = rotational_share(J)
TAU = np.tan(np.radians([1.0, 10.0, 30.0, 60.0, 85.0]))


@pytest.mark.parametrize("e", [0.3, 0.7, 0.95, 1.0])
def test_normal_restitution_of_a_linear_contact(e):
    found, _ = impact(SpringDashpot(1.0, 2.0 * log_decrement(e), 0.3, 0.0, 0.0), TAU, J)
    # the last step ends between two: its error is of the first order in the step, pi/4000 here
    assert found == pytest.approx(e, abs=5e-4)


@pytest.mark.parametrize("e", [0.3, 0.7, 0.95, 1.0])
def test_normal_restitution_of_hertz_with_the_dashpot_of_constant_e(e):
    """Antypov & Elliott (2011), EPL 94, 50004: sqrt(5) times the share of critical damping gives e."""
    found, _ = impact(SpringDashpot(1.5, math.sqrt(5.0) * log_decrement(e), 0.3, 0.0, 0.0), TAU, J)
    assert found == pytest.approx(e, abs=5e-4)


@pytest.mark.parametrize("beta", [0.2, 0.44, 1.0])
def test_half_a_tangential_period_reverses_the_slip(beta):
    e_n, slip = impact(linear_contact(0.9, beta, 1e9), TAU, J)
    assert e_n == pytest.approx(0.9, abs=5e-4)
    np.testing.assert_allclose(-slip / TAU, beta, atol=1e-3)


def test_gross_sliding_takes_the_impulse_of_coulomb():
    contact = linear_contact(0.9, 0.44, 0.1)
    tau = np.array([20.0, 100.0])
    e_n, slip = impact(contact, tau, J)
    # the bound is mu |F_n|, also at the end, where the dashpot of the normal attracts: 1.4e-3 more of impulse
    np.testing.assert_allclose(slip, tau - 0.1 * (1.0 + e_n) / SHARE, atol=3e-3)


def test_without_damping_it_is_the_model_of_stronge():
    """One spring behind one slider, solved from event to event in `ifrfit.physics.compliance`."""
    khat, mu = 0.8, 0.2
    tau = np.tan(np.radians(np.linspace(2.0, 80.0, 27)))
    _, slip = impact(SpringDashpot(1.0, 0.0, khat, 0.0, mu), tau, J, 8 * STEPS)
    chi = 0.5 * khat * (1.0 + 1.0 / J)
    psi2 = rebound_ratio(khat / mu * tau, chi, method="stronge", e_n=1.0)
    np.testing.assert_allclose(slip, mu / khat * psi2, atol=2e-3 * mu / khat)


@pytest.mark.parametrize("slider", ["force", "spring"])
def test_more_steps_change_little(slider):
    contact = SpringDashpot(1.5, 0.1, 1.2, 0.1, 0.15, slider=slider)
    coarse, fine = (impact(contact, TAU, J, steps) for steps in (STEPS, 4 * STEPS))
    assert coarse[0] == pytest.approx(fine[0], abs=1e-4)
    # the slider acts at the end of a step: an error of the first order, below 1e-3 of v_x/u (2/7 of this)
    np.testing.assert_allclose(coarse[1], fine[1], atol=3e-3)


@pytest.mark.parametrize("keeps", ["stretch", "force"])
def test_a_spring_keeps_its_stretch_or_its_force(keeps):
    """Against an integrator with an error control, without a slider: Hertz's overlap, dashpots along both."""
    c_n, k_t, c_t = 0.1, 1.2, 0.2

    def motion(_, state):
        d, w, kept, slip = max(state[0], 1e-300), *state[1:]
        normal = d**1.5 + c_n * d**0.25 * w
        spring = k_t * np.sqrt(d) * kept if keeps == "stretch" else kept
        growth = slip if keeps == "stretch" else k_t * np.sqrt(d) * slip
        return w, -normal, growth, -(spring + c_t * d**0.25 * slip) / SHARE

    def leaves(_, state):
        return state[0]

    leaves.terminal, leaves.direction = True, -1
    end = solve_ivp(motion, (0.0, 10.0), [1e-12, 1.0, 0.0, 1.0], events=leaves, rtol=1e-10, atol=1e-12).y[
        :, -1
    ]
    e_n, slip = impact(SpringDashpot(1.5, c_n, k_t, c_t, 1e9, keeps=keeps), np.ones(1), J)
    assert e_n == pytest.approx(-end[1], abs=5e-4)
    assert slip[0] == pytest.approx(end[3], abs=5e-4)


def test_a_lateral_spin_pushes_along_the_slip():
    """Slip and push are one line: their parts along x are those of |slip| by its cosine."""
    contact = SpringDashpot(1.5, 0.1, 1.2, 0.1, 0.15, slider="spring")
    sideways = Incidence.of([20.0, 50.0], 0.3, [0.2, -0.1], degrees=True)
    found = response(contact, J, STEPS, sideways)
    _, slip = impact(contact, sideways.tau, J)
    after = slip * sideways.cosine  # along the slip
    lost = SHARE * (sideways.slip - after) * sideways.slip_x / sideways.slip
    np.testing.assert_allclose(found.v_x, sideways.sine - lost, atol=1e-12)


def test_a_clamped_contact_never_attracts():
    overdamped = SpringDashpot(1.0, 1.0, 0.3, 0.0, 0.1)
    free, _ = impact(overdamped, TAU, J)
    clamped, _ = impact(SpringDashpot(1.0, 1.0, 0.3, 0.0, 0.1, clamped=True), TAU, J)
    assert clamped > free
