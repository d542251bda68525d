"""A mixture against the closed form of a mixture of normal laws."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy import special

from ifrfit.inference.distributions.mixture import Mixture, Tabulated

WEIGHTS = np.array([0.2, 0.5, 0.3])
PLACES = np.array([-1.0, 0.0, 2.0])
MEANS = np.array([0.3, 1.0, 4.0])
SDS = np.array([0.5, 0.7, 1.1])


@dataclass(frozen=True)
class Normal:
    """x, and y = -x; a transition that is exp(x)."""

    mean_of_x: float
    sd_of_x: float
    names = ("x", "y")
    resolution = 0.02
    n_draws = np.inf

    def mean(self, name):
        return self.mean_of_x if name == "x" else -self.mean_of_x

    def sd(self, name):
        return self.sd_of_x

    def cdf(self, name, value):
        return special.ndtr((np.asarray(value) - self.mean(name)) / self.sd_of_x)

    def quantile(self, name, p):
        if name == "transition_tau[a]":
            return np.exp(self.quantile("x", p))
        return self.mean(name) + self.sd_of_x * special.ndtri(p)

    def covariance(self, names):
        signs = np.array([1.0 if name == "x" else -1.0 for name in names])
        return self.sd_of_x**2 * np.outer(signs, signs)

    def draws(self, n, rng):
        x = self.mean_of_x + self.sd_of_x * rng.standard_normal(n)
        return {"x": x, "y": -x}


@pytest.fixture
def mixture():
    components = tuple(Normal(mean, sd) for mean, sd in zip(MEANS, SDS, strict=True))
    marginal = Tabulated(np.array([-2.0, 3.0]), np.array([0.0, 1.0]))
    return Mixture("z", PLACES, WEIGHTS, components, marginal, 0.0, 0.0, 0.0, 1e-4)


def test_moments_are_those_of_total_variance(mixture):
    mean = WEIGHTS @ MEANS
    variance = WEIGHTS @ (SDS**2 + MEANS**2) - mean**2
    assert mixture.names == ("x", "y", "z")
    assert mixture.mean("y") == pytest.approx(-mean, rel=1e-14)
    assert mixture.sd("x") == pytest.approx(np.sqrt(variance), rel=1e-14)
    z = PLACES - WEIGHTS @ PLACES
    expected = np.array([[variance, WEIGHTS @ (MEANS * z)], [WEIGHTS @ (MEANS * z), WEIGHTS @ z**2]])
    np.testing.assert_allclose(mixture.covariance(["x", "z"]), expected, rtol=1e-13)
    assert mixture.sd("z") == pytest.approx(np.sqrt(expected[1, 1]), rel=1e-14)


def test_quantiles_invert_the_distribution_function(mixture):
    p = np.array([1e-6, 0.025, 0.16, 0.5, 0.84, 0.975, 1.0 - 1e-6])
    at = mixture.quantile("x", p)
    below = (WEIGHTS[:, None] * special.ndtr((at - MEANS[:, None]) / SDS[:, None])).sum(axis=0)
    np.testing.assert_allclose(below, p, atol=1e-7)
    np.testing.assert_allclose(mixture.cdf("x", at), p, atol=1e-7)
    np.testing.assert_allclose(mixture.quantile("y", 1.0 - p), -at, atol=1e-5)
    assert isinstance(mixture.quantile("x", 0.5), float)
    # a single normal law of the same mean and sd has other quantiles
    assert abs(at[3] - mixture.mean("x")) > 0.2


def test_what_has_quantiles_only_is_mixed_by_them(mixture):
    p = np.array([0.025, 0.5, 0.975])
    np.testing.assert_allclose(
        mixture.quantile("transition_tau[a]", p), np.exp(mixture.quantile("x", p)), rtol=3e-3
    )


def test_what_may_be_infinite_stays_so(mixture):
    components = (Normal(0.0, 1.0), Normal(800.0, 1.0))
    one = Mixture("z", PLACES[:2], np.array([0.4, 0.6]), components, mixture.marginal, 0.0, 0.0, 0.0, 1e-4)
    with np.errstate(over="ignore"):
        found = one.quantile("transition_tau[a]", [0.2, 0.9])
    assert found[0] == pytest.approx(1.0, abs=1e-3)
    assert np.isinf(found[1])


def test_draws_go_together(mixture):
    drawn = mixture.draws(20_000, np.random.default_rng(1))
    np.testing.assert_array_equal(drawn["x"], -drawn["y"])
    assert set(drawn["z"]) == set(PLACES)
    rows = drawn["z"] == 2.0
    assert rows.mean() == pytest.approx(0.3, abs=0.015)
    assert drawn["x"][rows].mean() == pytest.approx(4.0, abs=0.06)
    assert drawn["x"].std() == pytest.approx(mixture.sd("x"), rel=0.03)


def test_the_further_quantity_is_tabulated(mixture):
    assert mixture.quantile("z", 0.5) == pytest.approx(0.5)
    assert mixture.cdf("z", 0.5) == pytest.approx(0.5)
    np.testing.assert_allclose(mixture.cdf("z", [-3.0, 4.0]), [0.0, 1.0])
