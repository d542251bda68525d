"""Parabolas of a piecewise problem: their least value is that of the problem at each value of an unknown."""

from __future__ import annotations

import numpy as np
import pytest
from random_problems import random_problem

from ifrfit.errors import UsageError
from ifrfit.inference.optimize import piecewise_profile
from ifrfit.inference.optimize.branch_and_bound import least_value, minimise
from ifrfit.inference.optimize.linear_families import linear_form
from ifrfit.inference.optimize.piecewise import PiecewiseProblem
from ifrfit.inference.optimize.piecewise_profile import BoundedParabolas, PiecewiseProfile
from ifrfit.inference.optimize.solve import whole_group


def problems(n: int, unknowns: int) -> list[PiecewiseProblem]:
    """Random ones in one unknown or two."""
    found, seed = [], 0
    while len(found) < n:
        seed += 1
        try:
            problem = random_problem(np.random.default_rng(seed))
        except UsageError:  # a prior beyond the bounds that were drawn
            continue
        form = linear_form(whole_group(problem, problem.noise.sigma))
        if form is not None and form.problem.kappa.size == unknowns:
            found.append(form.problem)
    return found


@pytest.mark.parametrize("unknowns", [1, 2])
def test_parabolas_are_the_certified_least_values(unknowns) -> None:
    for problem in problems(30, unknowns):
        optimum = minimise(problem)
        for unknown in range(unknowns):
            low, high = problem.interval(unknown)
            at = optimum.t[unknown]
            near = np.clip(at + 0.1 * np.array([-2.0, -0.5, 0.0, 0.3, 1.0]), low, high)
            profile = PiecewiseProfile(problem, optimum.t, unknown)
            found = profile.parabolas()(near)
            certified = [least_value(problem.with_fixed(unknown, x))[0] for x in near.tolist()]
            assert found == pytest.approx(certified, rel=1e-8, abs=1e-8)
            assert found == pytest.approx(profile(near)[0], rel=1e-8, abs=1e-8)


def test_least_between_two_ends_is_that_of_a_dense_grid() -> None:
    for problem in problems(20, 2):
        optimum = minimise(problem)
        own = PiecewiseProfile(problem, optimum.t, 1).parabolas()
        at = float(optimum.t[1])
        low, high = 0.7 * at, 0.9 * at
        grid = float(own(np.linspace(low, high, 20_001)).min())
        (found,) = own.least_between(np.array([low]), np.array([high]))
        assert found <= grid + 1e-9 * max(1.0, grid)
        assert found == pytest.approx(grid, rel=1e-5, abs=1e-5)
        # along x = factor (start + t) the same values are met
        (along,) = (
            own.along(np.array([0.5]), 1.9)
            .within(np.array(2.0 * low - 1.9), np.array(2.0 * high - 1.9))
            .lowest()[0]
        )
        assert along.min() == pytest.approx(found, rel=1e-9, abs=1e-9)


def test_the_answer_does_not_depend_on_how_much_is_done_at_once(monkeypatch) -> None:
    (problem,) = problems(1, 2)
    x = np.linspace(0.05, 1.0, 40)
    optimum = minimise(problem)
    every = PiecewiseProfile(problem, optimum.t, 1).parabolas()(x)
    monkeypatch.setattr(piecewise_profile, "_AT_ONCE", 7)
    few = PiecewiseProfile(problem, optimum.t, 1).parabolas()
    assert few(x).tolist() == every.tolist()
    assert few.least_between(x, x + 0.1).tolist() == pytest.approx(
        [float(few.least_between(x[i : i + 1], x[i : i + 1] + 0.1)[0]) for i in range(x.size)], rel=0.0
    )


def test_lowest_of_bounded_parabolas() -> None:
    one = np.ones(1)
    for a, b, low, high, d in (
        (2.0, -2.0, -5.0, 5.0, 1.0),  # inside
        (2.0, -2.0, 2.0, 5.0, 2.0),  # at an end
        (0.0, 0.0, 3.0, np.inf, 3.0),  # flat, without an end
        (0.0, 0.0, -np.inf, np.inf, 0.0),
    ):
        value, place = BoundedParabolas(a * one, b * one, 7.0 * one, low * one, high * one).lowest()
        assert place.tolist() == [d]
        assert value.tolist() == [a * d * d + 2.0 * b * d + 7.0]
    value, _ = BoundedParabolas(one, one, one, 2.0 * one, one).lowest()
    assert value.tolist() == [np.inf]
