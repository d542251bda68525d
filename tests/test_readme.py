"""What the README shows is what the package does."""

from __future__ import annotations

import csv
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib import pyplot

import ifrfit
from ifrfit.cli.main import app
from ifrfit.inference.model.prior_laws import read_law

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_fit_that_is_shown_is_the_fit_that_is_made():
    found = ifrfit.fit("cornell-glass")
    shown = re.search(r"    closure IFR.*?(?=\nWhat follows)", README, re.DOTALL)
    assert shown is not None
    lines = [line[4:].rstrip() for line in shown.group().rstrip().splitlines()]
    made = "\n".join(line.rstrip() for line in found.summary().splitlines())
    assert "\n".join(lines) in made
    assert "LOOK" not in made  # all well, as the README says of what follows


def test_it_is_short():
    assert len(README.splitlines()) <= 120


def test_the_shell_example_runs(impacts, tmp_path, monkeypatch):
    path = impacts(gamma=np.linspace(5, 85, 30), noise=0.03, sigma=0.03)
    monkeypatch.chdir(tmp_path)
    lines = re.findall(r"^    \$ (ifrfit .*)$", README.partition("## Your own table")[2], re.MULTILINE)
    assert len(lines) == 10
    runner = CliRunner()
    for line in lines:
        words = shlex.split(line.partition("#")[0].partition(">")[0])[1:]
        words = [str(path) if word == "my.csv" else word for word in words]
        words = [str(ROOT / word) if word.startswith("docs/") else word for word in words]
        found = runner.invoke(app, words)
        assert found.exit_code == 0, (line, found.output)


def test_the_first_example_is_real_and_says_what_reproduce_finds_in_the_authors_closure():
    first = re.search(r"\$ ifrfit fit (\S+)", README)
    assert first is not None
    assert first[1] == "cornell-glass"
    with (ROOT / "figures" / "constants.csv").open(encoding="utf-8", newline="") as file:
        found = {row["constant"]: row for row in csv.DictReader(file) if row["case"] == "cornell-glass-fr"}
    words = re.search(
        r"e_n (\S+), beta0 (\S+), mu (\S+); `make reproduce` finds (\S+), (\S+) and (\S+) in it", README
    )
    assert words is not None
    for name, printed, own in zip(
        ("e_n", "beta0", "mu"), words.groups()[:3], words.groups()[3:], strict=True
    ):
        assert printed.partition("(")[0] == found[name]["printed"]
        places = len(own.partition("(")[0].partition(".")[2])
        sd = round(float(found[name]["stderr"]) * 10**places)
        assert own == f"{float(found[name]['value']):.{places}f}({sd})"


def test_the_library_example_runs(impacts, tmp_path, monkeypatch):
    impacts(gamma=np.linspace(5, 85, 30), noise=0.03, sigma=0.03)  # writes impacts.csv
    monkeypatch.chdir(tmp_path)
    (example,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    names: dict[str, object] = {}
    exec(example, names)
    assert (tmp_path / "result.json").exists()
    assert names["fit"].constants["e_t"].status in ("determined", "one_sided")
    examples = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "python.md").read_text("utf-8"), re.DOTALL)
    assert len(examples) == 3
    for each in examples:
        exec(each, names)
    pyplot.close("all")


def test_the_table_of_priors_is_that_of_the_laws():
    page = (ROOT / "docs" / "priors.md").read_text("utf-8")
    for in_python, in_shell in re.findall(r"`(\w+\([^`]*\))` \| `--prior \w+=([a-z]+:[^`]*)`", page):
        law = eval(f"ifrfit.{in_python}")
        assert read_law(in_shell) == law
    assert len(re.findall(r"--prior \w+=[a-z]+:", page)) == 5


def test_every_file_that_is_linked_exists():
    links = re.findall(r"\]\(([^)#]+)\)", README)
    assert links
    for link in links:
        assert (ROOT / link).exists(), link


@pytest.mark.parametrize(
    "name", ["rebound", "fit", "read", "load_dataset", "load_result", "lmfit_model", "simulate"]
)
def test_the_public_names_are_there(name):
    assert callable(getattr(ifrfit, name))
    assert name in dir(ifrfit)
