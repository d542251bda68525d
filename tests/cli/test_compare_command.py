"""`ifrfit compare`: options of `fit`, files, statuses and messages."""

from __future__ import annotations

import importlib
import json
from pathlib import Path

import pytest
from comparison_data import not_converged

QUICK = ("--no-loo", "--fix", "e_n=0.94", "--closure", "fr", "--closure", "ifr")


@pytest.fixture
def path(impacts):
    return impacts(gamma=range(5, 85, 5), sigma=0.03, noise=0.03, c=-0.85)


def test_loo_is_on_unless_it_is_declined(cli, path):
    only = ("--closure", "ifr", "--closure", "fr", "--fix", "e_n=0.94", "--json")
    assert json.loads(cli("compare", path, *only).stdout)["closures"]["ifr"]["loo"] is not None
    assert json.loads(cli("compare", path, *only, "--no-loo").stdout)["closures"]["ifr"]["loo"] is None


def test_options_of_fit_mean_the_same(cli, path):
    options = ("--gamma-min", "20", "--exclude", "12", "--noise", "scaled", "--prior", "mu=0.12,0.02")
    fitted = json.loads(cli("fit", path, "--closure", "fr", "--fix", "e_n=0.94", *options, "--json").stdout)
    compared = json.loads(cli("compare", path, *QUICK, *options, "--json").stdout)
    assert set(compared["closures"]) == {"fr", "ifr"}
    assert compared["command"].startswith("ifrfit")
    assert compared["closures"]["fr"]["fit"] == fitted["fit"]
    assert compared["closures"]["fr"]["constants"] == fitted["constants"]
    assert compared["input"] == fitted["input"]


@pytest.mark.usefixtures("blank_pictures")
def test_files_appear_and_are_kept(cli, path):
    found = cli("compare", path, *QUICK, "--out", "results/one")
    assert found.stdout.rstrip().endswith("written: results/one/  compare.json  compare.svg  compare.png")
    names = {p.name for p in Path("results/one").iterdir()}
    assert names == {"compare.json", "compare.svg", "compare.png"}
    again = cli("compare", path, *QUICK, "--out", "results/one")
    assert again.returncode == 2
    assert again.stderr == "ifrfit: results/one holds an earlier comparison; add --force to replace it.\n"
    assert cli("compare", path, *QUICK, "--out", "results/one", "--force").returncode == 0


def test_quiet_says_nothing(cli, path):
    found = cli("compare", path, *QUICK, "--quiet")
    assert (found.returncode, found.stdout, found.stderr) == (0, "", "")


@pytest.mark.parametrize(
    ("options", "status", "says"),
    [
        (("--closure", "ifr"), 2, "Only closure IFR is named, so there is nothing to compare it with."),
        (("--fix", "e_t"), 2, "--fix e_t: write it as NAME=VALUE"),
        (("--gamma-min", "89"), 3, "No row is left."),
    ],
)
def test_wrong_calls_leave_nothing(cli, path, options, status, says):
    found = cli("compare", path, "--no-loo", *options, "--out", "results")
    assert (found.returncode, found.stdout) == (status, "")
    assert says in found.stderr
    assert "Traceback" not in found.stderr
    assert list(Path().iterdir()) == []


def test_strict_is_4_where_an_evidence_did_not_converge(cli, path, monkeypatch):
    module = importlib.import_module("ifrfit.inference.comparison.compare")
    right = module.compare

    def loose(*arguments, **options):
        return not_converged(right(*arguments, **options), "fr")

    assert cli("compare", path, *QUICK, "--strict").returncode == 0
    monkeypatch.setattr(module, "compare", loose)
    found = cli("compare", path, *QUICK, "--strict")
    assert found.returncode == 4
    assert found.stderr == "ifrfit: --strict: FR: the quadrature reached 1e-2 only.\n"
    assert "VERDICT" in found.stdout
    assert cli("compare", path, *QUICK).returncode == 0
