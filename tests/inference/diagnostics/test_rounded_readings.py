"""Readings that are rounded more coarsely than they scatter are named; ordinary decimals are not."""

from __future__ import annotations

import numpy as np
import pytest
from factories import at_most, rest_long
from refusals import refused

import ifrfit
from ifrfit.errors import DataError
from ifrfit.inference.fit import fit
from ifrfit.physics import rebound


def table(path, e_n, noise, seed, *, decimals=2, sigma=None):
    """30 impacts: beta to six decimals, e_n to few."""
    rng = np.random.default_rng(seed)
    gamma = np.round(rng.uniform(5.0, 80.0, 30), 1)
    beta = rebound(gamma, e_n=e_n, e_t=-0.85, mu=0.14, degrees=True).beta + 0.02 * rng.standard_normal(30)
    readings = np.round(e_n + noise * rng.standard_normal(30), decimals)
    given = "" if sigma is None else f",0.02,{sigma}"
    rows = [f"{g:.1f},{b:.6f},{e:.{decimals}f}{given}" for g, b, e in zip(gamma, beta, readings, strict=True)]
    header = "gamma_deg,beta,e_n" + ("" if sigma is None else ",sigma_beta,sigma_e_n")
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("seeds", rest_long((4, 12)))
def test_common_rounding_errors_are_named_with_a_value_that_holds(tmp_path, seeds):
    covered = []
    for seed in range(seeds):
        path = table(tmp_path / "t.csv", 0.9037, 0.001, seed)
        readings = np.genfromtxt(path, delimiter=",", skip_header=1)[:, 2]
        if np.ptp(readings) == 0.0:
            continue  # refused, see below
        found = fit(path, method="lsq")
        fact = found.facts["rounded_readings"]
        assert fact.says.startswith("readings of e_n stand in steps of 0.01 and scatter by 0.00")
        assert "--observable beta --prior e_n=0.90" in fact.says
        assert found.summary().startswith("LOOK  readings are rounded to coarser steps than they scatter")
        mean, sd = fact.figures["mean_rounded"], fact.figures["sd_rounded"]
        given = fit(path, method="lsq", observable=["beta"], prior={"e_n": (mean, sd)})
        low, high = given.constants["e_n"].interval95
        covered.append(low <= 0.9037 <= high)
    assert 2 * len(covered) >= seeds
    assert all(covered)


def test_a_given_sigma_below_the_steps_is_named(tmp_path):
    fact = fit(table(tmp_path / "t.csv", 0.9037, 0.001, 1, sigma=0.001), method="lsq").facts[
        "rounded_readings"
    ]
    assert fact.figures["sd_rounded"] > 1.5 * fact.figures["sd"]


def test_equal_readings_are_refused_for_their_rounding(tmp_path):
    path = table(tmp_path / "t.csv", 0.9, 0.0005, 0)
    with refused(DataError, match=r"all 30 values of e_n are 0.9, rounded or copied") as said:
        fit(path, method="lsq")
    assert "--observable beta --fix e_n=0.9" in said.value.in_shell
    assert (
        fit(path, method="lsq", observable=["beta"], fix={"e_n": 0.9}).constants["mu"].status == "determined"
    )


@pytest.mark.parametrize("noise", [0.003, 0.004, 0.005])
@pytest.mark.parametrize("seeds", rest_long((2, 6)))
def test_neighbouring_steps_are_neither_codes_nor_kinds_of_impacts(tmp_path, noise, seeds):
    for seed in range(seeds):
        facts = fit(table(tmp_path / "t.csv", 0.905, noise, seed), method="lsq").facts
        assert facts["slips"].ok, facts["slips"].says
        assert "mixture" not in facts


@pytest.mark.parametrize(("noise", "decimals"), [(0.006, 2), (0.01, 2), (0.02, 3), (0.02, 6)])
@pytest.mark.parametrize("seeds", rest_long((2, 300)))
def test_ordinary_decimals_are_fine(tmp_path, noise, decimals, seeds):
    alarms = 0
    for seed in range(seeds):
        e_n = np.random.default_rng([seed, 1]).uniform(0.85, 0.95)
        path = table(tmp_path / "t.csv", e_n, noise, seed, decimals=decimals)
        alarms += "rounded_readings" in ifrfit.fit(path, method="lsq").facts
    assert alarms <= at_most(seeds, 0.001)
