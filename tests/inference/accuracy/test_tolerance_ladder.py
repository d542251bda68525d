"""The tolerance goes down as long as the foreseen time fits; accuracy that is claimed is real."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import ifrfit
from ifrfit import Automatic
from ifrfit.cost.inference_costs import largest_errors, of_distribution
from ifrfit.inference.accuracy.request import make_request
from ifrfit.inference.accuracy.select_method import LADDER, ladder, refine
from ifrfit.inference.posterior import integrate
from ifrfit.inference.posterior.adaptive_quadrature import GridTooLargeError


class Clock:
    """A clock that only moves when it is told to."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


@dataclass
class Integral:
    """What a posterior says of itself."""

    tolerance: float
    error: float
    converged: bool = True
    error_evidence: float = 0.0


class Explore:
    """Takes as long as it is told to at each tolerance, and looks at the clock as rounds do."""

    def __init__(self, clock, seconds, *, rounds=10, stuck=()):
        self.clock, self.seconds, self.rounds, self.stuck = clock, seconds, rounds, stuck
        self.asked = []

    def __call__(self, problem, tolerance, start, over=None):
        self.asked.append(tolerance)
        for done in range(1, self.rounds + 1):
            self.clock.now += self.seconds[tolerance] / self.rounds
            if over is not None and over() and done < self.rounds:
                return Integral(tolerance, tolerance * 10.0 ** (self.rounds - done), False)
        if tolerance in self.stuck:
            return Integral(tolerance, 300.0 * tolerance, False)
        return Integral(tolerance, 0.5 * tolerance)


def refined(budget, seconds, accuracy=None):
    clock = Clock()
    integrate = Explore(clock, dict(zip(ladder(accuracy, True), seconds, strict=False)))
    found = refine(None, None, make_request(accuracy, budget, clock=clock), integrate)
    return found, integrate.asked, clock.now


def test_goes_on_to_the_finest_where_there_is_time():
    found, asked, _ = refined(100.0, [0.1] * 6)
    assert found.tolerance == LADDER[-1]
    assert asked == list(LADDER)


def test_stops_where_the_next_one_is_foreseen_to_be_late():
    found, asked, spent = refined(1.0, [0.1, 0.2, 0.4, 0.8, 1.6, 3.2])
    # after 0.3 s the next is foreseen at four times 0.2 s, over the 0.9 s for searching
    assert found.tolerance == asked[-1] == 1e-2
    assert spent == pytest.approx(0.3)


def test_growth_that_was_seen_is_believed():
    found, asked, _ = refined(10.0, [0.1, 1.0, 9.0])
    assert found.tolerance == asked[-1] == 1e-2  # ten times 1.0 s would be late, four times would not


def test_a_step_that_takes_longer_than_foreseen_is_cut_short():
    found, asked, spent = refined(1.0, [0.1, 30.0])
    assert asked == [1e-1, 1e-2]
    assert found.tolerance == 1e-1  # it came to an end, and is the better one
    assert spent < 5.0  # a round of the ten, not all


def test_nothing_where_even_the_coarsest_does_not_come_to_an_end():
    found, asked, _ = refined(1.0, [50.0])
    assert found is None
    assert asked == [1e-1]


def test_who_must_have_it_gets_the_coarsest_however_long_it_takes():
    clock = Clock()
    integrate = Explore(clock, dict.fromkeys(LADDER, 50.0))
    found = refine(None, None, make_request(None, 1.0, clock=clock), integrate, must=True)
    assert integrate.asked == [1e-1]
    assert found.error == 0.05
    assert clock.now == pytest.approx(50.0)


def test_time_that_ends_before_the_first_round_leaves_what_there_was():
    clock = Clock()

    def integrate(problem, tolerance, start, over):
        clock.now += 0.01 if tolerance == 1e-1 else 5.0
        if over():
            raise TimeoutError
        return Integral(tolerance, 0.5 * tolerance)

    found = refine(None, None, make_request(None, 1.0, clock=clock), integrate)
    assert found.tolerance == 1e-1


