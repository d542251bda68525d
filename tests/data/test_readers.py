"""Long and wide tables in the shapes that spreadsheets and instruments export them."""

from __future__ import annotations

import hashlib

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import ifrfit.data as data
from ifrfit.data.schema import TABLE_COLUMNS
from ifrfit.errors import DataError, UsageError


def test_long_table_keeps_every_column_and_the_line(tmp_path):
    path = tmp_path / "impacts.csv"
    path.write_text(
        "series,observable,gamma_deg,spin_x,spin_y,sigma_spin_x,sigma_spin_y,speed_m_s,value,sigma,"
        "sigma_gamma_deg,impact_id,provenance\n"
        "a,beta,10,0.1,0.2,0.01,0.02,3.9,0.42,0.03,0.5,i1,measured\n"
        "b,e_n,,,,,,,0.94,,,,digitized\n"
    )
    obs = data.read(path)
    table = obs.table
    assert tuple(table.columns) == TABLE_COLUMNS
    first, second = table.iloc[0], table.iloc[1]
    assert (first.series, first.observable, first.impact_id, first.provenance) == (
        "a",
        "beta",
        "i1",
        "measured",
    )
    numbers = ["gamma_deg", "spin_x", "spin_y", "sigma_spin_x", "sigma_spin_y", "speed_m_s", "value", "sigma"]
    assert list(first[numbers]) == [10, 0.1, 0.2, 0.01, 0.02, 3.9, 0.42, 0.03]
    assert first.sigma_gamma_deg == 0.5
    assert np.isnan(second.gamma_deg)
    assert (second.spin_x, second.spin_y, second.value) == (0.0, 0.0, 0.94)
    assert np.isnan(second.sigma)
    assert list(table.row) == [2, 3]
    assert set(table.source) == {"impacts.csv"}
    assert obs.provenance == ("measured", "digitised")
    (source,) = obs.sources
    assert source.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert (source.rows, source.rows_used, dict(source.rows_skipped)) == (2, 2, {})
    assert source.provenance == "measured, digitised"


def test_series_defaults_to_the_file_stem_and_nothing_is_averaged(read):
    obs = read("gamma_deg,beta\n30,0.1\n30,0.2\n30,0.1\n", name="steel.csv")
    assert list(obs.table.series) == ["steel"] * 3
    assert list(obs.table.value) == [0.1, 0.2, 0.1]
    assert list(obs.table.n_repeats) == [1, 1, 1]
    assert list(obs.table.impact_id) == [""] * 3


def test_wide_table_ties_the_observables_of_a_line_together(read):
    table = read("gamma_deg,beta,e_n,sigma_beta,sigma_e_n\n10,0.4,0.9,0.1,0.2\n20,,0.8,0.1,0.2\n").table
    assert list(table.observable) == ["beta", "e_n", "e_n"]
    assert list(table.impact_id) == ["line 2", "line 2", "line 3"]
    assert list(table.sigma) == [0.1, 0.2, 0.2]
    assert list(table.row) == [2, 2, 3]


def test_wide_table_of_one_observable_takes_a_plain_sigma(read):
    table = read("gamma_deg,beta,sigma\n10,0.4,0.1\n20,0.3,\n").table
    assert table.sigma[0] == 0.1
    assert np.isnan(table.sigma[1])


def test_empty_and_nan_cells_are_skipped_and_counted(read):
    obs = read("gamma_deg,beta,spin_y\n10,0.4,0\n20,,0\n30,NaN,0\n,0.3,0\n40,0.2,\n50,n/a,0\n")
    assert list(obs.table.row) == [2]
    (source,) = obs.sources
    assert dict(source.rows_skipped) == {
        "not measured": 3,
        "angle not measured": 1,
        "spin not measured": 1,
    }
    assert source.rows == source.rows_used + 5
    assert obs.notes == (), "the counts are told once, by the report"


