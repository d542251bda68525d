"""`ifrfit check`: what a file holds and what can be fitted from it; 3 with the refusal."""

from __future__ import annotations

from pathlib import Path

import pytest
from project_files import as_json, version_4
from sheet_files import xlsx

BETA = "gamma_deg,beta\n10,0.5\n40,0.1\n70,-0.7\n"


def checked(cli, text, *options, name="x.csv"):
    Path(name).write_bytes(text if isinstance(text, bytes) else text.encode())
    said = cli("check", name, *options)
    assert said.returncode == 0, said.stderr
    assert said.stderr == ""
    return " ".join(said.stdout.split())


def test_beta_alone(cli):
    said = checked(cli, BETA)
    assert "column 'gamma_deg' is gamma (deg, from the normal)" in said
    assert "3 beta of x: -0.7 to 0.5, 10 to 70 degrees from the normal" in said
    assert "to fit e_t and mu (1 + e_n), from beta missing e_n: without it mu is known only in" in said
    assert "sigma of all beta" in said
    assert "provenance: whether" in said


def test_what_is_there_is_not_missing(cli):
    said = checked(
        cli,
        "gamma_deg,beta,sigma_beta,e_n,sigma_e_n,sigma_gamma_deg,speed_m_s,provenance\n"
        "10,0.5,0.01,0.9,0.01,0.1,2,measured\n70,-0.7,0.01,0.9,0.01,0.1,2,measured\n",
    )
    assert "e_n, from e_n e_t and mu, from beta" in said
    assert "missing" not in said


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("gamma_deg,e_n\n10,0.9\n40,0.9\n", "neither e_t nor mu is known"),
        ("gamma_deg,beta\n30,0.5\n30.2,0.4\n", "one angle alone shows sticking or sliding"),
        ("gamma_deg;beta;sigma_beta\n10;0,4;0,1\n40;0,1;\n", "sigma of 1 of 2 beta"),
    ],
)
def test_what_is_missing_is_told(cli, text, words):
    assert words in checked(cli, text)


def test_figures_and_sheets(cli):
    said = checked(cli, as_json(version_4()), "--x", "gamma_deg", "--y", "beta", name="figure.json")
    assert "3 beta of glass" in said
    assert "share the error of its calibration" in said
    book = xlsx({"one": [["gamma_deg", "beta"], [10, 0.5]], "two": [["gamma_deg", "e_n"], [10, 0.5]]})
    assert "1 e_n of x" in checked(cli, book, "--sheet", "two", name="x.xlsx")


def test_a_refusal_is_that_of_a_fit(cli):
    Path("x.csv").write_text("gamma_deg,beta\n10,high\n", encoding="utf-8")
    said, fit = cli("check", "x.csv"), cli("fit", "x.csv")
    assert (said.returncode, said.stdout) == (3, "")
    assert said.stderr == fit.stderr
