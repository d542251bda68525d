"""Known numbers of the figures, and where the printed equations of Doménech-Carbó (2023) go astray.

Each `printed` below is an equation as the paper has it; the assertion shows that it cannot hold and that ours
does. Numbers in the names of tests are those of the paper's equations.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from ifrfit.cost.impulse_balance import ifr, impact
from ifrfit.physics import Rebound, rebound

SHARE = 2.0 / 7.0
# constants of Fig. 3 and of Fig. A2.1
E_N, E_T, MU = 0.94, -0.98, 0.12
LATERAL = {"e_n": 0.90, "e_t": -0.90, "mu": 0.15}
LATERAL_TRANSITION = 31.757838


def hit(gamma: float, spin_x: float = 0.0, spin_y: float = 0.0, **constants: float) -> Rebound:
    values = {"e_n": E_N, "e_t": E_T, "mu": MU} | constants
    return rebound(gamma, spin_x, spin_y, degrees=True, **values)  # type: ignore[arg-type]


def test_4_the_impulse_changes_the_spin_it_does_not_make_it() -> None:
    r = hit(50.0, 0.2, 0.3, e_t=-1.0, mu=0.0)
    assert (float(r.spin_x), float(r.spin_y)) == (0.2, 0.3)
    hard = hit(50.0, 0.2, 0.3)
    printed = 2.5 * (hard.v_x - math.sin(math.radians(50.0)))
    assert float(hard.spin_y) == pytest.approx(printed + 0.3, abs=1e-15)


def test_16_friction_in_sliding_goes_with_e_n_not_with_e_t() -> None:
    r = hit(70.0, e_t=-1.0)
    printed = -MU * (1.0 - 1.0) * math.cos(math.radians(70.0))
    push = float(r.v_x) - math.sin(math.radians(70.0))
    assert printed == 0.0
    assert push == pytest.approx(-MU * (1.0 + E_N) * math.cos(math.radians(70.0)), abs=1e-15)


@pytest.mark.parametrize(("gamma", "regime"), [(10.0, "22: sticking"), (70.0, "21: sliding")])
def test_21_22_friction_opposes_the_slip(gamma: float, regime: str) -> None:
    r = hit(gamma, 0.1, 0.2, e_t=-1.0)
    assert bool(r.sticking) == regime.endswith("sticking")
    push = np.array([r.v_x - r.incidence.sine, r.v_y])
    slip = np.array([r.incidence.slip_x, r.incidence.slip_y])
    assert push @ slip < 0.0
    # with the printed sign the contact point only gains speed
    assert np.linalg.norm(slip - 3.5 * push) > np.linalg.norm(slip) > np.linalg.norm(slip + 3.5 * push)


def test_25_beta_has_a_sign_that_a_ratio_of_magnitudes_loses() -> None:
    sticking, sliding = hit(10.0), hit(85.0)
    for r in (sticking, sliding):
        printed = -math.hypot(r.contact_x, r.contact_y) / r.incidence.slip
        assert abs(float(printed)) == pytest.approx(abs(float(r.beta)), abs=1e-14)
        assert printed < 0.0
    assert float(sticking.beta) == pytest.approx(E_T + 1.4, abs=1e-14)
    assert sliding.beta < 0.0


def test_after_29_the_total_restitution_takes_beta_of_the_centre() -> None:
    gamma = 60.0
    r = hit(gamma)
    normal, tangential = E_N * math.cos(math.radians(gamma)), math.sin(math.radians(gamma))
    assert float(r.beta_tot) == pytest.approx(math.hypot(normal, r.beta_cm * tangential), abs=1e-15)
    assert abs(math.hypot(normal, r.beta * tangential) - float(r.beta_tot)) > 0.1


def test_34_with_its_printed_sign_jumps_at_the_transition() -> None:
    below, above = (hit(LATERAL_TRANSITION + off, 0.30, **LATERAL) for off in (-0.001, 0.001))
    assert bool(below.sticking)
    assert not bool(above.sticking)
    assert math.degrees(abs(below.lambda_ - above.lambda_)) < 0.01
    k = SHARE * 0.1 + 0.4
    printed = math.degrees(math.atan(k * 0.30 / (below.incidence.sine - k * below.incidence.slip_x)))
    assert printed == pytest.approx(23.14, abs=0.01)
    assert printed - math.degrees(above.lambda_) == pytest.approx(46.28, abs=0.02)


def test_a1_7_the_contact_slows_by_seven_halves_of_the_friction() -> None:
    gamma = 70.0
    r = rebound(gamma, e_n=E_N, beta0=0.4, mu=MU, closure="fr", degrees=True)
    friction = MU * (1.0 + E_N) * math.cos(math.radians(gamma))
    slip = math.sin(math.radians(gamma))
    assert float(r.contact_x) == pytest.approx(float(r.v_x + r.spin_y), abs=1e-15)
    assert float(r.contact_x) == pytest.approx(slip - 3.5 * friction, abs=1e-14)
    assert abs(float(r.contact_x) - (slip - friction / 3.5)) > 0.1


def test_a1_17_a1_18_nothing_in_sticking_depends_on_mu_or_the_angle() -> None:
    s_x, s_y, gamma = 0.05, 0.1, 10.0
    r = hit(gamma, s_x, s_y)
    assert bool(r.sticking)
    slip_x = math.sin(math.radians(gamma)) + s_y
    assert float(r.spin_x) == pytest.approx(s_x - (1.0 + (5.0 / 7.0) * (1.0 + E_T)) * s_x, abs=1e-15)
    assert float(r.contact_x) == pytest.approx(slip_x - (1.4 + (1.0 + E_T)) * slip_x, abs=1e-15)
    other = hit(gamma, s_x, s_y, mu=3.0)
    assert (float(other.spin_x), float(other.contact_x)) == (float(r.spin_x), float(r.contact_x))


def test_a1_21_a1_24_a1_25_the_friction_term_is_a_velocity() -> None:
    """Twice the speed and spin is twice the velocity; a bare number in place of u cos(gamma) is not."""
    constants = {"law": ifr, "constant": 0.0, "e_n": 0.0, "mu": MU}
    gamma, s_x = 70.0, 0.2
    r = hit(gamma, s_x, e_n=0.0, e_t=0.0)
    for speed in (1.0, 2.0):
        state = impact(gamma, s_x, 0.0, speed=speed, **constants)
        assert state["v_y"] == pytest.approx(float(r.v_y), abs=1e-15)
    sigma = math.atan2(s_x, math.sin(math.radians(gamma)))
    ours = -SHARE * s_x - MU * math.cos(math.radians(gamma)) * math.sin(sigma)
    printed = -SHARE * s_x - MU * math.cos(sigma) * math.sin(sigma)
    assert float(r.v_y) == pytest.approx(ours, abs=1e-15)
    assert abs(printed - ours) > 0.01


def test_a1_22_a1_23_without_restitution_the_factor_is_24_35() -> None:
    r = hit(20.0, 0.05, 0.1, e_n=0.0, e_t=0.0, mu=1.0)
    assert float(r.impulse_factor) == pytest.approx(24.0 / 35.0, abs=1e-15)
    sine = math.sin(math.radians(20.0))
    assert float(r.v_x) == pytest.approx(sine - 24.0 / 35.0 * (sine + 0.1), abs=1e-15)
    assert float(r.v_y) == pytest.approx(-24.0 / 35.0 * 0.05, abs=1e-15)
    # a factor of one would take away the centre's whole slip at any angle
    assert abs(float(r.v_x) + 0.1) > 0.05


def test_a1_1_the_ball_leaves_the_wall() -> None:
    state = impact(40.0, 0.0, 0.0, law=ifr, constant=E_T, e_n=E_N, mu=MU)
    r = hit(40.0)
    assert float(r.v_n) == pytest.approx(E_N * math.cos(math.radians(40.0)), abs=1e-15)
    # a positive v_z would make the normal impulse go with 1 - e_n, and the apparent friction with it
    drag = math.sin(math.radians(40.0)) - state["v_x"]
    towards_wall = math.cos(math.radians(40.0))
    assert float(r.mu_app) == pytest.approx(drag / (towards_wall + state["v_n"]), abs=1e-14)
    assert abs(drag / (towards_wall - state["v_n"]) - float(r.mu_app)) > 1.0


def test_26_30_top_spin_faster_than_rolling_turns_the_friction() -> None:
    gamma, spin = 60.0, -2.0
    r = hit(gamma, 0.0, spin)
    sine, cosine = math.sin(math.radians(gamma)), math.cos(math.radians(gamma))
    assert not bool(r.sticking)
    assert r.mu_app < 0.0
    printed = E_T + 3.5 * MU * (1.0 + E_N) * cosine / (sine + spin)
    complete = E_T + 3.5 * MU * (1.0 + E_N) * cosine / abs(sine + spin)
    assert float(r.beta) == pytest.approx(complete, abs=1e-14)
    assert abs(printed - complete) > 0.1


def test_26_with_lateral_spin_divides_by_the_whole_slip() -> None:
    gamma, s_x = 60.0, 0.8
    r = hit(gamma, s_x)
    sine, cosine = math.sin(math.radians(gamma)), math.cos(math.radians(gamma))
    assert float(r.beta) == pytest.approx(
        E_T + 3.5 * MU * (1.0 + E_N) * cosine / math.hypot(sine, s_x), abs=1e-14
    )
    assert abs(E_T + 3.5 * MU * (1.0 + E_N) * cosine / sine - float(r.beta)) > 0.1


def test_26_27_30_31_only_sliding_depends_on_mu() -> None:
    for gamma, depends in ((10.0, False), (70.0, True)):
        one, two = hit(gamma), hit(gamma, mu=0.14)
        assert bool(one.sticking) != depends
        assert (abs(float(one.beta - two.beta)) > 1e-3) == depends
        assert (abs(float(one.mu_app - two.mu_app)) > 1e-3) == depends


def test_32_33_the_ball_can_bounce_back_and_the_angle_says_so() -> None:
    r = hit(5.0, 0.0, 0.8, mu=2.0)
    assert r.v_x < 0.0
    assert r.delta < 0.0
    # lambda of 180 degrees, which an arc tangent of the ratio would call 0
    assert math.degrees(r.lambda_) == 180.0


def test_36_37_the_contact_angle_is_over_the_incoming_velocity() -> None:
    for gamma in (10.0, 70.0):
        r = hit(gamma)
        assert float(r.tan_psi_out) == pytest.approx(float(r.tan_psi_after) / E_N, abs=1e-14)
        tangent = math.tan(math.radians(gamma))
        printed = -(E_T + 1.4) * tangent if r.sticking else -E_T * tangent - 3.5 * MU * (1.0 + E_N)
        assert float(r.tan_psi_after) == pytest.approx(printed, abs=1e-13)


def test_section_2_4_no_normal_rebound_leaves_along_the_wall() -> None:
    for gamma in (10.0, 70.0):
        assert math.degrees(hit(gamma, e_n=0.0).delta) == 90.0


def test_section_2_4_walton_is_met_only_with_beta0_of_two_fifths() -> None:
    gamma = np.linspace(1.0, 89.0, 89)
    ifr = rebound(gamma, e_n=E_N, e_t=-1.0, mu=MU, degrees=True).beta
    same = rebound(gamma, e_n=E_N, beta0=0.4, mu=MU, closure="fr", degrees=True).beta
    other = rebound(gamma, e_n=E_N, beta0=0.5, mu=MU, closure="fr", degrees=True).beta
    np.testing.assert_allclose(ifr, same, rtol=0.0, atol=1e-14)
    assert np.abs(ifr - other).max() > 0.05


def test_a1_zero_tangential_restitution_creates_energy() -> None:
    r = hit(10.0, e_n=1.0, e_t=0.0, mu=1.0)
    assert float(r.beta) == pytest.approx(1.4, abs=1e-15)
    assert float(r.contact_x / r.incidence.slip_x) ** 2 == pytest.approx(1.96, abs=1e-14)
    assert r.energy_change > 0.0


def test_fig_4a_contact_and_centre_restitution_are_told_apart_by_the_data() -> None:
    for gamma in (20.0, 50.0, 80.0):
        r = hit(gamma, e_n=0.78, e_t=-0.80, mu=0.01)
        cotangent = 1.0 / math.tan(math.radians(gamma))
        assert float(-r.beta) == pytest.approx(0.80 - 0.0623 * cotangent, abs=2e-5 * (1.0 + cotangent))
        assert float(-r.beta_cm) == pytest.approx(0.943 - 0.0178 * cotangent, abs=2e-4 * (1.0 + cotangent))


def test_16_to_22_restitution_acts_even_at_grazing_incidence() -> None:
    grazing = hit(90.0)
    assert float(grazing.v_n) == 0.0
    assert float(1.0 - grazing.v_x) == pytest.approx(SHARE * (1.0 + E_T), abs=1e-15)
    assert float(hit(90.0, e_t=-1.0).v_x) == 1.0
    assert hit(89.999).mu_app > 100.0 * MU / 2.0