def test_a_spin_column_that_is_empty_throughout_means_no_spin(read):
    assert list(read("gamma_deg,beta,spin_y\n10,0.4,\n20,0.3,\n").table.spin_y) == [0.0, 0.0]


def test_nothing_but_empty_cells_is_refused(read):
    with pytest.raises(DataError, match=r"no row can be used \(2 not measured\)\. Fill in"):
        read("gamma_deg,beta\n10,\n20,\n")


@pytest.mark.parametrize(
    ("header", "cell"),
    [
        ("gamma_deg", "30"),
        ("gamma [deg]", "30"),
        ("gamma (°)", "30"),
        ("Gamma_Deg", "30"),
        ("γ [deg]", "30"),
        ("gamma", "30"),
        ("gamma_rad", str(np.pi / 6)),
        ("gamma (rad)", str(np.pi / 6)),
        ("tan_gamma", str(np.tan(np.pi / 6))),
    ],
)
def test_units_of_the_angle(read, header, cell):
    table = read(f"{header},beta\n{cell},0.4\n").table
    assert table.gamma_deg[0] == pytest.approx(30, abs=1e-12)


def test_degrees_lose_nothing(read):
    angles = ["0.1", "29.999999999999996", "89.9999999999999", "33.3"]
    table = read("gamma_deg,beta\n" + "".join(f"{a},0.4\n" for a in angles)).table
    assert list(table.gamma_deg) == [float(a) for a in angles]


@pytest.mark.parametrize(
    ("header", "cell", "expected"),
    [
        ("speed_m_s", "2", 2.0),
        ("speed [mm/s]", "2000", 2.0),
        ("u (m/s)", "2", 2.0),
        ("speed_mm_s", "500", 0.5),
    ],
)
def test_units_of_the_speed(read, header, cell, expected):
    assert read(f"gamma_deg,{header},beta\n10,{cell},0.4\n").table.speed_m_s[0] == expected


def test_angles_among_the_observables_come_out_in_degrees(read):
    table = read("gamma_deg,delta [rad],sigma_delta\n40,0.5,0.01\n").table
    assert table.observable[0] == "delta_deg"
    assert table.value[0] == pytest.approx(np.degrees(0.5), rel=1e-15)
    assert table.sigma[0] == pytest.approx(np.degrees(0.01), rel=1e-15)
    long = read("observable,gamma_deg,value,sigma\ndelta (rad),40,0.5,0.01\nbeta,40,0.2,0.1\n").table
    assert list(long.value) == pytest.approx([np.degrees(0.5), 0.2])
    assert list(long.sigma) == pytest.approx([np.degrees(0.01), 0.1])


def test_sd_and_n_become_a_standard_error(read):
    table = read("gamma_deg,beta,sd,n\n10,0.4,0.1,25\n20,0.3,0.1,1\n").table
    assert table.sigma[0] == pytest.approx(0.02)
    assert np.isnan(table.sigma[1])
    assert list(table.n_repeats) == [25, 1]
    long = read("observable,gamma_deg,value,sd,n_repeats\nbeta,10,0.4,0.1,4\n").table
    assert long.sigma[0] == pytest.approx(0.05)


def test_notes_columns_and_bookkeeping_are_passed_over(read):
    obs = read("note,gamma_deg,beta,Comment 2,source,row\nfine,10,0.4,hm,x,7\n")
    assert len(obs) == 1
    assert obs.table.row[0] == 2


def test_a_saved_table_reads_back(read, tmp_path):
    obs = read("gamma_deg,beta,e_n,sigma_beta,speed_m_s\n10,0.4,0.9,0.1,3\n20,0.1,0.8,0.1,3\n")
    for name, save in (("t.csv", "to_csv"), ("t.parquet", "to_parquet")):
        getattr(obs.table, save)(tmp_path / name, index=False)
        again = data.read(tmp_path / name).table
        same = [c for c in TABLE_COLUMNS if c not in ("source", "row")]
        pd.testing.assert_frame_equal(again[same], obs.table[same])


