"""Posteriors of two optima: both are found, and each weighs what brute force says."""

from __future__ import annotations

import math

import numpy as np
import pytest
from posterior_agreement import check
from posterior_dense import Dense
from posterior_questions import Question, Row
from scipy import special

from ifrfit.inference.posterior import integrate

# two rows that sticking and sliding explain, and sliding alone does too, exactly as well
PAIR = ((20.0, 0.42), (60.0, -0.5))


def pair(sigma: float) -> Question:
    return Question(tuple(Row("beta", g, v, sigma) for g, v in PAIR), fix={"e_n": 0.9})


def second(shift: float) -> Question:
    """Further rows that favour one explanation without ruling the other out."""
    rows = (
        Row("beta", 20.0, 0.42, 0.02),
        Row("beta", 20.0, 0.42 + shift, 0.02),
        Row("beta", 60.0, -0.5, 0.02),
        Row("beta", 65.0, -0.56 - shift, 0.03),
    )
    return Question(rows, fix={"e_n": 0.9})


def other(closure: str, value: float) -> Question:
    rows = (Row("beta", 25.0, value, 0.02), Row("beta", 60.0, -0.55, 0.02))
    return Question(rows, closure, fix={"e_n": 0.9})


LAMBDA = (Row("lambda_deg", 40.0, -8.0, 3.0, spin_x=0.3), Row("lambda_deg", 20.0, -30.0, 4.0, spin_x=0.3))
FREE = (*(Row("beta", g, v, 0.02) for g, v in PAIR), Row("e_n", 5.0, 0.9, 0.05))
# with the panels that the dense oracle needs
QUESTIONS = {
    **{f"exact, sigma {sigma:g}": (pair(sigma), (1, 60, 120)) for sigma in (0.05, 0.01, 1e-3)},
    **{f"of less weight, {shift:g}": (second(shift), (1, 40, 80)) for shift in (0.0, 0.02, 0.05)},
    "FR": (other("fr", 0.2), (1, 40, 80)),
    "IFR-contact": (other("ifr-contact", 0.3), (1, 40, 80)),
    "e_n free": (Question(FREE), (10, 16, 30)),
    "few rows of lambda": (Question(LAMBDA, fix={"e_n": 0.9}), (1, 30, 60)),
}


@pytest.mark.parametrize("name", QUESTIONS)
def test_both_optima_are_integrated(name: str) -> None:
    question, pieces = QUESTIONS[name]
    post = integrate(question.problem())
    check(post, Dense(question, pieces=pieces, order=8).summary(), 1e-4)
    assert np.isfinite(post.quantile("mu", np.array([0.01, 0.99]))).all()


def test_the_weights_of_two_narrow_optima_in_closed_form() -> None:
    # each optimum is normal; their evidence is 1/|det| of rows by (e_t, kappa)
    sigma = 1e-5
    (tau_1, beta_1), (tau_2, beta_2) = ((math.tan(math.radians(g)), v) for g, v in PAIR)
    # sticking, then sliding: e_t = beta_1 - 7/5
    e_t_stick = beta_1 - 1.4
    kappa_stick = (beta_2 - e_t_stick) * tau_2 / 3.5
    det_stick = 3.5 / tau_2
    # sliding both
    kappa_slide = (beta_1 - beta_2) / (3.5 / tau_1 - 3.5 / tau_2)
    e_t_slide = beta_1 - 3.5 * kappa_slide / tau_1
    det_slide = 3.5 / tau_1 - 3.5 / tau_2
    assert 2.5 * kappa_stick > tau_1
    assert 2.5 * kappa_slide < tau_1
    assert -1.0 < e_t_slide < -0.4
    assert -1.0 < e_t_stick < -0.4
    share = (1.0 / det_slide) / (1.0 / det_slide + 1.0 / det_stick)
    post = integrate(pair(sigma).problem())
    between = 0.5 * (kappa_slide + kappa_stick)
    assert kappa_slide < between < kappa_stick
    assert abs(post.cdf("kappa", between) - share) < 1e-4
    assert (
        abs(
            post.cdf("e_t", 0.5 * (e_t_slide + e_t_stick)) - (share if e_t_slide < e_t_stick else 1.0 - share)
        )
        < 1e-4
    )
    log_z = math.log((1.0 / det_slide + 1.0 / det_stick) / (0.6 * 2.0 * 1.9))
    assert abs(post.log_evidence - log_z) < 1e-4
    mean = share * kappa_slide + (1.0 - share) * kappa_stick
    assert abs(post.mean("kappa") - mean) < 1e-4 * post.sd("kappa")
    # a quantile well inside one optimum
    p = 0.5 * share
    sd = sigma * math.sqrt(2.0) / det_slide
    assert abs(post.quantile("kappa", p) - (kappa_slide + sd * special.ndtri(0.5))) < 1e-2 * sd
