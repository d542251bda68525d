"""A bootstrap of cases from sums of random groups of impacts, against that of a table in memory."""

from __future__ import annotations

import math

import numpy as np
import pytest
from refusals import refused
from streams import folder_of, impacts

import ifrfit
from ifrfit.data.stream import portions
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.sufficient_statistics import grouped_cases, passes
from ifrfit.inference.sufficient_statistics.grouped_cases import GROUPS

pytest.importorskip("numba")

REPLICATES = 400
# of the ratio of two sds: each from so many replicates, one of them from groups beside
ERROR = math.sqrt(2.0 / (2.0 * REPLICATES) + 1.0 / (2.0 * GROUPS))


def scatter(table, seed, kind):
    """Errors as given, twice as large, or growing with the angle, beside a sigma that says nothing of it."""
    rng = np.random.default_rng(seed)
    for name in ("beta", "e_n"):
        error = {"as given": 0.0, "twice": math.sqrt(3.0), "uneven": 4.0 * (table["gamma_deg"] / 90.0) ** 2}
        table[name] += table[f"sigma_{name}"] * error[kind] * rng.standard_normal(len(table))
    return table


@pytest.mark.parametrize("kind", ["as given", "twice", "uneven"])
def test_sds_are_those_of_a_bootstrap_of_impacts(tmp_path, kind):
    """Over random scenes: the mean of the ratios of sds is 1 within four of its errors, and so is each."""
    rng = np.random.default_rng(17)
    ratios, of_sigma = [], []
    for seed in range(2):
        truth = {"e_n": rng.uniform(0.6, 0.95), "e_t": rng.uniform(-0.9, -0.5), "mu": rng.uniform(0.05, 0.3)}
        table = scatter(impacts(int(rng.integers(1000, 2000)), seed, sigma=0.02, **truth), seed, kind)
        here = tmp_path / str(seed)
        here.mkdir()
        table.to_csv(here / "all.csv", index=False)
        method = ifrfit.Bootstrap(replicates=REPLICATES)
        streamed = ifrfit.fit(folder_of(here / "all", table, 2, "parquet"), method=method, seed=seed)
        held = ifrfit.fit(here / "all.csv", method=method, seed=seed)
        plain = ifrfit.fit(here / "all.csv", method="lsq")
        for name in ("e_n", "e_t", "mu"):
            ours, theirs = streamed.constants[name], held.constants[name]
            assert ours.value == pytest.approx(theirs.value, abs=5.0 * theirs.stderr / math.sqrt(REPLICATES))
            ratios.append(ours.stderr / theirs.stderr)
            of_sigma.append(ours.stderr / plain.constants[name].stderr)
    assert np.abs(np.log(ratios)).max() < 4.0 * ERROR
    assert abs(np.log(ratios).mean()) < 4.0 * ERROR / math.sqrt(len(ratios))
    # the point of a bootstrap: sigma is not believed
    assert (np.mean(of_sigma) > 1.5) == (kind != "as given")


def test_unknown_noise_and_series(tmp_path):
    table = impacts(1200, 3, columns=("v_x", "v_n"), series=2)
    table.to_csv(tmp_path / "all.csv", index=False)
    asked = {"method": ifrfit.Bootstrap(replicates=REPLICATES), "noise": "unknown"}
    folder = folder_of(tmp_path / "all", table)
    streamed = ifrfit.fit(folder, separate=("e_n", "e_t", "mu"), **asked)
    held = ifrfit.fit(tmp_path / "all.csv", separate=("e_n", "e_t", "mu"), **asked)
    ours, theirs = streamed.flat_constants(), held.flat_constants()
    assert list(ours) == list(theirs)
    for name, estimate in theirs.items():
        assert abs(math.log(ours[name].stderr / estimate.stderr)) < 4.0 * ERROR
    for group, sigma in held.noise.sigma.items():
        assert streamed.noise.sigma[group] == pytest.approx(sigma, rel=0.01)  # means of draws
    with refused(DataError, match="constants that some series share and others not"):
        ifrfit.fit(folder, separate=("mu",), **asked)


