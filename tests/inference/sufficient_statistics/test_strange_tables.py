"""Tables as they come: streamed they are what the reader in memory makes of them, or refused."""

from __future__ import annotations

import gzip
from decimal import Decimal

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from streams import impacts

import ifrfit
from ifrfit.data.stream import table_batches
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.estimators import LeastSquares

HALF = 200


@pytest.fixture
def folder(tmp_path):
    path = tmp_path / "log"
    path.mkdir()
    return path


def written(folder, table, name="a.csv"):
    if name.endswith(".parquet"):
        table.to_parquet(folder / name)
    else:
        table.to_csv(folder / name, index=False)
    return folder


def assert_as_in_memory(folder, table, **options):
    found = ifrfit.fit(folder, method="lsq", **options)
    whole = ifrfit.fit(table, method="lsq", **options)
    assert found.fit.chi2 == pytest.approx(whole.fit.chi2, rel=1e-9)
    for name, one in found.constants.items():
        other = whole.constants[name]
        pairs = [(one[key], other[key]) for key in one] if isinstance(one, dict) else [(one, other)]
        for ours, theirs in pairs:
            if theirs.value is not None:
                assert ours.value == pytest.approx(theirs.value, rel=1e-9)
    return found


@pytest.mark.parametrize("name", ["a.csv", "a.parquet"])
@pytest.mark.parametrize("rows", [[7], list(range(5, 51))])
def test_a_spin_that_was_not_measured_is_no_zero(folder, name, rows):
    table = impacts(400)
    table.loc[rows, "spin_y"] = np.nan
    found = assert_as_in_memory(written(folder, table, name), table)
    assert found.inputs[0].rows_skipped["spin not measured"] == len(rows)


def test_a_column_of_spins_that_is_empty_says_no_spin(folder):
    table = impacts(400, spin=0.0)
    table["spin_y"] = np.nan
    found = assert_as_in_memory(written(folder, table, "a.parquet"), table)
    assert any(one.startswith("no spin before impact") for one in found.assumed)
    with_spins = impacts(400, seed=1)
    written(folder, with_spins, "b.parquet")
    with pytest.raises(DataError, match=r"b\.parquet, row 1 .*, column spin_y: a spin, where the first file"):
        ifrfit.fit(folder, method="lsq")


def test_a_file_without_its_spins_is_left_out_and_counted(folder):
    table = impacts(400)
    written(folder, table.iloc[:HALF], "a.parquet")
    table.loc[HALF:, "spin_y"] = np.nan
    written(folder, table.iloc[HALF:], "b.parquet")
    found = assert_as_in_memory(folder, table)
    assert found.inputs[0].rows_skipped["spin not measured"] == HALF


@pytest.mark.parametrize("workers", [1, 2])
def test_one_sigma_that_would_outweigh_all_is_refused(folder, monkeypatch, workers):
    from ifrfit.data.stream import sample

    monkeypatch.setattr(sample, "SAMPLE", 100)  # which does not hold it
    table = impacts(4000)
    table.loc[3777, "sigma_beta"] = 1e-9
    written(folder, table)
    with pytest.raises(DataError, match=r"a\.csv: 1e-09 is more than 10,000 times smaller than the median"):
        ifrfit.fit(folder, method=LeastSquares(workers=workers))


def test_sigmas_over_many_decades_have_none_that_is_alone(folder):
    table = impacts(3000)
    table["sigma_beta"] = np.exp(np.random.default_rng(0).normal(np.log(0.03), 2.0, len(table)))
    state = ifrfit.rebound(
        table["gamma_deg"], spin_y=table["spin_y"], e_n=0.9, e_t=-0.7, mu=0.15, degrees=True
    )
    table["beta"] = state.beta + table["sigma_beta"] * np.random.default_rng(1).standard_normal(len(table))
    assert_as_in_memory(written(folder, table), table)


@pytest.mark.parametrize("options", [{"separate": "mu"}, {"series": ["s1"]}], ids=["separate", "series"])
@pytest.mark.parametrize("before", ["", " "])
def test_blanks_about_the_name_of_a_series_make_no_other(folder, before, options):
    table = impacts(400, series=2)
    table["series"] = [f"{before}{name} " if row % 2 else name for row, name in enumerate(table["series"])]
    assert_as_in_memory(written(folder, table), table, **options)


