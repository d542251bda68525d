"""Transition angles: printed constants, none, one and two roots, extreme ratios."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from ifrfit.physics import CLOSURES, rebound, transition_angles, transition_tau
from ifrfit.physics.angles import Incidence


def ratio_off(angle: float, tau: float, spin_x: float, spin_y: float) -> float:
    """|U_t| - tau U_n at an angle in degrees, relative to what one rounding of the angle can change."""
    state = Incidence.of(angle, spin_x, spin_y, degrees=True)
    last_bits = 1.0 + abs(spin_x) + abs(spin_y) + tau
    return abs(float(state.slip) - tau * float(state.cosine)) / last_bits


@pytest.mark.parametrize(
    ("figure", "e_n", "e_t", "mu", "spin_x", "spin_y", "expected"),
    [
        ("3, 8, 9", 0.94, -0.98, 0.12, 0.0, 0.0, 30.20),
        ("4a", 0.78, -0.80, 0.01, 0.0, 0.0, 2.55),
        ("4b", 0.60, -0.75, 0.15, 0.0, 0.0, 30.96),
        ("5", 0.38, -0.95, 0.10, 0.0, 0.0, 19.03),
        ("6, slow spin", 0.94, -0.98, 0.14, 0.0, 0.225, 23.45),
        ("6, fast spin", 0.94, -0.98, 0.14, 0.0, 0.833, None),
        ("7", 0.80, -0.98, 0.11, 0.0, 0.0, 26.34),
        ("A2.1a", 0.90, -0.90, 0.15, 0.30, 0.0, 31.76),
    ],
)
def test_printed_constants(
    figure: str, e_n: float, e_t: float, mu: float, spin_x: float, spin_y: float, expected: float | None
) -> None:
    tau = transition_tau(CLOSURES["ifr"], e_t, mu * (1.0 + e_n))
    angles = transition_angles(tau, spin_x, spin_y)
    if expected is None:
        assert angles == ()
        gamma = np.linspace(0.0, 90.0, 901)
        assert not rebound(gamma, spin_x, spin_y, e_n=e_n, e_t=e_t, mu=mu, degrees=True).sticking.any()
        return
    assert [round(angle, 2) for angle in angles] == [expected]
    just = np.array([expected - 0.01, expected + 0.01])
    sticking = rebound(just, spin_x, spin_y, e_n=e_n, e_t=e_t, mu=mu, degrees=True).sticking
    assert sticking.tolist() == [True, False]


@pytest.mark.parametrize(
    ("law", "c", "inertia_factor", "expected"),
    [
        ("ifr", -0.98, 0.4, 2.5),
        ("ifr", -0.5, 0.4, 2.5),
        ("ifr", -0.98, 2.0 / 3.0, 1.5),
        ("f", 0.0, 0.4, 3.5),
        ("fr", 0.4, 0.4, 2.5),
        ("fr", 0.0, 2.0 / 3.0, 2.5),
        ("fr", -1.0, 0.4, math.inf),
        ("ifr-contact", -0.9, 0.4, 3.5),
    ],
)
def test_transition_ratio_per_kappa(law: str, c: float, inertia_factor: float, expected: float) -> None:
    kappa = 0.25
    assert transition_tau(CLOSURES[law], c, kappa, inertia_factor) == pytest.approx(expected * kappa)


@pytest.mark.parametrize(
    ("tau", "spin_x", "spin_y", "count"),
    [
        (0.5, 0.0, 0.0, 1),
        (0.5, 0.3, 0.0, 1),
        (0.5, 0.6, 0.0, 0),
        (0.5, 0.0, 0.6, 0),
        (0.5, 0.0, 0.4, 1),
        (0.5, 0.0, -0.4, 1),
        (0.5, 0.0, -0.7, 2),
        (0.5, 0.2, -0.7, 2),
        (0.5, 0.45, -0.7, 0),
        (0.5, 0.0, -1.05, 2),
        (0.5, 0.0, -1.2, 0),
        (2.0, 0.0, -1.5, 1),
        (2.0, 1.9, -1.5, 0),
    ],
)
def test_none_one_and_two_angles(tau: float, spin_x: float, spin_y: float, count: int) -> None:
    angles = transition_angles(tau, spin_x, spin_y)
    assert len(angles) == count
    assert len(crossings(tau, spin_x, spin_y)) == count


def crossings(tau: float, spin_x: float, spin_y: float) -> list[float]:
    """Angles where a fine scan sees |U_t| - tau U_n change sign, degrees."""
    gamma = np.linspace(0.0, 90.0, 200_001)
    state = Incidence.of(gamma, spin_x, spin_y, degrees=True)
    above = state.slip - tau * state.cosine > 0.0
    return list(gamma[:-1][above[1:] != above[:-1]])


@given(st.floats(1e-3, 1e3), st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
@settings(max_examples=60, deadline=None)
def test_finds_what_a_scan_finds(tau: float, spin_x: float, spin_y: float) -> None:
    seen = crossings(tau, spin_x, spin_y)
    angles = transition_angles(tau, spin_x, spin_y)
    step = 90.0 / 200_000
    # a scan cannot resolve two angles within a step, nor one at an end of the range
    ends = all(step < angle < 90.0 - step for angle in (*seen, *angles))
    assume(ends)
    assume(len(angles) < 2 or angles[1] - angles[0] > 2.0 * step)
    assert len(angles) == len(seen)
    assert all(abs(one - two) <= 1.01 * step for one, two in zip(angles, seen, strict=True))


def test_top_spin_slides_sticks_and_slides() -> None:
    mu, e_n, spin = 0.14, 0.94, -0.75
    low, high = transition_angles(transition_tau(CLOSURES["ifr"], -0.98, mu * (1.0 + e_n)), 0.0, spin)
    gamma = np.array([low - 0.1, low + 0.1, high - 0.1, high + 0.1])
    sticking = rebound(gamma, 0.0, spin, e_n=e_n, e_t=-0.98, mu=mu, degrees=True).sticking
    assert sticking.tolist() == [False, True, True, False]


@given(st.floats(1e-6, 10.0), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
@settings(max_examples=300, deadline=None)
def test_angles_satisfy_the_condition_and_ascend(tau: float, spin_x: float, spin_y: float) -> None:
    angles = transition_angles(tau, spin_x, spin_y)
    assert len(angles) <= 2
    assert list(angles) == sorted(set(angles))
    assert all(0.0 <= angle <= 90.0 for angle in angles)
    # the sine of the angle is a double root near a tangency and near 90 degrees
    assert all(ratio_off(angle, tau, spin_x, spin_y) <= 1e-7 for angle in angles)


@given(st.floats(1e-300, 1e300), st.floats(-0.9, 0.9))
@settings(max_examples=300, deadline=None)
def test_extreme_ratios_keep_all_digits(tau: float, spin_y: float) -> None:
    angles = transition_angles(tau, 0.0, spin_y)
    assert all(ratio_off(angle, tau, 0.0, spin_y) <= 1e-13 for angle in angles)
    if tau > abs(spin_y):
        assert len(angles) == 1
    elif spin_y < 0.0 and tau > 1e-10:
        assert len(angles) == 2


@pytest.mark.parametrize(
    ("tau", "spin_y", "expected"),
    [
        (1e-300, 0.0, math.degrees(1e-300)),
        (1e-160, 0.0, math.degrees(1e-160)),
        (1e6, 0.0, 90.0 - math.degrees(1e-6)),
        (1e8, 0.5, 90.0 - math.degrees(1.5e-8)),
        (1e155, 0.0, 90.0),
        (1e300, 0.0, 90.0),
        (1e300, -0.5, 90.0),
    ],
)
def test_known_angles_of_extreme_ratios(tau: float, spin_y: float, expected: float) -> None:
    assert transition_angles(tau, 0.0, spin_y) == pytest.approx([expected], rel=1e-14, abs=0.0)


def test_two_angles_close_together_are_told_apart() -> None:
    low, high = transition_angles(1e-9, 0.0, -0.5)
    assert low == pytest.approx(30.0 - math.degrees(1e-9), abs=1e-13)
    assert high == pytest.approx(30.0 + math.degrees(1e-9), abs=1e-13)


def test_without_friction_only_rolling_sticks() -> None:
    assert [str(angle) for angle in transition_angles(0.0)] == ["0.0"]  # no -0.0
    assert transition_angles(0.0, 0.0, -0.5) == pytest.approx([30.0], rel=1e-14)
    assert transition_angles(0.0, 0.1, -0.5) == ()


@pytest.mark.parametrize("tau", [math.inf, math.nan, -1.0])
def test_no_angle_where_the_ratio_is_not_reached(tau: float) -> None:
    assert transition_angles(tau, 0.1, -0.2) == ()
