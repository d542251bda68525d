"""Evidences less some rows, by points of all rows: held against quadrature of the rest."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from factories import each_once
from posterior_questions import Question, measured

from ifrfit.inference.diagnostics.thresholds import SAMPLING_ERROR
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.posterior import integrate
from ifrfit.inference.posterior.factorised_sampling import EvidenceBySeries
from ifrfit.inference.posterior.importance_sampling import EvidenceByDraws, with_kept_rows
from ifrfit.inference.posterior.integrators import evidence_by_draws

ANGLES = (7.0, 16.0, 27.0, 38.0, 52.0, 70.0)
ODD = 3  # the row whose value is far from the law


def question(separate: tuple[str, ...], *, odd: float, noise: str = "unknown") -> Problem:
    """Two series with a mu and a noise each or not, and one value that is off by so many sigma."""
    rows = [
        row
        for number, mu in enumerate((0.12, 0.2))
        for row in measured("beta", ANGLES, seed=number, series=f"s{number}", mu=mu, sigma=0.02)
    ]
    rows[ODD] = replace(rows[ODD], value=rows[ODD].value + odd * 0.02)
    problem = Question(tuple(rows), separate=separate, fix={"e_n": 0.9}, noise=noise).problem()
    return problem.with_noise(replace(problem.noise, separate=True)) if noise == "unknown" else problem


PROBLEMS = {
    "shared constants": lambda: question((), odd=0.0),
    "shared constants, an odd value": lambda: question((), odd=12.0),
    "a mu each": lambda: question(("mu",), odd=0.0),
    "a mu each, an odd value": lambda: question(("mu",), odd=12.0),
    "a mu each, known noise": lambda: question(("mu",), odd=6.0, noise="known"),
}


@cache
def points(name: str) -> tuple[Problem, EvidenceByDraws, float]:
    problem = PROBLEMS[name]()
    optimum = least_squares(problem)
    return problem, evidence_by_draws(problem, optimum), integrate(problem, 1e-3, optimum).log_evidence


@pytest.mark.parametrize(("row", "name"), each_once([0, ODD, 9], PROBLEMS))
def test_a_row_is_predicted_as_quadrature_of_the_rest_says(name: str, row: int) -> None:
    problem, fewer, whole = points(name)
    kept = np.delete(np.arange(len(problem.rows)), row)
    expected = whole - integrate(with_kept_rows(problem, kept), 1e-3).log_evidence
    found, error = fewer.log_density_of_others(kept)
    assert error <= SAMPLING_ERROR
    # the whole is sampled, too
    assert abs(found - expected) <= 4.0 * error + 4.0 * 0.02


def test_rows_of_two_series_are_left_to_another_road() -> None:
    problem, fewer, _ = points("a mu each")
    _, error = fewer.log_density_of_others(np.delete(np.arange(len(problem.rows)), [0, 8]))
    assert error == np.inf


def test_points_that_do_not_carry_all_rows_are_not_believed(monkeypatch) -> None:
    problem, fewer, _ = points("a mu each")
    kept = np.arange(1, len(problem.rows))
    assert fewer.log_density_of_others(kept)[1] <= SAMPLING_ERROR
    monkeypatch.setattr(EvidenceBySeries, "evidence", lambda self: (0.0, np.inf))
    assert fewer.log_density_of_others(kept)[1] == np.inf


def test_noises_keep_their_priors() -> None:
    problem, _, _ = points("a mu each, an odd value")
    rest = with_kept_rows(problem, np.delete(np.arange(len(problem.rows)), ODD))
    assert rest.noise_bounds() == problem.noise_bounds()
