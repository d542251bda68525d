"""Tables that are handed over in Python are read as files are."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import ifrfit
from ifrfit.data.table_objects import TABLE, cells_of_table
from ifrfit.errors import DataError, UsageError

GAMMA = np.linspace(5.0, 80.0, 16)
COLUMNS = {
    "gamma_deg": GAMMA,
    "beta": ifrfit.rebound(GAMMA, e_n=0.9, e_t=-0.7, mu=0.15, degrees=True).beta,
}
FRAME = pd.DataFrame(COLUMNS)


def forms():
    """The same table in every form, by name."""
    import pyarrow as pa

    yield "frame", FRAME
    yield "mapping of arrays", COLUMNS
    yield "mapping of lists", {name: list(values) for name, values in COLUMNS.items()}
    yield "mapping of series", {name: pd.Series(values) for name, values in COLUMNS.items()}
    yield "arrow", pa.table(FRAME)
    yield "texts", FRAME.astype(str)
    yield "decimals", FRAME.astype(object)
    yield "nullable", FRAME.convert_dtypes()


@pytest.mark.parametrize(
    ("form", "table"), list(forms()), ids=lambda one: one if isinstance(one, str) else ""
)
def test_every_form_is_the_same_table(tmp_path, form, table):
    FRAME.to_csv(tmp_path / "table.csv", index=False)
    of_file = ifrfit.read(tmp_path / "table.csv").table
    found = ifrfit.read(table).table
    for column in ("gamma_deg", "value", "observable", "series"):
        if found[column].dtype == float:
            np.testing.assert_allclose(found[column], of_file[column], rtol=1e-15)
        else:
            assert found[column].tolist() == of_file[column].tolist()


def test_polars():
    polars = pytest.importorskip("polars")
    found = ifrfit.read(polars.DataFrame({name: list(values) for name, values in COLUMNS.items()}))
    assert found.table["value"].tolist() == COLUMNS["beta"].tolist()


@pytest.mark.parametrize("kind", ["Categorical", "Enum"])
def test_categories_of_polars_are_their_words(kind):
    polars = pytest.importorskip("polars")
    plain = polars.DataFrame(
        {"gamma_deg": ["10", "40", "60"], "beta": [0.6, None, 0.1], "series": ["a", None, "b"]}
    )
    words = (
        {"Categorical": [], "Enum": [["10", "40", "60"]]}[kind],
        {"Categorical": [], "Enum": [["a", "b"]]}[kind],
    )
    given = plain.with_columns(
        plain["gamma_deg"].cast(getattr(polars, kind)(*words[0])),
        plain["series"].cast(getattr(polars, kind)(*words[1])),
    )
    found, expected = (ifrfit.read(table).table for table in (given, plain))
    assert found.equals(expected)
    assert found["gamma_deg"].tolist() == [10.0, 60.0]


def test_the_same_numbers_have_the_same_digest():
    digests = {name: cells_of_table(table).sha256 for name, table in forms() if name != "texts"}
    assert len(set(digests.values())) == 1
    other = FRAME.assign(beta=FRAME["beta"] + 1e-15)
    assert cells_of_table(other).sha256 not in digests.values()


def test_rows_are_called_as_the_index_does():
    part = FRAME[FRAME["gamma_deg"] > 30.0]
    assert ifrfit.read(part).table["row"].tolist() == part.index.tolist()
    by_name = part.set_index(pd.Index([f"shot {i}" for i in range(len(part))]))
    assert ifrfit.read(by_name).table["row"].tolist() == list(range(len(part)))


def test_single_values_stand_in_every_row():
    found = ifrfit.fit(**COLUMNS, sigma=0.02, fix={"e_n": 0.9})
    assert set(found.points["sigma"]) == {0.02}
    assert found.noise.policy == "known"


def test_missing_values_are_not_measured():
    table = {"gamma_deg": [10, 20, 30], "beta": [0.4, None, float("nan")]}
    found = ifrfit.read(table)
    assert len(found) == 1
    assert found.sources[0].rows_skipped == {"not measured": 2}


def test_what_is_masked_is_not_measured():
    beta = np.ma.array(COLUMNS["beta"], mask=[i == 4 for i in range(GAMMA.size)])
    beta.data[4] = 9.0
    found = ifrfit.read({"gamma_deg": GAMMA, "beta": beta})
    assert len(found) == GAMMA.size - 1
    assert found.table["value"].max() < 1.0


def test_series_of_other_rows_are_not_paired_by_place():
    gamma, beta = pd.Series(GAMMA), pd.Series(COLUMNS["beta"])
    with pytest.raises(DataError, match="gamma_deg and beta have different indexes"):
        ifrfit.read({"gamma_deg": gamma.sort_values(ascending=False), "beta": beta})
    assert len(ifrfit.read({"gamma_deg": gamma, "beta": beta})) == GAMMA.size


def test_generators_and_sets():
    found = ifrfit.fit(gamma_deg=iter(GAMMA), beta=COLUMNS["beta"], sigma=0.02, fix={"e_n": 0.9})
    assert found.fit.n == GAMMA.size
    with pytest.raises(DataError, match="a set is no column"):
        ifrfit.fit(gamma_deg=set(GAMMA), beta=COLUMNS["beta"])


def test_arrays_name_series_and_observables():
    stated = FRAME.assign(sigma=0.02)
    both = ifrfit.read({"steel": stated, "glass": stated.assign(gamma_deg=GAMMA + 1.0)})
    for names in (np.array(["steel"]), pd.Series(["steel"])):
        found = ifrfit.fit(both, series=names, observable=np.array(["beta"]), fix={"e_n": 0.9})
        assert found.fit.n == GAMMA.size


def test_several_tables():
    both = ifrfit.read({"steel": FRAME, "glass": FRAME.assign(gamma_deg=GAMMA + 1.0)})
    assert list(dict.fromkeys(both.table["series"])) == ["steel", "glass"]
    found = ifrfit.fit([FRAME, FRAME.assign(gamma_deg=GAMMA + 1.0)], fix={"e_n": 0.9}, noise="unknown")
    assert [source.name for source in found.inputs] == ["table 1", "table 2"]
    with pytest.raises(UsageError, match="given twice"):
        ifrfit.fit([FRAME, FRAME], fix={"e_n": 0.9})


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"gamma_deg": [1.0, 2.0], "beta": [0.1]}, "column gamma_deg has 2 values, beta has 1"),
        ({"gamma_deg": [[1.0, 2.0]], "beta": [0.1]}, "is not a number"),
        ({"gamma_deg": np.ones((2, 2)), "beta": [0.1, 0.2]}, "column gamma_deg: has 2 dimensions"),
        (
            {"gamma_deg": [10.0, "x"], "beta": [0.1, 0.2]},
            r"row 1 .*, column gamma_deg: 'x' is not a number",
        ),
        (
            {"gamma_deg": [10.0], "beta": [float("inf")]},
            r"row 0 .*, column beta: 'inf' is infinite",
        ),
        ({"gamma_deg": [True], "beta": [0.1]}, "column gamma_deg: holds bool"),
        ({"gamma_deg": [10.0], "beta": [1j]}, "holds complex"),
        (
            {"gamma_deg": [10.0], "beta": [0.1], "weight": [4.0]},
            "weight: unknown name, which some write for 1/sigma",
        ),
        ({"gamma_deg": [10.0], "": [0.1]}, "column 2: the column has no name"),
        ({}, "there is no column"),
        (pd.DataFrame({"gamma_deg": [], "beta": []}), "there is no row"),
    ],
    ids=str,
)
def test_what_is_no_table_is_refused(table, said):
    with pytest.raises(DataError, match=rf"^{TABLE}.*{said}"):
        ifrfit.read(table)


def test_what_is_nothing_to_fit():
    for given in (3, GAMMA, object()):
        with pytest.raises(UsageError, match="is no table of impacts"):
            ifrfit.fit(given)
    with pytest.raises(UsageError, match="There is nothing to fit"):
        ifrfit.fit()
    with pytest.raises(UsageError, match="columns are given beside data"):
        ifrfit.fit(FRAME, beta=COLUMNS["beta"])
    with pytest.raises(TypeError, match=r"unexpected keyword argument 'clousre'\. Did you mean closure\?"):
        ifrfit.fit(**COLUMNS, clousre="fr")


def test_records_are_one_table():
    records = FRAME.to_records(index=False)
    rows = FRAME.to_dict("records")
    whole = ifrfit.read(FRAME).table
    for given in (records, np.array(records), rows, tuple(rows)):
        pd.testing.assert_frame_equal(ifrfit.read(given).table, whole)
    fit = ifrfit.fit([{**row, "sigma": 0.02} for row in rows], fix={"e_n": 0.9}, method="lsq")
    assert [source.name for source in fit.inputs] == [TABLE]


def test_an_array_without_names_and_headers_of_two_levels_have_a_remedy():
    with pytest.raises(UsageError, match=r"shape \(3, 2\) .*\{\"gamma_deg\": array\[:, 0\]"):
        ifrfit.read(np.ones((3, 2)))
    two = FRAME.set_axis(pd.MultiIndex.from_product([["set"], FRAME.columns]), axis=1)
    with pytest.raises(DataError, match=r"2 levels of names: .* table\.columns\.get_level_values\(-1\)"):
        ifrfit.read(two)
    with pytest.raises(UsageError, match=r"^3 \(int\) is no table"):
        ifrfit.fit([3, 4])


def test_messages_say_how_rows_are_counted(tmp_path):
    text = {"gamma_deg": [10.0, 20.0, 30.0], "beta": ["0.4", "high", "0.3"]}
    frame = pd.DataFrame(text)
    with pytest.raises(DataError, match=r"^table, row 1 \(counted from 0\), column beta: 'high'"):
        ifrfit.read(text)
    with pytest.raises(DataError, match=r"^table, row 1 \(counted from 0\), column beta"):
        ifrfit.read(frame)
    with pytest.raises(DataError, match=r"^table, row 1 \(as the index has it\), column beta"):
        ifrfit.read(frame.iloc[1:])
    pd.DataFrame({"gamma_deg": [10.0, 20.0], "beta": [0.4, 1e300]}).to_parquet(tmp_path / "t.parquet")
    with pytest.raises(DataError, match=r"t\.parquet, row 2 \(counted from 1\), column beta"):
        ifrfit.read(tmp_path / "t.parquet")


def test_an_empty_column_is_no_observable():
    table = {"gamma_deg": [10.0, 40.0], "beta": [0.4, 0.3], "e_n": [None, None], "sigma": [0.02, 0.03]}
    found = ifrfit.read(table).table
    assert found["observable"].tolist() == ["beta", "beta"]
    assert found["sigma"].tolist() == [0.02, 0.03]
    with pytest.raises(DataError, match=r"sigma: could belong to any of beta, e_n. Call it sigma_beta"):
        ifrfit.read({**table, "e_n": [0.9, None]})


def test_labels_by_keyword_go_into_a_mapping():
    columns = {"gamma_deg": [10.0, 40.0], "beta": [0.4, 0.3]}
    with pytest.raises(UsageError, match=r'fit\(\{"series": \[\.\.\.\], "gamma_deg": \[\.\.\.\], "beta"'):
        ifrfit.fit(**columns, series=["a", "a"])
    with pytest.raises(UsageError, match="chooses among the observables of a table"):
        ifrfit.fit(gamma_deg=[10.0, 40.0], value=[0.4, 0.3], observable=["beta", "v_x"])


def test_a_class_is_no_object():
    with pytest.raises(UsageError, match=r"noise: Noise is a class. Give an object, as ifrfit.Noise"):
        ifrfit.fit(**COLUMNS, noise=ifrfit.Noise)
    with pytest.raises(UsageError, match=r"model: Model is a class. Give an object, as ifrfit.Model"):
        ifrfit.fit(**COLUMNS, model=ifrfit.Model)


def test_names_of_tables_are_those_of_their_series_whatever_they_hold():
    names = ["0.5 mm", "0.7 mm", "steel/glass", "steel/brass", "<b>"]
    tables = {name: FRAME.assign(beta=FRAME["beta"] + 0.01 * i) for i, name in enumerate(names)}
    found = ifrfit.read(tables)
    assert list(found.table["series"].unique()) == names
    assert [source.name for source in found.sources] == names


def test_the_counter_of_reset_index_is_left_out():
    frame = pd.DataFrame({"gamma_deg": [10.0, 30.0, 60.0], "beta": [0.4, 0.35, -0.1]})
    found = ifrfit.read(frame.reset_index())
    np.testing.assert_array_equal(found.table["value"], frame["beta"])
    with pytest.raises(DataError, match=r"say reset_index\(drop=True\)"):
        ifrfit.read(frame[1:].reset_index())
