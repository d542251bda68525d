"""`ifrfit import`: a figure becomes a table that every command reads, or nothing is written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from project_files import VALUES, as_json, version_4

import ifrfit


@pytest.fixture
def project() -> Path:
    path = Path("figure.json")
    path.write_bytes(as_json(version_4()))
    return path


def test_the_table_is_read_again_with_its_notes(cli, project):
    said = cli("import", project, "--x", "gamma_deg", "--y", "beta", "--out", "data.csv")
    assert (said.returncode, said.stderr) == (0, "")
    assert said.stdout.startswith("data.csv: 3 points of glass\n")
    assert "share the error of its calibration" in said.stdout
    text = Path("data.csv").read_text(encoding="utf-8")
    assert "# from figure.json, SHA-256 " in text
    found = ifrfit.read("data.csv")
    direct = ifrfit.read_figure(project, x="gamma_deg", y="beta")
    np.testing.assert_allclose(found.table[["gamma_deg", "value"]], VALUES, rtol=1e-9)
    columns = ["gamma_deg", "value", "sigma", "sigma_gamma_deg"]
    np.testing.assert_allclose(found.table[columns], direct.table[columns], rtol=1e-9)
    assert found.notes == direct.notes
    assert set(found.table["provenance"]) == {"digitised"}


def test_without_out_the_table_is_on_standard_output(cli, project):
    said = cli("import", project, "--x", "gamma_deg", "--y", "beta")
    assert said.stdout.count("\nglass,beta,") == 3


def test_nothing_is_replaced_unasked_and_nothing_left_of_a_refusal(cli, project):
    given = ("import", project, "--x", "gamma_deg", "--y", "beta", "--out", "data.csv")
    Path("data.csv").write_text("mine", encoding="utf-8")
    said = cli(*given)
    assert said.returncode == 2
    assert "--out data.csv: there is such a file already." in said.stderr
    assert Path("data.csv").read_text(encoding="utf-8") == "mine"
    assert cli(*given, "--force").returncode == 0
    Path("data.csv").unlink()
    project.write_bytes(project.read_bytes()[:-20])
    said = cli(*given)
    assert said.returncode == 3
    assert said.stderr.startswith("ifrfit: figure.json, line 1, character ")
    assert [each.name for each in Path().iterdir()] == ["figure.json"]


def test_fit_takes_a_project_with_the_same_options(cli, project):
    said = cli("fit", project, "--x", "gamma_deg", "--y", "beta", "--pixels", "2", "--fix", "e_n=0.9")
    assert said.returncode == 0, said.stderr
    assert "share the error of its calibration" in " ".join(said.stdout.split())
    said = cli("fit", project)
    assert said.returncode == 3
    assert "figure.json: is a project of WebPlotDigitizer. Say what its axes are" in said.stderr


def test_a_project_takes_the_place_of_a_stand_in(cli, project):
    said = cli(
        "datasets", "install", "cross-2019", project, "--convention", "x=gamma_deg", "--convention", "y=beta"
    )
    assert said.returncode == 0, said.stderr
    assert "digitised" in cli("datasets", "show", "cross-2019").stdout
    np.testing.assert_allclose(ifrfit.load_dataset("cross-2019").table["value"], VALUES[:, 1], rtol=1e-9)
