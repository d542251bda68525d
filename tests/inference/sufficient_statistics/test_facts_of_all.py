"""Facts that the sums of all impacts tell, as those of a table in memory."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from streams import folder_of, impacts

import ifrfit
from ifrfit.data.stream import sample
from ifrfit.inference.diagnostics.nested_models import pooling

pytest.importorskip("numba")


def two_series(n, mu, seed=0, sigma=(0.03, 0.03), **more):
    """Two series, each with a mu."""
    parts = [
        impacts(n, seed + k, mu=own, sigma=spread, **more).assign(series=f"s{k}")
        for k, (own, spread) in enumerate(zip(mu, sigma, strict=True))
    ]
    return pd.concat(parts, ignore_index=True).sample(frac=1.0, random_state=seed)


def both(folder, table, **options):
    """Fits of all, and in memory."""
    folder.mkdir(exist_ok=True)
    table.to_csv(folder / "all.csv", index=False)
    streamed = ifrfit.fit(folder_of(folder / "all", table), method="lsq", **options)
    return streamed, ifrfit.fit(folder / "all.csv", method="lsq", **options)


@pytest.mark.parametrize("noise", ["known", "unknown"])
@pytest.mark.parametrize("mu", [(0.15, 0.15), (0.15, 0.155), (0.08, 0.4)])
def test_whether_series_share_their_constants(tmp_path, monkeypatch, noise, mu):
    monkeypatch.setattr(sample, "SAMPLE", 50)  # which alone would tell hardly anything
    streamed, held = both(tmp_path, two_series(600, mu), noise=noise)
    # without what single rows tell in memory, of slips that explain as much
    ours, theirs = streamed.facts["pooling"], pooling(*held.problem_and_optimum()).fact
    assert ours.ok == theirs.ok == (mu[0] == mu[1])
    assert ours.says == theirs.says
    assert ours.figures["separate"] == theirs.figures["separate"]
    for name, p in theirs.figures["p"].items():
        assert ours.figures["p"][name] == pytest.approx(p, rel=1e-6, abs=1e-100)


def test_whether_series_share_their_noise(tmp_path):
    table = two_series(1500, (0.15, 0.15), sigma=(0.02, 0.023))
    streamed, held = both(tmp_path, table, noise="unknown")
    ours, theirs = streamed.facts["unequal_noise"], held.facts["unequal_noise"]
    assert not theirs.ok
    assert ours.says == theirs.says
    assert ours.figures["p"] == pytest.approx(theirs.figures["p"], rel=1e-6)
    equal = ifrfit.fit(
        folder_of(tmp_path / "equal", two_series(1500, (0.15, 0.15))), method="lsq", noise="unknown"
    )
    assert "unequal_noise" not in equal.facts


def test_a_slip_of_one_series_is_told_by_the_sample(tmp_path):
    table = two_series(500, (0.15, 0.15), spin=0.0)
    turned = table["series"] == "s1"
    table.loc[turned, "gamma_deg"] = 90.0 - table.loc[turned, "gamma_deg"]
    streamed, held = both(tmp_path, table)
    ours = streamed.facts
    assert not held.facts["slips"].ok
    assert ours["slips"].says.startswith("in a sample of ")
    assert "pooling" not in ours or ours["pooling"].says.startswith("in a sample of ")


def test_the_posterior_of_all_predicts_the_sample(tmp_path):
    table = impacts(2000)
    folder = folder_of(tmp_path / "all", table)
    checked = ifrfit.fit(folder).facts["predictive"]
    assert checked.ok
    assert checked.says.startswith("in a sample of 4,000 values: the posterior predicts data like these")
    table["beta"] += 0.1 * np.sin(table["gamma_deg"] / 5.0)  # which no constants explain
    bent = ifrfit.fit(folder_of(tmp_path / "bent", table), scene="none.toml")
    assert not bent.facts["predictive"].ok
    assert any(said.startswith("--scene none.toml: not looked at") for said in bent.warnings)
    assert "predictive" not in ifrfit.fit(folder, method="lsq").facts


@pytest.mark.parametrize("too_small", ["all", "beta"])
def test_a_sigma_that_is_too_small_makes_no_series_differ(tmp_path, too_small):
    """Of 60 pairs of equal series, with a sigma of half the scatter, 16 differed by the sigma as given."""
    table = two_series(600, (0.15, 0.15), seed=208)
    for name in ("beta", "e_n") if too_small == "all" else ("beta",):
        table[f"sigma_{name}"] /= 2.0
    streamed, held = both(tmp_path, table)
    ours, theirs = streamed.facts["pooling"], held.facts["pooling"]
    assert theirs.ok
    assert ours.ok
    if too_small == "all":  # else memory weighs no value by a sigma, and sums do
        for name, p in theirs.figures["p"].items():
            assert ours.figures["p"][name] == pytest.approx(p, rel=1e-3)


def test_series_that_differ_do_so_beside_a_sigma_that_is_too_small(tmp_path):
    table = two_series(600, (0.15, 0.17))
    for name in ("beta", "e_n"):
        table[f"sigma_{name}"] /= 2.0
    streamed, held = both(tmp_path, table)
    assert not streamed.facts["pooling"].ok
    assert not held.facts["pooling"].ok
