"""Results go to other processes and into caches of other programs: copied, they say the same."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pandas as pd
import pytest

import ifrfit

GAMMA = np.linspace(5.0, 85.0, 12)


def table(seed):
    """Impacts with noise of 0.01."""
    rng = np.random.default_rng(seed)
    state = ifrfit.rebound(GAMMA, e_n=0.9, e_t=0.6, mu=0.12, degrees=True)
    beta, e_n = state.beta + 0.01 * rng.normal(size=12), 0.9 + 0.01 * rng.normal(size=12)
    return pd.DataFrame({"gamma_deg": GAMMA, "beta": beta, "e_n": e_n})


ONE, TWO = table(1), {"a": table(1), "b": table(2)}
QUESTIONS = {
    "over the transition": (ONE, {}),
    "unknown noise": (ONE, {"noise": "unknown"}),
    "on grids": (ONE, {"closure": "f"}),
    "one scale": (ONE.assign(sigma_beta=0.01, sigma_e_n=0.01), {"noise": "scaled"}),
    "separate mu": (TWO, {"separate": "mu"}),
    "all separate, unknown noise": (TWO, {"separate": ["e_n", "e_t", "mu"], "noise": "unknown"}),
    "prior of mu": (ONE, {"prior": {"mu": (0.12, 0.01)}, "fix": {"e_n": 0.9}}),
    "heavy tails": (ONE[["gamma_deg", "beta"]], {"noise": ifrfit.Noise(tails="student-t")}),
    "by importance": (ONE, {"method": ifrfit.Exact(accuracy=0.05), "closure": "maw"}),
    "lsq": (TWO, {"separate": "mu", "method": "lsq"}),
    "profile": (ONE, {"method": "profile"}),
    "bootstrap": (ONE, {"method": ifrfit.Bootstrap(replicates=200)}),
    "mcmc": (ONE, {"method": ifrfit.MCMC(max_steps=400)}),
}


@pytest.mark.parametrize("question", QUESTIONS)
def test_a_copy_says_the_same(question):
    data, choices = QUESTIONS[question]
    fit = ifrfit.fit(data, **choices)
    for other in (pickle.loads(pickle.dumps(fit)), copy.deepcopy(fit), copy.copy(fit)):
        assert other.summary() == fit.summary()
        name = fit.distribution.names[0]
        assert other.distribution.quantile(name, 0.3) == fit.distribution.quantile(name, 0.3)
        one, same = (each.draws(5, np.random.default_rng(1)) for each in (fit, other))
        pd.testing.assert_frame_equal(one, same)


def test_a_copy_of_a_comparison_says_the_same():
    found = ifrfit.compare(ONE, ["ifr", "f"], loo=False)
    assert pickle.loads(pickle.dumps(found)).summary() == found.summary()


def test_a_copy_of_a_streamed_fit_says_the_same(tmp_path):
    path = tmp_path / "impacts.csv"
    table(3).assign(sigma_beta=0.01, sigma_e_n=0.01).to_csv(path, index=False)
    fit = ifrfit.fit(tmp_path)
    assert fit.problem is None
    assert pickle.loads(pickle.dumps(fit)).summary() == fit.summary()
