"""Rows of e_n and mu alone: no row sees the closure constant, whose law is then its prior."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from posterior_agreement import check, normal, uniform
from posterior_questions import LEVELS, Question, Row

from ifrfit.inference.posterior import QuadraturePosterior, integrate

E_N, MU = (0.93, 0.01), (0.25, 0.004)  # what the rows come to: value and sigma
SHARE = 2.0 / 7.0  # of 1 + beta0 in the impulse of sticking
ROWS = (
    Row("e_n", 5.0, E_N[0] + 0.01, E_N[1] * math.sqrt(2.0)),
    Row("e_n", 5.0, E_N[0] - 0.01, E_N[1] * math.sqrt(2.0)),
    Row("mu", 5.0, *MU),
)


def question(**more: object) -> Question:
    """Both are known well within their domains, so that their laws are normal to 1e-10."""
    return Question(ROWS, "fr", **more)  # type: ignore[arg-type]


@cache
def posterior(tolerance: float) -> QuadraturePosterior:
    return integrate(question().problem(), tolerance)


def test_e_n_and_mu_are_normal_and_the_closure_constant_is_as_before() -> None:
    kappa_sd = math.hypot(MU[1] * (1.0 + E_N[0]), MU[0] * E_N[1], MU[1] * E_N[1])
    both_e_n = -0.5 - 2.0 * math.log(E_N[1] * math.sqrt(4.0 * math.pi))  # a residual of 0.01 each
    log_z = both_e_n + math.log(E_N[1] * math.sqrt(2.0 * math.pi)) - math.log(2.0)  # mu has 2 to be in
    known = {
        "log_evidence": log_z,
        "quantities": {
            "e_n": normal(*E_N),
            "mu": normal(*MU),
            "kappa": {"mean": MU[0] * (1.0 + E_N[0]), "sd": kappa_sd},
            "beta0": uniform(-1.0, 1.0),
        },
    }
    check(posterior(1e-8), known, 1e-7)


def test_the_transition_is_kappa_over_the_bound_of_sticking() -> None:
    # P(tau < t) = 1 - E[kappa]/(2 SHARE t) wherever kappa < 2 SHARE t for certain
    p = np.array(LEVELS[1:])
    wanted = MU[0] * (1.0 + E_N[0]) / (2.0 * SHARE * (1.0 - p))
    assert posterior(1e-8).quantile("transition_tau[run]", LEVELS)[1:] == pytest.approx(wanted, rel=1e-8)


def test_draws_have_the_transition_of_the_quantiles() -> None:
    post = posterior(1e-4)
    draws = post.draws(20_000, np.random.default_rng(3))
    tau = draws["kappa"] / (SHARE * (1.0 + draws["beta0"]))
    below = np.array([(tau < t).mean() for t in post.quantile("transition_tau[run]", LEVELS)])
    assert np.abs(below - LEVELS).max() < 4.0 * 0.5 / math.sqrt(tau.size)
    assert draws["mu"] * (1.0 + draws["e_n"]) == pytest.approx(draws["kappa"])
    assert abs(np.corrcoef(draws["mu"], draws["beta0"])[0, 1]) < 4.0 / math.sqrt(tau.size)


@pytest.mark.parametrize(
    "asked",
    [
        question(),
        question(fix={"e_n": 0.93}),
        question(prior={"mu": (0.24, 0.01)}),
        question(noise="scaled", noise_bounds={"": (0.1, 10.0)}),
    ],
    ids=["free", "e_n fixed", "a prior on mu", "a common factor"],
)
def test_no_ridge_is_followed(asked: Question) -> None:
    post = integrate(asked.problem())
    assert post.converged
    # as many places as a law in which nothing is tilted takes
    untilted = integrate(Question(asked.rows, "ifr", **_same(asked)).problem())
    assert post.density.integral.size() <= 2 * untilted.density.integral.size()
    for name in ("mu", "kappa"):
        assert post.quantile(name, 0.975) == pytest.approx(untilted.quantile(name, 0.975), abs=1e-4)


def _same(asked: Question) -> dict[str, object]:
    return {name: getattr(asked, name) for name in ("fix", "prior", "noise", "noise_bounds")}
