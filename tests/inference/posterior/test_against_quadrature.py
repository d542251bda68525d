"""Brute force where the integral separates: 30 digits for known noise, dense panels for unknown."""

from __future__ import annotations

import functools
from typing import Any

import pytest
from factories import rest_long
from posterior_agreement import check, distances
from posterior_dense import Dense
from posterior_precise import Precise
from posterior_questions import Question, Row, measured

from ifrfit.inference.posterior import integrate

FAN = (8.0, 17.0, 26.0, 35.0, 50.0, 70.0)
NORMAL = (Row("e_n", 5.0, 0.91, 0.03), Row("v_n", 20.0, 0.85, 0.02))


def closures_with_e_n() -> dict[str, Question]:
    """beta beside e_n for each closure, and other tangential observables of both regimes."""
    made = {
        closure: Question(measured("beta", FAN, seed=seed, closure=closure, c=c) + NORMAL, closure)
        for closure, c, seed in (("ifr", -0.85, 1), ("ifr-contact", -0.5, 2), ("fr", 0.4, 3), ("f", 0.0, 4))
    }
    made["ifr on its bound"] = Question(measured("beta", FAN, seed=5, c=-1.0) + NORMAL)
    made["four rows"] = Question(measured("beta", (15.0, 45.0, 70.0), seed=6, sigma=0.02) + NORMAL[:1])
    made["spin and mixed observables"] = Question(
        measured("v_x", (20.0, 45.0, 65.0), seed=7, sigma=0.03, spin_y=0.2)
        + measured("spin_y_after", (10.0, 60.0), seed=8, sigma=0.05)
        + measured("v_y", (25.0, 40.0), seed=9, sigma=0.02, spin_x=0.3)
        + NORMAL
    )
    made["tight"] = Question(measured("beta", FAN, seed=10, sigma=0.001) + NORMAL)
    made["a thin shell"] = Question(
        measured("tan_psi_after", FAN[:5], seed=11, sigma=0.04, inertia_factor=2.0 / 3.0, c=-0.9) + NORMAL,
        inertia_factor=2.0 / 3.0,
    )
    return made


def known_by(precise: Precise) -> dict[str, Any]:
    moments = {name: {"mean": m, "sd": s} for name, (m, s) in precise.moments().items()}
    return {"log_evidence": precise.log_evidence(), "quantities": moments}


@pytest.mark.parametrize("name", rest_long(closures_with_e_n(), 4))
def test_tangential_beside_e_n_to_seven_digits(name: str) -> None:
    question = closures_with_e_n()[name]
    post = integrate(question.problem(), tolerance=1e-8)
    precise = Precise(question, order=10)
    check(post, known_by(precise), 1e-7)
    p = 0.025
    if question.own:
        assert abs(precise.cdf_c(float(post.quantile(question.own, p))) - p) < 3e-8
    if question.closure != "fr":
        assert abs(precise.cdf_kappa(float(post.quantile("kappa", p))) - p) < 3e-8


@pytest.mark.parametrize(
    "question",
    [
        Question(
            measured("beta", FAN, seed=21) + NORMAL,
            prior={"mu": (0.16, 0.01), "e_t": (-0.8, 0.05), "e_n": (0.95, 0.04)},
        ),
        Question(measured("beta", FAN, seed=22), fix={"e_n": 0.9}, prior={"mu": (0.02, 0.1)}),
        Question(
            measured("beta", FAN, seed=23, closure="fr", c=0.4),
            "fr",
            fix={"e_n": 0.9},
            prior={"mu": (0.16, 0.01), "beta0": (0.3, 0.1)},
        ),
        Question(measured("beta", FAN, seed=24) + NORMAL[:1], prior={"e_n": (1.05, 0.05)}),
    ],
    ids=["all three", "mu near its bound", "FR", "e_n beyond its bound"],
)
def test_gaussian_priors(question: Question) -> None:
    check(integrate(question.problem(), tolerance=1e-8), known_by(Precise(question, order=10)), 1e-7)


