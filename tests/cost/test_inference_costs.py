"""Errors of methods against posteriors that are known in closed form."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import ifrfit
from ifrfit.cost.inference_costs import (
    OTHER_QUESTION,
    UNIT,
    Extent,
    Numbers,
    inference_costs,
    largest_errors,
    of_distribution,
    of_least_squares,
    of_profiles,
)
from ifrfit.errors import UsageError
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.posterior import integrate
from ifrfit.inference.posterior.adaptive_quadrature import GridTooLargeError
from ifrfit.inference.profile.profile_all import profile_all

from .made import closed_form

SMALL = Extent(tolerances=(1e-1, 1e-4), replicates=(100,), steps=(10, 40), seeds=2, repeats=1, longest=30.0)


@pytest.fixture
def near_the_bound(impacts):
    """Sticking impacts only, mu fixed: e_t has a normal posterior cut at -1."""
    return linear_problem(impacts, c=-0.97)


@pytest.fixture
def far_from_bounds(impacts):
    return linear_problem(impacts, c=-0.7)


def linear_problem(impacts, c):
    path = impacts(gamma=np.linspace(5.0, 40.0, 12), c=c, mu=5.0, sigma=0.1, noise=0.1, seed=3)
    return ifrfit.fit(path, method="lsq", fix={"e_n": 0.94, "mu": 5.0}).problem


def test_the_reference_is_the_posterior_in_closed_form(near_the_bound, far_from_bounds):
    for problem in (near_the_bound, far_from_bounds):
        right, _, _ = closed_form(problem)
        found = of_distribution(problem, integrate(problem, 1e-9))
        assert max(largest_errors([found], right).values()) < 3e-9


def test_errors_of_exact_are_those_against_the_closed_form(near_the_bound):
    right, _, _ = closed_form(near_the_bound)
    measured = inference_costs(near_the_bound, extent=SMALL)
    assert measured.reference.error <= measured.reference.tolerance
    for cost in (c for c in measured.costs if c.method == "exact"):
        tolerance = float(cost.setting.removeprefix("tolerance "))
        own = of_distribution(near_the_bound, integrate(near_the_bound, tolerance))
        expected = max(largest_errors([own], right)[cost.quantity], measured.reference.error)
        assert cost.error == pytest.approx(expected, abs=1e-8)
        assert cost.error <= tolerance


def test_least_squares_are_as_far_off_as_the_cut_normal_law_says(near_the_bound):
    right, mean, sd = closed_form(near_the_bound)
    expected = Numbers(
        np.array([max(mean, -1.0)]),
        np.array([sd]),
        np.clip([[max(mean, -1.0) - 1.959964 * sd, max(mean, -1.0) + 1.959964 * sd]], -1.0, -0.4),
    )
    expected_errors = largest_errors([expected], right)
    found = largest_errors([of_least_squares(near_the_bound, least_squares(near_the_bound))], right)
    assert found == pytest.approx(expected_errors, rel=1e-5)
    assert found["mean"] > 0.1  # the control: cut at the bound the posterior's mean lies inside


def test_where_nothing_is_cut_all_methods_agree(far_from_bounds):
    problem = far_from_bounds
    right, _, _ = closed_form(problem)
    found = least_squares(problem)
    of_profile = of_profiles(problem, profile_all(problem, found, curves=False))
    assert max(largest_errors([of_least_squares(problem, found)], right).values()) < 1e-3
    assert max(largest_errors([of_profile], right).values()) < 1e-3


def test_everything_is_measured_with_three_quantities(near_the_bound):
    told = []
    measured = inference_costs(
        near_the_bound, extent=SMALL, progress=lambda done, most: told.append((done, most))
    )
    names = {(c.method, c.setting) for c in measured.costs}
    own = {
        ("lsq", ""),
        ("profile", ""),
        ("bootstrap", "100 replicates"),
        ("exact", "tolerance 1e-1"),
        ("exact", "tolerance 1e-4"),
        ("mcmc", "10 steps"),
        ("mcmc", "40 steps"),
    }
    assert {each for each in names if each[0] in dict(own)} == own
    assert len(measured.costs) == 3 * len(names)
    assert {c.quantity for c in measured.costs} == {"mean", "sd", "interval95"}
    assert all(c.error_unit == UNIT and c.kind == "inference" for c in measured.costs)
    assert all(c.error >= measured.reference.error for c in measured.costs)
    assert all(0.0 < c.time.low <= c.time.median <= c.time.high for c in measured.costs)
    assert measured.notes == ()
    assert told[-1][0] == len(names) <= told[-1][1]
    assert set(OTHER_QUESTION) < {c.method for c in measured.costs}


def test_of_seeds_the_root_mean_square_counts():
    right = Numbers(np.array([0.0, 0.0]), np.array([1.0, 2.0]), np.zeros((2, 2)))
    lucky = Numbers(np.array([0.0, 0.0]), right.sd, np.zeros((2, 2)))
    unlucky = Numbers(np.array([0.3, 0.8]), np.array([1.0, 2.0]), np.array([[0.0, 0.1], [0.0, 0.0]]))
    found = largest_errors([lucky, unlucky], right)
    assert found["mean"] == pytest.approx(0.4 / math.sqrt(2.0))  # of the second constant, whose sd is 2
    assert found["sd"] == 0.0
    assert found["interval95"] == pytest.approx(0.1 / math.sqrt(2.0))


def test_errors_of_chains_fall_with_their_length(far_from_bounds):
    extent = Extent(tolerances=(1e-1,), replicates=(), steps=(20, 200), seeds=2, repeats=1, longest=60.0)
    told = inference_costs(far_from_bounds, extent=extent)
    error = {c.setting: c.error for c in told.costs if c.method == "mcmc" and c.quantity == "mean"}
    assert error["200 steps"] < 0.7 * error["20 steps"]
    assert error["200 steps"] < 0.04


def test_lengths_that_would_take_too_long_are_left_out(far_from_bounds):
    told = inference_costs(
        far_from_bounds,
        extent=Extent((1e-1,), (100,), (10**9,), seeds=1, repeats=1, longest=5.0),
    )
    assert told.notes == ("1,000,000,000 steps of mcmc would take longer than 5 s.",)
    assert "mcmc" not in {c.method for c in told.costs}


def test_replicates_that_would_take_too_long_are_left_out(impacts):
    """Rebound angles have their replicates fitted one by one."""
    path = impacts(gamma=np.linspace(10.0, 80.0, 10), observables=("delta_deg",), sigma=2.0, noise=1.0)
    problem = ifrfit.fit(path, method="lsq", fix={"e_n": 0.94}).problem
    few = Extent((1e-1,), (10**6,), (10,), seeds=1, repeats=1, longest=20.0)
    told = inference_costs(problem, extent=few)
    assert "1,000,000 replicates would take longer than 20 s." in told.notes
    assert "bootstrap" not in {c.method for c in told.costs}


def test_without_a_reference_nothing_is_measured(far_from_bounds, monkeypatch):
    cut = integrate(far_from_bounds, 1e-1)
    bad = replace(cut, errors=(7.0,), tolerance=1e-3, aim=7.0)
    monkeypatch.setattr("ifrfit.cost.inference_costs.integrate", lambda *_: bad)
    with pytest.raises(UsageError, match="comes to 7e0 of an sd only: there is nothing to measure errors"):
        inference_costs(far_from_bounds, extent=SMALL)


def test_a_tolerance_beyond_the_memory_leaves_the_next_coarser_as_the_reference(far_from_bounds, monkeypatch):
    def limited(problem, tolerance):
        if tolerance < largest:
            raise GridTooLargeError("a grid of 2e7 values")
        return integrate(problem, tolerance)

    largest = 1e-4
    monkeypatch.setattr("ifrfit.cost.inference_costs.integrate", limited)
    told = inference_costs(far_from_bounds, extent=SMALL)
    assert told.reference.tolerance == 1e-4
    assert told.notes[0].startswith("Tolerances of exact below 1e-4 are out of reach")
    largest = 1.0  # nothing to measure errors against
    with pytest.raises(GridTooLargeError):
        inference_costs(far_from_bounds, extent=SMALL)


def test_constants_of_each_series_count(far_from_bounds):
    problem = ifrfit.fit(
        "cross-2019", method="lsq", fix={"e_n": 0.94}, series=["no spin", "spin 0.225"], separate="mu"
    ).problem
    assert problem.parameters.free_names == ("e_t", "mu[no spin]", "mu[spin 0.225]")
    assert of_distribution(problem, integrate(problem, 1e-2)).ends.shape == (3, 2)
