"""The table cannot be written into, and several become one without losing where a row came from."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

import ifrfit.data as data
from ifrfit.data.observations import Observations, Source, make_table
from ifrfit.data.schema import TABLE_COLUMNS
from ifrfit.errors import UsageError


def observations(name="a.csv", sha="1", **columns):
    table = make_table(
        {"value": [0.1, 0.2], "observable": "beta", "gamma_deg": [10, 20], "source": name, **columns}
    )
    return Observations(table, (Source(name, sha, 2, 2),), (f"note of {name}",))


def test_make_table_fills_what_is_missing():
    table = make_table({"value": [1, 2]})
    assert tuple(table.columns) == TABLE_COLUMNS
    assert (table.spin_x == 0).all()
    assert table.gamma_deg.isna().all()
    assert list(table.n_repeats) == [1, 1]
    assert list(table.row) == [1, 2]
    assert (table.provenance == "").all()


def test_nobody_writes_into_the_stored_frame():
    made = make_table({"value": [1.0, 2.0]})
    obs = Observations(made)
    made.loc[0, "value"] = 99.0
    handed_out = obs.table
    handed_out.loc[1, "value"] = 99.0
    handed_out["sigma"] = 5.0
    assert list(obs.table.value) == [1.0, 2.0]
    assert obs.table.sigma.isna().all()
    with pytest.raises(FrozenInstanceError):
        obs.table = made


def test_length_provenance_and_display():
    obs = observations(provenance=["measured", "<stand-in>"])
    assert len(obs) == 2
    assert obs.provenance == ("measured", "<stand-in>")
    assert repr(obs) == "Observations(a.csv: 2 rows of beta; measured, <stand-in>)"
    html = obs._repr_html_()
    assert "note of a.csv" in html
    assert "&lt;stand-in&gt;" in html
    assert "<stand-in>" not in html


def test_with_note_says_things_once():
    assert observations().with_note("x", "note of a.csv").with_note("x").notes == ("note of a.csv", "x")


def test_combine():
    both = data.combine([observations(), observations("b.csv", "2", value=[0.3, np.nan])])
    assert len(both) == 4
    assert list(both.table.source) == ["a.csv", "a.csv", "b.csv", "b.csv"]
    assert [s.name for s in both.sources] == ["a.csv", "b.csv"]
    assert both.notes == ("note of a.csv", "note of b.csv")
    assert list(both.table.index) == [0, 1, 2, 3]


def test_combine_keeps_files_of_one_name_apart():
    both = data.combine([observations(), observations(sha="2"), observations(sha="3")])
    assert list(dict.fromkeys(both.table.source)) == ["a.csv", "a.csv (2)", "a.csv (3)"]
    assert [s.name for s in both.sources] == ["a.csv", "a.csv (2)", "a.csv (3)"]


def test_combine_refuses_the_same_data_twice():
    with pytest.raises(
        UsageError, match=r"^a\.csv: the same data are given twice and would be counted twice"
    ):
        data.combine([observations(), observations()])
    with pytest.raises(UsageError, match=r"^a\.csv and copy\.csv: the same data"):
        data.combine([observations(), observations("copy.csv")])
    with pytest.raises(UsageError, match="No data given"):
        data.combine([])


def test_combine_of_one_is_itself():
    obs = observations()
    assert data.combine([obs]) is obs
    assert replace(obs, notes=()).notes == ()