@pytest.mark.parametrize(
    "question",
    [
        Question(measured("beta", FAN, seed=31, mu=0.3), fix={"e_n": 0.9}, bounds={"mu": (0.12, 0.26)}),
        Question(measured("beta", FAN, seed=32), fix={"e_n": 0.9}, bounds={"e_t": (-0.9, -0.88)}),
        Question(
            measured("beta", FAN, seed=33), fix={"e_n": 0.9}, bounds={"e_t": (-1.6, 0.4), "mu": (0.0, 6.0)}
        ),
        Question(measured("beta", FAN, seed=34, closure="fr", c=0.9, sigma=0.1), "fr", fix={"e_n": 0.9}),
        Question(measured("beta", FAN, seed=35, mu=0.0), fix={"e_n": 0.9}),
        Question(measured("beta", FAN, seed=36), fix={"e_n": 0.9, "mu": 0.15}),
        Question(measured("beta", FAN, seed=37), fix={"e_n": 0.9, "e_t": -0.85}),
    ],
    ids=["mu", "e_t narrow", "both wide", "FR", "mu = 0", "mu fixed", "e_t fixed"],
)
def test_bounds_and_fixed_constants(question: Question) -> None:
    known = Dense(question, pieces=(1, 20, 40), order=12).summary()
    check(integrate(question.problem(), tolerance=1e-8), known, 2e-6)


@pytest.mark.parametrize(
    "question",
    [
        Question(
            measured("beta", FAN, seed=41, known=False),
            fix={"e_n": 0.9},
            noise="unknown",
            noise_bounds={"run/beta": (1e-3, 1.0)},
        ),
        Question(
            measured("beta", FAN, seed=42, known=False, closure="fr", c=0.4),
            "fr",
            fix={"e_n": 0.9},
            noise="unknown",
            noise_bounds={"run/beta": (1e-3, 0.08)},
        ),
        Question(
            measured("beta", FAN, seed=43, known=False)
            + measured("v_x", FAN, seed=44, known=False, sigma=0.02),
            fix={"e_n": 0.9},
            noise="unknown",
            noise_bounds={"run/beta": (1e-3, 0.5), "run/v_x": (1e-3, 0.5)},
        ),
        Question(
            measured("beta", FAN, seed=45), fix={"e_n": 0.9}, noise="scaled", noise_bounds={"": (0.01, 20.0)}
        ),
        Question(
            measured("beta", FAN, seed=46, mu=0.2)[:4],
            fix={"e_n": 0.9},
            noise="scaled",
            noise_bounds={"": (0.3, 3.0)},
        ),
    ],
    ids=["one group", "FR", "two groups", "common factor", "bounds of the factor matter"],
)
def test_unknown_noise(question: Question) -> None:
    known = Dense(question, pieces=(1, 30, 70), order=8).summary()
    check(integrate(question.problem(), tolerance=1e-7), known, 1e-6)
    check(integrate(question.problem()), known, 1e-4)


@pytest.mark.parametrize(
    ("question", "pieces", "order", "tolerance"),
    [
        pytest.param(
            Question(
                measured("beta", FAN, seed=51, known=False)
                + measured("e_n", (5.0, 10.0, 15.0, 20.0), seed=52, sigma=0.02, known=False),
                noise="unknown",
                noise_bounds={"run/beta": (1e-3, 1.0), "run/e_n": (1e-3, 1.0)},
            ),
            (12, 8, 60),
            10,  # the tails are long
            1e-4,
            marks=pytest.mark.long,
        ),
        (
            Question(
                measured("beta", FAN, seed=53) + measured("e_n", (5.0, 10.0), seed=54, sigma=0.02),
                noise="scaled",
                noise_bounds={"": (0.1, 10.0)},
            ),
            (8, 6, 30),
            8,  # itself right to 4e-5
            1e-3,
        ),
    ],
    ids=["a noise each", "common factor"],
)
def test_unknown_noise_beside_e_n(
    question: Question, pieces: tuple[int, int, int], order: int, tolerance: float
) -> None:
    known = Dense(question, pieces, order).summary()
    check(integrate(question.problem(), tolerance), known, tolerance)


@functools.cache
def dense_with_e_n() -> dict[str, Any]:
    return Dense(closures_with_e_n()["ifr"], pieces=(14, 14, 24), order=9).summary()


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4, 1e-6])
def test_the_reached_error_is_what_was_asked_for_and_no_less_than_it_is(tolerance: float) -> None:
    question = closures_with_e_n()["ifr"]
    known = dense_with_e_n()
    post = integrate(question.problem(), tolerance=tolerance)
    check(post, known, tolerance)
    far = distances(post, known)
    evidence = far.pop("log evidence")
    assert max(far.values()) <= max(post.error, 2e-7)
    assert evidence <= max(post.error_evidence, 1e-7)
