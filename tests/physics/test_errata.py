"""Known numbers of the figures, and where Doménech-Carbó (2023) goes astray as printed.

Each `printed` below is an equation as the paper has it; the assertion shows that it cannot hold and that ours
does. Numbers in the names of tests are those of the paper's equations; docs/errata.md names them. Conditions,
labels and captions that do not hold come last.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from ifrfit.cost.impulse_balance import ifr, impact
from ifrfit.physics import CLOSURES, Rebound, rebound, transition_angles, transition_tau

SHARE = 2.0 / 7.0
# constants of Fig. 3 and of Fig. A2.1
E_N, E_T, MU = 0.94, -0.98, 0.12
LATERAL = {"e_n": 0.90, "e_t": -0.90, "mu": 0.15}
LATERAL_TRANSITION = 31.757838


def hit(gamma: object, spin_x: object = 0.0, spin_y: object = 0.0, **constants: float) -> Rebound:
    values = {"e_n": E_N, "e_t": E_T, "mu": MU} | constants
    return rebound(gamma, spin_x, spin_y, degrees=True, **values)  # type: ignore[arg-type]


def sine(degrees: float) -> float:
    return math.sin(math.radians(degrees))


def cosine(degrees: float) -> float:
    return math.cos(math.radians(degrees))


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


# conditions, labels and captions


@pytest.mark.parametrize("spin_y", [0.3, -2.0])
@pytest.mark.parametrize(("mu", "sticks"), [(0.05, False), (5.0, True)])
def test_7_8_the_sign_is_that_against_the_slip(spin_y: float, mu: float, sticks: bool) -> None:
    gamma = 40.0
    r = rebound(gamma, spin_y=spin_y, e_n=E_N, mu=mu, closure="f", degrees=True)
    slip = sine(gamma) + spin_y
    size = SHARE * abs(slip) if sticks else mu * (1.0 + E_N) * cosine(gamma)
    assert bool(r.sticking) == sticks
    assert float(r.v_x) - sine(gamma) == pytest.approx(-math.copysign(size, slip), abs=1e-14)


@pytest.mark.parametrize("towards", [1.0, -1.0])
def test_13_15_17_a_sign_times_a_projection_is_a_magnitude(towards: float) -> None:
    """Right if the unit vector points along the slip; it speeds the contact up if it points against it."""
    slip = np.array([0.8, -0.3])
    unit = towards * slip / np.linalg.norm(slip)
    projection = slip @ unit
    printed = -SHARE * (1.0 + E_T) * projection * np.sign(projection) * unit
    needed = -SHARE * (1.0 + E_T) * slip
    assert np.allclose(printed, towards * needed)
    assert (np.linalg.norm(slip + 3.5 * printed) < np.linalg.norm(slip)) == (towards > 0.0)


def test_before_9_the_slip_before_decides_about_the_direction() -> None:
    """The printed sum of velocity after and spin before is (1 - k) U_x: the sign agrees while k < 1."""
    for spin_y in (0.3, -2.0):
        r = hit(40.0, 0.0, spin_y)
        mixed = float(r.v_x) + spin_y
        assert mixed == pytest.approx((1.0 - float(r.impulse_factor)) * float(r.incidence.slip_x), abs=1e-14)
        assert float(r.v_x) + float(r.spin_y) != pytest.approx(mixed, abs=0.05)


def test_18_the_tangent_of_sigma_loses_the_quadrant() -> None:
    gamma, s_x, s_y = 30.0, 0.4, -1.5
    r = hit(gamma, s_x, s_y)
    sigma = math.atan2(s_x, sine(gamma) + s_y)
    printed = math.atan(s_x / (sine(gamma) + s_y))
    assert abs(sigma - printed) == pytest.approx(math.pi)
    k, slip = float(r.impulse_factor), float(r.incidence.slip)
    assert float(r.v_x) == pytest.approx(sine(gamma) - k * slip * math.cos(sigma), abs=1e-14)
    assert abs(float(r.v_x) - (sine(gamma) - k * slip * math.cos(printed))) > 0.1


def test_3_4_the_lateral_spin_is_minus_the_right_handed_one() -> None:
    """U = u + omega x r with r into the wall, +z: the paper's signs need -omega_x."""
    s_x, s_y, gamma = 0.3, 0.2, 50.0
    r = hit(gamma, s_x, s_y)
    right_handed = np.array([-s_x, s_y, 0.0])
    before = np.array([sine(gamma), 0.0, cosine(gamma)]) + np.cross(right_handed, [0.0, 0.0, 1.0])
    assert np.allclose(before[:2], [r.incidence.slip_x, r.incidence.slip_y])
    after = np.array([-float(r.spin_x), float(r.spin_y), 0.0])
    contact = np.array([float(r.v_x), float(r.v_y), -float(r.v_n)]) + np.cross(after, [0.0, 0.0, 1.0])
    assert np.allclose(contact[:2], [r.contact_x, r.contact_y])
    assert before[1] != pytest.approx(-s_x)


