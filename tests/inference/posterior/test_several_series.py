"""Constants shared by series or separate, against nested quadrature."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from factories import problem_of
from posterior_agreement import check
from posterior_dense import reference
from posterior_questions import LEVELS, Question, Row, measured

from ifrfit.data import combine, read
from ifrfit.inference.posterior import integrate

FAN = (8.0, 17.0, 26.0, 35.0, 50.0, 70.0)


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


DEAR = "e_n separate"  # under one mu: its transitions differ


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        *((name, 1e-4) for name in NESTED if name != DEAR),
        (DEAR, 1e-3),
        pytest.param(DEAR, 1e-4, marks=pytest.mark.long),
    ],
)
def test_nested(name: str, tolerance: float) -> None:
    question = NESTED[name]
    check(integrate(question.problem(), tolerance), reference(question), tolerance)


def test_all_separate_is_each_alone_and_evidence_adds() -> None:
    e_n = {"a": 0.9, "b": 0.7, "c": 0.8}
    rows = {s: r + drops(s, e_n[s]) for s, r in (("a", A), ("b", B), ("c", C))}
    names = ("e_n", "e_t", "mu")
    joint = integrate(Question(sum(rows.values(), ()), separate=names).problem())
    alone = {s: integrate(Question(r).problem()) for s, r in rows.items()}
    assert set(joint.names) == {f"{n}[{s}]" for s in rows for n in (*names, "kappa")}
    assert abs(joint.log_evidence - sum(p.log_evidence for p in alone.values())) < 4e-4
    for s, post in alone.items():
        for n in (*names, "kappa"):
            sd = post.sd(n)
            assert abs(joint.mean(f"{n}[{s}]") - post.mean(n)) < 2e-4 * sd
            assert abs(joint.sd(f"{n}[{s}]") / sd - 1.0) < 2e-4
            off = joint.quantile(f"{n}[{s}]", np.array(LEVELS)) - post.quantile(n, np.array(LEVELS))
            assert np.abs(off).max() < 2e-4 * sd


def test_ten_series_of_their_own_mu() -> None:
    rows = sum((run(f"s{i}", 20 + i, mu=0.05 + 0.03 * i) for i in range(10)), ())
    question = Question(rows, fix={"e_n": 0.9}, separate=("mu",))
    check(integrate(question.problem()), reference(question), 1e-4)


def test_two_files(tmp_path: Path) -> None:
    parts = []
    for name, rows in (("first", run("first", 31)), ("second", run("second", 32, mu=0.22))):
        path = tmp_path / f"{name}.csv"
        lines = [f"{r.gamma!r},{r.value!r},{r.sigma!r}" for r in rows]
        path.write_text("\n".join(["gamma_deg,beta,sigma", *lines]) + "\n", encoding="utf-8")
        parts.append(read(path))
    problem = problem_of(combine(parts), fix={"e_n": 0.9}, separate=("mu",))
    question = Question(run("first", 31) + run("second", 32, mu=0.22), fix={"e_n": 0.9}, separate=("mu",))
    check(integrate(problem), reference(question), 1e-4)
