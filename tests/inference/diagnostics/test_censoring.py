"""Readings clipped to a value, or discarded for it, are named where the table shows it."""

from __future__ import annotations

import numpy as np
import pytest
from factories import at_most, rest_long

from ifrfit.inference.fit import fit
from ifrfit.physics import rebound


def table(path, seed, change, *, n=60, e_n=0.9, noise=0.03, e_n_noise=0.02):
    """Impacts of which `change` gives beta and e_n anew, nan where it discards one."""
    rng = np.random.default_rng(seed)
    gamma = np.round(rng.uniform(5.0, 80.0, n), 1)
    beta = rebound(gamma, e_n=e_n, e_t=-0.85, mu=0.14, degrees=True).beta + noise * rng.standard_normal(n)
    beta, readings = change(beta, e_n + e_n_noise * rng.standard_normal(n))
    rows = [
        f"{g:.1f},{b:.6f},{e:.6f}"
        for g, b, e in zip(gamma, beta, readings, strict=True)
        if np.isfinite(b) and np.isfinite(e)
    ]
    path.write_text("\n".join(["gamma_deg,beta,e_n", *rows]) + "\n", encoding="utf-8")
    return path


def named(path):
    facts = fit(path, method="lsq").facts
    return [name for name in ("censoring", "truncation") if name in facts]


@pytest.mark.parametrize("seeds", rest_long((2, 4)))
def test_clipped_values_are_named(tmp_path, seeds):
    for seed in range(seeds):
        path = table(tmp_path / "t.csv", seed, lambda b, e: (np.minimum(b, 0.55), e))
        found = fit(path, method="lsq")
        says = found.facts["censoring"].says
        assert "values of beta are 0.55 exactly, the largest of all" in says
        assert found.summary().startswith("LOOK  values look clipped")


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


@pytest.mark.parametrize("seeds", rest_long((4, 8)))
def test_discarded_readings_of_e_n_are_named_where_the_table_shows_it(tmp_path, seeds):
    found = [
        named(
            table(
                tmp_path / "t.csv",
                seed,
                lambda b, e: (b, np.where(e > 1.0, np.nan, e)),
                n=300,
                e_n=0.97,
                e_n_noise=0.05,
            )
        )
        for seed in range(seeds)
    ]
    assert sum(each == ["truncation"] for each in found) >= 0.75 * seeds, found


@pytest.mark.parametrize("n", [15, 60])
@pytest.mark.parametrize("seeds", rest_long((3, 300)))
def test_complete_tables_are_fine(tmp_path, n, seeds):
    alarms = sum(
        bool(named(table(tmp_path / "t.csv", seed, lambda b, e: (b, e), n=n))) for seed in range(seeds)
    )
    assert alarms <= at_most(seeds, 0.001)
