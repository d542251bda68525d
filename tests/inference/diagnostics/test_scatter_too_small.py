"""A sigma that is too large comes before what follows from it."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from factories import impacts_file, rest_long, table_file

from ifrfit import fit
from ifrfit.physics import rebound

ANGLES = np.linspace(5.0, 85.0, 40)


def _table(path, of_beta=1.0, of_e_n=1.0, seed=0):
    """beta and e_n with noises of 0.02 and 0.01, and sigmas times a factor."""
    beta = {"gamma": ANGLES, "noise": 0.02, "sigma": 0.02 * of_beta, "seed": seed}
    e_n = {"gamma": ANGLES, "observables": ("e_n",), "noise": 0.01, "sigma": 0.01 * of_e_n, "seed": 9 + seed}
    return impacts_file(path, beta, e_n)


def test_a_sigma_in_percent_is_called_so_before_anything_else(tmp_path):
    facts = fit(_table(tmp_path / "t.csv", 100.0, 100.0), method="lsq").facts
    assert next(iter(facts)) == "scatter_too_small"
    assert "sigma looks as if it were in percent: divide it by 100" in facts["scatter_too_small"].says
    assert "mend sigma first" in facts["identifiable"].says
    assert "fixes e_n" not in facts["identifiable"].says


def test_sigma_of_one_observable_alone(tmp_path):
    says = fit(_table(tmp_path / "t.csv", 100.0), method="lsq").facts["scatter_too_small"].says
    assert says.startswith("the values of beta scatter")
    assert "in percent" in says
    assert "--noise unknown takes its size" in says


@pytest.mark.parametrize("factor", [3.0, 40.0])
def test_another_factor_is_no_percent(tmp_path, factor):
    says = fit(_table(tmp_path / "t.csv", factor, factor), method="lsq").facts["scatter_too_small"].says
    assert "divide it by 100" not in says
    assert ("percent of each value" in says) is (factor > 30.0)


def test_what_nothing_fixes_is_said_with_a_large_sigma_too(tmp_path):
    beta = {"gamma": ANGLES, "noise": 0.02, "sigma": 0.1}
    facts = fit(impacts_file(tmp_path / "t.csv", beta), method="lsq").facts
    assert not facts["scatter_too_small"].ok
    assert "give e_n a value" in facts["identifiable"].says


def test_sigma_of_single_readings_beside_their_means(tmp_path):
    """Means of n readings, with the sd of one of them."""
    n = np.where(np.arange(40) % 2, 4, 16)
    beta = rebound(ANGLES, e_n=0.9, e_t=-0.8, mu=0.15, degrees=True).beta
    beta = beta + 0.02 / np.sqrt(n) * np.random.default_rng(3).standard_normal(40)
    columns = {"gamma_deg": ANGLES, "beta": beta, "beta_sigma": 0.02, "n": n}
    path, fixed = tmp_path / "t.csv", {"e_n": 0.9}
    result = fit(table_file(path, columns), method="lsq", fix=fixed)
    assert (
        "one of the n readings of each row: divide it by the root of n"
        in result.facts["scatter_too_small"].says
    )
    assert "sigma that of the mean of the n readings of a row, not of one of them" in result.assumed
    right = columns | {"beta_sigma": 0.02 / np.sqrt(n)}
    assert "scatter_too_small" not in fit(table_file(path, right), method="lsq", fix=fixed).facts
    del columns["beta_sigma"]
    assumed = fit(table_file(path, columns), method="lsq", fix=fixed).assumed
    assert any(words.startswith("as much weight for each row whatever its n") for words in assumed)


def test_a_right_sigma_is_none(tmp_path):
    for seed in range(20):
        assert "scatter_too_small" not in fit(_table(tmp_path / "t.csv", seed=seed), method="lsq").facts


def _of_two_series(path, seed, factors, names=("beta", "e_n"), noise=0.02):
    """Series A and B of 30 impacts each; sigmas of an observable in a series times a factor."""
    rng, parts = np.random.default_rng([seed, 71]), []
    for series in "AB":
        gamma = rng.uniform(10.0, 80.0, 30)
        state = rebound(gamma, e_n=0.9, e_t=-0.7, mu=0.15, degrees=True)
        for name in names:
            value = getattr(state, name) + noise * rng.standard_normal(30)
            setting = {"series": series, "observable": name, "gamma_deg": gamma, "value": value}
            sigma = noise * factors.get(f"{name} in {series}", 1.0)
            parts.append(
                pd.DataFrame({**setting, "sigma": sigma, "impact_id": [f"{series}{i}" for i in range(30)]})
            )
    return table_file(path, pd.concat(parts), "%.6f")


@pytest.mark.parametrize("noise", [0.01, 0.05])
@pytest.mark.parametrize("of", [("beta in A",), ("e_n in B",), ("beta in B", "e_n in B")])
@pytest.mark.parametrize("seed", rest_long(range(5)))
def test_sigma_of_one_series_alone(tmp_path, seed, of, noise):
    path = _of_two_series(tmp_path / "t.csv", seed, dict.fromkeys(of, 100.0), noise=noise)
    says = fit(path, method="lsq").facts["scatter_too_small"].says
    assert says.startswith(f"the values of {' and '.join(of)} scatter ")
    assert "sigma looks as if it were in percent: divide it by 100" in says


@pytest.mark.parametrize("of", ["A", "B"])
@pytest.mark.parametrize("seed", rest_long(range(5)))
def test_sigma_of_one_series_of_one_observable(tmp_path, seed, of):
    path = _of_two_series(tmp_path / "t.csv", seed, {f"beta in {of}": 100.0}, ("beta",))
    says = fit(path, method="lsq", fix={"e_n": 0.9}).facts["scatter_too_small"].says
    assert says.startswith(f"the values of beta in {of} scatter ")


@pytest.mark.parametrize("seed", rest_long(range(5)))
def test_a_sigma_of_all_series_is_named_once(tmp_path, seed):
    whole = {f"{name} in {series}": 100.0 for name in ("beta", "e_n") for series in "AB"}
    says = fit(_of_two_series(tmp_path / "t.csv", seed, whole), method="lsq").facts["scatter_too_small"].says
    assert says.startswith("the values scatter ")
    of_beta = {name: x for name, x in whole.items() if name.startswith("beta")}
    says = (
        fit(_of_two_series(tmp_path / "u.csv", seed, of_beta), method="lsq").facts["scatter_too_small"].says
    )
    assert says.startswith("the values of beta scatter ")


@pytest.mark.parametrize("seed", rest_long(range(40), 5))
def test_sigmas_of_series_that_are_right(tmp_path, seed):
    """Control."""
    assert "scatter_too_small" not in fit(_of_two_series(tmp_path / "t.csv", seed, {}), method="lsq").facts
