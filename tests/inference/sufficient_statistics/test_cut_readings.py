"""Readings that noise carries below zero: a stream uses those that sigma explains, and tells the others."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
from streams import folder_of

import ifrfit
from ifrfit.data.stream.tally import Tally
from ifrfit.errors import DataError
from ifrfit.inference.estimators import LeastSquares
from ifrfit.inference.result.assumptions import COMPLETE

E_N = 0.5


def grazing(n=4000, sigma=0.1, seed=3, least=60.0, *, stated=False):
    """Impacts so flat that noise makes v_n negative; with or without columns of sigma."""
    rng = np.random.default_rng(seed)
    gamma = rng.uniform(least, 86.0, n)
    state = ifrfit.rebound(gamma, degrees=True, e_n=E_N, e_t=-0.8, mu=0.2)
    table = pd.DataFrame(
        {
            "gamma_deg": gamma,
            "v_n": state.v_n + sigma * rng.standard_normal(n),
            "beta": state.beta + 0.03 * rng.standard_normal(n),
        }
    )
    return table.assign(sigma_v_n=sigma, sigma_beta=0.03) if stated else table


def test_readings_that_sigma_explains_are_used_as_in_memory(tmp_path):
    table = grazing(stated=True)
    folder = folder_of(tmp_path / "all", table, 3)
    table.to_csv(tmp_path / "all.csv", index=False)
    fit, whole = ifrfit.fit(folder, method="lsq"), ifrfit.fit(tmp_path / "all.csv", method="lsq")
    assert "truncation" not in fit.facts
    assert fit.fit.n == 2 * len(table)
    e_n = fit.constants.e_n
    assert abs(e_n.value - E_N) < 3.0 * e_n.stderr
    # v_n = e_n cos(gamma) with one sigma: the mean by hand, of all readings
    slope = np.cos(np.radians(table["gamma_deg"]))
    by_hand = float(slope @ table["v_n"] / (slope @ slope))
    np.testing.assert_allclose([e_n.value, whole.constants.e_n.value], by_hand, rtol=1e-9)
    assert any(COMPLETE in said for said in fit.assumed)


def test_readings_further_below_zero_than_sigma_reaches_are_left_out(tmp_path):
    table = grazing(sigma=0.01, least=30.0, stated=True)
    wrong = table.index[:400]
    table.loc[wrong, "v_n"] *= -1.0
    far = int((table["v_n"] < -0.05).sum())
    fit = ifrfit.fit(folder_of(tmp_path / "all", table, 3), method="lsq")
    assert fit.inputs[0].rows_skipped["v_n impossible"] == far
    fact = fit.facts["truncation"]
    assert fact.figures["missing"] == far
    assert "below 0 by more than 5 sigma" in fact.says
    assert "Correct them or their sigma" in fact.says


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
    assert "State sigma of every observable" in fact.says
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


def test_readings_of_e_n_without_an_angle_are_cut_as_well(tmp_path):
    e_n = 0.1 + 0.1 * np.random.default_rng(1).standard_normal(900)
    fit = ifrfit.fit(
        folder_of(tmp_path / "all", pd.DataFrame({"e_n": e_n, "speed_m_s": 2.0}), 3), method="lsq"
    )
    fact = fit.facts["truncation"]
    assert fact.figures["missing"] == np.count_nonzero(e_n < 0.0)
    assert "--gamma-max" not in fact.says


def said_of(source):
    with pytest.raises(DataError) as refused:
        ifrfit.fit(source, method="lsq")
    return str(refused.value)


@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize("parts", [1, 3])
def test_a_column_of_the_other_sign_is_refused_as_in_memory(tmp_path, stated, parts):
    table = grazing(least=40.0, stated=stated)
    table["v_n"] *= -1.0
    table.to_csv(tmp_path / "all.csv", index=False)
    words = "impossible for v_n (0 to 10), and no noise"
    streamed, whole = said_of(folder_of(tmp_path / "all", table, parts)), said_of(tmp_path / "all.csv")
    assert words in streamed
    assert streamed.partition(words)[2] == whole.partition(words)[2]
    slope = np.cos(np.radians(table["gamma_deg"]))
    assert f"{float(slope @ table['v_n'] / (slope @ slope)):.3g}" in streamed


@pytest.mark.parametrize("stated", [True, False])
def test_so_is_one_series_of_it(tmp_path, stated):
    table = grazing(least=40.0, stated=stated).assign(series="a")
    table.loc[2500:, "series"] = "b"
    folder_of(tmp_path / "right", table, 2)
    ifrfit.fit(tmp_path / "right", method="lsq")
    table.loc[2500:, "v_n"] *= -1.0
    assert "of series b: " in said_of(folder_of(tmp_path / "all", table, 2))


def test_what_noise_alone_makes_is_refused_in_no_table(tmp_path):
    # e_n = 0: the constant is below zero in half of them, by 4 standard errors in one of 30,000
    for seed in range(20):
        rng = np.random.default_rng(seed)
        table = grazing(200, seed=seed, stated=True)
        table["v_n"] = 0.1 * rng.standard_normal(200)
        ifrfit.fit(folder_of(tmp_path / str(seed), table, 2), method="lsq")


def test_one_far_cell_refuses_nothing(tmp_path):
    table = grazing(least=30.0, sigma=0.01, stated=True)
    table.loc[5, ["v_n", "sigma_v_n"]] = -0.9, 1e-4
    fit = ifrfit.fit(folder_of(tmp_path / "all", table, 2), method="lsq")
    assert fit.inputs[0].rows_skipped["v_n impossible"] >= 1


def test_sums_below_zero_are_those_of_any_parting():
    one, other, whole = Tally(), Tally(), Tally()
    for tally, series in ((one, ["a", "b"]), (other, ["b", "c"])):
        tally.numbers_of(series)
        for name in series:
            tally.note_below("v_n", name, 2, (-1.5, 0.25, 4.0))
            whole.note_below("v_n", name, 2, (-1.5, 0.25, 4.0))
    one.merge(Tally.of_dict(json.loads(json.dumps(other.to_dict()))))
    assert one.below == whole.below
    assert one.below["v_n"]["b"] == (4, -3.0, 0.5, 8.0)


def test_workers_say_the_same(tmp_path):
    table = grazing(least=40.0, stated=True)
    table["v_n"] *= -1.0
    folder = folder_of(tmp_path / "all", table, 3)
    with pytest.raises(DataError) as refused:
        ifrfit.fit(folder, method=LeastSquares(workers=2))
    assert str(refused.value) == said_of(folder)
