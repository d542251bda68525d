"""Campaigns from files to folders, whatever the files hold."""

from __future__ import annotations

import html
import json
import math

import numpy as np
import pandas as pd
import pytest
from command_line import in_this_process as command
from factories import HEADER, impacts_text
from refusals import refused

import ifrfit
from ifrfit.campaign.report.folder import record
from ifrfit.campaign.report.page import page
from ifrfit.campaign.report.table import results_table
from ifrfit.campaign.report.text import summary
from ifrfit.campaign.run import run_campaign
from ifrfit.data.conventions import parse_conventions
from ifrfit.data.groups import GroupedFiles
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.options import AngleErrors, Model, Noise
from ifrfit.inference.workers.crews import crew_of

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


def run(path, out, deliver=lambda found: [], *, workers=1, **options):
    options = {"facts": False, **options}
    with crew_of(workers, None, "ifrfit.campaign.many_groups.plain_groups") as crew:
        return run_campaign([path], ["run"], out, deliver, crew=crew, **options)[0]


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
    with refused(UsageError, match="of other files"):  # the rows kept would be of none of its groups, and go
        run(campaign_file(tmp_path / "other.csv", runs=3), out, resume=True)
    fitted = []
    import ifrfit.campaign.many_groups.plain_groups as module

    monkeypatch.setattr(module, "fit_group", _counting(module.fit_group, fitted))
    again = run(path, out, resume=True)
    assert again.rows == whole.rows
    assert len(fitted) == 3
    assert not journal.exists()


@pytest.mark.parametrize("groups", [0, 3])
def test_an_interrupt_says_what_is_kept_where_something_was_found(tmp_path, monkeypatch, groups):
    path = campaign_file(tmp_path / "all.csv")
    every = list(GroupedFiles.groups(GroupedFiles((path,), ("run",), parse_conventions(()))))
    monkeypatch.setattr("ifrfit.campaign.run.groups_at_once", lambda _: 1)

    def interrupted(_):
        yield from every[:groups]
        raise KeyboardInterrupt

    monkeypatch.setattr(GroupedFiles, "groups", interrupted)
    found = command("campaign", str(path), "--by", "run", "--no-facts", "--out", str(tmp_path / "out"))
    kept = " What was found is kept: --resume goes on." if groups else ""
    assert (found.returncode, found.stdout, found.stderr) == (130, "", f"ifrfit: interrupted.{kept}\n")
    assert (tmp_path / "out.unfinished.jsonl").exists() == bool(groups)


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
    ("options", "said"),
    [
        ({"method": "mcmc"}, "--method mcmc: campaigns take exact, lsq, profile"),
        ({"method": "exact("}, r"--method exact\(: campaigns take exact, lsq, profile"),
        ({"workers": 0}, "1 or more"),
    ],
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
    shown = page(run(path, tmp_path / "out"))
    assert "<script>alert" not in shown
    assert "&lt;script&gt;alert(1)" in shown


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (
            {"model": Model(prior={"mu": (0.15, 0.03)})},
            "the prior of mu stands in the posterior of every group",
        ),
        ({"model": Model(prior={"mu": ifrfit.Uniform(0.0, 1.0)})}, "Leave --prior out for a population"),
        (
            {"model": Model(prior_from="soda-lime glass/smooth aluminium")},
            "Leave --prior-from out for a population",
        ),
        ({"noise": Noise(angles=AngleErrors(offset_sd=0.5))}, "Leave --angle-offset out for a population"),
        ({"model": Model(bounds={"mu": (0.0, 0.15)})}, "the bounds of mu cut what"),
    ],
)
def test_what_would_count_once_a_group_leaves_no_population(tmp_path, asked, said):
    """60 equal groups of mu = 0.2 and one prior of 0.15 +- 0.03 made a population of 0.186 +- 0.002."""
    found = run(campaign_file(tmp_path / "all.csv"), tmp_path / "out", **asked)
    assert found.populations == ()
    assert said in found.no_population
    assert found.no_population in summary(found)
    assert found.no_population in html.unescape(page(found))
    assert record(found)["no_population"] == found.no_population
    assert "there is no population to tell of" not in summary(found)


@pytest.mark.parametrize(
    "model",
    [Model(), Model(fix={"e_t": -0.7}), Model(bounds={"mu": (0.0, 1.5)}), Model(bounds={"mu": (0.0, 3.0)})],
)
def test_what_is_fixed_and_bounds_that_cut_nothing_leave_a_population(tmp_path, model):
    found = run(campaign_file(tmp_path / "all.csv"), tmp_path / "out", model=model)
    assert found.no_population == ""
    assert record(found)["no_population"] is None
    assert "mu" in {each.name for each in found.populations}


