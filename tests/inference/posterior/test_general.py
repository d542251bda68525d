"""Mixtures that do not separate, against dense quadrature over all three constants."""

from __future__ import annotations

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


DEAR = "mu_app and e_n, a common factor"  # a fourth dimension


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        *((name, 1e-4) for name in MIXTURES if name != DEAR),
        (DEAR, 1e-3),
        pytest.param(DEAR, 1e-4, marks=pytest.mark.long),
    ],
)
def test_mixture(name: str, tolerance: float) -> None:
    question = MIXTURES[name]
    check(integrate(question.problem(), tolerance), reference(question), tolerance)
