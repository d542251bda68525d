"""No local search may end below what is certified to be the least.

The suite's share of ``scripts/calibrate.py``: 20 random problems (300 with -m long), 40 local starts each.
The local searches are MINPACK's on a model written out by hand, so that they share nothing with the
certified solver.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from calibrate import compare, compare_many, summary
from factories import rest_long
from local_search import Local
from random_problems import random_problem

import ifrfit.inference.optimize.solve as block_solver
from ifrfit.inference.optimize.branch_and_bound import minimise as certified_minimum
from ifrfit.inference.optimize.optimum import objective_at
from ifrfit.inference.optimize.piecewise import PiecewiseOptimum, PiecewiseProblem
from ifrfit.inference.optimize.solve import solve

SEED = 20230101


@pytest.fixture(scope="module")
def problems():
    """Random problems of the kind the check uses."""
    children = np.random.SeedSequence(SEED + 1).spawn(60)
    return [random_problem(np.random.default_rng(child)) for child in children]


@pytest.mark.parametrize("n", rest_long((20, 300)))
def test_certified_is_never_worse_than_40_local_starts(n):
    found = list(compare_many(n, 40, SEED, 1))
    lines, held = summary(found)
    assert held, "\n".join(lines)
    certified = [c for c in found if c.certified]
    assert len(certified) >= 5 * n // 6  # the check would be empty if little were certified
    # and it would prove little if local searches never went astray
    assert sum(c.missed for c in certified) > 0.05 * sum(c.starts for c in certified)


@pytest.mark.long
def test_workers_do_not_change_the_comparison():
    assert list(compare_many(6, 3, SEED, 2)) == list(compare_many(6, 3, SEED, 1))


def test_model_by_hand_is_the_model(problems):
    rng = np.random.default_rng(SEED)
    for problem in problems:
        local = Local(problem)
        theta = local.start(rng)
        x = local.unknowns(theta)
        r = local.residuals(x)
        expected = objective_at(problem, problem.noise.sigma, local.theta(x))
        assert r @ r == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_one_local_search_that_calls_itself_certified_is_caught(problems):
    """Negative control: a certificate that looks at the local cell only."""

    template = solve(problems[0], problems[0].noise.sigma)

    def only_here(problem, sigma):
        local = Local(problem)
        _, theta = local.search(local.start(np.random.default_rng(7)))
        return replace(template, theta=theta, objective=objective_at(problem, sigma, theta), gap=0.0)

    found = [compare(p, 10, np.random.default_rng(i), only_here) for i, p in enumerate(problems)]
    lines, held = summary(found)
    assert not held, "\n".join(lines)
    assert sum(c.worse for c in found) >= 5


def test_second_best_cell_taken_for_the_best_is_caught(problems, monkeypatch):
    """Negative control, subtle: the certified solver, but with its runner-up handed out as the optimum."""
    swapped = []

    def runner_up(problem: PiecewiseProblem) -> PiecewiseOptimum:
        best = certified_minimum(problem)
        if len(best.optima) < 2 or best.optima[1][0] < best.chi2 + 1e-3:
            return best
        swapped.append(True)
        value, t = best.optima[1]
        return replace(best, t=t, chi2=value, gap=0.0)

    monkeypatch.setattr(block_solver, "minimise", runner_up)
    caught = total = 0
    for i, problem in enumerate(problems):
        swapped.clear()
        optimum = solve(problem, problem.noise.sigma)
        if not swapped or not optimum.certified:
            continue
        total += 1
        caught += compare(problem, 30, np.random.default_rng(i)).worse
    assert total >= 3
    assert caught > 0.5 * total  # the starts need not find every optimum that was hidden


def test_chi2_that_is_not_that_of_the_constants_is_caught(problems):
    """Negative control: right constants, wrong account of them."""

    def boasts(problem, sigma):
        optimum = solve(problem, sigma)
        return replace(optimum, objective=0.99 * optimum.objective - 1e-3, gap=None)

    found = [compare(p, 1, np.random.default_rng(0), boasts) for p in problems[:5]]
    assert all(c.misstated for c in found)
    assert not summary(found)[1]
