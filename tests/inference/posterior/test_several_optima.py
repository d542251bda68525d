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


@pytest.mark.parametrize("sigma", [0.05, 0.01, 1e-3])
def test_two_exact_explanations(sigma: float) -> None:
    question = pair(sigma)
    known = Dense(question, pieces=(1, 60, 120), order=8).summary()
    check(integrate(question.problem()), known, 1e-4)


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


@pytest.mark.parametrize("shift", [0.0, 0.02, 0.05])
def test_a_second_optimum_of_less_weight(shift: float) -> None:
    # further rows that favour one explanation without ruling the other out
    rows = (
        Row("beta", 20.0, 0.42, 0.02),
        Row("beta", 20.0, 0.42 + shift, 0.02),
        Row("beta", 60.0, -0.5, 0.02),
        Row("beta", 65.0, -0.56 - shift, 0.03),
    )
    question = Question(rows, fix={"e_n": 0.9})
    known = Dense(question, pieces=(1, 40, 80), order=8).summary()
    check(integrate(question.problem()), known, 1e-4)


@pytest.mark.parametrize("closure", ["fr", "ifr-contact"])
def test_two_optima_of_other_closures(closure: str) -> None:
    rows = (Row("beta", 25.0, 0.2 if closure == "fr" else 0.3, 0.02), Row("beta", 60.0, -0.55, 0.02))
    question = Question(rows, closure, fix={"e_n": 0.9})
    known = Dense(question, pieces=(1, 40, 80), order=8).summary()
    check(integrate(question.problem()), known, 1e-4)


def test_two_optima_with_e_n_free() -> None:
    rows = (*(Row("beta", g, v, 0.02) for g, v in PAIR), Row("e_n", 5.0, 0.9, 0.05))
    question = Question(rows)
    known = Dense(question, pieces=(10, 16, 30), order=8).summary()
    check(integrate(question.problem()), known, 1e-4)


def test_few_rows_of_lambda() -> None:
    rows = (Row("lambda_deg", 40.0, -8.0, 3.0, spin_x=0.3), Row("lambda_deg", 20.0, -30.0, 4.0, spin_x=0.3))
    question = Question(rows, fix={"e_n": 0.9})
    known = Dense(question, pieces=(1, 30, 60), order=8).summary()
    post = integrate(question.problem())
    check(post, known, 1e-4)
    assert np.isfinite(post.quantile("mu", np.array([0.01, 0.99]))).all()
