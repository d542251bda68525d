"""What is refused, and in which words: file, line, column, remedy, in one or two sentences."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from refusals import refused

import ifrfit.data as data
from ifrfit.errors import DataError

WORDS_OF = tomllib.loads(Path(__file__).with_name("refused.toml").read_text(encoding="utf-8"))
CASES = {
    "spreadsheet": (b"PK\x03\x04abc", "x.csv: the file is a spreadsheet or an archive, not a text table."),
    "compressed": (b"\x1f\x8b\x08abc", "x.csv: the file is compressed, not a text table."),
    "in the first column": ("gamma_deg,beta\n" + "1" * 200_000 + ",0.4\n", "line 2, column gamma_deg"),
    **WORDS_OF["tables"],
    **WORDS_OF["undefined"],
    **WORDS_OF["raw_velocities"],
}


def refusal(tmp_path, text, **options):
    path = tmp_path / "x.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with refused(DataError) as caught:
        data.read(path, **options)
    assert caught.value.exit_status == 3
    return caught.value.in_shell.replace(f"{tmp_path}/", "")


def sentences(message):
    return len(re.findall(r"[.!?](?=\s+[A-Z'-]|$)", message.replace("v_t'/v_t", ""))) or 1


@pytest.mark.parametrize("name", CASES)
def test_refusal_names_place_and_remedy(tmp_path, name):
    text, expected = CASES[name]
    message = refusal(tmp_path, text)
    assert expected in message
    assert message.startswith("x.csv")
    assert sentences(message) <= 2
    assert len(message) < 500


@pytest.mark.parametrize(
    "text",
    [
        "gamma_deg,spin_y,beta\n0,0.1,0.4\n",  # spin moves the contact point
        "gamma_deg,beta\n90,0.4\n",
        "gamma_deg,beta_cm\n90,0.4\n",
        "gamma_deg,spin_x,lambda_deg\n0,0.2,-90\n",
        "gamma_deg,beta_tot\n90,0.4\n",
        "gamma_deg,beta_tot\n0,0.4\n",
        "gamma_deg,psi_after_deg\n0,0\n",
        "gamma_deg,v_n\n90,0\n",
        "gamma_deg,v_x\n10,5e-17\n",  # rounding of a simulation
        "gamma_deg,beta,sigma_gamma_deg\n10,0.4,0\n",  # set exactly
    ],
)
def test_what_is_defined_is_not_refused(read, text):
    assert len(read(text)) == 1


WORDS = st.sampled_from(WORDS_OF["words"])


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=300)
@given(
    st.one_of(
        st.binary(max_size=200),
        st.text(max_size=200).map(lambda text: text.encode("utf-8", "surrogatepass")),
        st.tuples(st.lists(st.lists(WORDS, max_size=5), max_size=5), st.sampled_from(",;\t")).map(
            lambda t: "\n".join(t[1].join(row) for row in t[0]).encode()
        ),
    )
)
def test_whatever_a_file_holds_it_is_read_or_refused_in_words(tmp_path, raw):
    path = tmp_path / "x.csv"
    path.write_bytes(raw)
    try:
        obs = data.read(path)
    except DataError as error:
        message = str(error)
    else:
        assert np.isfinite(obs.table.value).all()
        assert obs.sources[0].rows_used == len(obs) > 0
        return
    assert message.startswith(str(path))
    assert len(message) < 800


def test_missing_file_and_folder(tmp_path):
    with refused(DataError, match=r"nix\.csv: there is no such file\. Check the name\."):
        data.read(tmp_path / "nix.csv")
    with refused(DataError, match=r"this is a folder\. Name a CSV, TSV or Parquet file in it\."):
        data.read(tmp_path)
    with refused(DataError, match="cannot be read"):
        data.read("a\0b.csv")


def test_empty_columns_to_the_right_are_no_error(read):
    assert list(read("gamma_deg;beta;;\n10;0,4;;\n20;0,3;;\n").table.value) == [0.4, 0.3]
    assert list(read("gamma_deg,beta\n10,0.4,,\n20,0.3\n").table.value) == [0.4, 0.3]


@pytest.mark.parametrize(
    ("header", "sigma"),
    [
        ("se_e_n", "sigma_e_n"),
        ("gamma_error", "sigma_gamma_deg"),
    ],
)
def test_an_uncertainty_is_never_offered_as_a_value(read, header, sigma):
    with refused(DataError) as raised:
        read(f"gamma_deg,beta,{header}\n10,-0.5,0.01\n20,-0.4,0.01\n")
    assert f"a column {sigma}" in raised.value.in_shell
    assert f"column:{sigma}={header}" in raised.value.in_shell


@pytest.mark.parametrize("code", ["-999", "-99", "9999", "-99.9"])
@pytest.mark.parametrize("column", ["beta", "gamma_deg", "spin_y", "sigma"])
def test_a_code_for_a_missing_value_is_refused_with_its_place(read, column, code):
    cells = {"gamma_deg": "20", "beta": "0.4", "spin_y": "0.1", "sigma": "0.02"}
    lines = [",".join(cells), ",".join(cells.values()), ",".join((cells | {column: code}).values())]
    with refused(DataError) as raised:
        read("\n".join(lines) + "\n")
    assert f"line 3, column {column}: {code} looks like a code for 'not measured'" in raised.value.in_shell
    assert "Leave such cells empty" in raised.value.in_shell


@pytest.mark.parametrize(
    ("code", "times", "is_code"), [("9.99", 3, True), ("9.99", 2, False), ("-9.9", 4, True)]
)
def test_a_short_code_is_one_where_it_is_repeated(read, code, times, is_code):
    lines = [f"{10 + i},{code if i < times else 0.1 * i}" for i in range(10)]
    text = "gamma_deg,beta\n" + "\n".join(lines) + "\n"
    if not is_code:
        assert len(read(text).table) == 10
        return
    with refused(DataError) as raised:
        read(text)
    assert f"line 2, column beta: {code} looks like a code for 'not measured'" in raised.value.in_shell


def test_nines_among_their_like_are_values(read):
    lines = [f"{10 + i},{9.99 if i < 4 else 4.0 + 0.1 * i}" for i in range(10)]
    assert len(read("gamma_deg,tan_psi_after\n" + "\n".join(lines) + "\n").table) == 10


def test_a_number_like_a_code_among_its_like_is_none(read):
    text = "u_x_m_s,u_z_m_s,v_x_m_s,radius_m,omega_y_after_rad_s\n1,2,0.5,0.001,{}\n1,2,0.5,0.001,-150\n"
    assert read(text.format("-99")).table.value.size == 4
    assert read(text.format("-80")).table.value.size == 4


@pytest.mark.parametrize(
    ("column", "values", "words"),
    [
        ("gamma_deg", (10, 20), "has the angle 20 degrees here and 10 degrees in line 2"),
        ("spin_y", (0.1, 0.3), "has the spin 0.3 here and 0.1 in line 2"),
        ("speed_m_s", (1, 2), "has the speed 2 m/s here and 1 m/s in line 2"),
    ],
)
def test_an_impact_id_that_starts_anew_is_refused(read, column, values, words):
    cells = {"gamma_deg": 10, "beta": 0.4, "spin_y": 0.1, "speed_m_s": 1, "impact_id": 7}
    rows = [cells | {column: value} for value in values]
    text = "\n".join(",".join(map(str, row)) for row in (cells, *(row.values() for row in rows)))
    with refused(DataError, match="impact '7'") as raised:
        read(text + "\n")
    assert words in raised.value.in_shell
    assert "column impact_id" in raised.value.in_shell
    assert "Number the impacts through the whole table or remove the column." in raised.value.in_shell


def test_readings_of_one_impact_may_differ_a_little(read):
    text = "observable,value,gamma_deg,impact_id\nbeta_cm,-0.7,{},1\nspin_y_after,-0.4,{},1\n"
    assert len(read(text.format(20, 20.3))) == 2
    with refused(DataError, match=r"Number the impacts through the whole table\.$"):
        read(text.format(20, 21))


def test_a_table_of_means_may_be_called_so(read):
    assert set(read("series,gamma_deg,beta\nmean,10,0.4\nmean,20,0.3\n").table["series"]) == {"mean"}
