"""How often series that contradict one another are told, and series that agree: see docs/facts.md."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from factories import at_most, problem_of, rest_long, table_file
from simulated import simulated

from ifrfit import fit
from ifrfit.inference.diagnostics.nested_models import pooling
from ifrfit.inference.diagnostics.thresholds import REFUTED
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.physics import rebound

GAMMA = np.linspace(5.0, 85.0, 17)
TRUE = {"e_n": 0.9, "e_t": -0.85, "mu": 0.14}
SIGMA = 0.02
GIVEN = {"known": (True, True), "unknown": (False, False), "mixed": (True, False)}  # of which series


def question(rng: np.random.Generator, policy: str, **difference: float) -> Problem:
    """Two series of beta; the constants of the second differ, and e_n is given."""
    value, sigma = [], []
    for second, given in enumerate(GIVEN[policy]):
        constants = {name: x + second * difference.get(name, 0.0) for name, x in TRUE.items()}
        value.append(rebound(GAMMA, degrees=True, **constants).beta + SIGMA * rng.standard_normal(GAMMA.size))
        sigma.append(np.full(GAMMA.size, SIGMA if given else np.nan))
    rows = np.tile(GAMMA, 2), np.concatenate(value), np.concatenate(sigma)
    data = simulated(
        np.full(2 * GAMMA.size, "beta"), *rows, series=np.repeat(["first", "second"], GAMMA.size)
    )
    problem = problem_of(data, fix={"e_n": TRUE["e_n"]})
    assert problem.noise.policy == policy
    return problem


def told(problem: Problem) -> set[str]:
    """Constants that the fact says are not shared."""
    found = pooling(problem, least_squares(problem))
    assert found is not None
    return set(found.fact.figures["separate"])


def share(policy: str, n: int, seed: int, **difference: float) -> pd.Series:
    rng = np.random.default_rng(seed)
    found = [told(question(rng, policy, **difference)) for _ in range(n)]
    return pd.Series({name: sum(name in one for one in found) / n for name in ("e_t", "mu")})


@pytest.mark.parametrize("policy", GIVEN)
def test_a_large_difference_is_told_and_none_is_not(policy):
    large = share(policy, 3, 1, mu=0.06)
    assert large["mu"] == 1.0
    assert share(policy, 3, 2).sum() == 0.0


@pytest.mark.long
@pytest.mark.parametrize("policy", GIVEN)
def test_series_that_agree_are_hardly_ever_told_apart(policy):
    n = 1000
    assert n * share(policy, n, 3).max() <= at_most(n, REFUTED)


@pytest.mark.long
@pytest.mark.parametrize("policy", GIVEN)
@pytest.mark.parametrize(
    ("name", "sizes", "least"),
    [("mu", (0.005, 0.01, 0.02), (0.1, 0.75, 1.0)), ("e_t", (0.02, 0.03, 0.06), (0.1, 0.4, 0.98))],
)
def test_series_that_differ_are_told_at_three_sizes(policy, name, sizes, least):
    found = [share(policy, 100, 4, **{name: size})[name] for size in sizes]
    assert found == sorted(found)
    for one, limit in zip(found, least, strict=True):
        assert one >= limit


@pytest.mark.parametrize("seed", rest_long(range(8)))
def test_constants_that_only_together_differ(tmp_path, seed):
    """One kappa from another e_n and mu: neither alone describes the second series (seeds 0, 1 and 7)."""
    rng = np.random.default_rng(seed)
    gamma = np.linspace(10.0, 75.0, 20)
    parts = []
    for name, e_n, mu, scatter in (("A", 0.9, 0.15, 0.02), ("B", 0.6, 0.285 / 1.6, 2e-4)):
        beta = rebound(gamma, e_n=e_n, e_t=-0.75, mu=mu, degrees=True).beta
        read = {"beta": beta + 0.02 * rng.standard_normal(20), "e_n": e_n + scatter * rng.standard_normal(20)}
        parts.append(pd.DataFrame({"gamma_deg": gamma, "series": name} | read))
    found = fit(table_file(tmp_path / "t.csv", pd.concat(parts)), method="lsq").facts["pooling"]
    assert not found.ok
    assert found.figures["separate"] == ["e_n", "mu"]
    assert "0.600" in found.says or "0.599" in found.says


@pytest.mark.parametrize(("mu", "differ"), [(0.15, False), (0.2, True)])
def test_series_of_one_name_in_two_files_are_compared(tmp_path, mu, differ):
    paths = []
    for number, friction in enumerate((0.15, mu)):
        rng = np.random.default_rng(number)
        gamma = np.round(rng.uniform(10.0, 78.0, 30), 1)
        beta = rebound(gamma, e_n=0.9, e_t=-0.75, mu=friction, degrees=True).beta
        table = {"gamma_deg": gamma, "beta": beta, "e_n": np.full(30, 0.9), "series": ["glass"] * 30}
        table |= {name: table[name] + 0.01 * rng.standard_normal(30) for name in ("beta", "e_n")}
        paths.append(table_file(tmp_path / f"{'ab'[number]}.csv", table, "%.4f"))
    found = fit(paths, method="lsq")
    assert any("the series glass is in a.csv and in b.csv" in said for said in found.warnings)
    assert found.facts["pooling"].ok is not differ
    if differ:
        assert "in glass of a.csv" in found.facts["pooling"].says
        assert "give those of different files different names" in found.facts["pooling"].says
    alone = fit(paths[0], method="lsq")
    assert not [said for said in alone.warnings if "the series glass" in said]


def test_constants_that_one_series_tells_alone_are_not_said_to_be_shared(tmp_path):
    """One sticks all through, the other slides: mu is not compared. e_t acts in sliding, too."""
    rng = np.random.default_rng(2)
    gamma = np.concatenate((np.linspace(5.0, 20.0, 12), np.linspace(60.0, 75.0, 12)))
    truth = rebound(gamma, degrees=True, e_n=0.9, e_t=-0.9, mu=0.12)
    columns = {
        "gamma_deg": gamma,
        "beta": truth.beta + 0.02 * rng.standard_normal(24),
        "e_n": 0.9 + 0.01 * rng.standard_normal(24),
        "series": np.repeat(["drop", "launch"], 12),
    }
    fact = fit(table_file(tmp_path / "t.csv", columns, "%.5g"), method="lsq").facts["pooling"]
    assert fact.ok
    assert fact.says.startswith("one e_n and e_t for all series (p = ")
    assert fact.says.endswith("mu is told by one series alone, and not compared")
