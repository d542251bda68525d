"""Conditions, labels and captions of Doménech-Carbó (2023) that do not hold as printed.

Equations that are wrong as printed have their tests in test_figures_anchors.py; docs/errata.md names both.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from ifrfit.physics import CLOSURES, Rebound, rebound, transition_angles, transition_tau

SHARE = 2.0 / 7.0
E_N, E_T, MU = 0.94, -0.98, 0.12


def hit(gamma: object, spin_x: object = 0.0, spin_y: object = 0.0, **constants: float) -> Rebound:
    values = {"e_n": E_N, "e_t": E_T, "mu": MU} | constants
    return rebound(gamma, spin_x, spin_y, degrees=True, **values)  # type: ignore[arg-type]


def sine(degrees: float) -> float:
    return math.sin(math.radians(degrees))


def cosine(degrees: float) -> float:
    return math.cos(math.radians(degrees))


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
