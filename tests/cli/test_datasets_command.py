"""`ifrfit datasets`: a user's own digitisation in the place of a stand-in, and back."""

from __future__ import annotations

import json
from pathlib import Path

import pytest


@pytest.fixture
def own(impacts):
    """What a user read off the figure."""
    return impacts(gamma=range(5, 85, 5), sigma=0.02, series="no spin", name="figure3.csv")


def test_install_shows_everywhere_and_remove_brings_the_stand_in_back(cli, own, tmp_path):
    before = {
        words: cli(*words).stdout for words in (("datasets", "list"), ("datasets", "show", "cross-2019"))
    }
    fit = ("fit", "cross-2019", "--fix", "e_n=0.94")
    assert "STAND-IN" in cli(*fit).stdout

    installed = cli("datasets", "install", "cross-2019", own)
    assert (installed.returncode, installed.stderr) == (0, "")
    assert installed.stdout.startswith(f"cross-2019: {own} is used from now on, kept in {tmp_path / 'own'}")
    assert "'ifrfit datasets remove cross-2019' undoes it." in installed.stdout

    line = next(line for line in cli("datasets", "list").stdout.splitlines() if line.startswith("cross-2019"))
    assert "digitised (yours)" in line
    assert "stand-in" not in line
    shown = cli("datasets", "show", "cross-2019").stdout
    assert "digitised" in shown
    assert "figure3.csv" in shown
    fitted = cli(*fit).stdout
    assert "STAND-IN" not in fitted
    assert "generated" not in fitted
    assert "digitised" in fitted
    content = json.loads(cli(*fit, "--json").stdout)
    assert content["input"][0]["provenance"] == "digitised"

    removed = cli("datasets", "remove", "cross-2019")
    assert (removed.returncode, removed.stdout) == (0, "cross-2019: the bundled dataset is used again.\n")
    assert {words: cli(*words).stdout for words in before} == before
    assert "STAND-IN" in cli(*fit).stdout
    assert json.loads(cli(*fit, "--json").stdout)["input"][0]["provenance"] == "stand-in"


def test_install_takes_conventions_and_provenance(cli, tmp_path):
    path = tmp_path / "mine.csv"
    path.write_text("alpha_deg,beta\n80,0.4\n50,0.3\n30,-0.5\n", encoding="utf-8")
    refused = cli("datasets", "install", "buck-2017", path)
    assert refused.returncode == 3
    assert "from the wall or from its normal" in refused.stderr
    assert not (tmp_path / "own").exists()
    choice = ("--convention", "angle=from-wall", "--provenance", "measured")
    assert cli("datasets", "install", "buck-2017", path, *choice).returncode == 0
    kept = (tmp_path / "own" / "datasets" / "buck-2017" / "data.csv").read_text(encoding="utf-8")
    header, first, *_ = (line.split(",") for line in kept.splitlines())
    row = dict(zip(header, first, strict=True))
    assert (float(row["gamma_deg"]), row["provenance"]) == (10.0, "measured")


def test_validate_counts_what_is_in_a_file(cli, own):
    found = cli("datasets", "validate", own)
    assert (found.returncode, found.stderr) == (0, "")
    assert found.stdout == f"{own}: fine, 16 rows\n  no spin  beta  16\n"


def test_validate_names_the_first_fault(cli):
    Path("bad.csv").write_text("gamma_deg,beta\n10,0.4\n20,x\n", encoding="utf-8")
    found = cli("datasets", "validate", "bad.csv")
    assert (found.returncode, found.stdout) == (3, "")
    assert "bad.csv, line 3, column beta: 'x' is not a number." in found.stderr


def test_validate_takes_a_folder_that_install_made(cli, own, tmp_path):
    assert cli("datasets", "install", "cross-2019", own).returncode == 0
    found = cli("datasets", "validate", tmp_path / "own" / "datasets" / "cross-2019")
    assert (found.returncode, found.stderr) == (0, "")
    assert "fine, 16 rows" in found.stdout
