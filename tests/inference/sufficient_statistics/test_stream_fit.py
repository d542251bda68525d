"""Impacts that are not held in memory are fitted as those that are."""

from __future__ import annotations

import math

import numpy as np
import pytest
from factories import each_once
from matplotlib.text import Text
from streams import folder_of, impacts

import ifrfit
from ifrfit.data.stream import files as stream_files_module
from ifrfit.data.stream import sample as sample_module
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.result.restore import question
from ifrfit.inference.result.types import Estimate
from ifrfit.inference.sufficient_statistics import stream_fit as stream_fit_module
from ifrfit.inference.sufficient_statistics.shown_points import MOST_SHOWN

pytest.importorskip("numba")


def both(tmp_path, table, suffix="parquet", **options):
    """The fit of a folder, and that of one file in memory."""
    name = "all.csv" if suffix.startswith("csv") else "all.parquet"
    if name.endswith("csv"):
        table.to_csv(tmp_path / name, index=False)
    else:
        table.to_parquet(tmp_path / name)
    streamed = ifrfit.fit(folder_of(tmp_path / "all", table, suffix=suffix), **options)
    return streamed, ifrfit.fit(tmp_path / name, **options)


def assert_same(streamed, held, rtol=1e-9):
    """To the last digits, as far as these rest on sums of many numbers."""
    for name, estimate in held.flat_constants().items():
        own = streamed.flat_constants()[name]
        assert own.status == estimate.status, name
        if estimate.value is not None:
            assert own.value == pytest.approx(estimate.value, rel=1e-12), name
        if estimate.stderr:
            assert own.stderr == pytest.approx(estimate.stderr, rel=rtol), name
        np.testing.assert_allclose(own.interval95, estimate.interval95, rtol=1e-10)
    ours, theirs = (found.derived["transition_angle_deg"] for found in (streamed, held))
    for name in theirs:  # at the median spin of each series
        assert_same_angle(ours[name], theirs[name], rtol)
    for name in ("n", "n_sliding", "n_sticking", "dof", "rank"):
        assert getattr(streamed.fit, name) == getattr(held.fit, name), name
    for name in ("chi2", "p_value", "log_likelihood", "aic", "bic", "log_evidence"):
        theirs = getattr(held.fit, name)
        if theirs is not None and math.isfinite(theirs):
            assert getattr(streamed.fit, name) == pytest.approx(theirs, rel=1e-9), name
    assert streamed.facts["global_optimum"].ok == held.facts["global_optimum"].ok
    assert dict(streamed.noise.sigma) == pytest.approx(dict(held.noise.sigma), rel=1e-9)


def assert_same_angle(ours, theirs, rtol):
    """Both of one branch, or none of any."""
    assert type(ours) is type(theirs)
    if isinstance(theirs, Estimate):
        assert ours.value == pytest.approx(theirs.value, rel=rtol)
        np.testing.assert_allclose(ours.interval95, theirs.interval95, rtol=rtol)


@pytest.mark.parametrize(("noise", "method"), each_once(["known", "unknown"], ["lsq", "exact"]))
def test_the_same_as_in_memory(tmp_path, method, noise):
    streamed, held = both(tmp_path, impacts(2500), method=method, noise=noise)
    assert_same(streamed, held)
    if method == "exact":
        assert streamed.distribution.log_evidence == pytest.approx(held.distribution.log_evidence, rel=1e-9)
        assert streamed.distribution.log_evidence == pytest.approx(streamed.fit.log_evidence, rel=1e-12)


@pytest.mark.parametrize(
    ("options", "table"),
    [
        ({"closure": "fr"}, {}),
        ({"closure": "f"}, {}),
        ({"fix": {"e_n": 0.9}}, {"columns": ("beta",)}),
        ({"prior": {"e_n": (0.9, 0.01)}}, {"columns": ("beta",)}),
        ({"bounds": {"mu": (0.1, 0.14)}}, {"n": 600}),  # which refute it: facts look for slips
        ({"inertia_factor": 2.0 / 3.0}, {"inertia_factor": 2.0 / 3.0}),
        ({"gamma_min": 10.0, "gamma_max": 70.0}, {}),
        ({}, {"columns": ("v_x", "v_n")}),
        ({}, {"columns": ("spin_y_after", "v_x", "v_n")}),
        ({}, {"columns": ("beta_cm", "e_n")}),
        ({"observable": "beta", "fix": {"e_n": 0.9}}, {}),
        ({"separate": ("mu",)}, {"series": 2}),
        ({"separate": ("mu",), "noise": "unknown"}, {"series": 2}),
        ({"noise": "unknown"}, {"series": 3}),
    ],
    ids=str,
)
def test_every_question_that_is_taken(tmp_path, options, table):
    assert_same(*both(tmp_path, impacts(**{"n": 2200, "seed": 3, **table}), method="lsq", **options))