def test_a_series_of_blanks_has_no_name(folder):
    table = impacts(400, series=2)
    table.loc[5:50, "series"] = "  "
    found = ifrfit.fit(written(folder, table), method="lsq", separate="mu")
    assert set(found.constants["mu"]) == {"s0", "s1", "log"}


LABELS = {
    "categories": lambda x: pa.array(pd.Categorical(x)),
    "integers": lambda x: pa.array([int(name[1:]) for name in x]),
    "floats": lambda x: pa.array([float(name[1:]) for name in x]),
    "views": lambda x: pa.array(list(x), pa.string_view()),
    "large": lambda x: pa.array(list(x), pa.large_string()),
}


@pytest.mark.parametrize(
    ("first", "second"),
    # every type first, and every kind of text after text and after numbers: files are read one by one
    [(first, "categories") for first in LABELS]
    + [(first, second) for first in ("categories", "integers") for second in ("large", "views")],
)
def test_labels_of_files_may_have_other_types(folder, first, second):
    table = impacts(400, series=2)
    labels = table.pop("series")
    for rows, kind, name in ((slice(0, HALF), first, "a"), (slice(HALF, None), second, "b")):
        part = pa.Table.from_pandas(table.iloc[rows], preserve_index=False)
        pq.write_table(
            part.append_column("series", LABELS[kind](labels.iloc[rows])), folder / f"{name}.parquet"
        )
    if first in ("integers", "floats"):
        labels = [name[1:] if row < HALF else name for row, name in enumerate(labels)]
    assert_as_in_memory(folder, table.assign(series=labels), separate="mu")


def test_labels_beyond_the_whole_numbers_of_floats_stay_apart(folder):
    part = pa.Table.from_pandas(impacts(400), preserve_index=False)
    labels = pa.array([2**53, 2**53 + 1] * HALF)
    pq.write_table(part.append_column("series", labels), folder / "a.parquet")
    found = ifrfit.fit(folder, method="lsq", separate="mu")
    assert set(found.constants["mu"]) == {str(2**53), str(2**53 + 1)}


def test_decimals_are_numbers(folder):
    table = impacts(400).round(6)
    part = pa.Table.from_pandas(table, preserve_index=False)
    place = part.schema.get_field_index("beta")
    beta = pa.array([Decimal(f"{value:.6f}") for value in table["beta"]])
    pq.write_table(part.set_column(place, "beta", beta), folder / "a.parquet")
    assert_as_in_memory(folder, table)


def test_columns_that_are_not_used_may_hold_anything(folder):
    table = impacts(400)
    for rows, odd, name in ((slice(0, HALF), [[1]], "a"), (slice(HALF, None), ["x"], "b")):
        part = pa.Table.from_pandas(table.iloc[rows], preserve_index=False)
        pq.write_table(part.append_column("odd", pa.array(odd * HALF)), folder / f"{name}.parquet")
    assert_as_in_memory(folder, table.assign(odd=1), convention=["ignore=odd"])


def test_labels_without_text_are_refused(folder):
    part = pa.Table.from_pandas(impacts(10), preserve_index=False)
    pq.write_table(part.append_column("series", pa.array([[1]] * 10)), folder / "a.parquet")
    with pytest.raises(DataError, match="column series: holds list<element: int64>, not text"):
        ifrfit.fit(folder, method="lsq")


def test_whole_numbers_beyond_those_of_floats_are_impossible_and_named(folder):
    part = pa.Table.from_pandas(impacts(400), preserve_index=False)
    place = part.schema.get_field_index("beta")
    part = part.set_column(place, "beta", pa.array([2**60 + 1] + [0] * 399))
    pq.write_table(part, folder / "a.parquet")
    assert any(
        "beta impossible" in said and "row 1" in said for said in ifrfit.fit(folder, method="lsq").warnings
    )


