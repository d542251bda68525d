"""chi2 of all values, where a sample of them is too small to show what it says of sigma."""

from __future__ import annotations

import pytest
from streams import folder_of, impacts

import ifrfit
from ifrfit.data.stream import sample
from ifrfit.text import times_text

pytest.importorskip("numba")


def streamed(folder, times, names=("beta", "e_n"), **options):
    """A fit of 6,000 impacts, of which 300 are looked at, with some sigmas wrong by a factor."""
    table = impacts(6000, 4)
    table[[f"sigma_{name}" for name in names]] *= times
    return table, ifrfit.fit(folder_of(folder / "all", table), method="lsq", **options)


@pytest.mark.parametrize(("times", "name"), [(0.96, "scatter_too_large"), (1.05, "scatter_too_small")])
def test_a_sigma_that_is_wrong_by_little_is_told_as_in_memory(tmp_path, monkeypatch, times, name):
    monkeypatch.setattr(sample, "SAMPLE", 300)
    table, ours = streamed(tmp_path, times)
    theirs = ifrfit.fit(table, method="lsq")
    assert not theirs.facts[name].ok
    assert not ours.facts[name].ok
    for figure in ("chi2", "dof", "factor"):
        assert ours.facts[name].figures[figure] == pytest.approx(theirs.facts[name].figures[figure], rel=1e-9)
    assert "the values scatter 1.0" in ours.facts[name].says
    assert "--noise unknown takes its size" in ours.facts[name].says
    assert ours.facts["lack_of_fit"].ok


def test_a_sigma_of_one_observable(tmp_path, monkeypatch):
    monkeypatch.setattr(sample, "SAMPLE", 300)
    _, ours = streamed(tmp_path, 0.95, ["beta"])
    assert "the values of beta scatter" in ours.facts["scatter_too_large"].says


@pytest.mark.parametrize("options", [{}, {"noise": "unknown"}])
def test_a_sigma_that_is_right_or_not_used_is_not_accused(tmp_path, monkeypatch, options):
    monkeypatch.setattr(sample, "SAMPLE", 300)
    _, ours = streamed(tmp_path, 1.0 if not options else 0.93, **options)
    assert not {"scatter_too_large", "scatter_too_small"} & ours.facts.keys()


def test_how_many_times_more():
    said = {1.0203: "1.020", 1.00041: "1.00041", 1.5: "1.5", 2.345: "2.3", 120.3: "120"}
    assert {factor: times_text(factor) for factor in said} == said
