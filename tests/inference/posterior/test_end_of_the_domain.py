"""Closure F where the likelihood rises beyond the domain, or its ends cut panels: against dense sums."""

from __future__ import annotations

import math

import numpy as np
import pytest
from factories import rest_long
from posterior_dense import observe, tau_of
from posterior_questions import Question, Row, measured

from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.posterior import integrate, log_evidence

FAN = (6.0, 11.0, 16.0, 21.0, 26.0, 33.0, 41.0, 52.0, 63.0, 75.0)
N_E, N_MU = 1000, 1001


def brute(question: Question, mu_ends: tuple[float, float], e_ends: tuple[float, float]) -> dict[str, float]:
    """Log evidence, and means and sds of mu and of e_n in each series, by midpoints within given ends."""
    domain = [question.domain("mu"), question.domain("e_n")]
    mu = mu_ends[0] + (mu_ends[1] - mu_ends[0]) * (np.arange(N_MU) + 0.5) / N_MU
    e_n = e_ends[0] + (e_ends[1] - e_ends[0]) * (np.arange(N_E)[:, None] + 0.5) / N_E
    cells = [(high - low) / n for (low, high), n in ((mu_ends, N_MU), (e_ends, N_E))]
    d_mu, d_e = (cell / (high - low) for cell, (low, high) in zip(cells, domain, strict=True))
    own = question.series if "e_n" in question.separate else ("",)
    log_mu, moments = np.zeros(N_MU), {}
    for series in own:
        log_f = np.zeros((N_E, N_MU))
        for row in (row for row in question.rows if series in ("", row.series)):
            assert row.sigma is not None
            k = np.minimum(2.0 / 7.0, mu * (1.0 + e_n) / tau_of(row))
            log_f -= 0.5 * ((row.value - observe(row, 0.4, k, e_n, mu)) / row.sigma) ** 2
            log_f -= math.log(row.sigma * math.sqrt(2.0 * math.pi))
        top = log_f.max(axis=0)
        f = np.exp(log_f - top) * d_e
        z = f.sum(axis=0)
        log_mu += np.log(z) + top
        moments[series] = [(f * e_n**power).sum(axis=0) / z for power in (1, 2)]
    share = np.exp(log_mu - log_mu.max()) * d_mu
    found = {"log evidence": float(np.log(share.sum()) + log_mu.max())}
    share /= share.sum()
    of_constants = {f"e_n[{s}]" if s else "e_n": pair for s, pair in moments.items()} | {"mu": [mu, mu**2]}
    for name, (first, second) in of_constants.items():
        mean = float(share @ first)
        found |= {name: mean, f"sd {name}": math.sqrt(float(share @ second) - mean**2)}
    return found


def series_of(name: str, e_n: float, seed: int, gamma: tuple[float, ...] = FAN) -> tuple[Row, ...]:
    return measured("mu_app", gamma, seed=seed, sigma=0.003, series=name, closure="f", mu=0.1, e_n=e_n)


CLEAN = series_of("A", 0.7, 1, FAN[3:]) + series_of("B", 0.85, 2) + series_of("C", 0.95, 3)
# of no closure: mu and an e_n go to their ends, and nothing fits
RANDOM = tuple(
    Row("mu_app", gamma, value, 0.003, spin_y=spin_y, series=series)
    for series, gamma, spin_y, value in (
        ("A", 16.915, 0.3778, 0.2307),
        ("C", 11.224, 0.5293, 0.2507),
        ("C", 84.782, -0.2334, 0.9274),
        ("B", 12.328, 0.2226, 0.1481),
        ("B", 69.701, 0.1812, 0.5414),
        ("A", 24.324, -0.2833, 0.0477),
        ("A", 78.085, -0.3633, 0.5274),
        ("C", 68.744, 0.0598, 0.5068),
        ("B", 11.714, -0.1331, 0.0249),
        ("B", 15.532, -0.0455, 0.0790),
        ("C", 16.246, 0.1098, 0.1329),
        ("C", 88.117, 0.3100, 3.2915),
        ("C", 19.397, -1.0470, -0.2522),
        ("C", 28.333, 0.1826, 0.2508),
    )
)
# what `brute` looks at: beyond it there is nothing
QUESTIONS = {
    "e_n of each series": (Question(CLEAN, "f", separate=("e_n",)), (0.095, 0.107), (0.0, 1.0)),
    "mu ends below its optimum": (
        Question(CLEAN, "f", bounds={"mu": (0.0, 0.095)}), (0.093, 0.095), (0.6, 1.0)
    ),
    "e_n ends below its optimum": (
        Question(CLEAN, "f", bounds={"e_n": (0.0, 0.6)}, separate=("e_n",)), (0.095, 0.107), (0.3, 0.6)
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", rest_long(QUESTIONS, 2))
def test_against_dense_sums(name: str) -> None:
    question, mu_ends, e_ends = QUESTIONS[name]
    post = integrate(question.problem(), tolerance=1e-3)
    expected = brute(question, mu_ends, e_ends)
    assert post.converged
    assert post.log_evidence == pytest.approx(expected["log evidence"], abs=2e-3)
    for constant in (name for name in expected if f"sd {name}" in expected):
        sd = expected[f"sd {constant}"]
        assert abs(post.mean(constant) - expected[constant]) < 2e-3 * sd, constant
        assert abs(post.sd(constant) / sd - 1.0) < 2e-3, constant


def test_the_last_end_of_a_shared_mu() -> None:
    """The first panel of mu has all its mass at one end, which the coarse rule does not see."""
    post = integrate(Question(RANDOM, "f", separate=("e_n",)).problem())
    alone = [
        integrate(
            Question(tuple(row for row in RANDOM if row.series == s), "f", fix={"mu": 2.0 - 1e-5}).problem()
        )
        for s in "ABC"
    ]
    assert post.converged
    assert post.mean("mu") > 1.9999
    for series, given in zip("ABC", alone, strict=True):
        assert post.mean(f"e_n[{series}]") == pytest.approx(given.mean("e_n"), abs=0.1 * given.sd("e_n"))


def test_a_mode_below_the_kappa_that_every_e_n_allows_is_not_taken_for_the_best() -> None:
    """Separated from e_n, kappa ends at 0.147, with nothing near to that end: the certified one is 0.29."""
    gamma = tuple(np.linspace(20.0, 60.0, 12).tolist())
    rows = measured("beta", gamma, seed=5, sigma=0.02, mu=0.147, e_n=0.99, c=-0.98)
    problem = Question((*rows, Row("e_n", 5.0, 0.99, 0.01)), bounds={"mu": (0.0, 0.147)}).problem()
    start = least_squares(problem)
    post = integrate(problem, 1e-4, start)
    mu = dict(zip(problem.parameters.names, start.optimum.theta.tolist(), strict=True))["mu"]
    assert abs(post.mean("mu") - mu) < 5.0 * post.sd("mu")  # it was 124 of them, log evidence 425 lower
    assert post.mean("kappa") > 0.28
    assert log_evidence(problem, 1e-4, start) == pytest.approx(post.log_evidence, abs=2e-4)
