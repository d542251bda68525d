"""Every method, and every result read from a file, has a distribution that answers the same questions."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy import stats

import ifrfit
from ifrfit.inference import load_result
from ifrfit.inference.distributions.truncated_normal import TruncatedNormal

GAMMA = np.linspace(4.0, 80.0, 24)
P = np.array([0.025, 0.16, 0.5, 0.84, 0.975])
METHODS: dict[str, dict[str, Any]] = {
    "exact": {"method": "exact"},
    "lsq": {"method": "lsq"},
    "profile": {"method": "profile"},
    "bootstrap": {"method": ifrfit.Bootstrap(replicates=400)},
}


@pytest.mark.parametrize("method", METHODS)
def test_the_same_questions_have_the_same_answers(impacts, tmp_path, method: str) -> None:
    path = impacts(gamma=GAMMA, observables=("beta", "e_n"), noise=0.03, sigma=0.03, c=-0.75, seed=1)
    fit = ifrfit.fit(path, **METHODS[method])
    fit.save(tmp_path / "r.json")
    exact = ifrfit.fit(path).distribution
    for distribution in (fit.distribution, load_result(tmp_path / "r.json").distribution):
        assert {"e_n", "e_t", "mu", "kappa"} <= set(distribution.names)
        for name in ("e_n", "e_t", "mu", "kappa"):
            sd = exact.sd(name)
            assert distribution.mean(name) == pytest.approx(exact.mean(name), abs=0.5 * sd)
            assert distribution.sd(name) == pytest.approx(sd, rel=0.5)
            quantiles = np.asarray(distribution.quantile(name, P))
            assert quantiles == pytest.approx(np.asarray(exact.quantile(name, P)), abs=1.2 * sd)
            assert distribution.quantile(name, 0.5) == pytest.approx(quantiles[2])
            assert np.asarray(distribution.cdf(name, quantiles)) == pytest.approx(P, abs=0.02)
        parameters = ("e_n", "e_t", "mu")
        covariance = distribution.covariance(parameters)
        assert np.sqrt(np.diag(covariance)) == pytest.approx(
            [distribution.sd(x) for x in parameters], rel=0.05
        )
        drawn = distribution.draws(200, np.random.default_rng(1))
        assert drawn["kappa"] == pytest.approx(drawn["mu"] * (1.0 + drawn["e_n"]))
        assert {x.shape for x in drawn.values()} == {(200,)}
    tau = np.asarray(fit.distribution.quantile("transition_tau[run]", P))
    assert tau == pytest.approx(2.5 * np.asarray(fit.distribution.quantile("kappa", P)), rel=1e-3)


@pytest.mark.parametrize("dof", [math.inf, 6.0])
@pytest.mark.parametrize(("center", "low", "high"), [(0.3, 0.0, 1.0), (-2.5, 0.0, 1.0), (1.8, 0.0, 1.0)])
def test_the_distribution_function_inverts_the_quantiles(dof, center, low, high) -> None:
    normal = TruncatedNormal(min(max(center, low), high), center, 0.4, low, high, dof)
    for p in (0.01, 0.5, 0.975):
        assert normal.cdf(normal.quantile(p)) == pytest.approx(p, abs=1e-9)
    assert (normal.cdf(low - 1.0), normal.cdf(low), normal.cdf(high)) == (0.0, 0.0, 1.0)
    law = stats.norm(center, 0.4) if math.isinf(dof) else stats.t(dof, center, 0.4)
    share = (law.cdf(0.5) - law.cdf(low)) / (law.cdf(high) - law.cdf(low))
    assert normal.cdf(0.5) == pytest.approx(share, abs=1e-6)


def test_what_the_data_do_not_see_is_spread_evenly_over_its_domain() -> None:
    open_ = TruncatedNormal(0.3, 0.3, math.inf, 0.0, 0.5)
    assert (open_.quantile(0.2), open_.cdf(0.25)) == pytest.approx((0.1, 0.5))
