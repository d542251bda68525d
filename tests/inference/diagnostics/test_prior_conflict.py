"""What was fixed or known before is held against the data."""

from __future__ import annotations

import numpy as np
import pytest
from factories import at_most, impacts_file, rest_long

from ifrfit import fit
from ifrfit.report.sentences import headline

ANGLES = np.linspace(4.0, 84.0, 25)
TRUTH = {"gamma": ANGLES, "e_n": 0.94, "c": -0.9, "mu": 0.12, "noise": 0.02}


@pytest.fixture(params=[None, 0.02], ids=["unknown", "known"])
def path(request, tmp_path):
    return impacts_file(tmp_path / "t.csv", TRUTH | {"sigma": request.param})


@pytest.mark.parametrize(
    ("taken", "says"),
    [
        ({"fix": {"e_n": 0.94, "e_t": -0.6}}, "e_t = -0.6, which you fixed"),
        ({"fix": {"e_n": 0.94, "mu": 0.15}}, "mu = 0.15, which you fixed"),
        ({"fix": {"e_n": 0.94}, "prior": {"mu": (0.2, 0.005)}}, "your prior mu = 0.2 +- 0.005"),
        ({"fix": {"e_n": 0.94}, "bounds": {"e_t": (-0.8, -0.5)}}, "your bound e_t >= -0.8 (p = "),
        ({"fix": {"e_n": 0.94}, "bounds": {"mu": (0.0, 0.1)}}, "your bound mu <= 0.1 (p = "),
    ],
)
def test_a_value_that_the_data_contradict_is_named(path, taken, says):
    found = fit(path, method="lsq", **taken)
    fact = found.facts["prior_conflict"]
    assert not fact.ok
    assert fact.says.startswith("the data contradict ")
    assert says in fact.says
    assert "effects" not in found.facts  # a wrong value feigns them
    assert "the data contradict a value that was taken for known" in found.summary().split(". Details")[0]


def test_what_the_data_do_not_see_is_not_contradicted(path):
    """Of beta only kappa is seen: a wrong e_n makes a wrong mu, and no misfit."""
    assert "prior_conflict" not in fit(path, method="lsq", fix={"e_n": 0.5}).facts


@pytest.mark.parametrize(
    "bounds", [{"e_t": (-1.0, -0.5)}, {"e_t": (-0.99, -0.5)}, {"mu": (0.05, 0.5)}], ids=str
)
def test_bounds_that_hold_the_truth_are_not_contradicted(path, bounds):
    assert "prior_conflict" not in fit(path, method="lsq", fix={"e_n": 0.94}, bounds=bounds).facts


@pytest.mark.parametrize("seeds", rest_long((18, 60)))
def test_right_values_are_seldom_contradicted(tmp_path, seeds):
    """At 1e-3, times the number of constants."""
    rng = np.random.default_rng(5)
    alarms = 0
    for seed in range(seeds):
        sigma = None if seed % 2 else 0.02
        table = impacts_file(tmp_path / "t.csv", TRUTH | {"sigma": sigma, "seed": seed})
        bounds = {"e_t": (-0.9, -0.5)} if seed % 3 else None  # ends at the truth
        fixed = {"e_n": 0.94} if bounds else {"e_n": 0.94, "e_t": -0.9}
        prior = {"mu": (0.12 + 0.01 * rng.standard_normal(), 0.01)}
        found = fit(table, method="lsq", fix=fixed, prior=prior, bounds=bounds)
        alarms += "prior_conflict" in found.facts
    assert alarms <= at_most(seeds, 1e-3)


def test_a_small_inertia_factor_is_no_matter_of_closure_maw(tmp_path):
    """The table of MAW ends before; the search for omitted effects goes on without it."""
    table = impacts_file(tmp_path / "t.csv", TRUTH | {"sigma": None})
    assert "slips" in fit(table, method="lsq", fix={"e_n": 0.94}, inertia_factor=0.05).facts


@pytest.mark.parametrize("seed", rest_long((1, 2, 3)))
def test_a_contradicted_bound_comes_before_a_slip_that_explains_no_more(tmp_path, seed):
    """e_n of 0.9 beside a bound of 0.92 looks like a ratio of energies, too."""
    parts = [
        {
            "gamma": ANGLES,
            "observables": (name,),
            "e_n": 0.9,
            "noise": 0.01,
            "sigma": None,
            "seed": 10 * seed + i,
        }
        for i, name in enumerate(("beta", "e_n"))
    ]
    found = fit(impacts_file(tmp_path / "t.csv", *parts), method="lsq", bounds={"e_n": (0.92, 1.0)})
    assert headline(found) == "the data contradict a value that was taken for known"
    says = found.facts["prior_conflict"].says
    assert says.startswith("the data contradict your bound e_n >= 0.92")
    assert "else the table looks as if it had e_n as a ratio of energies" in says
    assert "slips" not in found.facts
