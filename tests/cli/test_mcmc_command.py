"""`ifrfit fit --method mcmc`: what is said, written, resumed and refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from json_schemas import validator

MCMC = ("fit", "cross-2019", "--fix", "e_n=0.94", "--method", "mcmc")
FILES = {"result.json", "fit.svg", "fit.png", "report.html", "chains.npz"}


def chains(folder: str) -> dict[str, np.ndarray]:
    with np.load(Path(folder) / "chains.npz", allow_pickle=False) as file:
        return {name: file[name] for name in file.files}


def converged(folder: str) -> dict[str, object]:
    content = json.loads((Path(folder) / "result.json").read_text())
    validator("result").validate(content)
    assert content["method"] == "mcmc"
    assert "emcee" in content["versions"]
    return dict(content["facts"]["converged"])


@pytest.mark.usefixtures("small_page")
def test_too_short_a_walk_says_so_and_can_be_resumed(cli):
    short = cli(*MCMC, "--max-steps", 60, "--out", "short", "--strict")
    assert short.returncode == 4
    assert short.stdout.startswith("LOOK  the estimator did not converge")
    told = " ".join(short.stdout.split())
    assert "the chains did not converge in 60 steps: the chain has" in told
    assert "for 50 wanted" in told
    assert "more steps would do: --resume DIR --max-steps" in told
    assert {path.name for path in Path("short").iterdir()} == FILES
    figures = converged("short")["figures"]
    assert "length" in figures["failed"]
    assert figures["steps"] == 60
    assert figures["steps_more"] > 0

    resumed = cli(*MCMC, "--resume", "short", "--strict")
    assert resumed.returncode == 0
    assert "4 ensembles of 64 walkers agree after" in resumed.stdout
    assert "written: short/" in resumed.stdout
    assert converged("short")["ok"]

    # the same rows and choices are asked for
    for options in (("--seed", "1"), ("--gamma-min", "20")):
        other_question = cli(*MCMC, *options, "--resume", "short")
        assert other_question.returncode == 2
        assert "these chains are of other data, choices or another seed" in other_question.stderr

    predicted = cli("predict", "short/result.json", "--gamma", "10,60")
    assert predicted.returncode == 0
    assert predicted.stdout.count("\n") == 3

    Path("short/chains.npz").write_bytes(b"junk")
    damaged = cli(*MCMC, "--resume", "short")
    assert damaged.returncode == 3
    assert "cannot be read as chains" in damaged.stderr


@pytest.mark.usefixtures("small_page")
@pytest.mark.parametrize(
    "whole", [("--max-steps", "90"), pytest.param((), marks=pytest.mark.long)], ids=["90 steps", "converged"]
)
def test_resumed_a_walk_is_the_long_one(cli, whole):
    assert cli(*MCMC, "--max-steps", 60, "--out", "short", "--quiet").returncode == 0
    assert cli(*MCMC, *whole, "--resume", "short", "--quiet").returncode == 0
    found = cli(*MCMC, *whole, "--out", "whole", "--quiet")
    assert (found.returncode, found.stdout, found.stderr) == (0, "", "")
    one, other = chains("short"), chains("whole")
    assert one.keys() == other.keys()
    assert all(np.array_equal(one[name], other[name]) for name in one)
    texts = [
        json.loads(Path(folder, "result.json").read_text())["constants"] for folder in ("short", "whole")
    ]
    assert texts[0] == texts[1]


@pytest.mark.usefixtures("small_page")
def test_an_earlier_result_is_not_replaced_unless_resumed(cli):
    assert cli(*MCMC, "--max-steps", 5, "--out", "out", "--quiet").returncode == 0
    assert cli(*MCMC, "--max-steps", 5, "--out", "out").returncode == 2
    assert cli("fit", "cross-2019", "--method", "lsq", "--out", "out", "--force").returncode == 0
    assert not Path("out/chains.npz").exists()  # they were not of this result


def test_all_fixed_leaves_nothing_to_sample(cli):
    fixed = ("--fix", "e_t=-0.9", "--fix", "mu=0.1", "--noise", "known")
    found = cli(*MCMC, *fixed)
    assert found.returncode == 2
    assert "there is nothing to sample" in found.stderr


@pytest.mark.long
def test_two_workers_from_the_command_line(cli, python):
    done = python("-m", "ifrfit", *MCMC, "--workers", "2", "--out", "two")
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert cli(*MCMC, "--out", "one", "--quiet").returncode == 0
    one, two = chains("one"), chains("two")
    assert all(np.array_equal(one[name], two[name]) for name in one)