REFUSED = {
    "series mean": ({"series": ["mean"] + ["a"] * 399}, {}, "'mean' names a summary"),
    "impact mean": ({"impact_id": [*map(str, range(399)), "Mean"]}, {}, "'Mean' names a summary"),
    "nan": ({}, {"gamma_min": float("nan")}, "need numbers, not nan"),
    "empty range": ({}, {"gamma_min": 60, "gamma_max": 30}, "no row can lie between"),
    "no series": ({"series": "a"}, {"series": ["a", "zz"]}, "zz.*: not in the data"),
    "no observable": ({"sigma_v_x": 0.03}, {}, "the uncertainty of v_x, which the table does not have"),
    "one sigma": ({"sigma_beta": None, "sigma_e_n": None, "sigma": 0.03}, {}, "could belong to any of"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused_in_memory_is_refused(folder, case):
    change, options, said = REFUSED[case]
    table = impacts(400).assign(**change).drop(columns=[name for name in change if change[name] is None])
    written(folder, table)
    for data in (folder / "a.csv", folder):
        with pytest.raises((DataError, UsageError), match=said):
            ifrfit.fit(data, method="lsq", **options)


def test_uncertainties_that_are_not_used_are_told(folder):
    written(folder, impacts(400).drop(columns="sigma_beta"))
    found = ifrfit.fit(folder, method="lsq")
    assert any("sigma_e_n is not used" in said for said in found.warnings), found.warnings


def test_headers_alone_are_no_copies_and_the_least_files_are(folder):
    table = impacts(400)
    written(folder, table)
    for name in "bc":
        written(folder, table.iloc[:0], f"{name}.csv")
    assert_as_in_memory(folder, table)
    for name in "de":
        (folder / f"{name}.csv").write_text("gamma_deg,beta\n10,0.5\n", encoding="utf-8")
    with pytest.raises(DataError, match=r"e\.csv: the same data as d\.csv"):
        ifrfit.fit(folder, method="lsq")


def test_the_last_suffix_tells_what_a_file_is(folder):
    table = impacts(400)
    written(folder, table.iloc[:HALF], "a.csv.parquet")
    with gzip.open(folder / "B.CSV.GZ", "wt", encoding="utf-8") as file:
        table.iloc[HALF:].to_csv(file, index=False)
    assert_as_in_memory(folder, table)


@pytest.mark.parametrize("sigma", [1e-3, 1e-5, 1e-6])
@pytest.mark.parametrize("noise", ["known", "unknown"])
def test_precise_values_keep_the_digits_of_their_scatter(folder, sigma, noise):
    table = impacts(400, sigma=sigma)
    found = ifrfit.fit(written(folder, table), method="lsq", noise=noise)
    whole = ifrfit.fit(table, method="lsq", noise=noise)
    assert found.fit.chi2 == pytest.approx(whole.fit.chi2, abs=0.1 * np.sqrt(2 * 800))
    if noise == "unknown":
        assert found.fit.rmse == pytest.approx(whole.fit.rmse, rel=0.1 / np.sqrt(2 * 800))


@pytest.mark.parametrize("sigma", [1e-8, 1e-10])
@pytest.mark.parametrize("noise", ["known", "unknown"])
def test_values_too_precise_for_sums_are_refused(folder, sigma, noise):
    written(folder, impacts(400, sigma=sigma))
    with pytest.raises(DataError, match=r"scatters so little against its size|cannot tell its own noise"):
        ifrfit.fit(folder, method="lsq", noise=noise)


def test_one_impact(folder):
    table = impacts(1)
    found = assert_as_in_memory(written(folder, table), table)
    assert found.fit.p_value is None


BROKEN = {
    "a row in a cell": lambda row, line: f'"x\n{line},z"' if row % 3 == 0 else "b",
    "not closed": lambda row, line: '"open' if row == 250 else "b",
    "closed much later": lambda row, line: {50: '"open', 300: 'shut"'}.get(row, "b"),
}


@pytest.mark.parametrize("size", [6000, 10**9])
@pytest.mark.parametrize("case", BROKEN)
def test_quotation_marks_over_lines_lose_no_rows_in_silence(folder, monkeypatch, case, size):
    from ifrfit.data.stream import portions

    monkeypatch.setattr(portions, "_TEXT_BYTES", size)
    header, *lines = impacts(400).to_csv(index=False).splitlines()
    lines = [f"{line},{BROKEN[case](row, line)}" for row, line in enumerate(lines)]
    (folder / "a.csv").write_text("\n".join([f"{header},note", *lines, ""]), encoding="utf-8")
    with pytest.raises((UsageError, DataError), match=r"line break|quotation mark|cannot be read"):
        ifrfit.fit(folder, method="lsq")


def test_quotation_marks_within_lines_are_no_matter(folder):
    table = impacts(400).assign(note='say "hi", or not')
    assert_as_in_memory(written(folder, table), table.drop(columns="note"))


@pytest.mark.parametrize("other", ["a.csv", "a.csv.gz"])
def test_the_rows_of_a_table_beside_it_in_another_format_are_not_counted_twice(folder, other):
    table = impacts(400)
    written(folder, table, "a.parquet")
    written(folder, table.round(9), other)
    with pytest.raises(DataError, match=r"a\.parquet: begins with the rows of a\.csv.* counted twice"):
        ifrfit.fit(folder, method="lsq")


def test_other_rows_of_the_same_name_in_another_format_are_taken(folder):
    tables = impacts(400), impacts(300, 1)
    written(folder, tables[0], "a.parquet")
    written(folder, tables[1], "a.csv")
    assert_as_in_memory(folder, pd.concat(tables))


def test_a_damaged_page_with_a_checksum_is_refused(folder):
    table = impacts(4000, spin=0.0)
    path = folder / "a.parquet"
    pq.write_table(pa.Table.from_pandas(table), path, compression="none", write_page_checksum=True)
    raw = bytearray(path.read_bytes())
    at = raw.find(np.float64(table["beta"][1234]).tobytes())
    raw[at] ^= 1  # in the last digit: nothing is impossible about it
    path.write_bytes(raw)
    with pytest.raises(DataError, match=r"a\.parquet: .*(CRC|checksum).* Write it again"):
        ifrfit.fit(folder, method="lsq")
    with pytest.raises(DataError, match=r"a\.parquet: .*(CRC|checksum).* Write it again"):
        ifrfit.fit(path, method="lsq")


def in_order(table, column, *cells):
    """Values of a column put at rows."""
    for row, value in cells:
        table.loc[row, column] = value
    return table


CODED = {
    "alone in its batch": (True, "speed_m_s", 2.0, [(7, 99.9)]),
    "beside larger values of another batch": (False, "speed_m_s", 2.0, [(7, 99.0), (390, 40.0)]),
    "one in each batch": (True, "speed_m_s", 2.0, [(7, 9.99), (150, 9.99), (390, 9.99)]),
    "two in all": (False, "speed_m_s", 2.0, [(7, 9.99), (390, 9.99)]),
    "a short one beside larger values of another batch": (
        False,
        "speed_m_s",
        2.0,
        [(7, 9.99), (8, 9.99), (9, 9.99), (390, 4.0)],
    ),
    "negative": (True, "spin_y", 0.1, [(7, -999.0)]),
    "first small, then large": (False, "spin_y", 0.1, [(7, 99.0), (399, 60.0)]),
}


@pytest.mark.parametrize("case", CODED)
@pytest.mark.parametrize("size", [50, 1000])
def test_a_code_for_not_measured_is_judged_by_all_rows(folder, monkeypatch, case, size):
    monkeypatch.setattr(table_batches, "_BATCH", size)
    is_code, name, other, cells = CODED[case]
    table = impacts(400, spin=0.0)
    table[name] = other
    table = in_order(table, name, *cells)
    written(folder, table, "a.parquet")
    if is_code:
        for data in (table, folder):
            with pytest.raises(DataError, match=f"column {name}: {cells[0][1]:g} looks like a code for 'not"):
                ifrfit.fit(data, method="lsq")
    else:
        assert_as_in_memory(folder, table)


@pytest.mark.parametrize("numbered", ["in each file", "in the table"])
def test_ids_that_name_no_single_impact_are_told_and_take_no_fact_away(folder, numbered):
    table = impacts(600, spin=0.0)
    table["impact_id"] = np.arange(600) % (300 if numbered == "in each file" else 200)
    for first, name in ((0, "a.parquet"), (300, "b.parquet")):
        written(folder, table.iloc[first : first + 300], name)
    found = ifrfit.fit(folder, method="lsq")
    (said,) = (said for said in found.warnings if "impact_id" in said)
    assert "names no single impact: each row is taken for an impact of its own" in said
    assert "outliers" in found.facts
    alone = ifrfit.fit(table.drop(columns="impact_id"), method="lsq")
    assert found.fit.chi2 == pytest.approx(alone.fit.chi2, rel=1e-9)


@pytest.mark.parametrize("noise", ["known", "unknown"])
@pytest.mark.parametrize("even", [True, False])
def test_the_rmse_is_that_in_memory_or_none(folder, noise, even):
    table = impacts(600)
    if even:
        table["sigma_beta"], table["sigma_e_n"] = 0.04, 0.02
    written(folder, table, "a.parquet")
    streamed, held = (ifrfit.fit(data, method="lsq", noise=noise).fit.rmse for data in (folder, table))
    if even or noise == "unknown":
        assert streamed == pytest.approx(held, rel=1e-9)
    else:  # weighted sums do not tell it
        assert np.isnan(streamed)


def test_a_copied_row_is_no_lack_of_fit(folder):
    """A narrow interval that holds a row and its copy has no scatter: "departs by 2e5 times the noise"."""
    table = impacts(60, 1, spin=0.0)
    written(folder, pd.concat([table, table.iloc[:1]], ignore_index=True))
    streamed, held = ifrfit.fit(folder, method="lsq"), ifrfit.fit(folder / "a.csv", method="lsq")
    assert held.facts["lack_of_fit"].ok
    assert streamed.facts["lack_of_fit"].says == held.facts["lack_of_fit"].says


@pytest.mark.parametrize("names", [("fr", "f"), ("ifr-contact", "f")])
def test_a_closure_without_hope_is_refuted_by_few_rows_too(folder, names):
    """FR was refuted and F, far behind it, was not: means of few rows had no power."""
    written(folder, impacts(100, 4, sigma=0.002)[["gamma_deg", "beta", "sigma_beta"]])
    asked = {"fix": {"e_n": 0.9}, "loo": False}
    streamed, held = (ifrfit.compare(data, names, **asked) for data in (folder, folder / "a.csv"))
    assert (streamed.verdict.kind, streamed.verdict.says) == (held.verdict.kind, held.verdict.says)
    ps = [[each.p_of_fit(entry) for entry in each.entries.values()] for each in (streamed, held)]
    assert ps[0] == pytest.approx(ps[1], rel=1e-6)


def test_readings_of_one_impact_are_told(folder):
    table = impacts(100, 2).assign(impact_id=np.arange(100))
    again = table.assign(beta=table["beta"] + 0.001)
    written(folder, pd.concat([table, again], ignore_index=True))
    assert any("stands in several rows at one angle" in said for said in ifrfit.fit(folder).warnings)


@pytest.mark.parametrize("size", [50, 1000])
@pytest.mark.parametrize("name", ["a.csv", "a.parquet"])
def test_a_unit_that_a_header_leaves_open_is_told_by_all_rows(folder, monkeypatch, name, size):
    """A batch of steep impacts alone was refused: "could be in degrees or in radians"."""
    monkeypatch.setattr(table_batches, "_BATCH", size)
    table = impacts(400, spin=0.0).sort_values("gamma_deg").rename(columns={"gamma_deg": "gamma"})
    table["e_n"] *= 100.0
    table["sigma_e_n"] *= 100.0
    table.loc[table.index[:60], "gamma"] = np.linspace(0.1, 1.5, 60)
    table.loc[table.index[:60], "e_n"] = 1.0  # of percent: a batch of nothing else
    table = table.rename(columns={"e_n": "e_n (%)", "sigma_e_n": "sigma_e_n (%)"})
    written(folder, table, name)
    assert_as_in_memory(folder, table)


@pytest.mark.parametrize("column", ["gamma", "e_n (%)"])
@pytest.mark.parametrize("workers", [1, 2])
def test_a_unit_that_all_rows_leave_open_is_refused(folder, column, workers):
    table = impacts(400, spin=0.0)
    if column == "gamma":
        table["gamma"] = np.radians(table.pop("gamma_deg"))
    else:
        table = table.rename(columns={"e_n": column, "sigma_e_n": f"sigma_{column}"})
    written(folder, table.iloc[:HALF], "a.parquet")
    written(folder, table.iloc[HALF:], "b.parquet")
    for data, options in ((table, {}), (folder, {"workers": workers})):
        with pytest.raises(DataError, match=r"degrees or in radians|the header says percent, but no value"):
            ifrfit.fit(data, method=LeastSquares(**options))


@pytest.mark.parametrize("gaps", [0, 120])
@pytest.mark.parametrize("noise", ["known", "unknown"])
@pytest.mark.parametrize("odd", [False, True], ids=["plain", "with an impossible value"])
def test_a_column_of_the_same_measurement_fills_the_gaps_of_another(folder, gaps, noise, odd):
    """Where beta_cm was empty and beta was not, the row was lost."""
    table = impacts(400, 1, columns=("beta_cm", "beta", "e_n"))
    table.loc[table.index[:gaps], "beta_cm"] = np.nan
    table.loc[table.index[100 : 100 + gaps], "beta"] = np.nan
    kept = table
    if odd:
        table.loc[399, "e_n"] = 1e9
        kept = table.assign(e_n=table["e_n"].where(table.index < 399))
    written(folder, table.iloc[:HALF], "a.parquet")
    written(folder, table.iloc[HALF:], "b.parquet")
    found = assert_as_in_memory(folder, kept, noise=noise)
    held = ifrfit.fit(kept, method="lsq", noise=noise)
    assert found.fit.n == held.fit.n
    once = "same impacts counted already"
    assert found.inputs[0].rows_skipped.get(once) == held.inputs[0].rows_skipped.get(once)


def test_a_second_column_that_has_no_sigma_is_left_out_and_told(folder):
    table = impacts(400, 1, columns=("beta_cm", "beta", "e_n")).drop(columns="sigma_beta")
    written(folder, table)
    found = ifrfit.fit(folder, method="lsq")
    assert any("beta left out: they are of the same impacts" in said for said in found.warnings)


@pytest.mark.parametrize("method", ["exact", "bootstrap", "profile"])
def test_every_method_takes_columns_that_fill_each_other(folder, method):
    table = impacts(400, 1, columns=("beta_cm", "beta", "e_n"))
    written(folder, table)
    found = ifrfit.fit(folder, method=method, seed=1)
    held = ifrfit.fit(table.drop(columns=["beta", "sigma_beta"]), method="lsq")
    assert found.constants["mu"].value == pytest.approx(
        held.constants["mu"].value, abs=held.constants["mu"].stderr
    )


def test_under_an_unknown_noise_no_sigma_is_missed(folder):
    """Rows without a sigma were left out, and --noise unknown named as the remedy where these are many."""
    table = impacts(400)
    table.loc[5:350, "sigma_beta"] = np.nan
    found = assert_as_in_memory(written(folder, table), table, noise="unknown")
    assert found.fit.n == ifrfit.fit(table, method="lsq", noise="unknown").fit.n == 800


def test_readings_that_drift_along_the_table_are_told(folder):
    """The sample, though it held all rows, had them in another order: neither drift nor alike neighbours."""
    table = impacts(600, 3, spin=0.0)
    table["beta"] += 0.06 * np.linspace(-1.0, 1.0, 600)
    written(folder, table, "a.parquet")
    streamed, held = (ifrfit.fit(data, method="lsq").facts for data in (folder, table))
    told = {name for name, fact in held.items() if not fact.ok}
    assert "drift" in held["slips"].says
    assert {name for name, fact in streamed.items() if not fact.ok} == told