@pytest.mark.parametrize("suffix", ["csv", "csv.gz"])
def test_text_files(tmp_path, suffix):
    table = impacts(3000).round(6)
    table.loc[5, "beta"] = np.nan
    assert_same(*both(tmp_path, table, suffix=suffix, method="lsq"))


def test_rows_that_cannot_be_are_counted_and_named(tmp_path):
    table = impacts(3000)
    table.loc[10, "gamma_deg"] = 95.0
    table.loc[[20, 21], "sigma_beta"] = -1.0
    table.loc[30, "e_n"] = 12.0
    table.loc[40, "beta"] = np.nan
    fit = ifrfit.fit(folder_of(tmp_path / "all", table, 2, "parquet"), method="lsq")
    (source,) = fit.inputs
    assert dict(source.rows_skipped) == {
        "not measured": 1,
        "angle outside 0 to 90 degrees": 2,
        "sigma of beta": 2,
        "e_n impossible": 1,
    }
    assert source.rows == 6000
    assert source.rows_used == fit.fit.n == 5994
    said = " ".join(fit.warnings)
    assert "0.parquet, row 11" in said
    assert "row 21" in said
    assert "sample" in said


def test_a_closure_that_the_means_refute(tmp_path):
    """Impacts of FR, of which single values are far too uncertain to tell it from F."""
    table = impacts(200_000, columns=("beta",), spin=0.0, sigma=0.3, e_t=-0.75)
    folder = folder_of(tmp_path / "all", table, 2, "parquet")
    good = ifrfit.fit(folder, method="lsq", fix={"e_n": 0.9})
    assert good.facts["lack_of_fit"].ok
    bad = ifrfit.fit(folder, method="lsq", closure="f", fix={"e_n": 0.9})
    assert not bad.facts["lack_of_fit"].ok
    assert bad.facts["lack_of_fit"].figures["departure_over_noise"] > 0.1


def test_more_intervals_change_nothing(tmp_path, monkeypatch):
    table = impacts(4000)
    folder = folder_of(tmp_path / "all", table, 2, "parquet")
    few = ifrfit.fit(folder, method="lsq")
    monkeypatch.setattr(stream_fit_module, "_MANY", (1000, 3000))
    assert_same(ifrfit.fit(folder, method="lsq"), few)


def test_a_slip_is_found_in_the_sample(tmp_path):
    table = impacts(4000, spin=0.0)
    table["gamma_deg"] = 90.0 - table["gamma_deg"]
    fit = ifrfit.fit(folder_of(tmp_path / "all", table, 2, "parquet"), method="lsq")
    slip = fit.facts["slips"]
    assert not slip.ok
    assert slip.says.startswith("in a sample of ")


def test_a_result_of_few_impacts_keeps_them(tmp_path):
    table = impacts(1500)
    fit = ifrfit.fit(folder_of(tmp_path / "all", table, 2, "parquet"))
    assert not fit.is_sampled
    assert len(fit.points) == fit.fit.n
    table.to_csv(tmp_path / "all.csv", index=False)
    held = ifrfit.fit(tmp_path / "all.csv", method="lsq")
    for name in ("value", "fitted", "residual", "sigma_used", "standardised"):
        np.testing.assert_allclose(np.sort(fit.points[name]), np.sort(held.points[name]), atol=1e-9)
    assert np.bincount(fit.points["sticking"]).tolist() == np.bincount(held.points["sticking"]).tolist()


