"""Which method is measured under which scatter, and against what."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from refusals import refused

from ifrfit import AngleErrors, Noise
from ifrfit.cost.inference_costs import QUICK, Extent, inference_costs, largest_errors, of_distribution
from ifrfit.cost.measure import measure_costs
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.fit import fit
from ifrfit.inference.posterior import integrate

from .made import closed_form, setting_at, start_of

EFFECTIVE = Noise(angles=AngleErrors("effective", sigma_deg=1.0))
SMALL = Extent(tolerances=(1e-1, 1e-2), replicates=(100,), steps=(10,), seeds=1, repeats=1, longest=60.0)
FIX = {"e_n": 0.94}
ALL = {"lsq", "profile", "bootstrap", "exact", "mcmc"}
PLAIN_ONLY = {
    "profile likelihood is left out: --method profile knows independent Gaussian errors of the values only",
    "bootstrap is left out: --method bootstrap knows independent Gaussian errors of the values only",
}


@pytest.fixture
def path(impacts):
    return impacts(gamma=np.linspace(5.0, 80.0, 8), c=-0.8, sigma=0.05, noise=0.05, seed=3)


@pytest.mark.parametrize(
    ("error_model", "methods", "notes"),
    [  # as in the table of docs/noise.md
        ({"tails": "student-t"}, {"lsq", "exact", "mcmc"}, PLAIN_ONLY),
        pytest.param(
            {"angle_errors": "effective", "sigma_gamma": 1.0},
            {"lsq", "exact", "mcmc"},
            PLAIN_ONLY,
            marks=pytest.mark.long,
        ),
        (
            {"angle_errors": "set", "sigma_gamma": 1.0},
            {"exact", "mcmc"},
            {*PLAIN_ONLY, "least squares is left out: --method lsq cannot integrate true angles out"},
        ),
        ({"sigma_velocity": 0.05, "sigma_spin": 0.05}, ALL, set()),
    ],
    ids=["student-t", "effective", "set", "propagated"],
)
def test_a_method_that_does_not_know_the_scatter_is_left_out(path, error_model, methods, notes):
    found = start_of(path, fix=FIX, **error_model)
    measured = inference_costs(found.problem, extent=SMALL)
    assert {cost.method for cost in measured.costs} & ALL == methods
    assert {note.rpartition(": ")[0] for note in measured.notes} >= notes
    assert all(cost.error < 0.5 for cost in measured.costs if cost.method == "exact")


def test_the_reference_under_a_scatter_that_hardly_differs_is_the_plain_one(impacts):
    """Sticking does not depend on the angle: true angles integrated out leave the closed form."""
    path = impacts(gamma=np.linspace(5.0, 40.0, 12), c=-0.7, mu=5.0, sigma=0.1, noise=0.1, seed=3)
    fix = {"e_n": 0.94, "mu": 5.0}
    right, _, _ = closed_form(fit(path, method="lsq", fix=fix).problem)
    for error_model in ({"angle_errors": "set", "sigma_gamma": 0.1}, {"tails": "student-t", "dof": 1e6}):
        problem = start_of(path, fix=fix, **error_model).problem
        found = of_distribution(problem, integrate(problem, 1e-3))
        assert max(largest_errors([found], right).values()) < 2e-3
    # the control: heavy tails make another posterior
    problem = start_of(path, fix=fix, tails="student-t").problem
    assert max(largest_errors([of_distribution(problem, integrate(problem, 1e-3))], right).values()) > 0.1


def test_the_noise_of_an_integrated_scatter_is_as_in_a_fit(impacts):
    """One unknown noise becomes a factor with the prior of the noise, by either road."""
    path = impacts(gamma=np.linspace(5.0, 80.0, 12), noise=0.05, sigma=None, seed=3)
    own = start_of(path, fix=FIX, angle_errors="set", sigma_gamma=1.0).problem
    through_fit = fit(path, method="lsq", fix=FIX, noise=EFFECTIVE).problem
    assert own.noise.policy == through_fit.noise.policy == "scaled"
    assert own.noise_bounds() == through_fit.noise_bounds()
    assert own.noise.sigma.tolist() == through_fit.noise.sigma.tolist()


def test_angles_that_tie_e_n_leave_no_reference(impacts):
    path = impacts(gamma=np.linspace(5.0, 80.0, 12), observables=("mu_app",), sigma=0.05, noise=0.05)
    error_model = {"angle_errors": "set", "sigma_gamma": 1.0}
    with refused(UsageError, match=r"so there is no quadrature to measure errors against\. Fix e_n"):
        start_of(path, **error_model)
    assert start_of(path, posterior=False, **error_model).method == "lsq"
    assert start_of(path, fix=FIX, **error_model).problem.error_model.integrates


def test_errors_of_a_scatter_name_the_scatter_that_was_asked_for(path):
    error_model = {"angle_errors": "set", "sigma_gamma": 1.0}
    with refused(UsageError, match=r"Closure MAW knows independent Gaussian.*--angle-errors set out"):
        start_of(path, closure="maw", **error_model)
    with refused(DataError, match="--angle-errors set, but no row states an uncertainty of its angle"):
        start_of(path, fix=FIX, angle_errors="set")
    with refused(UsageError, match="--angle-errors measured needs --angle-population"):
        measure_costs(path, fix=FIX, noise=Noise(angles=AngleErrors("measured", sigma_deg=1.0)))


def test_where_every_method_takes_too_long_nothing_is_claimed(path, monkeypatch):
    problem = start_of(path, fix=FIX, angle_errors="set", sigma_gamma=1.0).problem
    hasty = Extent((1e-1,), (50,), (10**9,), seeds=1, repeats=1, longest=0.5, reference=0.0)
    with refused(UsageError, match=r"takes longer on these data than 0\.5 s: choose --kind physics"):
        inference_costs(problem, extent=hasty)
    monkeypatch.setattr("ifrfit.cost.inference_costs.foreseen", lambda *_: math.inf)
    endless = replace(QUICK, steps=(10**9,))
    monkeypatch.setattr("ifrfit.cost.inference_costs.QUICK", endless)
    with refused(UsageError, match=r"than 0\.7 s: leave --quick out, or choose --kind physics"):
        inference_costs(problem, extent=endless)


def test_contact_laws_stand_at_constants_that_the_notes_own_up_to(path):
    choices = {"fix": FIX, "angle_errors": "set", "sigma_gamma": 1.0}
    setting = setting_at(path, **choices)
    plain = setting_at(path, fix=FIX)
    by_slope = fit(path, method="lsq", fix=FIX, noise=EFFECTIVE)
    assert setting.constants["mu"] == pytest.approx(by_slope.constants["mu"].value, rel=1e-6)
    assert setting.constants["mu"] != plain.constants["mu"]
    assert setting.constants["chi"] == plain.constants["chi"]
    assert setting.notes[:2] == (
        "The constants at which contact laws and precisions are measured are those of effective variance: "
        "least squares cannot integrate true angles out.",
        "chi is that of independent Gaussian errors: closure MAW knows no others.",
    )


def test_the_text_says_which_scatter(path):
    found = measure_costs(path, kinds="arithmetic", quick=True, fix=FIX, noise=Noise(tails="student-t"))
    assert "closure IFR, known noise, Student-t errors (4 degrees of freedom)" in found.summary()
    assert found.to_dict()["noise"]["scatter"]["tails"] == "student-t"