@pytest.mark.parametrize("spin_y", [0.0, 0.4])
def test_after_26_reduction_to_11_needs_no_vanishing_spin(spin_y: float) -> None:
    gamma = 70.0
    r = hit(gamma, 0.0, spin_y, e_t=-1.0)
    eleven = 3.5 * MU * (1.0 + E_N) * cosine(gamma) / (sine(gamma) + spin_y) - 1.0
    assert not bool(r.sticking)
    assert float(r.beta) == pytest.approx(eleven, abs=1e-14)


def test_fig_4_slides_by_26_not_by_27() -> None:
    gamma = np.arange(10.0, 86.0, 5.0)
    r = hit(gamma, e_n=0.78, e_t=-0.80, mu=0.01)
    assert not r.sticking.any()
    twenty_six = -0.80 + 3.5 * 0.01 * 1.78 / np.tan(np.radians(gamma))
    assert np.allclose(r.beta, twenty_six, rtol=0.0, atol=1e-14)
    assert np.abs(r.beta - (1.4 - 0.80)).min() > 1.0
    ratio = np.array([0.3, 0.59, 0.61, 2.0])
    r = hit(np.degrees(np.arctan(ratio)), e_n=0.60, e_t=-0.75, mu=0.15)
    assert r.sticking.tolist() == [True, True, False, False]
    assert np.allclose(r.beta[:2], 0.65)


def test_fig_7_needs_32_below_its_transition() -> None:
    constants = {"e_n": 0.80, "e_t": -0.98, "mu": 0.11}
    gamma = 15.0
    r = hit(gamma, **constants)
    tangent = math.tan(math.radians(gamma))
    sticking = (tangent - (0.4 + SHARE * 0.02) * tangent) / 0.80
    sliding = (tangent - SHARE * 0.02 * tangent - 0.11 * 1.80) / 0.80
    assert bool(r.sticking)
    assert math.tan(float(r.delta)) == pytest.approx(sticking, abs=1e-14)
    assert abs(math.degrees(math.atan(sliding) - float(r.delta))) > 5.0


def test_a1_planar_is_sigma_of_zero_not_of_ninety() -> None:
    r = hit(60.0, 0.0, 0.2)
    assert float(r.v_y) == 0.0
    slip = float(r.incidence.slip)
    printed = -SHARE * (1.0 + E_T) * slip - MU * (1.0 + E_N) * cosine(60.0)  # (A1.9) at 90 degrees
    assert abs(printed) > 0.1


def test_section_3_2_a_head_on_impact_is_along_z() -> None:
    head_on, along = hit(0.0), hit(90.0)
    assert (float(head_on.v_x), float(head_on.v_n)) == (0.0, E_N)
    assert float(along.v_n) == 0.0


def test_figs_3_and_6_two_values_of_mu_are_two_curves() -> None:
    gamma = np.array([35.0, 45.0, 55.0])
    apart = np.abs(hit(gamma, mu=0.14).beta - hit(gamma, mu=0.12).beta)
    assert apart.min() > 0.09  # about two sigma of a single point, where sigma is 0.05


@pytest.mark.parametrize(
    ("speed", "rate", "spin"),
    [(2.0, 45.0, 0.225), (2.5, 30.0, 0.12), (1.5, 60.0, 0.40), (1.5, 125.0, 0.833), (2.1, 100.0, 0.476)],
)
def test_fig_6_its_spins_follow_from_speed_and_rate(speed: float, rate: float, spin: float) -> None:
    assert 0.010 * rate / speed == pytest.approx(spin, abs=5e-4)


@pytest.mark.parametrize(("spin", "angle"), [(0.12, 28.5), (0.225, 23.45), (0.40, 14.9), (0.476, 10.99)])
def test_fig_6_the_spreads_move_the_transition(spin: float, angle: float) -> None:
    tau = transition_tau(CLOSURES["ifr"], E_T, 0.14 * (1.0 + E_N))
    assert tau == pytest.approx(0.679)
    assert transition_angles(tau, 0.0, spin)[0] == pytest.approx(angle, abs=0.06)
    assert transition_angles(tau, 0.0, 0.68) == ()
