"""Draws are independent, follow the posterior's own law, and keep its correlations and bounds."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from posterior_dense import Dense
from posterior_questions import Question, Row, measured

from ifrfit.inference.posterior import QuadraturePosterior, integrate

pytestmark = pytest.mark.long

N = 100_000
FAR = 5.3  # standard errors: one in ten million
FAN = (8.0, 17.0, 26.0, 35.0, 50.0, 70.0)
DROPS = (Row("e_n", 5.0, 0.97, 0.03),)

QUESTIONS = {
    "beta and e_n near its bound": Question(measured("beta", FAN, seed=1) + DROPS),
    "e_n alone": Question((*DROPS, Row("e_n", 5.0, 0.93, 0.03))),
    "e_t on its bound": Question(measured("beta", FAN, seed=2, c=-1.0), fix={"e_n": 0.9}),
    "sticking only": Question(measured("beta", (5.0, 10.0, 15.0), seed=3)),
    "FR": Question(measured("beta", FAN, seed=4, closure="fr", c=0.4) + DROPS, "fr"),
    "noise unknown": Question(
        measured("beta", FAN, seed=5, known=False),
        fix={"e_n": 0.9},
        noise="unknown",
        noise_bounds={"run/beta": (1e-3, 1.0)},
    ),
    "a common factor": Question(
        measured("beta", FAN, seed=6) + DROPS, noise="scaled", noise_bounds={"": (0.1, 10.0)}
    ),
    "two optima": Question((Row("beta", 20.0, 0.42, 0.02), Row("beta", 60.0, -0.5, 0.02)), fix={"e_n": 0.9}),
    "delta": Question(
        measured("delta_deg", FAN, seed=7, sigma=1.0)
        + measured("delta_deg", FAN, seed=8, sigma=1.0, spin_y=0.3)
    ),
    "mu separate": Question(
        measured("beta", FAN, seed=9, series="a") + measured("beta", FAN, seed=10, series="b", mu=0.25),
        separate=("mu",),
        prior={"e_n": (0.9, 0.05)},
    ),
    "a prior on mu": Question(measured("beta", FAN, seed=11) + DROPS, prior={"mu": (0.02, 0.05)}),
}


@cache
def posterior(name: str) -> QuadraturePosterior:
    return integrate(QUESTIONS[name].problem())


@cache
def drawn(name: str) -> dict[str, np.ndarray]:
    return posterior(name).draws(N, np.random.default_rng(20230101))


@pytest.mark.parametrize("name", QUESTIONS)
def test_draws_follow_the_posterior(name: str) -> None:
    post, draws = posterior(name), drawn(name)
    assert set(draws) == set(post.names)
    limit = math.sqrt(math.log(2.0 / 1e-6) / 2.0 / N)  # of Kolmogorov and Smirnov's distance
    for quantity, x in draws.items():
        assert x.shape == (N,)
        assert np.isfinite(x).all()
        at = np.linspace(0, N - 1, 401).astype(int)  # no more than the supremum over all of them
        below = np.asarray(post.cdf(quantity, np.sort(x)[at]))
        distance = max((below - at / N).max(), ((at + 1) / N - below).max())
        assert distance < limit, (quantity, distance, limit)
        assert abs(x.mean() - post.mean(quantity)) < FAR * post.sd(quantity) / math.sqrt(N)


@pytest.mark.parametrize("name", QUESTIONS)
def test_draws_are_independent(name: str) -> None:
    for quantity, x in drawn(name).items():
        rank = np.argsort(np.argsort(x)) / N - 0.5
        for lag in (1, 2, 7, 1000):
            r = 12.0 * float((rank[lag:] * rank[:-lag]).mean())
            assert abs(r) < FAR / math.sqrt(N - lag), (quantity, lag, r)


@pytest.mark.parametrize("name", [n for n, q in QUESTIONS.items() if len(q.series) == 1])
def test_draws_keep_the_correlations(name: str) -> None:
    draws = drawn(name)
    known = Dense(QUESTIONS[name], pieces=(7, 7, 12), order=6).summary()["correlation"]
    for pair, expected in known.items():
        a, b = (draws[x] - draws[x].mean() for x in pair.split())
        a, b = a / a.std(), b / b.std()
        # the error of a correlation, whatever the law
        error = float(np.std(a * b - 0.5 * expected * (a * a + b * b))) / math.sqrt(N)
        assert abs(float((a * b).mean()) - expected) < FAR * error + 1e-4, pair


@pytest.mark.parametrize("name", QUESTIONS)
def test_draws_obey_the_bounds(name: str) -> None:
    question, draws = QUESTIONS[name], drawn(name)
    for quantity, x in draws.items():
        constant = quantity.split("[")[0]
        if constant == "kappa":
            low, high = 0.0, 4.0
        elif constant == "noise":
            low, high = next(iter(question.noise_bounds.values()))
        else:
            low, high = question.domain(constant)
        assert x.min() >= low, quantity
        assert x.max() <= high, quantity


@pytest.mark.parametrize("name", QUESTIONS)
def test_each_draw_is_one_point(name: str) -> None:
    draws = drawn(name)
    e_n = draws.get("e_n", np.full(N, QUESTIONS[name].fix.get("e_n", math.nan)))
    for quantity in draws:
        if quantity.startswith("kappa"):
            mu = draws[quantity.replace("kappa", "mu")]
            assert np.abs(draws[quantity] / (mu * (1.0 + e_n)) - 1.0).max() < 1e-9


@pytest.mark.parametrize("name", ["beta and e_n near its bound", "delta", "noise unknown"])
def test_the_seed_decides(name: str) -> None:
    post = posterior(name)
    once, again, other = (post.draws(1000, np.random.default_rng(seed)) for seed in (5, 5, 6))
    for quantity in post.names:
        assert np.array_equal(once[quantity], again[quantity])
        assert not np.array_equal(once[quantity], other[quantity])
    rng = np.random.default_rng(5)
    first, second = post.draws(500, rng), post.draws(500, rng)
    assert not np.array_equal(first[post.names[0]], second[post.names[0]])


def test_the_mass_between_two_regimes_is_drawn_as_often_as_it_weighs() -> None:
    post, draws = posterior("two optima"), drawn("two optima")
    for level in (0.05, 0.3, 0.7, 0.95):
        edge = float(post.quantile("kappa", level))
        share = float((draws["kappa"] <= edge).mean())
        assert abs(share - level) < FAR * math.sqrt(level * (1.0 - level) / N)