def test_a_group_of_another_population_is_named(tmp_path):
    """One e_n of 0.50 among eleven about 0.84 was pooled without a word."""
    rng = np.random.default_rng(1)
    truths = [{"e_n": rng.uniform(0.825, 0.861), "c": -0.7, "mu": 0.15} for _ in range(11)]
    lines = [
        line
        for place, truth in enumerate([*truths, {"e_n": 0.5, "c": -0.7, "mu": 0.15}])
        for line in lines_of(f"r{place}", place, **truth)
    ]
    path = tmp_path / "all.csv"
    path.write_text("\n".join([f"run,{HEADER}", *lines]) + "\n", encoding="utf-8")
    found = run(path, tmp_path / "out")
    assert {each.name: list(each.outlying) for each in found.populations} == {
        "e_n": [11], "e_t": [], "mu": [], "kappa": [11],
    }  # fmt: skip
    said = "e_n: not of the population of the others is r11 (p "
    assert said in summary(found)
    assert "make their campaign without them" in summary(found)
    assert said in html.unescape(page(found))
    (kept,) = record(found)["populations"]["e_n"]["not_of_the_population"]
    assert kept["group"] == ["r11"]
    assert kept["p_value"] < 1e-6
    assert record(found)["populations"]["mu"]["not_of_the_population"] == []


def test_an_end_of_a_domain_that_cuts_in_every_group_is_named(tmp_path):
    """Of 100 equal groups of e_t = -0.975 (errors 0.05) mu was 2.0 standard errors low, without a word."""
    lines = [line for place in range(30) for line in lines_of(f"r{place}", place, e_n=0.9, c=-0.985, mu=0.15)]
    path = tmp_path / "all.csv"
    path.write_text("\n".join([f"run,{HEADER}", *lines]) + "\n", encoding="utf-8")
    found = run(path, tmp_path / "out")
    said = "mu: the end -1 of the domain of e_t cuts what"
    assert said in summary(found)
    assert "or fix e_t where it is known" in summary(found)
    assert said in html.unescape(page(found))
    (cut,) = record(found)["populations"]["mu"]["cut_by_ends"]
    assert (cut["constant"], cut["end"]) == ("e_t", -1.0)
    assert cut["groups"] > 20
    plain = run(campaign_file(tmp_path / "plain.csv", runs=10), tmp_path / "plain")
    assert [each.cut for each in plain.populations] == [()] * 4
    assert "the end" not in summary(plain)


def test_groups_of_a_friction_so_high_that_nothing_slides_count_as_limits(tmp_path):
    """Left out, as they were, the median of 100 groups (sd 1 in log mu) was 1.6 standard errors low."""
    spread = np.exp(np.random.default_rng(2).normal(math.log(0.3), 0.8, 30))
    lines = [
        line
        for place, mu in enumerate(spread)
        for line in lines_of(f"r{place}", place, e_n=0.9, c=-0.7, mu=mu)
    ]
    path = tmp_path / "all.csv"
    path.write_text("\n".join([f"run,{HEADER}", *lines]) + "\n", encoding="utf-8")
    found = run(path, tmp_path / "out")
    mu = record(found)["populations"]["mu"]
    assert mu["limits"] > 0
    assert mu["groups"] + mu["limits"] + mu["left_out"] == 30
    assert f"{mu['groups']} of 30, {mu['limits']} as limits" in summary(found)
    assert f'<td class="number">{mu["limits"]}</td>' in page(found)
    low, high = mu["median_group"]["interval95"]
    assert low < math.exp(np.log(spread).mean()) < high
    assert record(found)["populations"]["e_n"]["limits"] == 0


def test_a_constant_that_hardly_any_group_determines_is_said_to_have_no_population(tmp_path):
    """Its row was not in the table, and nothing said why."""
    lines = [
        line
        for place in range(6)
        for line in lines_of(f"r{place}", place, e_n=0.9, c=-0.7, mu=0.15 if place < 2 else 4.0)
    ]
    path = tmp_path / "all.csv"
    path.write_text("\n".join([f"run,{HEADER}", *lines]) + "\n", encoding="utf-8")
    said = "mu: no population, as 4 of 6 groups give no more than a limit and 2 a value"
    found = run(path, tmp_path / "out")
    assert said in summary(found)
    assert said in html.unescape(page(found))
    fixed = summary(run(path, tmp_path / "fixed", model=Model(fix={"mu": 0.15})))
    assert "mu: 0 of 6" not in fixed


def test_of_three_groups_it_is_said_that_nothing_was_looked_at(tmp_path):
    found = run(campaign_file(tmp_path / "all.csv", runs=3), tmp_path / "out")
    assert (
        "Whether the groups are of one population in e_n, e_t, mu and kappa cannot be told from 3 groups."
        in (summary(found))
    )
    assert record(found)["populations"]["mu"]["not_of_the_population"] is None


