"""Readings clipped to a value, or discarded for it, are named where the table shows it."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from factories import at_most, rest_long, table_file

from ifrfit.inference.fit import fit
from ifrfit.physics import rebound

IFR = {"e_t": -0.85}


def table(path, seed, change, *, n=60, e_n=0.9, noise=0.03, e_n_noise=0.02, law=IFR, **columns):
    """Impacts of which `change` gives beta and e_n anew, nan where it discards one; and further columns."""
    rng = np.random.default_rng(seed)
    gamma = np.round(rng.uniform(5.0, 80.0, n), 1)
    beta = rebound(gamma, e_n=e_n, mu=0.14, degrees=True, **law).beta + noise * rng.standard_normal(n)
    beta, readings = change(beta, e_n + e_n_noise * rng.standard_normal(n))
    frame = pd.DataFrame({"gamma_deg": gamma, "beta": beta, "e_n": readings} | columns)
    return table_file(path, frame.dropna(), "%.6f")


def named(path):
    facts = fit(path, method="lsq").facts
    return [name for name in ("censoring", "truncation") if name in facts]


@pytest.mark.parametrize("seeds", rest_long((2, 4)))
def test_readings_of_e_n_that_end_at_1_are_named(tmp_path, seeds):
    for seed in range(seeds):
        path = table(tmp_path / "t.csv", seed, lambda b, e: (b, np.minimum(e, 1.0)), e_n=0.96, e_n_noise=0.05)
        assert "values of e_n are 1 exactly" in fit(path, method="lsq").facts["censoring"].says


@pytest.mark.parametrize("seeds", rest_long((2, 6)))
def test_equal_values_by_rounding_are_no_pile(tmp_path, seeds):
    for seed in range(seeds):
        path = table(tmp_path / "t.csv", seed, lambda b, e: (np.round(b, 1), np.round(e, 2)))
        assert not named(path)


@pytest.mark.parametrize("seeds", rest_long((4, 8)))
def test_discarded_values_are_named_where_the_table_shows_it(tmp_path, seeds):
    """A cut through the middle of a plateau of 200 impacts."""
    found = [
        named(table(tmp_path / "t.csv", seed, lambda b, e: (np.where(b > 0.56, np.nan, b), e), n=200))
        for seed in range(seeds)
    ]
    assert sum(each == ["truncation"] for each in found) >= 0.75 * seeds, found


@pytest.mark.parametrize(("n", "noise", "least"), [(300, 0.05, 0.75), (150, 0.03, 0.5)])
@pytest.mark.parametrize("seeds", rest_long((4, 24)))
def test_discarded_readings_of_e_n_above_1_are_named(tmp_path, seeds, n, noise, least):
    """The end is known beforehand: half as many readings show it half as often."""
    found = [
        named(
            table(
                tmp_path / "t.csv",
                seed,
                lambda b, e: (b, np.where(e > 1.0, np.nan, e)),
                n=n,
                e_n=0.97,
                e_n_noise=noise,
            )
        )
        for seed in range(seeds)
    ]
    assert sum(each == ["truncation"] for each in found) >= least * seeds, found


@pytest.mark.parametrize("seeds", rest_long((3, 20)))
@pytest.mark.parametrize(("noise", "beta", "e_n"), [("known", 0.09, 0.06), ("scaled", 0.03, 0.06)])
def test_a_sigma_that_is_too_large_leaves_no_readings_out(tmp_path, seeds, noise, beta, e_n):
    for seed in range(seeds):
        path = table(tmp_path / "t.csv", seed, lambda b, e: (b, e), n=40, sigma_beta=beta, sigma_e_n=e_n)
        facts = fit(path, method="lsq", noise=noise).facts
        assert "truncation" not in facts
        assert ("scatter_too_small" in facts) == (noise == "known")


@pytest.mark.parametrize("seeds", rest_long((3, 8)))
def test_readings_left_out_are_named_beside_a_sigma_up_to_a_factor(tmp_path, seeds):
    """Control: the scatter is that of the rows, and the power stays."""
    found = [
        fit(
            table(
                tmp_path / "t.csv",
                seed,
                lambda b, e: (np.where(b > 0.56, np.nan, b), e),
                n=200,
                sigma_beta=0.06,
                sigma_e_n=0.04,
            ),
            method="lsq",
            noise="scaled",
        ).facts
        for seed in range(seeds)
    ]
    assert sum("truncation" in facts for facts in found) >= 0.6 * seeds


@pytest.mark.parametrize("seeds", rest_long((3, 20)))
def test_a_law_that_runs_beside_the_readings_is_no_cut(tmp_path, seeds):
    """A plateau of beta at 0.33 by closure FR, below the least that IFR has."""
    law = {"closure": "fr", "beta0": 0.33}
    for seed in range(seeds):
        path = table(tmp_path / "t.csv", seed, lambda b, e: (b, e), n=40, law=law)
        assert "truncation" not in fit(path, method="lsq").facts


@pytest.mark.parametrize("seeds", rest_long((6, 40)))
def test_skewed_errors_are_no_cut(tmp_path, seeds):
    """Exponential errors of mean 0, sharp at their upper end; some look like normal ones that are cut off."""
    named_ones = 0
    for seed in range(seeds):
        rng = np.random.default_rng(100 + seed)
        errors = 1.0 - rng.exponential(1.0, (2, 60))
        path = table(
            tmp_path / "t.csv",
            seed,
            lambda b, e, errors=errors: (b + 0.03 * errors[0], 0.9 + 0.02 * errors[1]),
            noise=0.0,
        )
        fact = fit(path, method="lsq").facts.get("truncation")
        named_ones += fact is not None
        assert fact is None or "or errors are skewed" in fact.says
    assert named_ones <= 1 + seeds // 10


@pytest.mark.parametrize("n", [15, 60])
@pytest.mark.parametrize("seeds", rest_long((3, 300)))
def test_complete_tables_are_fine(tmp_path, n, seeds):
    alarms = sum(
        bool(named(table(tmp_path / "t.csv", seed, lambda b, e: (b, e), n=n))) for seed in range(seeds)
    )
    assert alarms <= at_most(seeds, 0.001)
