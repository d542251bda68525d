"""Posteriors whose integral does not separate, and those of several series, against dense quadrature."""

from __future__ import annotations

from dataclasses import replace

import pytest
from posterior_agreement import check
from posterior_dense import reference
from posterior_questions import Question, Row, measured

from ifrfit.inference.posterior import integrate

FAN = (8.0, 17.0, 26.0, 35.0, 50.0, 70.0)
DROPS = (Row("e_n", 5.0, 0.91, 0.03),)

MIXTURES = {
    "delta, two spins": Question(
        measured("delta_deg", FAN, seed=1, sigma=1.0, spin_y=0.3)
        + measured("delta_deg", FAN, seed=2, sigma=1.0)
    ),
    "delta and a prior of e_n": Question(
        measured("delta_deg", FAN, seed=3, sigma=1.0), prior={"e_n": (0.9, 0.02)}
    ),
    "delta alone": Question(measured("delta_deg", FAN, seed=4, sigma=0.4)),
    "lambda": Question(measured("lambda_deg", FAN, seed=5, sigma=1.0, spin_x=0.4), fix={"e_n": 0.9}),
    "lambda and e_n": Question(measured("lambda_deg", FAN, seed=6, sigma=2.0, spin_x=0.4) + DROPS),
    "beta_tot": Question(measured("beta_tot", FAN, seed=7, sigma=0.01)),
    "mu_app and beta": Question(
        measured("mu_app", FAN, seed=8, sigma=0.01) + measured("beta", FAN, seed=9, sigma=0.05)
    ),
    "mu_app alone": Question(measured("mu_app", FAN, seed=10, sigma=0.01)),
    "tan_psi_out and e_n": Question(measured("tan_psi_out", FAN, seed=11, sigma=0.04) + DROPS),
    "tan_psi_out alone": Question(measured("tan_psi_out", FAN, seed=12, sigma=0.04)),
    "mu, beta and e_n": Question(measured("beta", FAN, seed=13) + DROPS + (Row("mu", 5.0, 0.17, 0.01),)),
    "psi_after": Question(measured("psi_after_deg", FAN, seed=14, sigma=1.5), fix={"e_n": 0.9}),
    "psi_out and e_n": Question(measured("psi_out_deg", FAN, seed=15, sigma=1.5) + DROPS),
    "FR, delta and beta": Question(
        measured("delta_deg", FAN, seed=16, sigma=1.0, closure="fr", c=0.4)
        + measured("beta", FAN, seed=17, closure="fr", c=0.4),
        "fr",
    ),
    "IFR-contact, beta_tot and beta": Question(
        measured("beta_tot", FAN, seed=18, sigma=0.01, closure="ifr-contact", c=-0.5)
        + measured("beta", FAN, seed=19, closure="ifr-contact", c=-0.5),
        "ifr-contact",
    ),
    "F, delta": Question(measured("delta_deg", FAN, seed=20, sigma=0.4, closure="f", mu=0.1), "f"),
    "delta, noise unknown": Question(
        measured("delta_deg", FAN, seed=21, sigma=1.0, known=False),
        fix={"e_n": 0.9},
        noise="unknown",
        noise_bounds={"run/delta_deg": (0.01, 50.0)},
    ),
    "mu_app and e_n, a common factor": Question(
        measured("mu_app", FAN, seed=22, sigma=0.01) + DROPS, noise="scaled", noise_bounds={"": (0.1, 10.0)}
    ),
    # e_n alone is free: its marginal follows from the transition, under a bound that depends on beta0
    "FR, mu and beta0 fixed": Question(
        measured("beta", FAN, seed=24, closure="fr", c=0.4), "fr", fix={"mu": 0.15, "beta0": 0.4}
    ),
    "FR, priors on mu and e_n": Question(
        measured("beta", FAN, seed=23, closure="fr", c=0.4),
        "fr",
        prior={"mu": (0.16, 0.01), "e_n": (0.9, 0.03)},
    ),
}


