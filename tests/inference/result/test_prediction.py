"""Draws and bands: known laws, bounds, and what must be refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

import ifrfit
from ifrfit.errors import UsageError
from ifrfit.inference.distributions.truncated_gaussian import truncated_draws
from ifrfit.inference.distributions.truncated_normal import TruncatedNormal
from ifrfit.inference.result.types import State

GAMMA = np.linspace(4.0, 86.0, 34)


def drawn_from(center, covariance, lower, upper, n, seed):
    center = np.array(center, dtype=float)
    lower, upper = np.array(lower, dtype=float), np.array(upper, dtype=float)
    point = np.clip(center, lower, upper)
    names = tuple(f"c{i}" for i in range(center.size))
    state = State(names, point, center, np.array(covariance), lower, upper)
    return truncated_draws(state, n, np.random.default_rng(seed))


def test_draws_follow_the_truncated_law():
    # one coordinate whose centre lies one sd beyond its bound
    drawn = drawn_from([-1.0], [[1.0]], [0.0], [np.inf], 20_000, 1)[:, 0]
    law = stats.truncnorm(1.0, np.inf, loc=-1.0)
    assert stats.kstest(drawn, law.cdf).pvalue > 1e-3
    # control: the law without the cut is refused
    assert stats.kstest(drawn, stats.norm(-1.0).cdf).pvalue < 1e-6


def test_correlated_draws_keep_mean_and_covariance():
    covariance = np.array([[1.0, 0.9, 0.0], [0.9, 1.0, 0.3], [0.0, 0.3, 1.0]])
    drawn = drawn_from([1.0, 2.0, 3.0], covariance, [-np.inf] * 3, [np.inf] * 3, 40_000, 2)
    np.testing.assert_allclose(drawn.mean(axis=0), [1.0, 2.0, 3.0], atol=0.03)
    np.testing.assert_allclose(np.cov(drawn.T), covariance, atol=0.05)


def test_a_far_tail_keeps_its_digits():
    # centre 50 sd below the bound: the cut law is exponential with rate 50
    above, below = (
        TruncatedNormal(0.0, -50.0, 1.0, 0.0, np.inf),
        TruncatedNormal(0.0, 50.0, 1.0, -np.inf, 0.0),
    )
    assert above.quantile(0.95) == pytest.approx(np.log(20.0) / 50.0, rel=1e-2)
    assert below.quantile(0.05) == pytest.approx(-np.log(20.0) / 50.0, rel=1e-2)


def test_bands_hold_the_curve_and_widen_for_a_new_measurement(impacts):
    found = ifrfit.fit(impacts(gamma=GAMMA, noise=0.03, sigma=0.03, c=-0.8), fix={"e_n": 0.94})
    table = found.predict([10.0, 45.0, 80.0])
    assert (table["lo95"] < table["lo68"]).all()
    assert (table["lo68"] < table["value"]).all()
    assert (table["value"] < table["hi68"]).all()
    assert (table["hi95"] < table["new_hi95"]).all()
    # sticking: beta = e_t + 7/5, so the band is that of e_t
    e_t = found.constants["e_t"]
    assert table["hi95"][0] - table["lo95"][0] == pytest.approx(2 * 1.96 * e_t.stderr, rel=0.1)
    assert found.predict([10.0]).equals(found.predict([10.0]))


def test_the_noise_of_a_new_measurement_can_be_given_angle_by_angle(impacts):
    found = ifrfit.fit(impacts(gamma=GAMMA, noise=0.03, sigma=0.03, c=-0.8), fix={"e_n": 0.94})
    gamma, sigma = [10.0, 45.0, 80.0], np.array([0.0, 0.03, 0.3])
    own, given = found.predict(gamma), found.predict(gamma, sigma=sigma)
    assert own.drop(columns=[c for c in own if c.startswith("new")]).equals(
        given.drop(columns=[c for c in given if c.startswith("new")])
    )
    width = (given["new_hi95"] - given["new_lo95"]).to_numpy()
    assert width[0] == pytest.approx(given["hi95"][0] - given["lo95"][0], rel=1e-9)
    assert width[1] == pytest.approx(own["new_hi95"][1] - own["new_lo95"][1], rel=1e-9)
    assert width[2] == pytest.approx(2 * 1.96 * 0.3, rel=0.05)


def test_prediction_of_what_was_not_measured_carries_the_loose_constant(impacts):
    found = ifrfit.fit(impacts(gamma=GAMMA, noise=0.03, sigma=0.03, c=-0.8))
    table = found.predict([45.0], observable="e_n")
    assert table["hi95"][0] - table["lo95"][0] > 0.7  # e_n is open: nearly the whole domain
    assert np.isnan(table["new_hi95"][0])  # no noise is known for e_n


def test_draws_are_a_table_of_the_constants(impacts):
    found = ifrfit.fit(impacts(gamma=GAMMA, noise=0.03, sigma=0.03, c=-0.8), fix={"e_n": 0.94})
    drawn = found.draws(500, np.random.default_rng(0))
    assert list(drawn.columns) == ["e_n", "e_t", "mu", "kappa"]
    assert (drawn["e_n"] == 0.94).all()
    np.testing.assert_allclose(drawn["mu"] * 1.94, drawn["kappa"])
    assert drawn["mu"].std() == pytest.approx(found.constants["mu"].stderr, rel=0.2)


def test_without_bands_the_same_values_are_all_there_is(impacts):
    found = ifrfit.fit(impacts(gamma=GAMMA, noise=0.03, sigma=0.03, c=-0.8), fix={"e_n": 0.94})
    whole, bare = found.predict(GAMMA), found.predict(GAMMA, bands=False)
    assert list(bare) == ["gamma_deg", "spin_x", "spin_y", "value"]
    np.testing.assert_array_equal(bare, whole[list(bare)])


@pytest.mark.parametrize("bands", [True, False])
def test_more_friction_than_two_mu_is_told(impacts, bands):
    found = ifrfit.fit(impacts(gamma=GAMMA, noise=0.03, sigma=0.03, c=-0.8), fix={"e_n": 0.94}, method="lsq")
    e_t, mu = found.constants["e_t"].value, found.constants["mu"].value
    # mu (1 + (2/7)(1 + e_t) tau/kappa) = 2 mu
    limit = np.degrees(np.arctan(3.5 * mu * 1.94 / (1.0 + e_t)))
    assert found.predict([10.0, limit - 0.01], bands=bands).attrs["warnings"] == ()
    (warning,) = found.predict([10.0, limit + 0.01], observable="mu_app", bands=bands).attrs["warnings"]
    assert f"exceeds 2 mu at 1 of 2 incidences and is {2.0 * mu:.3g} (2 mu) at the worst" in warning
    assert "sliding under closure IFR has an impulse that grows with the slip" in warning
    assert "at 1 of 1 incidences" in found.predict([45.0], spin_y=50.0).attrs["warnings"][0]
    assert found.predict([90.0]).attrs["warnings"] == ()  # where there is no impact


def test_sliding_by_coulomb_alone_never_exceeds_mu(impacts):
    found = ifrfit.fit(impacts(gamma=GAMMA, noise=0.03, sigma=0.03, c=-0.8), closure="fr", fix={"e_n": 0.94})
    assert found.predict([10.0, 89.9, 90.0], spin_y=[0.0, 50.0, 0.0]).attrs["warnings"] == ()


def test_angles_beyond_the_wall_and_lengths_that_do_not_fit_are_refused():
    fit = ifrfit.fit("cornell-glass")
    for given, said in (
        ({"gamma": [10.0, 120.0]}, "gamma 120: incidence angles lie between 0 and 90 degrees"),
        ({"gamma": [-1.0]}, "gamma -1"),
        ({"gamma": [2.0], "degrees": False}, "gamma 2: .* pi/2"),
        ({"gamma": [10.0, 20.0], "spin_y": [0.1, 0.2, 0.3]}, "as long as one another"),
        ({"gamma": "10:80:10"}, "give numbers"),
    ):
        with pytest.raises(UsageError, match=said):
            fit.predict(observable="beta_cm", **given)


@pytest.mark.parametrize("closure", ["ifr", "fr", "maw"])
def test_curves_have_their_kinks_where_sticking_ends(closure):
    from ifrfit.inference.result.prediction import kinks_of

    beta = ifrfit.rebound(GAMMA, e_n=0.9, e_t=-0.8, mu=0.15, degrees=True).beta
    fit = ifrfit.fit(gamma_deg=GAMMA, beta=beta, sigma=0.01, fix={"e_n": 0.9}, closure=closure, method="lsq")
    (kink,) = kinks_of(fit, fit.problem.series[0])
    names = fit.problem.closure.constants
    constants = dict(zip(names, fit.least_squares.optimum.theta.tolist(), strict=True))
    near = ifrfit.rebound([kink - 1e-4, kink + 1e-4], **constants, closure=closure, degrees=True)
    assert near.sticking.tolist() == [True, False]
