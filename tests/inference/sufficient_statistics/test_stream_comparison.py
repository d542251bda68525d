"""Closures side by side on the sums of impacts that are not held in memory."""

from __future__ import annotations

import pytest
from matplotlib.text import Text
from streams import folder_of, impacts

import ifrfit
from ifrfit.data.stream import portions
from ifrfit.errors import UsageError
from ifrfit.inference.profile import least_squares_estimates
from ifrfit.inference.sufficient_statistics import passes, transition_window
from ifrfit.inference.sufficient_statistics.passes import Reader
from ifrfit.physics.closures import CLOSURES

pytest.importorskip("numba")

BILINEAR = tuple(closure.name for closure in CLOSURES.values() if closure.bilinear)
TOLERANCE = 1e-4  # of a log evidence: the quadrature's own is 1e-6 of a standard deviation, on other nodes


@pytest.mark.parametrize(
    ("options", "table"),
    [
        ({"noise": "known"}, {"columns": ("beta", "e_n")}),
        ({"noise": "unknown"}, {"columns": ("v_x", "v_n")}),
        ({"noise": "known", "fix": {"e_n": 0.9}}, {"columns": ("beta",), "sigma": 0.5}),
    ],
    ids=str,
)
def test_a_comparison_is_that_of_all_rows(tmp_path, options, table):
    rows = impacts(700, 3, **table)
    rows.to_csv(tmp_path / "all.csv", index=False)
    held = ifrfit.compare(tmp_path / "all.csv", BILINEAR, loo=False, **options)
    streamed = ifrfit.compare(folder_of(tmp_path / "all", rows), loo=False, **options)
    assert streamed.ranked == held.ranked
    for name, theirs in held.entries.items():
        ours = streamed.entries[name]
        assert ours.fit.problem is None
        assert ours.free == theirs.free
        for criterion in ("aic", "bic", "chi2", "log_likelihood"):
            value = getattr(theirs.fit.fit, criterion)
            assert getattr(ours.fit.fit, criterion) == pytest.approx(value, rel=1e-9)
        assert ours.log_evidence == pytest.approx(theirs.log_evidence, abs=TOLERANCE)
        assert ours.log_bayes_factor == pytest.approx(theirs.log_bayes_factor, abs=2.0 * TOLERANCE)
        assert ours.prior == theirs.prior
    assert [row.varied for row in streamed.priors] == [row.varied for row in held.priors]
    for ours, theirs in zip(streamed.priors, held.priors, strict=True):
        for name, value in theirs.log_evidence.items():
            if value is None:
                assert ours.log_evidence[name] is None
            else:
                assert ours.log_evidence[name] == pytest.approx(value, abs=10.0 * TOLERANCE)
    assert (streamed.verdict.kind, streamed.verdict.tied) == (held.verdict.kind, held.verdict.tied)
    notes = " ".join(streamed.notes)
    assert "MAW is not compared" in streamed.verdict.says  # which the order of those compared hangs on
    assert "Cross-validation and the psi plane take the rows one by one" in notes


def test_one_pass_for_all_closures(tmp_path, monkeypatch):
    passes = []
    for name in ("accumulate", "fetch"):
        own = getattr(Reader, name)

        def counted(*given, name=name, own=own):
            passes.append(name)
            return own(*given)

        monkeypatch.setattr(Reader, name, counted)
    folder = folder_of(tmp_path / "all", impacts(2500), 2, "parquet")
    found = ifrfit.compare(folder, ("ifr", "fr", "f"))
    assert passes == ["accumulate"]
    assert found.ranked[0] == "ifr"
    assert found.entries["f"].fit.fit.n == 5000
    assert found.best.is_sampled
    texts = [text.get_text() for text in found.plot().findobj(Text)]
    assert "points: a random sample of 4,000 of 5,000 rows" in texts


def test_what_a_comparison_cannot_have(tmp_path):
    folder = folder_of(tmp_path / "all", impacts(300), 2, "parquet")
    with pytest.raises(UsageError, match="needs the rows one by one"):
        ifrfit.compare(folder, ("ifr", "maw"))
    with pytest.raises(UsageError, match="in memory"):
        ifrfit.compare(folder, exclude=("drop 3",))
    with pytest.raises(UsageError, match="known or unknown"):
        ifrfit.compare(folder, noise="scaled")


def test_processes_that_read_change_nothing_and_are_refused_in_memory(tmp_path, monkeypatch):
    monkeypatch.setattr(portions, "FIRST_ROWS", 500)
    monkeypatch.setattr(portions, "ROWS", 500)
    rows = impacts(2000, 3)
    folder = folder_of(tmp_path / "all", rows, 4, "parquet")
    told = []
    alone = ifrfit.compare(folder, loo=False, progress=lambda done, most: told.append((done, most)))
    shared = ifrfit.compare(folder, loo=False, workers=2)
    assert told[-1] == (2000, 2000)
    for name, entry in alone.entries.items():
        assert shared.entries[name].log_evidence == entry.log_evidence
        assert shared.entries[name].fit.fit == entry.fit.fit
    rows.to_csv(tmp_path / "all.csv", index=False)
    with pytest.raises(UsageError, match="held in memory") as error:
        ifrfit.compare(tmp_path / "all.csv", loo=False, workers=2)
    assert str(error.value).startswith("workers")
    with pytest.raises(UsageError, match="held in memory"):
        ifrfit.compare(tmp_path / "all.csv", loo=False, scheduler="tcp://localhost:1")


def test_a_refuted_closure_leaves_few_impacts_to_be_held(tmp_path, monkeypatch):
    # without a transition that binds sliding to sticking, F leaves open where it lies: half of all impacts
    monkeypatch.setattr(transition_window, "MOST_ROWS", 20_000)
    monkeypatch.setattr(passes, "_MOST_KEPT", 5_000)
    path = tmp_path / "all"
    found = ifrfit.compare(folder_of(path, impacts(60_000, sigma=0.01, spin=0.0), 3, "parquet"), loo=False)
    assert found.ranked[0] == "ifr"
    assert "f" in found.entries


def test_optima_near_one_another_need_no_profile_beside_a_posterior(monkeypatch):
    asked = []
    profiled = least_squares_estimates._profiled
    monkeypatch.setattr(
        least_squares_estimates, "_profiled", lambda *each: asked.append(1) or profiled(*each)
    )
    table = impacts(300, sigma=0.03, spin=0.0)
    fit = ifrfit.fit(table, closure="f", method="lsq")
    assert fit.constants.mu.status == "determined"
    assert asked  # F does not describe these: its kinks leave optima beside one another
    asked.clear()
    exact = ifrfit.fit(table, closure="f")
    assert exact.constants.mu.status == "determined"
    assert not asked
    assert exact.constants.mu.value == pytest.approx(fit.constants.mu.value, abs=0.002)