def test_parquet_wide(tmp_path):
    frame = pd.DataFrame(
        {"gamma_deg": [10, 20, 30], "beta": [0.4, np.nan, 0.2], "impact_id": pd.Categorical(["a", "b", "c"])}
    )
    frame.to_parquet(tmp_path / "x.parquet")
    obs = data.read(tmp_path / "x.parquet")
    assert list(obs.table.value) == [0.4, 0.2]
    assert list(obs.table.row) == [1, 3]
    assert list(obs.table.impact_id) == ["a", "c"]
    frame.assign(beta=[0.1, 1e300, 0.2]).to_parquet(tmp_path / "y.parquet")
    with pytest.raises(
        DataError, match=r"y\.parquet, row 2 \(counted from 1\), column beta: 1e\+300 is impossible"
    ):
        data.read(tmp_path / "y.parquet")
    frame.assign(beta=[[1], [2], [3]]).to_parquet(tmp_path / "z.parquet")
    with pytest.raises(DataError, match=r"column beta: holds list<.*neither numbers nor text"):
        data.read(tmp_path / "z.parquet")


def test_damaged_parquet(read):
    with pytest.raises(DataError, match="not a readable Parquet file"):
        read(b"PAR1" + b"\x00" * 40, name="x.parquet")


def test_wide_without_angle_reads_e_n_and_mu(read):
    table = read("e_n,mu\n0.9,0.1\n0.8,\n").table
    assert list(table.observable) == ["e_n", "mu", "e_n"]
    assert table.gamma_deg.isna().all()


def test_inertia_factor_must_be_positive(read):
    with pytest.raises(UsageError, match="must be positive, not -1"):
        read("gamma_deg,beta\n10,0.4\n", inertia_factor=-1.0)


ROWS = st.lists(
    st.tuples(
        st.floats(0.5, 89.5), st.floats(-5, 5).filter(lambda x: x == 0 or abs(x) > 1e-50), st.floats(1e-3, 10)
    ),
    min_size=1,
    max_size=8,
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=60)
@given(
    rows=ROWS,
    delimiter=st.sampled_from([",", ";", "\t"]),
    comma=st.booleans(),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "latin-1", "utf-16"]),
    newline=st.sampled_from(["\n", "\r\n", "\r"]),
    title=st.sampled_from(["", "Stöße auf Glas, März 2023", '# a comment; with, signs " in it']),
    quoted=st.booleans(),
    blank=st.booleans(),
)
def test_every_dialect_gives_the_same_numbers(
    tmp_path, rows, delimiter, comma, encoding, newline, title, quoted, blank
):
    def cell(x):
        text = repr(x).replace(".", ",") if comma and delimiter != "," else repr(x)
        return f'"{text}"' if quoted else text

    lines = [title] if title else []
    lines.append(delimiter.join(["series", "observable", "gamma_deg", "value", "sigma"]))
    lines += [delimiter.join(["ä", "beta", *(cell(x) for x in row)]) for row in rows]
    if blank:
        lines.insert(-1, "")
        lines.insert(-1, delimiter * 4)
    path = tmp_path / "t.csv"
    path.write_bytes((newline.join(lines) + newline).encode(encoding))
    table = data.read(path).table
    assert list(zip(table.gamma_deg, table.value, table.sigma, strict=True)) == rows
    assert set(table.series) == {"ä"}
    assert table.row.iloc[-1] == len(lines)


def test_source_never_holds_the_folder(read, tmp_path):
    obs = read("gamma_deg,beta\n10,0.4\n20,\n")
    assert str(tmp_path) not in repr(obs.sources) + repr(obs.notes)


def test_a_large_table_is_read_in_seconds(tmp_path):
    import time

    n = 100_000
    path = tmp_path / "large.csv"
    path.write_text("gamma_deg,beta,sigma\n" + "10.5,0.25,0.05\n" * n)
    start = time.perf_counter()
    assert len(data.read(path)) == n
    assert time.perf_counter() - start < 5