def test_the_answer_is_that_of_any_parting_and_any_workers(tmp_path, monkeypatch):
    folder = folder_of(tmp_path / "all", impacts(2400), 3, "parquet")
    once = ifrfit.fit(folder, method=ifrfit.Bootstrap(replicates=100))
    monkeypatch.setattr(portions, "FIRST_ROWS", 800)
    monkeypatch.setattr(portions, "ROWS", 900)
    parted = ifrfit.fit(folder, method=ifrfit.Bootstrap(replicates=100))
    shared = ifrfit.fit(folder, method=ifrfit.Bootstrap(replicates=100, workers=2))
    for other in (parted, shared):
        for name in ("e_n", "e_t", "mu"):
            assert other.constants[name].value == once.constants[name].value
            assert other.constants[name].interval95 == once.constants[name].interval95
    assert any(said.startswith("Drawn were 1,024 random groups of impacts") for said in once.warnings)


def test_what_is_not_drawn_is_refused(tmp_path, monkeypatch):
    folder = folder_of(tmp_path / "all", impacts(1000), 2, "parquet")
    with refused(UsageError, match="--resample wild: data that are not held in memory are drawn by cases"):
        ifrfit.fit(folder, method=ifrfit.Bootstrap(scheme="wild"))
    monkeypatch.setattr(grouped_cases, "_MOST_ROWS", 100)
    with refused(DataError, match="leave open where sliding ends"):
        ifrfit.fit(folder, method="bootstrap")
    monkeypatch.undo()
    with monkeypatch.context() as elsewhere:
        elsewhere.setattr(grouped_cases, "_hull", lambda *given: (np.array([0]), np.array([5])))
        with refused(DataError, match="lies where impacts were not kept one by one"):
            ifrfit.fit(folder, method="bootstrap")
    with refused(DataError, match="too few to draw from"):
        ifrfit.fit(folder_of(tmp_path / "few", impacts(4), 2, "parquet"), method="bootstrap")


def test_an_interrupted_bootstrap_goes_on_in_its_second_pass(tmp_path, monkeypatch):
    for name, rows in (("FIRST_ROWS", 700), ("ROWS", 700)):
        monkeypatch.setattr(portions, name, rows)
    folder = folder_of(tmp_path / "all", impacts(4200, series=2), 3, "parquet")
    alone = ifrfit.fit(folder, method=ifrfit.Bootstrap(replicates=100))
    asked = {"method": ifrfit.Bootstrap(replicates=100, resume=tmp_path / "out")}
    seen = []

    def interrupting(done, most):
        seen.append(done)
        if seen.count(most) and done < most and done > 2000:  # in the second pass
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ifrfit.fit(folder, progress=interrupting, **asked)
    read = {module: [] for module in (passes, grouped_cases)}
    for module, wanted in read.items():
        sums = module._sums
        monkeypatch.setattr(
            module,
            "_sums",
            lambda nothing, tell, some, f=sums, w=wanted: w.extend(some) or f(nothing, tell, some),
        )
    found = ifrfit.fit(folder, **asked)
    assert found.flat_constants() == alone.flat_constants()
    assert found.fit == alone.fit
    most = len(portions.portions_of(sorted(folder.iterdir())))
    assert len(read[passes]) == 1  # of the first stage nothing is kept
    assert 0 < len(read[grouped_cases]) < most - 2
    assert not (tmp_path / "out.unfinished").exists()
    with refused(UsageError, match="--resume: these data are held in memory"):
        impacts(50).to_csv(tmp_path / "few.csv", index=False)
        ifrfit.fit(tmp_path / "few.csv", method=ifrfit.Bootstrap(resume=tmp_path / "out"))
