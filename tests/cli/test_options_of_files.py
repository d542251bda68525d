"""Options of figures and sheets, where several files are given: which of these they are about."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from project_files import as_json, axes, dataset, pixel, version_4
from sheet_files import xlsx

import ifrfit
from ifrfit.data.file_options import conventions_of

GAMMA = np.linspace(10.0, 80.0, 12)


def points(wave):
    beta = ifrfit.rebound(GAMMA, e_n=0.9, e_t=-0.6, mu=0.2, degrees=True).beta + 0.02 * np.sin(wave * GAMMA)
    return [pixel(g, b) for g, b in zip(GAMMA, beta, strict=True)]


@pytest.fixture
def files():
    project = version_4(
        axes_coll=[axes("A"), axes("B")],
        dataset_coll=[dataset("glass", "A", points(1)), dataset("steel", "B", points(2))],
    )
    Path("one.json").write_bytes(as_json(project))
    Path("two.json").write_bytes(as_json(version_4(dataset_coll=[dataset("brass", points=points(3))])))
    rows = [["gamma_deg", "beta"], *([g, b] for g, b in zip([20, 40, 60], [0.4, 0.3, -0.5], strict=True))]
    Path("book.xlsx").write_bytes(xlsx({"first": rows, "second": rows[:3]}))
    Path("table.csv").write_text("gamma_deg,beta\n15,0.5\n35,0.45\n75,-0.7\n", encoding="utf-8")


FIGURE = ("--x", "gamma_deg", "--y", "beta")


def counts(said):
    assert said.returncode == 0, said.stderr
    return said.stdout


def test_options_that_name_no_file_are_about_those_that_they_can_be_about(cli, files):
    said = cli("fit", "two.json", "table.csv", "book.xlsx", *FIGURE, "--sheet", "second", "--fix", "e_n=0.9")
    text = " ".join(counts(said).split())
    assert "12 rows" in text or "two.json" in text
    everything = conventions_of(
        "two.json", ["two.json", "table.csv", "book.xlsx"], ["x=gamma_deg", "sheet=second"]
    )
    assert everything == ["x=gamma_deg"]
    assert conventions_of(
        "book.xlsx", ["two.json", "table.csv", "book.xlsx"], ["x=gamma_deg", "sheet=second"]
    ) == ["sheet=second"]
    assert conventions_of("table.csv", ["two.json", "table.csv"], ["x=gamma_deg", "beta=centre"]) == [
        "beta=centre"
    ]
    assert conventions_of("table.csv", ["table.csv"], ["x=gamma_deg"]) == ["x=gamma_deg"]


def test_an_option_may_name_its_file(cli, files):
    given = (*FIGURE, "--axes", "one.json:A", "--dataset", "two.json:brass", "--pixels", "two.json:2")
    assert cli("fit", "one.json", "two.json", *given, "--fix", "e_n=0.9").returncode == 0
    whole = cli("fit", "one.json", "two.json", *FIGURE, "--fix", "e_n=0.9")
    assert whole.returncode == 2
    assert "--axes: one.json has points on the axes 'A', 'B'. Say which" in whole.stderr
    other = cli("fit", "one.json", "two.json", *FIGURE, "--axes", "A", "--fix", "e_n=0.9")
    assert other.returncode == 2
    assert "--axes 'A': two.json has the axes 'XY'" in other.stderr


def test_different_axes_of_different_files(cli, files):
    said = conventions_of(
        "two.json", ["one.json", "two.json"], ["y=one.json:e_n", "y=two.json:beta", "x=gamma_deg"]
    )
    assert said == ["y=beta", "x=gamma_deg"]
    absent = cli("fit", "one.json", "two.json", *FIGURE, "--axes", "table.csv:A")
    assert absent.returncode == 2
    assert (
        "--axes table.csv:A: table.csv is not among the data. They are one.json, two.json." in absent.stderr
    )
