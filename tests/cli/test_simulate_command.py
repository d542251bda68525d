"""`ifrfit simulate` as a user runs it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from json_schemas import validator

SCENES = Path(__file__).parents[2] / "docs" / "scenes"
LATERAL = SCENES / "lateral-spin.toml"


@pytest.fixture
def one_impact() -> Path:
    """A scene of a single impact, which has no figure."""
    text = LATERAL.read_text(encoding="utf-8")
    path = Path("scene.toml")
    path.write_text(text.replace("{ from = 0, to = 85, count = 18 }", "30"), encoding="utf-8")
    return path


def test_writes_a_folder_that_a_fit_reads_back(cli):
    text = LATERAL.read_text(encoding="utf-8").replace('"delta_deg", "lambda_deg"', '"e_n"')
    Path("scene.toml").write_text(text, encoding="utf-8")
    found = cli("simulate", "scene.toml", "--out", "one")
    assert (found.returncode, found.stderr) == (0, "")
    assert found.stdout.rstrip().endswith("simulation.svg  simulation.png")
    fitted = json.loads(cli("fit", "one/rebounds.csv", "--json").stdout)
    for name, truth in (("e_n", 0.9), ("e_t", -0.9), ("mu", 0.15)):
        low, high = fitted["constants"][name]["interval95"]
        assert low < truth < high, name
    assert fitted["input"][0]["provenance"] == "simulated"


def test_json_is_all_there_is(cli):
    found = cli("simulate", LATERAL, "--json")
    content = json.loads(found.stdout)
    assert content["plan"]["effects"][0]["effect"] == "lateral-spin"
    assert content["plan"]["effects"][0]["state"] == "on"
    assert found.stderr == ""
    assert list(Path().iterdir()) == []


def test_costs_are_measured_where_they_are_asked_for(cli, one_impact):
    found = cli("simulate", one_impact, "--cost", "--out", "one")
    assert (found.returncode, found.stderr) == (0, "")
    assert "closure alone, planar" in found.stdout
    assert found.stdout.rstrip().endswith("cost.csv  cost.svg  cost.png")
    content = json.loads(cli("simulate", one_impact, "--cost", "--json").stdout)
    validator("simulation").validate(content)
    assert list(content["cost"]["effects_ns"]) == [
        line["effect"] for line in content["plan"]["effects"] if line["value"] is not None
    ]
    assert "cost" not in json.loads(cli("simulate", one_impact, "--json").stdout)


def test_quiet_is_silent_and_an_earlier_simulation_is_replaced_only_by_force(cli, one_impact):
    found = cli("simulate", one_impact, "--quiet", "--out", "one")
    assert (found.returncode, found.stdout, found.stderr) == (0, "", "")
    assert Path("one/simulation.json").exists()
    again = cli("simulate", one_impact, "--out", "one")
    assert (again.returncode, again.stdout) == (2, "")
    assert "add --force" in again.stderr
    assert cli("simulate", one_impact, "--out", "one", "--quiet", "--force").returncode == 0


def test_a_refused_scene_is_3_and_nothing_is_written(cli):
    Path("scene.toml").write_text(LATERAL.read_text(encoding="utf-8").replace("mu = 0.15", "mu = -1"))
    found = cli("simulate", "scene.toml", "--out", "one")
    assert found.returncode == 3
    assert found.stderr == (
        "ifrfit: scene.toml: constants.mu: -1 is impossible (0 to 100 in SI units). Correct it.\n"
    )
    assert found.stdout == ""
    assert [path.name for path in Path().iterdir()] == ["scene.toml"]


@pytest.mark.parametrize(
    ("arguments", "status", "says"),
    [
        (("nix.toml",), 3, "there is no such file"),
        ((LATERAL, "--samples", 0), 2, "--samples 0: it must be 1 or more."),
        ((LATERAL, "--seed", -1), 2, "seed"),
        ((LATERAL, "--samples", 1_000_000), 2, "more than 2000000 impacts"),
    ],
)
def test_impossible_calls(cli, arguments, status, says):
    found = cli("simulate", *arguments)
    assert found.returncode == status
    assert says in found.stderr
    assert "Traceback" not in found.stderr