def test_nothing_is_begun_after_the_budget():
    clock = Clock()
    request = make_request(None, 1.0, clock=clock)
    clock.now = 2.0
    integrate = Explore(clock, {})
    assert refine(None, None, request, integrate) is None
    assert integrate.asked == []


@pytest.mark.parametrize("budget", [None, 100.0])
def test_finer_rules_are_tried_where_coarse_ones_get_stuck(budget):
    clock = Clock()
    integrate = Explore(clock, dict.fromkeys((1e-1, *LADDER), 1.0), stuck=(1e-1, 1e-2))
    found = refine(None, None, make_request(0.1, budget, clock=clock), integrate)
    assert integrate.asked == [1e-1, 1e-2, 1e-3]
    assert found.error == 0.5e-3
    assert found.tolerance == 0.1  # what was asked for is what has to be reached


def test_what_gets_no_better_is_given_up():
    clock = Clock()
    integrate = Explore(clock, dict.fromkeys(LADDER, 1.0))
    integrate.error = iter([0.04, 0.05])
    found = refine(
        None,
        None,
        make_request(1e-3, None, clock=clock),
        lambda *_, **__: Integral(1e-3, next(integrate.error), False),
    )
    assert found.error == 0.04


def test_a_grid_beyond_the_memory_ends_the_way_down():
    clock = Clock()
    walk = Explore(clock, dict.fromkeys(LADDER, 1.0))

    def limited(problem, tolerance, start, over=None):
        if tolerance < largest:
            raise GridTooLargeError("a grid of 2e7 values")
        return walk(problem, tolerance, start, over)

    largest = 1e-3
    found = refine(None, None, make_request(None, 100.0, clock=clock), limited)
    assert found.tolerance == 1e-3
    largest = 1.0  # nothing was reached before
    with pytest.raises(GridTooLargeError):
        refine(None, None, make_request(None, 100.0, clock=clock), limited)


def test_stops_at_the_asked_accuracy():
    found, asked, _ = refined(100.0, [0.1] * 6, accuracy=2e-3)
    assert asked == [1e-1, 1e-2, 2e-3]
    assert found.tolerance == 2e-3


def test_without_a_budget_goes_there_at_once():
    clock = Clock()
    integrate = Explore(clock, {3e-5: 1.0})
    found = refine(None, None, make_request(3e-5, None, clock=clock), integrate)
    assert integrate.asked == [3e-5]
    assert found.tolerance == 3e-5


@pytest.fixture(scope="module")
def references():
    found = {}
    for name, choices in {
        "kharaz-2001": {"prior": {"e_n": (0.98, 0.01)}},
        "cross-2019": {"fix": {"e_n": 0.94}},
    }.items():
        fit = ifrfit.fit(name, method="lsq", **choices)
        found[name] = fit.problem, choices, of_distribution(fit.problem, integrate(fit.problem, 1e-8))
    return found


@pytest.mark.parametrize("accuracy", [0.5, 0.03, 1e-3, 1e-5])
@pytest.mark.parametrize("name", ["kharaz-2001", "cross-2019"])
def test_the_accuracy_that_was_asked_for_is_reached(references, name, accuracy):
    problem, choices, reference = references[name]
    fit = ifrfit.fit(name, method=Automatic(accuracy=accuracy), **choices)
    off = max(largest_errors([of_distribution(problem, fit.distribution)], reference).values())
    assert off <= accuracy
    assert fit.effort.method == "exact"
    assert fit.effort.reached <= accuracy
    assert fit.effort.met
    assert fit.facts["converged"].ok


def test_a_first_look_alone_says_how_wrong_it_is():
    """The control: cut short at once, the result does not claim what it has not reached."""
    problem = ifrfit.fit("cross-2019", method="lsq", fix={"e_n": 0.94}).problem
    asked = iter([False, True])
    cut = integrate(problem, 1e-8, over=lambda: next(asked))
    with pytest.raises(TimeoutError):
        integrate(problem, 1e-8, over=lambda: True)
    whole = integrate(problem, 1e-8)
    assert not cut.converged
    assert cut.error > 1e-8
    assert np.isclose(cut.mean("mu"), whole.mean("mu"), atol=10.0 * cut.error * whole.sd("mu"))