def test_a_journal_line_that_cannot_be_read_is_fitted_anew_and_said(tmp_path):
    path, out = campaign_file(tmp_path / "all.csv"), tmp_path / "out"

    def full(found):
        raise UsageError("the disk is full")

    with refused(UsageError, match="full"):
        run(path, out, full)
    journal = tmp_path / "out.unfinished.jsonl"
    lines = journal.read_text(encoding="utf-8").splitlines()
    journal.write_text("\n".join([*lines[:2], lines[2][:30], *lines[3:]]) + "\n", encoding="utf-8")
    found = run(path, out, resume=True)
    assert found.rows == run(path, tmp_path / "fresh").rows
    assert "out.unfinished.jsonl: a line could not be read" in summary(found)
    assert "a line could not be read" in record(found)["unread"]


def test_an_empty_key_has_a_label(tmp_path):
    path = campaign_file(tmp_path / "all.csv")
    text = path.read_text(encoding="utf-8").replace("r1,", ",") + ",s,beta,30,0,0,oops,0.1\n"
    path.write_text(text.replace("r2,", "x,"), encoding="utf-8")
    found = run(path, tmp_path / "out")
    assert found.keys[1] == ("",)
    assert "(empty): " in summary(found)
    assert "<dt>(empty)</dt>" in page(found)
    path.write_text("\n".join(text.splitlines()[:-1]) + "\n", encoding="utf-8")
    html_of = page(run(path, tmp_path / "out"))
    assert '<td data-key="">(empty)</td>' in html_of
    assert "(empty): alone" in html_of


def test_a_campaign_without_a_group_that_can_be_fitted_is_refused(tmp_path, monkeypatch):
    """It was delivered, with status 0."""
    monkeypatch.chdir(tmp_path)
    lines = [f"run,{HEADER}", *(f"{run},s,beta,10,0,0,oops,0.1" for run in "ab")]
    (tmp_path / "all.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    done = command("campaign", "all.csv", "--by", "run", "--out", "res")
    assert done.returncode == 3
    assert done.stderr.startswith("ifrfit: All 2 groups failed, and nothing is written. a: all.csv, line 2")
    assert [each.name for each in tmp_path.iterdir()] == ["all.csv"]


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


def of_truths(path, truths):
    """A file of a group for each truth."""
    lines = [line for place, truth in enumerate(truths) for line in lines_of(f"r{place}", place, **truth)]
    path.write_text("\n".join([f"run,{HEADER}", *lines]) + "\n", encoding="utf-8")
    return path


def test_two_materials_in_one_campaign_are_named(tmp_path):
    """Ten groups of mu 0.10 and ten of 0.25 were one population of 0.05 to 0.5."""
    rng = np.random.default_rng(4)
    truths = [
        {"e_n": 0.85, "c": -0.7, "mu": (0.10, 0.25)[n % 2] * rng.uniform(0.96, 1.04)} for n in range(20)
    ]
    found = run(of_truths(tmp_path / "all.csv", truths), tmp_path / "out")
    two = {each.name: each.two for each in found.populations}
    assert two["e_n"] is None
    assert two["e_t"] is None
    assert two["mu"].sizes == (10, 10)
    said = "mu: two populations describe the groups better than one (p "
    for text in (summary(found), html.unescape(page(found))):
        assert said in text
        assert "make a campaign of each" in text
    kept = record(found)["populations"]
    assert kept["e_n"]["two_populations"] == {"p_value": None, "populations": []}
    assert kept["mu"]["two_populations"]["p_value"] < 1e-3
    lower, upper = kept["mu"]["two_populations"]["populations"]
    assert (lower["groups"], upper["groups"]) == (10, 10)
    assert lower["median_group"] == pytest.approx(0.10, rel=0.05)
    assert upper["median_group"] == pytest.approx(0.25, rel=0.05)
    table = results_table(found)
    assert (table["mu_upper_population"] > 0.5).tolist() == [n % 2 == 1 for n in range(20)]
    assert "e_n_upper_population" not in table


def test_the_table_says_which_groups_are_of_no_population(tmp_path):
    truths = [{"e_n": 0.85 + 0.002 * n, "c": -0.7, "mu": 0.15} for n in range(11)]
    truths.append({"e_n": 0.5, "c": -0.7, "mu": 0.15})
    found = run(of_truths(tmp_path / "all.csv", truths), tmp_path / "out")
    table = results_table(found)
    assert table["not_of_the_population"].tolist() == [""] * 11 + ["e_n, kappa"]
    (kept,) = record(found)["populations"]["e_n"]["not_of_the_population"]
    assert table["e_n_membership_p"].iloc[11] == kept["p_value"]
    assert (table["e_n_membership_p"].iloc[:11] > 0.001).all()
    shown = html.unescape(page(found))
    assert "not of the population in" in shown
    assert '<td data-key="e_n, kappa">' in shown
    clean = run(campaign_file(tmp_path / "clean.csv", runs=5), tmp_path / "other")
    assert "not of the population in" not in page(clean)
    assert results_table(clean)["not_of_the_population"].eq("").all()
    assert "is looked at from 10 groups on" in summary(clean)
    assert record(clean)["populations"]["mu"]["two_populations"] is None
