"""Diagnostics against known answers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from arviz_stats.base import array_stats
from mcmc_targets import autoregressive
from scipy import stats

from ifrfit.inference.mcmc.stopping import (
    Evidence,
    autocorrelation_time,
    effective,
    effective_bulk,
    effective_tail,
    rhat,
)

PHI = 0.8
TAU = (1.0 + PHI) / (1.0 - PHI)  # 9
SHAPE = (4, 4000, 16)


def test_autocorrelation_time_of_a_known_series() -> None:
    assert autocorrelation_time(autoregressive(SHAPE, PHI)) == pytest.approx(TAU, rel=0.05)


def test_effective_draws_of_independent_walkers() -> None:
    x = autoregressive(SHAPE, PHI)
    assert effective(x) == pytest.approx(x.size / TAU, rel=0.15)
    assert effective_bulk(x) == pytest.approx(x.size / TAU, rel=0.15)


@pytest.mark.parametrize("common", [0.1, 0.5])
def test_effective_draws_of_walkers_that_move_together(common: float) -> None:
    # the mean over the walkers has variance common + (1 - common)/walkers, and the same autocorrelation
    x = autoregressive(SHAPE, PHI, common=common)
    of_mean = common + (1.0 - common) / SHAPE[2]
    expected = SHAPE[0] * SHAPE[1] / TAU / of_mean
    assert effective(x) == pytest.approx(expected, rel=0.25)


def test_they_are_what_the_scatter_of_repeated_runs_says() -> None:
    runs = [autoregressive((4, 500, 8), PHI, common=0.2, seed=seed) for seed in range(200)]
    error_model = np.var([x.mean() for x in runs])
    stated = np.median([effective(x) for x in runs])
    assert stated == pytest.approx(1.0 / error_model, rel=0.35)  # 200 repeats know a variance to 10 %


def test_draws_in_one_row_would_look_independent() -> None:
    # the control: an estimator for single chains overlooks what lies a whole ensemble apart
    x = autoregressive(SHAPE, PHI)
    naive = float(array_stats.ess(x.reshape(SHAPE[0], -1), method="bulk"))
    assert naive > 3.0 * x.size / TAU


def test_tails_count_their_own_draws() -> None:
    # being below a quantile is forgotten sooner than the quantity itself, by the law of two normal numbers
    x, edge, p = autoregressive(SHAPE, PHI), stats.norm.ppf(0.05), 0.05
    both = [
        stats.multivariate_normal.cdf([edge, edge], cov=[[1.0, r], [r, 1.0]]) for r in PHI ** np.arange(1, 60)
    ]
    tau = 1.0 + 2.0 * sum((b - p * p) / (p - p * p) for b in both)
    assert tau < 0.8 * TAU
    assert effective_tail(x) == pytest.approx(x.size / tau, rel=0.2)


def test_rhat_of_chains_that_agree_and_of_those_that_do_not() -> None:
    x = autoregressive(SHAPE, PHI)
    assert 1.0 <= rhat(x) < 1.005
    shifted = x + np.array([0.0, 0.0, 0.0, 0.5])[:, None, None]
    assert rhat(shifted) > 1.02
    wider = x * np.array([1.0, 1.0, 1.0, 2.0])[:, None, None]
    assert rhat(wider) > 1.02  # the folded ranks see it
    drifting = x + np.linspace(-0.5, 0.5, SHAPE[1])[None, :, None]
    assert rhat(drifting) > 1.02  # the halves see it


def test_what_never_moved_is_no_evidence() -> None:
    still = np.ones((4, 100, 8))
    assert rhat(still) == math.inf
    assert autocorrelation_time(still) == math.inf
    assert effective_bulk(still) == 0.0
    assert effective_tail(still) == 0.0


def test_starts_are_discarded_by_autocorrelation_times() -> None:
    x = autoregressive(SHAPE, PHI)
    evidence = Evidence({"x": x})
    assert evidence.discarded == pytest.approx(10.0 * TAU, rel=0.2)
    assert evidence.kept["x"].shape[1] == SHAPE[1] - evidence.discarded
    slow = Evidence({"x": autoregressive((4, 60, 16), 0.99)})
    assert slow.discarded == 30
    assert Evidence({"x": np.ones((4, 100, 8))}).discarded == 50
