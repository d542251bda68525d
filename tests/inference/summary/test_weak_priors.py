"""A prior that says nothing determines nothing; bounds that confine a constant are named."""

from __future__ import annotations

import numpy as np
import pytest
from factories import impacts_file

from ifrfit import fit

ANGLES = np.linspace(5.0, 80.0, 11)  # what profiles cost grows with the rows
METHODS = ("lsq", "exact", "profile")


@pytest.fixture
def path(tmp_path):
    return impacts_file(tmp_path / "t.csv", {"gamma": ANGLES, "noise": 0.01, "sigma": 0.01})


@pytest.mark.parametrize("sd", [0.15, 0.3])
def test_methods_agree_on_a_weak_prior(path, sd):
    """A profile that closes by the prior alone is no limit that the data set."""
    found = [fit(path, method=method, prior={"e_n": (0.9, sd)}).constants for method in METHODS]
    for name in ("e_n", "mu"):
        estimates = [constants[name] for constants in found]
        assert {each.status for each in estimates} == {"not_determined"}
        assert len({each.reason for each in estimates}) == 1
        for each in estimates:
            assert each.interval95 == pytest.approx(estimates[0].interval95, abs=0.01)


@pytest.mark.parametrize("method", METHODS)
def test_a_narrow_prior_still_counts(path, method):
    result = fit(path, method=method, prior={"e_n": (0.9, 0.02)})
    assert result.constants["mu"].status == "prior"
    assert result.constants["mu"].reason == "rests on your prior of e_n"


@pytest.mark.parametrize("method", METHODS)
def test_bounds_that_confine_are_named(path, method):
    result = fit(path, method=method, bounds={"e_n": (0.85, 0.95)})
    for name, middle in (("e_n", 0.9), ("mu", 0.12 * 1.94 / 1.9)):
        estimate = result.constants[name]
        assert (estimate.status, estimate.reason) == ("prior", "rests on your bounds of e_n")
        assert estimate.value == pytest.approx(middle, abs=0.01)
        assert estimate.interval95[0] < middle < estimate.interval95[1]


@pytest.mark.parametrize("method", METHODS)
def test_bounds_that_leave_most_of_the_domain_determine_nothing(path, method):
    result = fit(path, method=method, bounds={"e_n": (0.2, 0.95)})
    assert result.constants["mu"].status == "not_determined"
