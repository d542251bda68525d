"""Readings that noise carries beyond what can be, and that a stream leaves out: a cut by size, and told."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from streams import folder_of

import ifrfit
from ifrfit.errors import DataError
from ifrfit.inference.result.assumptions import COMPLETE

E_N = 0.5


def grazing(n=4000, sigma=0.1, seed=3, least=60.0):
    """Impacts so flat that noise makes v_n negative."""
    rng = np.random.default_rng(seed)
    gamma = rng.uniform(least, 86.0, n)
    state = ifrfit.rebound(gamma, degrees=True, e_n=E_N, e_t=-0.8, mu=0.2)
    return pd.DataFrame(
        {
            "gamma_deg": gamma,
            "v_n": state.v_n + sigma * rng.standard_normal(n),
            "sigma_v_n": sigma,
            "beta": state.beta + 0.03 * rng.standard_normal(n),
            "sigma_beta": 0.03,
        }
    )


def test_readings_cut_at_zero_are_told_and_the_remedy_mends_it(tmp_path):
    table = grazing()
    folder = folder_of(tmp_path / "all", table, 3)
    fit = ifrfit.fit(folder)
    fact = fit.facts["truncation"]
    assert not fact.ok
    assert fact.figures["missing"] == np.count_nonzero(table["v_n"] < 0.0)
    assert next(iter(fit.facts)) == "truncation"  # what else misfits may follow from it
    assert abs(fit.constants.e_n.value - E_N) > 3.0 * fit.constants.e_n.stderr
    assert not any(COMPLETE in said for said in fit.assumed)
    assert "--observable beta" in fact.says
    left = ifrfit.fit(folder, observable="beta", prior={"e_n": (E_N, 0.01)})
    assert "truncation" not in left.facts
    assert any(COMPLETE in said for said in left.assumed)


def test_angles_without_such_readings_are_offered(tmp_path):
    table = grazing(least=30.0)
    fit = ifrfit.fit(folder_of(tmp_path / "all", table, 3))
    least = table.loc[table["v_n"] < 0.0, "gamma_deg"].min()
    assert f"--gamma-max {np.floor(10.0 * least) / 10.0:g} or" in fit.facts["truncation"].says


def test_few_of_many_are_no_finding_but_none_says_that_nothing_was_left_out(tmp_path):
    table = grazing(sigma=0.01)
    table.loc[7, "v_n"] = -0.02
    assert (table["v_n"] < 0.0).sum() == 1
    fit = ifrfit.fit(folder_of(tmp_path / "all", table, 3))
    assert "truncation" not in fit.facts or fit.facts["truncation"].ok
    assert not any(COMPLETE in said for said in fit.assumed)


def test_codes_and_rows_outside_what_was_asked_for_are_no_cut(tmp_path):
    table = grazing()
    table = table[table["v_n"] > 0.0].reset_index(drop=True)
    table.loc[:20, "v_n"] = -5.0
    fit = ifrfit.fit(folder_of(tmp_path / "codes", table, 3))
    assert fit.inputs[0].rows_skipped["v_n impossible"] == 21
    assert any(COMPLETE in said for said in fit.assumed)
    table.loc[:20, "v_n"] = -0.02
    table.loc[:20, "gamma_deg"] = 85.9
    fit = ifrfit.fit(folder_of(tmp_path / "range", table, 3), gamma_max=85.0)
    assert any(COMPLETE in said for said in fit.assumed)


def test_whoever_reads_counts_the_same_cut(tmp_path, monkeypatch):
    from ifrfit.data.stream import portions
    from ifrfit.inference.estimators import LeastSquares

    monkeypatch.setattr(portions, "FIRST_ROWS", 300)
    monkeypatch.setattr(portions, "ROWS", 300)
    folder = folder_of(tmp_path / "all", grazing(), 4, "parquet")
    alone, shared = (ifrfit.fit(folder, method=LeastSquares(workers=k)) for k in (1, 2))
    assert alone.facts["truncation"].says == shared.facts["truncation"].says


def test_in_memory_the_refusal_does_not_advise_to_cut(tmp_path):
    grazing(400).to_csv(tmp_path / "all.csv", index=False)
    with pytest.raises(DataError, match="leave out the whole setting"):
        ifrfit.fit(tmp_path / "all.csv")


def test_readings_of_e_n_without_an_angle_are_cut_as_well(tmp_path):
    e_n = 0.1 + 0.1 * np.random.default_rng(1).standard_normal(900)
    fit = ifrfit.fit(
        folder_of(tmp_path / "all", pd.DataFrame({"e_n": e_n, "sigma_e_n": 0.1}), 3), method="lsq"
    )
    fact = fit.facts["truncation"]
    assert fact.figures["missing"] == np.count_nonzero(e_n < 0.0)
    assert "--gamma-max" not in fact.says
