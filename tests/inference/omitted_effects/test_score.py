"""Score tests against known answers, and controls that must fail."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from ifrfit.inference.diagnostics.omitted_effects.effect_signatures import Direction
from ifrfit.inference.diagnostics.omitted_effects.score_tests import best_of, holm, scores

N = 40
RNG = np.random.default_rng(3)
JACOBIAN = np.column_stack((np.ones(N), np.linspace(0.0, 1.0, N)))
BEND = np.linspace(-1.0, 1.0, N) ** 2


def bend(**choices):
    return Direction("compliance", BEND, **choices)


def rest_of(*columns, of):
    basis = np.column_stack(columns)
    return float(((of - basis @ np.linalg.lstsq(basis, of)[0]) ** 2).sum())


@pytest.mark.parametrize("size", [0.0, 0.5, 3.0])
def test_of_unknown_noise_it_is_the_nested_f_test(size):
    """Exactly, with the row that speaks most for the direction kept: its own p is the larger one or equal."""
    residual = size * BEND + RNG.standard_normal(N)
    (one,) = scores([bend(two_sided=True)], JACOBIAN, residual, known=False)
    without, with_it = rest_of(JACOBIAN, of=residual), rest_of(JACOBIAN, BEND, of=residual)
    f = (without - with_it) / (with_it / (N - 3))
    assert one.p >= stats.f.sf(f, 1, N - 3) * (1.0 - 1e-9)
    assert one.drop == pytest.approx((N - 2) * np.log(without / with_it), rel=1e-9)
    basis = np.column_stack((JACOBIAN, BEND))
    assert one.strength == pytest.approx(np.linalg.lstsq(basis, residual)[0][2], rel=1e-9)


def test_of_known_noise_the_drop_is_that_of_chi2():
    residual = 2.0 * BEND + RNG.standard_normal(N)
    (one,) = scores([bend()], JACOBIAN, residual, known=True)
    assert one.drop == pytest.approx(rest_of(JACOBIAN, of=residual) - rest_of(JACOBIAN, BEND, of=residual))
    assert one.chi2 == pytest.approx((rest_of(JACOBIAN, of=residual), rest_of(JACOBIAN, BEND, of=residual)))
    assert one.dof == N - 3
    whole = rest_of(JACOBIAN, of=residual) - rest_of(JACOBIAN, of=residual - BEND)
    assert one.drop_whole == pytest.approx(whole)


def test_constants_change_nothing():
    residual = RNG.standard_normal(N)
    (before,) = scores([bend()], JACOBIAN, residual, known=False)
    moved = Direction("compliance", BEND + JACOBIAN @ [3.0, -2.0])
    (after,) = scores([moved], JACOBIAN, residual + JACOBIAN @ [-5.0, 1.0], known=False)
    assert after.p == pytest.approx(before.p, rel=1e-6)
    assert after.strength == pytest.approx(before.strength, rel=1e-6)


def test_what_the_constants_imitate_is_not_tested():
    spanned = Direction("compliance", JACOBIAN @ [1.0, 2.0])
    nothing = Direction("rolling", np.zeros(N))
    assert scores([spanned, nothing], JACOBIAN, RNG.standard_normal(N), known=True) == []
    assert scores([bend()], np.eye(N), RNG.standard_normal(N), known=True) == []


def test_an_effect_of_the_wrong_sign_is_none():
    residual = -4.0 * BEND + 0.1 * RNG.standard_normal(N)
    assert scores([bend()], JACOBIAN, residual, known=False)[0].p > 0.999
    assert scores([bend(two_sided=True)], JACOBIAN, residual, known=False)[0].p < 1e-10


def test_one_outlier_is_no_effect():
    """Where the direction is steepest: else it would stand out by four standard deviations."""
    residual = 0.5 * RNG.standard_normal(N)
    residual[0] += 20.0
    for known in (True, False):
        (one,) = scores([bend()], JACOBIAN, residual, known=known)
        assert one.p > 0.01
    assert rest_of(JACOBIAN, of=residual) - rest_of(JACOBIAN, BEND, of=residual) > 4.0**2


def test_noise_larger_than_sigma_says_is_no_effect():
    """Sigma understated five times: chi2 would find every direction significant, the scatter does not."""
    found = 0
    for seed in range(200):
        residual = 5.0 * np.random.default_rng(seed).standard_normal(N)
        (one,) = scores([bend()], JACOBIAN, residual, known=True)
        found += one.p < 0.05
    assert found <= 20


def test_p_is_uniform_or_larger_without_an_effect():
    p = [
        scores([bend()], JACOBIAN, np.random.default_rng(seed).standard_normal(N), known=False)[0].p
        for seed in range(2000)
    ]
    for level in (0.5, 0.1, 0.01):
        assert np.mean(np.array(p) < level) <= level + 3.5 * np.sqrt(level * (1.0 - level) / 2000)


def test_holm_against_his_rule():
    p = [0.01, 0.04, 0.03, 0.005]
    assert holm(p) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.9, 0.6]) == [1.0, 1.0]


def test_the_law_whose_own_size_fits_is_named():
    """Two laws of one shape: the slope tells which, where the theory says how large it is."""
    residual = BEND + 0.01 * RNG.standard_normal(N)
    small = Direction("viscoelastic", 0.1 * BEND, whole=True)
    right = Direction("plasticity", BEND, whole=True)
    tested = scores([small, right], JACOBIAN, residual, known=False)
    assert [one.direction.name for one in best_of(tested)] == ["plasticity"]
    open_size = scores([Direction("viscoelastic", 0.1 * BEND), right], JACOBIAN, residual, known=False)
    assert {one.direction.name for one in best_of(open_size)} == {"viscoelastic", "plasticity"}
    assert best_of([]) == []


def test_ways_of_one_slip_count_as_one_hypothesis():
    """Two of half a share each: together they are corrected as one is, and cost the third no more."""
    assert holm([0.01, 0.04, 0.03], [0.5, 0.5, 1.0]) == pytest.approx([0.04, 0.045, 0.045])
    assert holm([0.02, 0.5, 0.5], [1.0, 0.5, 0.5])[0] == pytest.approx(0.04)