@pytest.mark.parametrize("noise", ["known", "unknown"])
def test_a_result_of_many_keeps_a_sample(tmp_path, noise):
    table = impacts(9000)
    folder = folder_of(tmp_path / "all", table, 2, "parquet")
    fit = ifrfit.fit(folder, noise=noise)
    assert fit.is_sampled
    assert len(fit.points) == MOST_SHOWN < fit.fit.n
    points = fit.points[fit.points["observable"] == "beta"]
    predicted = [fit.predict([g], x, y)["value"].item() for g, x, y in _angle_and_spin(points.head(5))]
    np.testing.assert_allclose(points["fitted"].head(5), predicted, rtol=1e-2, atol=1e-2)
    # of clean data, by their own noise
    assert abs(fit.points["standardised"].std() - 1.0) < 4.0 / math.sqrt(2.0 * MOST_SHOWN)
    fit.save(tmp_path / "result.json")
    again = ifrfit.load_result(tmp_path / "result.json")
    assert again.is_sampled
    with pytest.raises(UsageError, match=r"a sample of 4,000 of .* cannot stand for all"):
        question(again)


@pytest.mark.parametrize("size", [20_000, 1000])
def test_scatter_larger_than_its_sigma_is_no_fit(tmp_path, monkeypatch, size):
    monkeypatch.setattr(sample_module, "SAMPLE", size)
    table = impacts(3000)
    table["sigma_beta"] /= 2.0
    fit = ifrfit.fit(folder_of(tmp_path / "all", table, 2, "parquet"))
    assert fit.fit.p_value < 1e-6
    assert not fit.facts["lack_of_fit"].ok
    assert fit.facts["lack_of_fit"].says.startswith("in a sample of ") == (size < len(table))


def test_the_sample_is_fitted_when_something_of_it_is_asked_for(tmp_path, monkeypatch):
    fitted = []
    sample = stream_fit_module._sample

    def told(*given):
        fitted.append(True)
        return sample(*given)

    monkeypatch.setattr(stream_fit_module, "_sample", told)
    table = impacts(3000, 3, spin=0.0).drop(columns="spin_y")
    found = ifrfit.fit(folder_of(tmp_path / "all", table), method="lsq")
    assert found.constants.mu.stderr > 0.0
    assert not fitted
    assert 0 < len(found.points) < found.fit.n
    assert f"the result keeps {len(found.points):,} of them" in found.warnings[-1]
    assert found.facts["lack_of_fit"].ok
    assert fitted == [True]


def test_what_is_assumed_is_as_in_memory(tmp_path):
    streamed, held = both(tmp_path, impacts(1500))
    assert len(streamed.assumed) == len(held.assumed) > 3
    for ours, theirs in zip(streamed.assumed, held.assumed, strict=True):
        assert ours.split(" (")[0] == theirs.split(" (")[0]


def _angle_and_spin(points):
    return points[["gamma_deg", "spin_x", "spin_y"]].itertuples(index=False)


def test_figure_and_report_of_a_sample_say_so(tmp_path):
    fit = ifrfit.fit(folder_of(tmp_path / "all", impacts(9000), 2, "parquet"))
    texts = [text.get_text() for text in fit.plot().findobj(Text)]
    said = f"a random sample of 4,000 of {fit.fit.n:,} rows"
    assert f"points: {said}" in texts
    fit.report(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert said in page
    assert "line 0" not in page
    assert "The same fit from the data inside this report" not in page


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"method": "mcmc"}, "exact, lsq, profile or bootstrap"),
        ({"noise": "scaled"}, "known or unknown"),
        ({"noise": ifrfit.Noise("known", tails="student-t")}, "in memory"),
        ({"exclude": ("drop 3",)}, "in memory"),
        ({"closure": "maw"}, "rows one by one"),
        ({"observable": "v_n"}, "no column of v_n"),
    ],
)
def test_what_needs_the_rows_is_refused(tmp_path, options, said):
    folder = folder_of(tmp_path / "all", impacts(500), 2, "parquet")
    with pytest.raises(UsageError, match=said):
        ifrfit.fit(folder, **options)


def test_files_that_cannot_be_read(tmp_path):
    folder = folder_of(tmp_path / "all", impacts(500), 2, "parquet")
    (folder / "2.parquet").write_bytes(b"PAR1 and no more")
    with pytest.raises(DataError, match=r"2\.parquet: cannot be read"):
        ifrfit.fit(folder)
    (folder / "2.parquet").unlink()
    (folder / "3.csv").write_text("gamma_deg,beta,e_n\n10,0.1,x\n", encoding="utf-8")
    with pytest.raises(DataError, match=r"3\.csv"):
        ifrfit.fit(folder)
    (tmp_path / "empty").mkdir()
    with pytest.raises(DataError, match="no Parquet or CSV"):
        ifrfit.fit(tmp_path / "empty")


