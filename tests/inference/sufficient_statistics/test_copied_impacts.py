"""Impacts that stand in a stream several times: found whole, and no departure from the closure."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from factories import each_once
from scipy import stats
from streams import folder_of, impacts

import ifrfit
from ifrfit.data.stream import copied_rows, sample
from ifrfit.data.stream.copied_rows import CopiedRows

pytest.importorskip("numba")


@pytest.fixture
def few(monkeypatch):
    """A sample that sees few of the rows, and a count of few different impacts."""
    monkeypatch.setattr(sample, "SAMPLE", 300)
    monkeypatch.setattr(copied_rows, "KEPT", 500)


def counted(columns, at, below=2**64 - 1):
    """The rows at some places, counted."""
    found = CopiedRows(below)
    for part in at:
        gamma, spin, value = (column[part] for column in columns)
        found.add((gamma, 0.0 * gamma, spin), [value, value], int(part[0]))
        found.tidy()
    return found


def test_counts_and_places_are_those_of_all_rows_however_they_are_parted(few):
    rng = np.random.default_rng(0)
    n = 3000
    columns = rng.uniform(1.0, 88.0, n), rng.standard_normal(n), rng.standard_normal(n)
    source = np.where(rng.random(n) < 0.3, rng.integers(n, size=n), np.arange(n))
    columns = [column[source] for column in columns]
    whole = counted(columns, [np.arange(n)])
    parts = np.array_split(np.arange(n), 7)
    halves = counted(columns, parts[:3]), counted(columns, parts[3:])
    halves[1].merge(halves[0])
    halves[1].tidy()
    for name in ("lots", "met", "impacts"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(halves[1], name))
    truth = pd.Series(np.arange(n)).groupby(columns[0]).agg(list)
    assert whole.lots.size == 500
    for first, again, count, gamma in zip(*whole.met.tolist(), whole.impacts[0], strict=True):
        rows = truth[gamma]
        assert (first, count) == (rows[0], len(rows))
        assert again == (rows[1] if len(rows) > 1 else 2**64 - 1)
    # Beyer et al. 2007, SIGMOD, 199: the relative sd of the number of different ones is 1/sqrt(k - 2)
    assert whole.different == pytest.approx(len(truth), rel=4.0 / np.sqrt(498))


@pytest.mark.parametrize(
    ("noise", "copied"), each_once(["known", "unknown"], ["each twice more", "a run", "a file"])
)
def test_copies_are_told_and_are_no_departure(tmp_path, few, copied, noise):
    table = impacts(2000, 1, spin=0.0, columns=("beta",), sigma=0.02).assign(sigma_beta=0.02)
    rng = np.random.default_rng(2)
    state = ifrfit.rebound(table["gamma_deg"].to_numpy(), degrees=True, e_n=0.9, e_t=-0.7, mu=0.15)
    table["beta"] = state.beta + 0.02 * rng.standard_normal(len(table))
    more = {"each twice more": [table] * 2, "a run": [table[200:1000]], "a file": [table[:1000]]}[copied]
    every = pd.concat([table, *more], ignore_index=True)
    found = ifrfit.fit(
        folder_of(tmp_path / "log", every, parts=4), method="lsq", noise=noise, fix={"e_n": 0.9}
    )
    held = ifrfit.fit(every, method="lsq", noise=noise, fix={"e_n": 0.9})
    told = found.facts["duplicates"]
    assert not told.ok
    assert not held.facts["duplicates"].ok
    assert found.facts["lack_of_fit"].ok
    # under unknown noise the runs test in memory takes copies, which stand side by side along tau, for runs
    assert held.facts["lack_of_fit"].ok == (noise == "known")
    share = 1.0 - len(table) / len(every)
    # of 500 different impacts
    assert told.figures["share"] == pytest.approx(share, abs=4.0 * np.sqrt(share * (1.0 - share) / 500))
    again, first = told.says.split("(")[2].split(",")[0].split(" is ")
    lines = {}
    for place in (again, first):
        name, line = place.split(":")
        lines[place] = (tmp_path / "log" / name).read_text().splitlines()[int(line) - 1]
    assert lines[again] == lines[first]


@pytest.mark.parametrize(("angle", "value"), [(0, 2), (1, 2), (0, 3), (2, 3)])
def test_readings_that_are_rounded_are_no_copies(tmp_path, few, angle, value):
    rng = np.random.default_rng(3)
    gamma = rng.uniform(1.0, 88.0, 6000)
    state = ifrfit.rebound(gamma, degrees=True, e_n=0.9, e_t=-0.7, mu=0.15)
    beta = state.beta + 0.02 * rng.standard_normal(6000)
    table = pd.DataFrame({"gamma_deg": gamma.round(angle), "beta": beta.round(value), "sigma_beta": 0.02})
    found = ifrfit.fit(folder_of(tmp_path / "log", table), method="lsq", fix={"e_n": 0.9})
    assert "duplicates" not in found.facts or "copies of others" not in found.facts["duplicates"].says


@pytest.mark.parametrize(("step", "angle", "copied"), [(0.05, 1, False), (0.005, 1, False), (0.005, 2, True)])
def test_steps_of_a_scale_are_no_copies(tmp_path, few, step, angle, copied):
    """Steps of 5 of the last decimal, at angles of few decimals; or three quarters of them twice."""
    rng = np.random.default_rng(3)
    gamma = rng.uniform(1.0, 88.0, 6000).round(angle)
    state = ifrfit.rebound(gamma, degrees=True, e_n=0.9, e_t=-0.7, mu=0.15)
    read = state.beta + 0.02 * rng.standard_normal(6000)
    table = pd.DataFrame(
        {"gamma_deg": gamma, "beta": np.round(np.round(read / step) * step, 3), "sigma_beta": 0.025}
    )
    every = pd.concat([table, table[: 4500 * copied]], ignore_index=True)
    found = ifrfit.fit(folder_of(tmp_path / "log", every), method="lsq", fix={"e_n": 0.9})
    told = "duplicates" in found.facts and "copies of others" in found.facts["duplicates"].says
    assert told == copied


def departures(tmp_path, every, scene):
    """p of the means of clean tables in which some impacts stand several times."""
    found = []
    for seed in range(every):
        table = scene(seed)
        fit = ifrfit.fit(folder_of(tmp_path / str(seed), table), method="lsq", fix={"e_n": 0.9})
        found.append(fit.facts["lack_of_fit"].figures["p"])
    return np.array(found)


@pytest.mark.long
@pytest.mark.parametrize("times", [1, 2, 4])
def test_p_of_means_with_copies_is_uniform(tmp_path, few, times):
    def scene(seed):
        rng = np.random.default_rng(seed)
        gamma = rng.uniform(1.0, 88.0, 3000)
        state = ifrfit.rebound(gamma, degrees=True, e_n=0.9, e_t=-0.7, mu=0.15)
        beta = state.beta + 0.02 * rng.standard_normal(gamma.size)
        table = pd.DataFrame({"gamma_deg": gamma, "beta": beta, "sigma_beta": 0.02})
        return pd.concat([table, *[table[: 3000 // 2]] * (times - 1)], ignore_index=True)

    p = departures(tmp_path, 60, scene)
    assert stats.kstest(p, "uniform").pvalue > 1e-3
    assert (p > 1e-3).all()


@pytest.mark.parametrize("noise", ["known", "unknown"])
@pytest.mark.parametrize("bend", [0.0, 0.3])
def test_rounded_angles_are_no_departure_and_hide_none(tmp_path, few, noise, bend):
    """Of clean angles rounded to a degree p was 2e-67: "the closure does not describe these data"."""
    rng = np.random.default_rng(5)
    gamma = rng.uniform(1.0, 88.0, 120_000)
    state = ifrfit.rebound(gamma, degrees=True, e_n=0.9, e_t=-0.7, mu=0.15)
    beta = state.beta + 0.005 * (rng.standard_normal(gamma.size) + bend * np.sin(gamma / 8.0))
    table = pd.DataFrame({"gamma_deg": gamma.round(0), "beta": beta.round(3)})
    if noise == "known":
        table["sigma_beta"] = 0.008  # with the angles' part
    fact = ifrfit.fit(folder_of(tmp_path / "log", table), method="lsq", fix={"e_n": 0.9}).facts["lack_of_fit"]
    assert fact.ok == (bend == 0.0)
    if fact.ok:
        assert "rounding leaves open, of angles in steps of 1 degrees and beta in steps of 0.001" in fact.says
    else:
        assert fact.says.startswith("the closure does not describe these data")
