"""A batch in which nothing is odd is read on a short road, and no bit tells which road it took."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ifrfit.data.conventions import Conventions
from ifrfit.data.selection import Selection
from ifrfit.data.stream import table_batches
from ifrfit.data.stream.impact_stream import ImpactStream
from ifrfit.data.stream.plain_rows import PlainRows, ends_of
from ifrfit.errors import DataError
from ifrfit.inference.sufficient_statistics.accumulated import Accumulated
from ifrfit.inference.sufficient_statistics.tau_intervals import Intervals

pytest.importorskip("numba")
BINS = 64
ODD = {
    "gamma_deg": (-1.0, 0.0, 1e-13, 45.0, 90.0, 95.0, np.nan, np.inf, 9.9, 5.0),
    "spin_y": (0.0, 1e-70, 2e6, np.nan, np.inf, 50.0),
    "beta": (np.nan, np.inf, 1e-70, 0.0, 1e13, -3.0, 20.0, 200.0),
    "e_n": (np.nan, -0.1, 0.0, 11.0, 9.9),
    "sigma_beta": (0.0, np.nan, 1e7, 9.9),
    "sigma_e_n": (-0.1, 0.03),
}


def table_of(seed, n, odd):
    rng = np.random.default_rng(seed)
    table = pd.DataFrame(
        {
            "gamma_deg": rng.uniform(1.0, 88.0, n),
            "spin_y": 0.3 * rng.standard_normal(n),
            "beta": rng.normal(0.5, 0.3, n),
            "e_n": rng.uniform(0.5, 1.0, n),
            "sigma_beta": rng.uniform(0.01, 0.1, n),
            "sigma_e_n": np.full(n, 0.03),
            "series": rng.choice(["a", "b"], n),
        }
    )
    for row, (name, number) in odd:
        table.loc[row % n, name] = ODD[name][number % len(ODD[name])]
    return table


def found_in(path, size, monkeypatch, *, short, selection=None, weighted=True):
    """What a pass finds with batches of some rows, by the short road or without it."""
    taken = []
    with monkeypatch.context() as here:
        here.setattr(table_batches, "_BATCH", size)
        of = PlainRows.of if short else lambda *given: None
        here.setattr(PlainRows, "of", of)
        read = PlainRows.read

        def reading(self, batch):
            columns = read(self, batch)
            taken.append(columns is not None)
            return columns

        here.setattr(PlainRows, "read", reading)
        stream = ImpactStream.of(path, Conventions(), selection or Selection(), 0.4)
        part = Accumulated.nothing(stream, weighted, Intervals(BINS), np.arange(BINS) % 3 == 0)
        for portion in stream.portions:
            for batch in stream.batches(portion, part.tally, part.sample):
                part.add(batch)
    whole = part.anew()
    whole.merge(part)
    return whole, taken


def assert_same_bits(one, other):
    np.testing.assert_array_equal(one.moments.high, other.moments.high)
    assert one.tally == other.tally
    for ours, theirs in zip(one.groups, other.groups, strict=True):
        for name in vars(ours):
            mine, its = getattr(ours, name), getattr(theirs, name)
            assert getattr(mine, "high", mine) == getattr(its, "high", its), name
    ours, theirs = one.window.arrays(), other.window.arrays()
    assert ours.keys() == theirs.keys()
    for name, rows in ours.items():
        np.testing.assert_array_equal(rows, theirs[name])
    lots = [np.concatenate([[0], *(lots for lots, _ in of.sample.drawn)]) for of in (one, other)]
    np.testing.assert_array_equal(*lots)
    if len(lots[0]) > 1:
        columns = (of.sample.cells(Path("sample")).columns for of in (one, other))
        for mine, its in zip(*columns, strict=True):
            np.testing.assert_array_equal(mine, its)


ODD_CELLS = st.tuples(st.integers(0, 10_000), st.tuples(st.sampled_from(sorted(ODD)), st.integers(0, 20)))


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 10_000),
    st.integers(1, 300),
    st.lists(ODD_CELLS, max_size=6),
    st.integers(1, 300),
    st.integers(1, 300),
)
@example(0, 2, [(0, ("gamma_deg", 18))], 1, 2)  # 9.9 among larger numbers is no code
def test_both_roads_and_every_parting_give_the_same_bits(seed, n, odd, size, other):
    with pytest.MonkeyPatch.context() as monkeypatch, tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rows.parquet"
        table_of(seed, n, odd).to_parquet(path)
        found = []
        for each, short in ((size, True), (size, False), (other, True), (n, False)):
            try:
                found.append(found_in(path, each, monkeypatch, short=short)[0])
            except DataError as error:  # a number that is infinite
                found.append(str(error))
        for elsewhere in found[1:]:
            if isinstance(found[0], str):  # which of several is named depends on what is read first
                assert isinstance(elsewhere, str)
            else:
                assert_same_bits(found[0], elsewhere)
                assert elsewhere.tally.sizes == found[0].tally.sizes


@pytest.mark.parametrize("selection", [Selection(), Selection(gamma_min=0.5, gamma_max=89.0)])
@pytest.mark.parametrize("weighted", [True, False])
def test_good_rows_take_the_short_road(tmp_path, monkeypatch, selection, weighted):
    table_of(0, 400, [(7, ("beta", 0)), (8, ("e_n", 0))]).to_parquet(tmp_path / "rows.parquet")
    given = (tmp_path / "rows.parquet", 100, monkeypatch)
    short, taken = found_in(*given, short=True, selection=selection, weighted=weighted)
    assert taken == [True] * 4
    general, taken = found_in(*given, short=False, selection=selection, weighted=weighted)
    assert taken == []
    assert_same_bits(short, general)
    assert short.tally.skipped["not measured"] == 2


@pytest.mark.parametrize(
    ("change", "kept"),
    [
        (lambda t: t.rename(columns={"gamma_deg": "gamma_rad"}).assign(gamma_rad=0.7), False),
        (lambda t: t.assign(beta=100.0 * t["beta"]).rename(columns={"beta": "beta [%]"}), False),
        (lambda t: t.drop(columns=["sigma_e_n", "spin_y", "series"]), True),
        (lambda t: t.astype({"beta": np.float32, "e_n": np.float32}), True),
        (lambda t: t.assign(speed_m_s=2.0), True),
    ],
    ids=["radians", "percent", "few columns", "single precision", "speeds"],
)
def test_columns_that_need_more_than_to_be_read(tmp_path, monkeypatch, change, kept):
    change(table_of(1, 200, [])).to_parquet(tmp_path / "rows.parquet")
    given = (tmp_path / "rows.parquet", 50, monkeypatch)
    try:
        short, taken = found_in(*given, short=True, weighted=False)
    except DataError as error:
        pytest.fail(str(error))
    assert taken == [True] * 4 * kept
    assert_same_bits(short, found_in(*given, short=False, weighted=False)[0])


@pytest.mark.parametrize(
    "values", [[0.3, -0.7, 0.1], [-0.2, -0.0, 0.0], [0.5], [-0.5, -1e-3], [2.0, 1.5, -2.5]]
)
def test_ends_of_a_column_are_those_of_its_numbers(values):
    values = np.array(values)
    assert ends_of(values) == (0, 0, values.min(), values.max())
    gaps = np.concatenate(([np.nan], values, [-np.nan, 1e-61, -1e-70, 0.0]))
    assert ends_of(gaps) == (2, 2, np.nanmin(gaps), np.nanmax(gaps))
