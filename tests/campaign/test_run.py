"""Campaigns from files to folders, whatever the files hold."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
from command_line import in_this_process as command
from factories import HEADER, impacts_text
from refusals import refused

import ifrfit
from ifrfit.campaign.report.page import page
from ifrfit.campaign.report.text import summary
from ifrfit.campaign.run import run_campaign
from ifrfit.errors import DataError, UsageError

CONSTANTS = ("e_n", "e_t", "mu")


def lines_of(run: str, seed: int, **truth: float) -> list[str]:
    gamma = np.linspace(4.0, 80.0, 14)
    made = impacts_text(gamma, ("beta", "e_n"), seed=seed, noise=0.02, sigma=0.02, **truth)
    return [f"{run},{line}" for line in made]


def campaign_file(path, runs=4):
    rng = np.random.default_rng(5)
    lines = [
        line
        for run in range(runs)
        for line in lines_of(f"r{run}", run, e_n=rng.uniform(0.8, 0.95), c=-0.7, mu=rng.uniform(0.1, 0.2))
    ]
    path.write_text("\n".join([f"run,{HEADER}", *lines]) + "\n", encoding="utf-8")
    return path


def run(path, out, deliver=lambda found: [], **options):
    options = {"facts": False, **options}
    return run_campaign([path], ["run"], out, deliver, **options)[0]


def test_a_group_is_fitted_as_by_itself(tmp_path):
    path = campaign_file(tmp_path / "all.csv")
    found = run(path, tmp_path / "out", facts=True)
    table = pd.read_csv(path)
    for (key,), row in zip(found.keys, found.rows, strict=True):
        alone = tmp_path / "alone.csv"
        table[table["run"] == key].drop(columns="run").to_csv(alone, index=False)
        fit = ifrfit.fit(alone)
        for name in CONSTANTS:
            estimate = fit.constants[name]
            assert row[name] == estimate.value
            assert (row[f"{name}_lo95"], row[f"{name}_hi95"]) == estimate.interval95
            assert row[f"{name}_status"] == estimate.status
        assert row["p_value"] == fit.fit.p_value
        assert row["findings"] == ", ".join(name for name, fact in fit.facts.items() if not fact.ok)


def test_failures_are_named_and_stop_nothing(tmp_path):
    good = campaign_file(tmp_path / "good.csv")
    bad = tmp_path / "bad.csv"
    bad.write_text(
        f"run,{HEADER}\n"
        "text,s,beta,10,0,0,oops,0.1\n"
        "steep,s,beta,95,0,0,0.3,0.1\n"
        "empty,s,beta,10,0,0,,0.1\n"
        "r1,s,beta,10,0,0,nan,0.1\n"
        "one,s,beta,30,0,0,0.4,0.1\n",
        encoding="utf-8",
    )
    (tmp_path / "ugly.parquet").write_bytes(b"PAR1")
    found = run(tmp_path, tmp_path / "out")
    rows = {key[0]: row for key, row in zip(found.keys, found.rows, strict=True)}
    assert "not a number" in rows["text"]["failure"]
    assert "bad.csv, line 3" in rows["steep"]["failure"]
    assert "no row can be used" in rows["empty"]["failure"]
    assert {key: row["failure"] for key, row in rows.items() if key.startswith("r")} == dict.fromkeys(
        ("r0", "r1", "r2", "r3"), ""
    )
    assert [each.name for each in found.refused] == ["ugly.parquet"]
    clean = run(good, tmp_path / "clean")
    for key, row in zip(clean.keys, clean.rows, strict=True):
        assert rows[key[0]] | {"files": "", "rows": 0} == row | {"files": "", "rows": 0}
    text = summary(found)
    assert "8 groups by run: 5 fitted by exact, 3 failed." in text
    assert "failed: 3 groups" in text


def test_workers_change_no_number(tmp_path):
    path = campaign_file(tmp_path / "all.csv", runs=30)
    found = [run(path, tmp_path / "out", workers=workers) for workers in (1, 2)]
    assert found[0].rows == found[1].rows
    assert found[0].keys == found[1].keys


class KeyPressedError(Exception):
    """Stands for a key pressed in the middle."""


def test_an_interrupted_campaign_goes_on(tmp_path, monkeypatch):
    path, out = campaign_file(tmp_path / "all.csv", runs=30), tmp_path / "out"
    whole = run(path, tmp_path / "whole")

    def interrupt(done, most):
        if done == 27:
            raise KeyPressedError

    with pytest.raises(KeyPressedError):
        run(path, out, progress=interrupt)
    journal = tmp_path / "out.unfinished.jsonl"
    assert not out.exists()
    assert len(journal.read_text(encoding="utf-8").splitlines()) == 28
    with journal.open("a", encoding="utf-8") as more:
        more.write('{"key": ["r28"], "dig')  # a line that was cut off
    with refused(UsageError, match="--resume"):
        run(path, out)
    with refused(UsageError, match="something else"):
        run(path, out, resume=True, method="lsq")
    fitted = []
    import ifrfit.campaign.plain_groups as module

    monkeypatch.setattr(module, "fit_group", _counting(module.fit_group, fitted))
    again = run(path, out, resume=True)
    assert again.rows == whole.rows
    assert len(fitted) == 3
    assert not journal.exists()


def _counting(function, calls):
    def counted(*given):
        calls.append(given)
        return function(*given)

    return counted


def test_a_group_that_changed_meanwhile_is_fitted_again(tmp_path):
    path, out = campaign_file(tmp_path / "all.csv"), tmp_path / "out"

    def full(found):
        raise UsageError("the disk is full")

    with refused(UsageError, match="full"):
        run(path, out, full)
    lines = path.read_text(encoding="utf-8").splitlines()
    path.write_text("\n".join([*lines[:-1], *lines_of("r3", 9, e_n=0.5, c=-0.7, mu=0.1)]) + "\n")
    fresh = run(path, tmp_path / "fresh")
    assert run(path, out, resume=True).rows == fresh.rows


@pytest.mark.parametrize(
    ("options", "said"), [({"method": "mcmc"}, "campaigns take"), ({"workers": 0}, "1 or more")]
)
def test_what_is_refused(tmp_path, options, said):
    path = campaign_file(tmp_path / "all.csv", runs=1)
    with refused(UsageError, match=said):
        run(path, tmp_path / "out", **options)
    assert not (tmp_path / "out.unfinished.jsonl").exists()


def test_files_without_a_group(tmp_path):
    (tmp_path / "a.parquet").write_bytes(b"PAR1")
    with refused(DataError, match="no group"):
        run(tmp_path / "a.parquet", tmp_path / "out")
    assert list(tmp_path.iterdir()) == [tmp_path / "a.parquet"]


def test_the_page_escapes_what_came_from_a_file(tmp_path):
    path = tmp_path / "all.csv"
    campaign_file(path)
    text = path.read_text(encoding="utf-8").replace("r1,", "<script>alert(1)</script>,")
    path.write_text(text.replace("r2,", "$x^{2}$&amp;,"), encoding="utf-8")
    html = page(run(path, tmp_path / "out"))
    assert "<script>alert" not in html
    assert "&lt;script&gt;alert(1)" in html


def test_the_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    campaign_file(tmp_path / "all.csv")
    (tmp_path / "broken.parquet").write_bytes(b"PAR1")
    done = command("campaign", ".", "--by", "run", "--out", "res")
    assert done.returncode == 0, done.stderr
    assert "4 groups by run: 4 fitted by exact, 0 failed." in done.stdout
    assert "refused: 1 file" in done.stdout
    assert sorted(p.name for p in (tmp_path / "res").iterdir()) == [
        "campaign.json", "index.html", "results.parquet",
    ]  # fmt: skip
    table = pd.read_parquet(tmp_path / "res" / "results.parquet")
    assert table["run"].tolist() == ["r0", "r1", "r2", "r3"]
    assert table["mu_pooled"].between(table["mu"].min(), table["mu"].max()).all()
    assert table["failure"].eq("").all()
    kept = json.loads((tmp_path / "res" / "campaign.json").read_text(encoding="utf-8"))
    assert kept["populations"]["mu"]["groups"] == 4
    assert kept["refused_files"][0]["file"] == "broken.parquet"
    again = command("campaign", ".", "--by", "run", "--out", "res")
    assert again.returncode == 2
    assert "--force" in again.stderr
    assert command("campaign", "all.csv", "--by", "wall", "--out", "other").returncode == 2
    assert command("campaign", "none.csv", "--by", "run", "--out", "other").returncode == 3
    assert not (tmp_path / "other").exists()
    assert not list(tmp_path.glob("*.jsonl"))
