"""The oracles know their own errors, and share nothing but the law with the package."""

from __future__ import annotations

import math

import numpy as np
import pytest
from factories import SCHEMA
from posterior_dense import Dense, grid_for, observe, reference, tau_of
from posterior_precise import Precise
from posterior_questions import OWN, Question, Row, measured

from ifrfit.physics import OBSERVABLES, rebound

FAN = (10.0, 20.0, 30.0, 50.0, 70.0)


@pytest.mark.parametrize("closure", ["ifr", "ifr-contact", "fr", "f"])
@pytest.mark.parametrize("observable", sorted(SCHEMA))
def test_the_law_written_down_for_the_oracles_is_the_law(closure: str, observable: str) -> None:
    rng = np.random.default_rng(1)
    for _ in range(10):
        gamma, s_x, s_y = rng.uniform(2.0, 88.0), rng.normal(0.0, 0.3), rng.normal(0.0, 0.3)
        e_n, c, mu, j = (
            rng.uniform(0.1, 1.0),
            rng.uniform(-1.0, -0.5),
            rng.uniform(0.0, 0.6),
            rng.uniform(0.2, 0.7),
        )
        row = Row(observable, gamma, 0.0, 1.0, s_x, s_y)
        a0, a1, b0, b1 = Question((row,), closure, j).linear()
        k = a0 + a1 * c + min(b0 + b1 * c, mu * (1.0 + e_n) / tau_of(row))
        state = rebound(
            gamma, s_x, s_y, e_n=e_n, mu=mu, closure=closure, inertia_factor=j, degrees=True,
            **({OWN[closure]: c} if OWN[closure] else {}),
        )  # fmt: skip
        expected = float(OBSERVABLES[observable].value(state, np.asarray(mu)))
        assert math.isclose(float(observe(row, j, k, e_n, mu)), expected, rel_tol=1e-11, abs_tol=1e-12)


@pytest.mark.parametrize("closure", ["ifr", "ifr-contact", "fr", "f"])
def test_two_oracles_agree(closure: str) -> None:
    c = {"fr": 0.4, "ifr-contact": -0.5}.get(closure, -0.85)
    rows = measured("beta", FAN, seed=1, closure=closure, c=c)
    question = Question(rows, closure, fix={"e_n": 0.9}, prior={"mu": (0.16, 0.02)})
    precise, dense = Precise(question, 12), Dense(question, pieces=(1, 16, 30), order=12)
    assert abs(precise.log_evidence() - dense.log_evidence) < 1e-9
    found = dense.summary()["quantities"]
    for name, (mean, sd) in precise.moments().items():
        assert abs(mean - found[name]["mean"]) < 1e-8 * sd
        assert abs(sd / found[name]["sd"] - 1.0) < 1e-8


@pytest.mark.parametrize(
    "question",
    [
        Question(measured("mu_app", FAN, seed=4, sigma=0.01)),
        Question(
            measured("beta", FAN, seed=5, series="a") + measured("beta", FAN, seed=6, series="b"),
            fix={"e_n": 0.9},
            separate=("mu",),
        ),
        Question(
            measured("beta", FAN, seed=7, known=False),
            fix={"e_n": 0.9},
            noise="unknown",
            noise_bounds={"run/beta": (1e-3, 1.0)},
        ),
        Question((*measured("beta", FAN, seed=8), Row("e_n", 5.0, 0.9, 0.03)), fix={"mu": 0.15}),
    ],
    ids=["mu_app", "two series", "noise unknown", "mu fixed"],
)
def test_a_finer_grid_changes_nothing(question: Question) -> None:
    pieces = grid_for(question)
    once = reference(question)
    finer = Dense(question, (max(1, pieces[0] * 4 // 3), pieces[1] * 4 // 3, pieces[2] * 4 // 3), 9).summary()
    assert abs(once["log_evidence"] - finer["log_evidence"]) < 2e-6
    for name, law in finer["quantities"].items():
        other = once["quantities"][name]
        assert abs(other["mean"] - law["mean"]) < 2e-6 * law["sd"]
        assert abs(other["sd"] / law["sd"] - 1.0) < 4e-6
        assert np.abs(np.subtract(other["quantiles"], law["quantiles"])).max() < 2e-5 * law["sd"]
