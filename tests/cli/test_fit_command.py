"""`ifrfit fit`: what stands on standard output and in the folder."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from json_schemas import strict_json, validator

import ifrfit

OWN = ["fit.png", "fit.svg", "report.html", "result.json"]
# of the run, not of the fit
PASSING = ("created", "command")
LSQ = ("--method", "lsq")


@pytest.mark.parametrize(
    "arguments",
    [
        ("kharaz-2001", "--prior", "e_n=0.98,0.01"),
        ("netl-glass-acrylic",),
        ("cross-2019", "--series", "no spin", "--series", "spin 0.225", "--separate", "mu", *LSQ),
        ("wang-2020", "--closure", "fr", *LSQ),
        ("buck-2017", "--closure", "f"),
    ],
)  # fmt: skip
def test_json_is_all_there_is_and_follows_the_schema(cli, arguments):
    found = cli("fit", *arguments, "--json")
    assert (found.returncode, found.stderr) == (0, "")
    content = strict_json(found.stdout)
    validator("result").validate(content)
    assert content["schema"] == "ifrfit/result/1"


def test_the_command_line_is_the_library(cli):
    shown = strict_json(
        cli("fit", "kharaz-2001", "--prior", "e_n=0.98,0.01", "--gamma-min", "15", "--json").stdout
    )
    called = ifrfit.fit("kharaz-2001", prior={"e_n": (0.98, 0.01)}, gamma_min=15.0).to_dict()
    for name in PASSING:
        shown.pop(name), called.pop(name)
    assert shown == json.loads(json.dumps(called))


@pytest.mark.parametrize("form", ["--json", "--quiet"])
def test_intervals_where_no_table_is_printed_are_refused(cli, form):
    found = cli("fit", "kharaz-2001", "--intervals", form)
    assert (found.returncode, found.stdout) == (2, "")
    assert found.stderr == f"ifrfit: --intervals prints a table, {form} none: keep one.\n"


def test_the_command_is_recorded(cli, monkeypatch):
    monkeypatch.setattr("sys.argv", ["/somewhere/ifrfit", "fit", "kharaz-2001", "--series", "a b"])
    content = strict_json(cli("fit", "kharaz-2001", "--json").stdout)
    assert content["command"] == "ifrfit fit kharaz-2001 --series 'a b'"


@pytest.mark.usefixtures("small_page")
def test_quiet_says_nothing_and_still_writes(cli):
    found = cli("fit", "kharaz-2001", "--quiet", "--out", "results")
    assert (found.returncode, found.stdout, found.stderr) == (0, "", "")
    assert sorted(path.name for path in Path("results").iterdir()) == OWN


@pytest.mark.usefixtures("small_page")
def test_json_and_out_are_the_same_numbers(cli):
    shown = cli("fit", "kharaz-2001", "--json", "--out", "results").stdout
    assert shown == Path("results/result.json").read_text(encoding="utf-8")


def test_an_earlier_result_is_refused_before_the_data_are_read(cli):
    Path("results").mkdir()
    Path("results/result.json").write_text("{}", encoding="utf-8")
    assert cli("fit", "nix.csv", "--out", "results").returncode == 2


@pytest.mark.usefixtures("small_page")
def test_refused_data_leave_an_earlier_result_alone_even_with_force(cli):
    assert cli("fit", "kharaz-2001", "--quiet", "--out", "results").returncode == 0
    earlier = Path("results/result.json").read_bytes()
    Path("bad.csv").write_text("gamma_deg,beta\n10,x\n", encoding="utf-8")
    assert cli("fit", "bad.csv", "--out", "results", "--force").returncode == 3
    assert Path("results/result.json").read_bytes() == earlier
    assert sorted(path.name for path in Path().iterdir()) == ["bad.csv", "results"]


def test_a_scene_says_what_hit_what(cli, impacts):
    data = impacts(gamma=[5.0, 15.0, 25.0, 40.0, 55.0, 70.0, 80.0], noise=0.01, sigma=0.01)
    scene = Path("scene.toml")
    bodies = '[sphere]\ndiameter_mm = 5\nmaterial = "alumina"\n[wall]\nmaterial = "soda-lime-glass"\n'
    scene.write_text(bodies, encoding="utf-8")
    content = strict_json(cli("fit", data, "--scene", scene, "--json").stdout)
    assert content["scene"]["origin"] == "scene.toml"
    assert {line["effect"] for line in content["effects"] if line["met"] is not None} == {"compliance"}
    assert "effects" not in strict_json(cli("fit", data, "--json").stdout)
    found = cli("compare", data, "--scene", scene, "--no-loo", "--closure", "ifr", "--closure", "fr")
    assert found.returncode == 0
    assert "by its conditions the scene calls for compliance: psi_1" in " ".join(found.stdout.split())


@pytest.mark.usefixtures("small_page")
def test_what_becomes_of_an_earlier_folder_is_said(cli):
    asked = ("fit", "cross-2019", "--fix", "e_n=0.94", "--method", "lsq", "--out", "results")
    first = cli(*asked)
    assert first.stdout.splitlines()[-1].startswith("written: results/")
    Path("results/notes.txt").write_text("mine")
    refused = cli(*asked)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert refused.stderr == "ifrfit: results holds an earlier result; add --force to replace it.\n"
    replaced = cli(*asked, "--force")
    assert replaced.returncode == 0
    assert replaced.stdout.splitlines()[-1].strip() == (
        "in the place of an earlier result; 1 other file there stays as before"
    )
    assert Path("results/notes.txt").read_text() == "mine"
    Path("results/result.json").write_text("{}")
    foreign = cli(*asked, "--force")
    assert foreign.returncode == 2
    assert "is not of ifrfit: it is not replaced, nor with --force" in foreign.stderr
    assert Path("results/result.json").read_text() == "{}"
