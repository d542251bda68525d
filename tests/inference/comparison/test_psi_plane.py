"""Slopes of the psi plane: recovered from data of each closure, whatever was measured, or said to be open."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from comparison_data import ANGLES, observations
from factories import problem_of, rest_long
from hypothesis import given, settings
from hypothesis import strategies as st

from ifrfit.inference.comparison.psi_plane import psi_plane, psi_rows
from ifrfit.physics.closures import CLOSURES

# closure, its constant, slope of sliding, slope of sliding less that of sticking; for inertia factor J
MADE = [
    ("f", {}, lambda j: 1.0, lambda j: 1.0),
    ("fr", {"beta0": 0.6}, lambda j: 1.0, lambda j: 1.6),
    ("ifr", {"e_t": -0.8}, lambda j: 0.8, lambda j: 1.0 + j),
    ("ifr-contact", {"e_t": -0.8}, lambda j: 0.8, lambda j: 1.0),
]


@pytest.mark.parametrize("case", MADE, ids=[case[0] for case in MADE])
@pytest.mark.parametrize("inertia_factor", rest_long((2.0 / 3.0, 0.4, 0.5)))
def test_slopes_of_each_closure_are_found_again(case, inertia_factor):
    closure, own, sliding, difference = case
    data = observations(closure, sigma=0.02, noise=0.0, inertia_factor=inertia_factor, **own)
    problems = [problem_of(data, name, inertia_factor=inertia_factor) for name in CLOSURES]
    plane = psi_plane(problems)
    assert plane.sliding.value == pytest.approx(sliding(inertia_factor), abs=1e-9)
    assert plane.difference.value == pytest.approx(difference(inertia_factor), abs=1e-9)
    assert closure not in plane.sliding.contradicts
    assert closure not in plane.difference.contradicts
    for slope in (plane.sliding, plane.difference):
        low, high = slope.interval95
        assert low < slope.value < high
        assert high - low == pytest.approx(2.0 * 1.96 * slope.stderr, rel=0.35)


def test_what_each_closure_wants():
    data = observations("ifr", e_t=-0.8)
    plane = psi_plane([problem_of(data, name) for name in CLOSURES])
    assert plane.sliding.expected["f"] == pytest.approx((1.0, 1.0))
    assert plane.sliding.expected["ifr"] == pytest.approx((0.4, 1.0))
    assert plane.sliding.expected["ifr-contact"] == pytest.approx((0.0, 1.0), abs=1e-12)
    assert plane.difference.expected["fr"] == pytest.approx((0.0, 2.0), abs=1e-12)
    assert plane.difference.expected["ifr"] == pytest.approx((1.4, 1.4))
    assert plane.difference.expected["ifr-contact"] == pytest.approx((1.0, 1.0))
    fixed = psi_plane([problem_of(data, "ifr", fix={"e_t": -0.7}), problem_of(data, "f")])
    assert fixed.sliding.expected["ifr"] == pytest.approx((0.7, 0.7))


@pytest.mark.parametrize("observable", ["beta", "beta_cm", "tan_psi_after", "spin_y_after", "v_x"])
@pytest.mark.parametrize("spin_y", rest_long((0.3, 0.0, -0.2)))
def test_every_linear_observable_is_the_same_plane(observable, spin_y):
    data = observations("ifr", observables=(observable,), noise=0.0, spin_y=spin_y, e_t=-0.75)
    plane = psi_plane([problem_of(data, "f")])
    assert plane.sliding.value == pytest.approx(0.75, abs=1e-8)
    assert plane.difference.value == pytest.approx(1.4, abs=1e-8)


@pytest.mark.parametrize("observable", ["spin_x_after", "v_y"])
def test_lateral_spin_is_no_hindrance(observable):
    data = observations("ifr", observables=(observable,), noise=0.0, spin_x=0.4, e_t=-0.75, mu=0.4)
    plane = psi_plane([problem_of(data, "f")])
    assert (plane.sliding.value, plane.difference.value) == pytest.approx((0.75, 1.4), abs=1e-8)


@pytest.mark.parametrize("observable", ["mu_app", "tan_psi_out"])
def test_what_holds_e_n_is_a_point_only_where_e_n_is_fixed(observable):
    data = observations("ifr", observables=(observable,), noise=0.0, e_t=-0.75)
    assert "holds e_n too: fix it" in psi_plane([problem_of(data, "f")]).reason
    plane = psi_plane([problem_of(data, "f", fix={"e_n": 0.9})])
    assert (plane.sliding.value, plane.difference.value) == pytest.approx((0.75, 1.4), abs=1e-8)


def test_standard_errors_are_those_of_two_straight_lines():
    data = observations("ifr", sigma=0.02, noise=0.0, e_t=-0.8)
    plane = psi_plane([problem_of(data, "f")])
    # by hand in the plane: Psi_2 = -beta tau, of error sigma tau
    tau = np.tan(np.radians(ANGLES))
    sticks = tau <= 2.5 * 0.15 * 1.9
    slides = np.column_stack((np.ones(tau.size), np.zeros(tau.size), -1.0 / tau))
    stays = np.column_stack((np.ones(tau.size), -np.ones(tau.size), np.zeros(tau.size)))
    design = np.where(sticks[:, None], stays, slides) / 0.02
    expected = np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    assert (plane.sliding.stderr, plane.difference.stderr) == pytest.approx(expected[:2], rel=1e-9)
    assert (plane.n_sticking, plane.n_sliding) == (int(sticks.sum()), int((~sticks).sum()))


def share_held(noise: str, repeats: int) -> int:
    """How many of two intervals an experiment hold their slope."""
    held = 0
    for seed in range(repeats):
        plane = psi_plane(
            [problem_of(observations("ifr", sigma=0.05, seed=seed, e_t=-0.8), "f", noise=noise)]
        )
        for slope, truth in ((plane.sliding, 0.8), (plane.difference, 1.4)):
            held += slope.interval95[0] <= truth <= slope.interval95[1]
    return held


def impacts_that_all_slide(closure: str, seed: int, **own: float):
    gamma = np.linspace(10.0, 85.0, 16)
    return observations(closure, gamma, ("beta",), sigma=0.05, seed=seed, e_n=0.5, mu=0.01, **own)


def test_a_law_that_holds_is_not_contradicted_by_chance():
    # a bend that noise makes of impacts that all slide lies beyond the 95 % interval one time in some twenty
    below = 0
    for seed in range(30):
        plane = psi_plane([problem_of(impacts_that_all_slide("ifr", seed, e_t=-0.8), "ifr")])
        for slope in (plane.sliding, plane.difference):
            assert slope.contradicts == ()
            below += slope.p["ifr"] < 0.05
    assert below >= 1  # the control: at 95 % it would be
    other = psi_plane([problem_of(impacts_that_all_slide("ifr", 0, e_t=-0.6), "f")])
    assert other.sliding.contradicts == ("f",)


def test_intervals_hold_the_slope_most_of_the_time():
    assert share_held("unknown", 12) >= 18  # fewer of 24 have a chance below 1e-4


@pytest.mark.long
@pytest.mark.parametrize("noise", ["known", "scaled", "unknown"])
def test_intervals_hold_the_slope_as_often_as_they_say(noise):
    # within four binomial standard deviations of 95 %; the two of an experiment are nearly independent
    assert abs(share_held(noise, 400) - 760) <= 4.0 * math.sqrt(800 * 0.95 * 0.05)


def test_unknown_noises_of_two_observables_are_told_apart():
    one = observations("ifr", observables=("beta",), sigma=0.01, e_t=-0.8, given=False)
    two = observations("ifr", observables=("tan_psi_after",), sigma=0.3, e_t=-0.8, given=False, seed=1)
    data = type(one)(pd.concat([one.table, two.table], ignore_index=True), one.sources)
    both, alone = (psi_plane([problem_of(d, "f")]) for d in (data, one))
    assert both.sliding.stderr == pytest.approx(alone.sliding.stderr, rel=0.35)


@pytest.mark.parametrize(
    ("gamma", "open_one"), [(np.linspace(2, 20, 12), "sliding"), (np.linspace(70, 85, 12), "difference")]
)
def test_one_regime_leaves_a_slope_open(gamma, open_one):
    plane = psi_plane([problem_of(observations("ifr", gamma, e_t=-0.8), name) for name in CLOSURES])
    slope = getattr(plane, open_one)
    assert not slope.determined
    assert slope.contradicts == () or math.isfinite(slope.interval95[0]) or math.isfinite(slope.interval95[1])


def test_grazing_and_slipless_impacts_take_part():
    gamma = np.concatenate((ANGLES, [90.0]))
    data = observations("ifr", gamma, ("v_x",), noise=0.0, e_t=-0.8)
    rows, _ = psi_rows(problem_of(data, "f"))
    assert np.isinf(rows.tau).sum() == 1
    plane = psi_plane([problem_of(data, "f")])
    assert plane.sliding.value == pytest.approx(0.8, abs=1e-9)
    still = observations("ifr", np.concatenate((ANGLES, [0.0])), ("v_x",), noise=0.0, e_t=-0.8)
    assert psi_plane([problem_of(still, "f")]).n == ANGLES.size  # without slip there is nothing to see


@pytest.mark.parametrize(
    ("data", "choices", "says"),
    [
        (observations("ifr", [0.0] * 6, ("e_n",), e_t=-0.8), {}, "e_n holds no tangential velocity"),
        (observations("ifr", observables=("delta_deg",), e_t=-0.8), {}, "is not linear in the tangential"),
        (observations("ifr", [10.0, 40.0, 60.0, 80.0], e_t=-0.8), {}, "4 rows cannot tell two slopes"),
        (observations("ifr", e_t=-0.8), {"separate": ["mu"]}, "constants are separate"),
        (observations("ifr", noise=0.0, e_t=-0.8), {"noise": "scaled"}, "leave no misfit"),
    ],
)
def test_it_says_why_there_is_none(data, choices, says):
    plane = psi_plane([problem_of(data, "f", **choices)])
    assert says in plane.reason
    assert plane.sliding is None
    assert plane.difference is None


@settings(max_examples=5)
@given(
    e_t=st.floats(-1.0, -0.4),
    mu=st.floats(0.05, 0.4),
    e_n=st.floats(0.3, 1.0),
    name=st.sampled_from(["ifr", "ifr-contact"]),
)
def test_the_plane_tells_the_frictions_apart_for_any_constants(e_t, mu, e_n, name):
    data = observations(name, np.linspace(1.0, 86.0, 60), sigma=0.01, noise=0.0, e_t=e_t, mu=mu, e_n=e_n)
    plane = psi_plane([problem_of(data, x) for x in ("ifr", "ifr-contact")])
    assert plane.sliding.value == pytest.approx(-e_t, abs=1e-6)
    assert plane.difference.value == pytest.approx(1.4 if name == "ifr" else 1.0, abs=1e-6)
    other = "ifr-contact" if name == "ifr" else "ifr"
    assert plane.difference.contradicts == (other,)
