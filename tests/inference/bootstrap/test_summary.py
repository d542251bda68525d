"""A whole fit by bootstrap: statuses, facts, warnings, JSON, predictions, figure."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from factories import table_file
from json_schemas import validator

import ifrfit
from ifrfit import Bootstrap
from ifrfit.inference.distributions.draws import Draws
from ifrfit.inference.io.json_text import dumps
from ifrfit.inference.io.read_result import from_dict

GAMMA = np.linspace(5.0, 85.0, 30)


@pytest.fixture
def both(impacts):
    path = impacts(gamma=GAMMA, observables=("beta", "e_n"), noise=0.03, sigma=0.03, c=-0.75, seed=1)
    return ifrfit.fit(path, method=Bootstrap(replicates=500))


def test_values_are_medians_and_stderr_the_sd_of_the_draws(both) -> None:
    for name in ("e_n", "e_t", "mu"):
        found, draws = both.constants[name], both.distribution.values[name]
        assert found.status == "determined"
        assert found.value == pytest.approx(np.median(draws))
        assert found.mean == pytest.approx(draws.mean())
        assert found.stderr == pytest.approx(draws.std())
        assert found.interval95 == pytest.approx(np.quantile(draws, (0.025, 0.975)))
        assert found.interval68 == pytest.approx(np.quantile(draws, (0.16, 0.84)))
    assert both.facts["converged"].ok
    assert (
        both.facts["converged"].figures["replicates"] == both.facts["converged"].figures["certified"] == 500
    )
    assert both.facts["converged"].says == "all 500 replicates have an answer"
    assert both.facts["resampling"].ok
    assert "predictive" not in both.facts
    assert both.fit.log_evidence is None
    assert "bootstrap (cases, 500 replicates)" in both.summary()


def test_the_file_fits_the_schema_and_comes_back_the_same(both, tmp_path) -> None:
    content = json.loads(dumps(both.to_dict()))
    validator("result").validate(content)
    assert content["method"] == "bootstrap"
    assert len(content["state"]["sample"]["e_t"]) == 500
    again = from_dict(content)
    assert again.to_dict() == content
    assert again.predict([20.0, 60.0]).equals(both.predict([20.0, 60.0]))
    assert again.summary() == both.summary()


def test_bands_and_draws_are_those_of_the_replicates(both) -> None:
    table = both.predict([10.0, 70.0])
    e_t = both.distribution.values["e_t"]
    assert table["value"][0] == pytest.approx(np.median(e_t) + 1.4)
    assert (table["lo95"][0], table["hi95"][0]) == pytest.approx(
        tuple(np.quantile(e_t + 1.4, (0.025, 0.975)))
    )
    drawn = both.draws(100, np.random.default_rng(1))
    assert set(drawn["e_t"]) <= set(e_t)
    assert drawn["kappa"].to_numpy() == pytest.approx((drawn["mu"] * (1.0 + drawn["e_n"])).to_numpy())
    words = [text.get_text() for legend in both.plot().legends for text in legend.get_texts()]
    assert "68, 95 % bands (bootstrap)" in words


def test_beta_alone_has_kappa_and_no_values_of_e_n_and_mu(impacts) -> None:
    found = ifrfit.fit(impacts(gamma=GAMMA, noise=0.03, c=-0.75), method=Bootstrap(replicates=300))
    assert found.constants["e_n"].value is None
    assert found.constants["mu"].value is None
    assert found.derived["kappa"].status == found.constants["e_t"].status == "determined"
    assert not any("Gaussian" in says for says in found.warnings)
    assert isinstance(found.distribution, Draws)


@pytest.mark.parametrize("seed", [1, 3])  # the best fit has all nine impacts stick; it has the last one slide
def test_sticking_impacts_alone_give_no_neat_interval_of_mu(impacts, seed) -> None:
    found = ifrfit.fit(
        impacts(gamma=np.linspace(3.0, 27.0, 9), noise=0.01, sigma=0.01, c=-0.75, seed=seed),
        fix={"e_n": 0.94},
        method=Bootstrap(replicates=300),
    )
    mu = found.constants["mu"]
    assert (mu.value, mu.stderr) == (None, None)
    assert mu.interval95[1] == math.inf
    assert found.constants["e_t"].status == "determined"
    assert found.fit.n_sliding == (seed == 3)
    assert found.facts["converged"].ok == (seed == 1)
    assert (found.state.sample is None) == (seed == 1)
    said = "those of the Gaussian" if seed == 1 else "of the replicates that have an answer"
    assert any(said in says for says in found.warnings)
    assert np.isfinite(found.predict([10.0])["hi95"]).all()


def test_one_sliding_impact_gives_only_a_lower_limit_and_says_so(impacts) -> None:
    gamma = [5.0, 9.0, 13.0, 17.0, 21.0, 24.0, 26.0, 60.0]
    found = ifrfit.fit(
        impacts(gamma=gamma, noise=0.002, sigma=0.002, c=-0.75),
        fix={"e_n": 0.94},
        method=Bootstrap(replicates=300),
    )
    fact = found.facts["converged"]
    assert not fact.ok
    assert fact.figures["failed"] == fact.figures["reasons"]["no impact slides in it"] > 60
    assert "have no answer: no impact slides in it" in fact.says
    assert "--method exact" in fact.says
    for estimate in (found.constants["mu"], found.derived["kappa"]):
        assert estimate.value is None
        assert estimate.status == "one_sided"
        assert estimate.interval95[1] == math.inf
        assert "of 300 replicates leave it open" in estimate.reason
    assert found.constants["e_t"].status == "determined"
    assert found.summary().startswith("LOOK  the estimator did not converge")
    exact = ifrfit.fit(impacts(gamma=gamma, noise=0.002, sigma=0.002, c=-0.75), fix={"e_n": 0.94})
    assert exact.constants["mu"].status == "determined"  # what the remedy gives


def test_a_constant_measured_once_is_too_little_to_draw_from(impacts) -> None:
    once = {"gamma": [0.0], "observables": ("e_n",), "sigma": 0.01}
    path = impacts({"gamma": GAMMA, "noise": 0.03, "sigma": 0.03, "c": -0.75}, once)
    found = ifrfit.fit(path, method=Bootstrap(replicates=200))
    assert found.constants["e_n"].status == "not_determined"
    assert found.constants["e_n"].reason.startswith("every replicate is the same")
    assert found.constants["e_t"].status == "determined"
    assert not found.facts["resampling"].ok
    assert "1 impact with e_n in run" in found.facts["resampling"].says
    assert "too little to draw from" in found.summary().splitlines()[0]
    remedied = ifrfit.fit(path, method=Bootstrap("residual", replicates=200))
    assert remedied.facts["resampling"].ok
    assert remedied.constants["e_n"].stderr == pytest.approx(0.01, rel=0.3)


def test_residuals_of_one_impact_drawn_apart_are_told(impacts, tmp_path) -> None:
    state = ifrfit.rebound(GAMMA, e_n=0.9, e_t=-0.8, mu=0.12, degrees=True)
    rng = np.random.default_rng(1)
    beta, e_n = state.beta + 0.03 * rng.standard_normal(30), 0.9 + 0.01 * rng.standard_normal(30)
    columns = {"gamma_deg": GAMMA, "beta": beta, "e_n": e_n, "sigma_beta": 0.03, "sigma_e_n": 0.01}
    path = table_file(tmp_path / "wide.csv", columns)
    for resample, told in (("residual", True), ("wild", False), ("cases", False)):
        found = ifrfit.fit(path, method=Bootstrap(resample, replicates=200))
        assert any("drawn apart" in says for says in found.warnings) == told


def test_a_constant_on_its_bound_keeps_the_interval_of_least_squares(impacts) -> None:
    path = impacts(gamma=GAMMA, observables=("beta", "e_n"), noise=0.02, sigma=0.02, c=-1.0, seed=2)
    found, local = ifrfit.fit(path, method=Bootstrap(replicates=100)), ifrfit.fit(path, method="lsq")
    on_bound = (found.distribution.values["e_t"] == -1.0).sum()
    assert on_bound > 50, "the replicates are to lie on the bound"
    assert found.constants["e_t"] == local.constants["e_t"]
    assert found.constants["e_t"].interval95[1] > -0.999
    assert found.constants["mu"] != local.constants["mu"]
    said = [warning for warning in found.warnings if "on a bound of its domain" in warning]
    assert said == [
        f"Of 100 replicates lies e_t in {on_bound} on a bound of its domain. Such replicates do not tell how "
        "far from the bound it may be: its interval is that of least squares."
    ]


def test_one_impact_a_series_determines_nothing(tmp_path) -> None:
    state = ifrfit.rebound(GAMMA[::4], e_n=0.9, e_t=-0.7, mu=0.15, degrees=True)
    rng = np.random.default_rng(6)
    beta, e_n = (x + 0.01 * rng.standard_normal(8) for x in (state.beta, 0.9))
    columns = {"gamma_deg": GAMMA[::4], "beta": beta, "e_n": e_n, "series": list("ABCDEFGH")}
    found = ifrfit.fit(table_file(tmp_path / "t.csv", columns), method=Bootstrap(replicates=100))
    assert {each.status for each in found.flat_constants().values()} == {"not_determined"}
    assert not found.noise.estimates  # no sd of 0 beside a noise either
    assert "other angles" not in found.summary()