def run(series: str, seed: int, **truth: float) -> tuple[Row, ...]:
    """beta of one series."""
    return measured("beta", FAN, seed=seed, series=series, **truth)


def drops(series: str, value: float) -> tuple[Row, ...]:
    """One measured e_n of one series."""
    return (Row("e_n", 5.0, value, 0.02, series=series),)


A, B, C = run("a", 1), run("b", 2, mu=0.22), run("c", 3, mu=0.08)

NESTED = {
    "mu separate, e_n measured": Question(A + B + drops("a", 0.9) + drops("b", 0.92), separate=("mu",)),
    "mu separate in three series, e_n fixed": Question(A + B + C, fix={"e_n": 0.9}, separate=("mu",)),
    "e_n separate": Question(
        A + run("b", 4) + drops("a", 0.9) + drops("b", 0.7), separate=("e_n",), prior={"mu": (0.15, 0.01)}
    ),
    "e_t separate": Question(A + run("b", 5, c=-0.6), fix={"e_n": 0.9}, separate=("e_t",)),
    "e_t separate, e_n measured": Question(A + run("b", 5, c=-0.6) + drops("a", 0.9), separate=("e_t",)),
    "e_t and mu separate": Question(
        A + run("b", 6, c=-0.6, mu=0.22) + drops("a", 0.9), separate=("e_t", "mu")
    ),
    "e_n and mu separate": Question(A + B + drops("a", 0.9) + drops("b", 0.7), separate=("e_n", "mu")),
    "mu fixed": Question(A + run("b", 7) + drops("a", 0.9), fix={"mu": 0.15}),
    "mu fixed, e_n separate": Question(
        A + run("b", 8) + drops("a", 0.9) + drops("b", 0.8), fix={"mu": 0.15}, separate=("e_n",)
    ),
    "all shared": Question(A + run("b", 9) + drops("a", 0.9)),
    "mu separate under a prior": Question(
        A + B + drops("a", 0.9), separate=("mu",), prior={"mu": (0.18, 0.03)}
    ),
    "FR, mu separate": Question(
        measured("beta", FAN, seed=10, series="a", closure="fr", c=0.4)
        + measured("beta", FAN, seed=11, series="b", closure="fr", c=0.4, mu=0.25),
        "fr",
        fix={"e_n": 0.9},
        separate=("mu",),
    ),
    "mu separate, a noise each": Question(
        tuple(replace(r, sigma=None) for r in A + B),
        fix={"e_n": 0.9},
        separate=("mu",),
        noise="unknown",
        noise_bounds={"a/beta": (1e-3, 0.5), "b/beta": (1e-3, 0.5)},
    ),
    "mu_app, mu separate": Question(
        measured("mu_app", FAN, seed=12, sigma=0.01, series="a")
        + measured("mu_app", FAN, seed=13, sigma=0.01, series="b", mu=0.25)
        + drops("a", 0.9),
        separate=("mu",),
    ),
}
NESTED["mu separate in ten series"] = Question(
    sum((run(f"s{i}", 20 + i, mu=0.05 + 0.03 * i) for i in range(10)), ()),
    fix={"e_n": 0.9},
    separate=("mu",),
)

QUESTIONS = {**MIXTURES, **NESTED}
# a second or more each; the others have their dimensions, closures and observables between them
DEAR = (
    "mu_app and e_n, a common factor",
    "e_n separate",
    "mu separate under a prior",
    "FR, delta and beta",
    "IFR-contact, beta_tot and beta",
    "delta, two spins",
    "mu separate in ten series",
    "mu_app, mu separate",
    "delta and a prior of e_n",
    "mu separate, a noise each",
    "delta alone",
    "psi_out and e_n",
    "FR, priors on mu and e_n",
)


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        *((name, 1e-4) for name in QUESTIONS if name not in DEAR),
        *(pytest.param(name, 1e-4, marks=pytest.mark.long) for name in DEAR),
    ],
)
def test_posterior_is_that_of_dense_quadrature(name: str, tolerance: float) -> None:
    question = QUESTIONS[name]
    check(integrate(question.problem(), tolerance), reference(question), tolerance)
