"""Rows of a stream are named by the file and row in which they stand, and so can be left out."""

from __future__ import annotations

import gzip
import re

import pandas as pd
import pytest
from streams import impacts

import ifrfit
from ifrfit.data.stream import portions, sample
from ifrfit.errors import UsageError
from ifrfit.inference.estimators import LeastSquares

pytest.importorskip("numba")

ODD = {"a": 17, "b": 250, "in/c": 90}  # a row of each file whose beta is far off


KINDS = ("csv", "csv.gz", "parquet", "whole parquet")


@pytest.fixture(params=KINDS)
def folder(tmp_path, monkeypatch, request):
    """Three files, in several portions each where they can be, with an outlier in each."""
    monkeypatch.setattr(portions, "_TEXT_BYTES", 6000)
    monkeypatch.setattr(portions, "FIRST_ROWS", 150)
    monkeypatch.setattr(portions, "ROWS", 200)
    path = tmp_path / "log"
    (path / "in").mkdir(parents=True)
    for seed, (name, row) in enumerate(ODD.items()):
        table = impacts(400, seed, spin=0.0)
        table.loc[row, "beta"] += 1.0
        suffix = request.param.removeprefix("whole ")
        file = path / f"{name}.{suffix}"
        if suffix == "parquet":
            table.to_parquet(file, row_group_size=400 if "whole" in request.param else 130)
        elif suffix == "csv":
            table.to_csv(file, index=False)
        else:
            with gzip.open(file, "wt", encoding="utf-8") as packed:
                table.to_csv(packed, index=False)
    return path


def first_of(name):
    """What the first row of a file is called: the header of a text is its first line."""
    return 1 if name.endswith("parquet") else 2


@pytest.mark.parametrize(
    ("folder", "workers", "size"),
    # of several processes, files that are read in portions: a whole one is a portion like any other
    [
        *((kind, 1, 500) for kind in KINDS),
        ("csv", 1, 20_000),
        ("parquet", 2, 500),
        pytest.param("csv", 2, 500, marks=pytest.mark.long),
    ],
    indirect=["folder"],
)
def test_outliers_are_named_and_the_remedy_works(folder, monkeypatch, size, workers):
    """Rows of the sample were named by their number in it, and --exclude was refused."""
    monkeypatch.setattr(sample, "SAMPLE", size)
    found = ifrfit.fit(folder, method=LeastSquares(workers=workers))
    far = found.facts.get("outliers")
    if size > 1200:
        assert not far.ok
    if far is None or far.ok:
        return
    entries = re.findall(r"--exclude (\S+)", far.says)
    for entry in entries:
        name, row = entry.split(":")
        assert int(row) - first_of(name) == ODD[name.partition(".")[0]]
        assert entry.split(":")[0] in far.says.split("--exclude")[0]
    again = ifrfit.fit(folder, method="lsq", exclude=entries)
    assert again.fit.n == found.fit.n - 2 * len(entries)
    assert again.inputs[0].rows_skipped == {"excluded": 2 * len(entries)}


def test_rows_left_out_are_as_if_not_there(folder):
    suffix = next(folder.glob("a.*")).name.partition(".")[2]
    entries = [f"{name}.{suffix}:{row + first_of(suffix)}" for name, row in ODD.items()]
    found = ifrfit.fit(folder, method="lsq", exclude=entries)
    rest = [impacts(400, seed, spin=0.0).drop(index=row) for seed, row in enumerate(ODD.values())]
    held = ifrfit.fit(pd.concat(rest), method="lsq")
    assert found.fit.n == held.fit.n
    assert found.fit.chi2 == pytest.approx(held.fit.chi2, rel=1e-9)
    for name, one in found.constants.items():
        assert one.value == pytest.approx(held.constants[name].value, rel=1e-9)


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ("9", r"could be of a\..* and b\..* and others. Write a\..*:9"),
        ("drop 3", r"rows are named by file and row, as a\."),
        ("zz.csv:3", r"rows are named by file and row, as a\."),
        ("SELF:100000", "there is no such row"),
        ("SELF:0", "the first row is [12]"),
    ],
)
def test_what_names_no_row_is_refused(folder, entry, said):
    entry = entry.replace("SELF", next(folder.glob("a.*")).name)
    with pytest.raises(UsageError, match=said):
        ifrfit.fit(folder, method="lsq", exclude=[entry])


def test_a_number_suffices_for_one_file_unless_impacts_have_numbers(tmp_path):
    table = impacts(300, 1, spin=0.0)
    (tmp_path / "log").mkdir()
    path = tmp_path / "log" / "a.parquet"
    table.to_parquet(path)
    found = ifrfit.fit(tmp_path / "log", method="lsq", exclude=[7, "9"])
    held = ifrfit.fit(table.drop(index=[6, 8]), method="lsq")
    assert found.fit.chi2 == pytest.approx(held.fit.chi2, rel=1e-9)
    table.assign(impact_id=range(300)).to_parquet(path)
    with pytest.raises(UsageError, match=r"could be a row or the impact called 7. Write a\.parquet:7"):
        ifrfit.fit(tmp_path / "log", method="lsq", exclude=[7])
