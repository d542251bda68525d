"""Draws of unequal weight as a distribution."""

from __future__ import annotations

import numpy as np
import pytest

from ifrfit.inference.distributions.draws import Draws, WeightedDraws

VALUES = np.array([3.0, 1.0, 2.0, 5.0])
WEIGHTS = np.array([0.2, 0.5, 0.2, 0.1])


def weighted(values=VALUES, weights=WEIGHTS, transitions=None):
    return WeightedDraws({"mu": values, "e_n": -values}, transitions or {}, weights)


def test_moments_are_those_of_the_discrete_law():
    post = weighted()
    assert post.mean("mu") == pytest.approx(2.0)
    assert post.sd("mu") == pytest.approx(np.sqrt(0.2 * 1.0 + 0.5 * 1.0 + 0.1 * 9.0))
    np.testing.assert_allclose(post.covariance(("mu", "e_n")), 1.6 * np.array([[1.0, -1.0], [-1.0, 1.0]]))
    assert post.n_draws == np.floor(1.0 / (WEIGHTS @ WEIGHTS))
    assert post.names == ("mu", "e_n")


def test_the_distribution_function_counts_the_weight_below():
    np.testing.assert_allclose(weighted().cdf("mu", [0.0, 1.5, 2.5, 4.0, 5.0]), [0.0, 0.5, 0.7, 0.9, 1.0])
    assert weighted().cdf("mu", 1.5) == pytest.approx(0.5)


def test_quantiles_of_equal_weights_are_those_of_draws():
    values = np.random.default_rng(2).normal(size=4000)
    own = weighted(values, np.full(4000, 1.0 / 4000))
    p = np.array([0.025, 0.16, 0.5, 0.84, 0.975])
    np.testing.assert_allclose(own.quantile("mu", p), Draws({"mu": values}).quantile("mu", p), atol=5e-3)
    assert own.quantile("mu", 0.5) == pytest.approx(np.median(values), abs=2e-3)


def test_weights_stand_for_what_was_not_drawn_from():
    # a normal law by weighted draws of one twice as wide
    rng = np.random.default_rng(3)
    x = 2.0 * rng.standard_normal(200_000)
    w = np.exp(-0.5 * x**2 + 0.125 * x**2)
    own = weighted(x, w / w.sum())
    assert own.sd("mu") == pytest.approx(1.0, abs=0.01)
    assert own.quantile("mu", 0.975) == pytest.approx(1.96, abs=0.02)
    drawn = own.draws(20_000, rng)["mu"]
    assert drawn.std() == pytest.approx(1.0, abs=0.03)
    assert abs(np.corrcoef(drawn[:-1], drawn[1:])[0, 1]) < 0.03  # in random order


def test_infinite_transitions_have_infinite_quantiles():
    tau = {"transition_tau[run]": np.array([1.0, 2.0, np.inf, np.inf])}
    own = weighted(transitions=tau)
    assert own.quantile("transition_tau[run]", 0.1) < 2.0
    assert own.quantile("transition_tau[run]", 0.95) == np.inf
    none = weighted(transitions={"transition_tau[run]": np.full(4, np.inf)})
    assert none.quantile("transition_tau[run]", 0.5) == np.inf