def test_a_large_file_is_streamed_unasked(tmp_path, monkeypatch):
    impacts(3000).to_parquet(tmp_path / "all.parquet")
    held = ifrfit.fit(tmp_path / "all.parquet", method="lsq")
    assert held.problem is not None
    monkeypatch.setattr(stream_files_module, "LARGE_ROWS", 1000)
    streamed = ifrfit.fit(tmp_path / "all.parquet", method="lsq")
    assert streamed.problem is None
    assert_same(streamed, held)
    # what cannot be streamed is held in memory, if it is a file
    tails = ifrfit.Noise("known", tails="student-t")
    assert ifrfit.fit(tmp_path / "all.parquet", method="lsq", noise=tails).problem is not None


def test_the_same_file_twice_is_refused(tmp_path):
    folder = folder_of(tmp_path / "all", impacts(500), 2, "parquet")
    (folder / "copy.parquet").write_bytes((folder / "0.parquet").read_bytes())
    with pytest.raises(DataError, match="counted twice"):
        ifrfit.fit(folder)


def test_a_sample_that_is_refused_is_told(tmp_path, monkeypatch):
    folder = folder_of(tmp_path / "all", impacts(500), 2, "parquet")

    def refused(*given):
        raise DataError("a row is odd")

    monkeypatch.setattr(stream_fit_module, "observe", refused)
    fit = ifrfit.fit(folder, method="lsq")
    assert any("no fact on single rows was looked for" in said for said in fit.warnings)
    assert "slips" not in fit.facts
    assert fit.facts["global_optimum"].ok


def test_files_without_rows_and_hidden_ones_change_nothing(tmp_path):
    table = impacts(1000)
    folder = folder_of(tmp_path / "all", table, 2, "parquet")
    alone = ifrfit.fit(folder, method="lsq")
    for name in ("a.parquet", "zz.parquet"):  # of the same bytes, but nothing is counted twice
        table.iloc[:0].to_parquet(folder / name)
    (folder / "_unfinished").mkdir()
    (table * 0.5).to_parquet(folder / "_unfinished" / "0.parquet")
    table.iloc[::2].to_parquet(folder / "1.parquet.new")
    with_them = ifrfit.fit(folder, method="lsq")
    assert with_them.fit.n == alone.fit.n
    assert with_them.constants["mu"].value == alone.constants["mu"].value
    (folder / "empty.csv").write_text("", encoding="utf-8")
    with pytest.raises(DataError, match=r"empty\.csv: the file is empty"):
        ifrfit.fit(folder)


def test_no_row_that_is_whole(tmp_path):
    table = impacts(1000).assign(sigma_beta=0.0)
    fit = ifrfit.fit(folder_of(tmp_path / "all", table, 2, "parquet"), method="lsq")
    assert fit.fit.n == 1000
    assert not fit.facts["identifiable"].ok
    assert any("no row is whole" in said for said in fit.warnings)


def test_numbers_of_rows_that_pandas_leaves(tmp_path):
    table = impacts(1000)
    some = folder_of(tmp_path / "some", table[table["gamma_deg"] < 80.0], 2, "parquet")
    assert ifrfit.fit(some, method="lsq").fit.n == 2 * (table["gamma_deg"] < 80.0).sum()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t: t.drop(columns="sigma_beta"), "there is no column sigma_beta, which other files have"),
        (lambda t: t.drop(columns="spin_y"), "there is no column spin_y, which other files have"),
        (lambda t: t.assign(beta_cm=0.1), "there is a column beta_cm, which other files do not have"),
        (lambda t: t.drop(columns="e_n"), "there is no column e_n, which other files have"),
    ],
    ids=("sigma", "spin", "another observable", "an observable"),
)
def test_files_of_other_columns_are_refused(tmp_path, change, said):
    table = impacts(2000)
    folder = folder_of(tmp_path / "all", table, 2, "parquet")
    change(table).to_parquet(folder / "2.parquet")
    with pytest.raises(DataError, match=rf"2\.parquet: {said}"):
        ifrfit.fit(folder, method="lsq")


def test_a_prior_of_another_law(tmp_path):
    table = impacts(1500, columns=("beta",))
    law = {"mu": ifrfit.LogNormal(0.15, 0.02)}
    streamed, held = both(tmp_path, table, fix={"e_n": 0.9}, prior=law)
    assert streamed.constants.mu.value == pytest.approx(
        held.constants.mu.value, abs=0.1 * held.constants.mu.stderr
    )
    assert streamed.asked[2].shape == law["mu"]
