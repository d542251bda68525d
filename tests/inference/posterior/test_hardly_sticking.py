"""FR where few rows stick, or none for certain: what is stated holds against a box of midpoints."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from factories import rest_long
from posterior_dense import observe
from posterior_questions import LEVELS, Question, Row, measured

import ifrfit
from ifrfit.inference.posterior import QuadraturePosterior, integrate

FAN = (25.0, 35.0, 45.0, 55.0, 65.0, 75.0)
DROPS = (Row("e_n", 5.0, 0.8, 0.03),)
N_E, N_C, N_MU = 20, 300, 600


def bundled(name: str) -> Question:
    """A bundled dataset, without spin."""
    problem = ifrfit.fit(name, closure="fr", method="lsq").problem
    rows = problem.rows
    assert not rows.incidence.spin_y.any()
    return Question(
        tuple(
            Row(rows.names[which], math.degrees(math.atan(tau)), value, sigma)
            for which, tau, value, sigma in zip(
                rows.which, rows.tau.tolist(), rows.value.tolist(), problem.noise.sigma.tolist(), strict=True
            )
        ),
        "fr",
    )


# each with ends of e_n and of beta0 outside of which there is nothing
QUESTIONS = {
    "beta_tot": (
        Question(
            measured("beta_tot", FAN, seed=3, sigma=0.02, closure="fr", c=-0.3, mu=0.2, e_n=0.8) + DROPS, "fr"
        ),
        (0.65, 0.95),
        (-1.0, 1.0),
    ),
    "delta": (
        Question(
            measured("delta_deg", FAN, seed=4, sigma=1.5, closure="fr", c=0.6, mu=0.12, e_n=0.8) + DROPS, "fr"
        ),
        (0.65, 0.95),
        (-1.0, 1.0),
    ),
    # the closure constant has a mode on each side, and the bound of mu cuts one of them off at many places
    "reagle-2013": (bundled("reagle-2013"), (0.19, 0.57), (-1.0, 1.0)),
    "wang-2020": (bundled("wang-2020"), (0.61, 0.92), (-1.0, 1.0)),
}


@cache
def brute(name: str) -> tuple[float, dict[str, tuple[np.ndarray, np.ndarray]]]:
    """Log evidence, and the constants at their places with the probabilities of these."""
    question, (low, high), (c_low, c_high) = QUESTIONS[name]
    x, w = np.polynomial.legendre.leggauss(N_E)
    e_n, e_weight = 0.5 * (low + high) + 0.5 * (high - low) * x, 0.5 * (high - low) * w
    c = c_low + (c_high - c_low) * (np.arange(N_C) + 0.5) / N_C
    root = (np.arange(N_MU) + 0.5) / N_MU
    mu, mu_weight = 2.0 * root**3, 3.0 * root**2 / N_MU  # with the prior's 1/2
    log_f = np.zeros((N_E, N_C, N_MU))
    for i, e in enumerate(e_n):
        for row in question.rows:
            assert row.sigma is not None
            k = np.minimum(2.0 / 7.0 * (1.0 + c[:, None]), mu * (1.0 + e) / math.tan(math.radians(row.gamma)))
            log_f[i] -= 0.5 * ((row.value - observe(row, 0.4, k, e, mu)) / row.sigma) ** 2
    top = log_f.max()
    share = np.exp(log_f - top) * e_weight[:, None, None] * mu_weight * (0.5 * (c_high - c_low) / N_C)
    z = share.sum()
    share /= z
    laws = {
        "e_n": (e_n, share.sum(axis=(1, 2))),
        "beta0": (c, share.sum(axis=(0, 2))),
        "mu": (mu, share.sum(axis=(0, 1))),
    }
    norm = sum(math.log(row.sigma * math.sqrt(2.0 * math.pi)) for row in question.rows if row.sigma)
    return float(np.log(z) + top - norm), laws


@cache
def posterior(name: str) -> QuadraturePosterior:
    return integrate(QUESTIONS[name][0].problem(), tolerance=1e-3)


@pytest.mark.parametrize("name", rest_long(("wang-2020", "reagle-2013", "beta_tot", "delta")))
def test_against_a_box(name: str) -> None:
    log_evidence, laws = brute(name)
    post = posterior(name)
    assert post.converged
    assert abs(post.log_evidence - log_evidence) < 1e-3
    for constant, (at, share) in laws.items():
        mean = float(share @ at)
        sd = math.sqrt(float(share @ (at - mean) ** 2))
        assert abs(post.mean(constant) - mean) < 1e-3 * sd, constant
        assert abs(post.sd(constant) / sd - 1.0) < 1e-3, constant
    c_low, c_high = QUESTIONS[name][2]
    cells = {
        "beta0": c_low + (c_high - c_low) * np.arange(N_C + 1) / N_C,
        "mu": 2.0 * (np.arange(N_MU + 1) / N_MU) ** 3,
    }
    for constant, edges in cells.items():
        below = np.concatenate(([0.0], np.cumsum(laws[constant][1])))
        reached = np.interp(np.asarray(post.quantile(constant, np.array(LEVELS))), edges, below)
        assert np.abs(reached - LEVELS).max() < 5e-4, constant


@pytest.mark.parametrize("name", ["wang-2020", "reagle-2013"])
def test_few_places_are_needed(name: str) -> None:
    assert posterior(name).density.integral.size() < 3_000_000
