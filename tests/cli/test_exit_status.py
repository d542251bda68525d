"""The contract's exit statuses: 0 result, 1 internal error, 2 usage, 3 data refused, 4 --strict."""

from __future__ import annotations

import json
import re
import signal
from pathlib import Path

import pytest


def sentence(outcome) -> str:
    """The message: on standard error alone, one or two sentences, without a traceback."""
    assert outcome.stdout == ""
    text = outcome.stderr.strip()
    assert "Traceback" not in text
    assert text.startswith("ifrfit: ")
    assert "\n" not in text
    ends = re.findall(r"[.!?](?=\s+['A-Z-]|$)", text)
    assert 1 <= len(ends) <= 3  # three where close names are offered
    return text.removeprefix("ifrfit: ")


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--closure", "walton"), "There is no closure 'walton'. Choose one of f, fr, ifr, ifr-contact"),
        (("--max-steps", "100"), "--max-steps belongs to --method mcmc, not to --method exact."),
        (("--fix", "e_n"), "--fix e_n: write it as NAME=VALUE"),
        (("--fix", "e_n=0,98"), "--fix e_n=0,98: write it as NAME=VALUE"),
        (("--fix", "e_n=high"), "--fix e_n=high: write it as NAME=VALUE"),
        (("--fix", "e_n=0.9", "--fix", "e_n=0.8"), "--fix e_n is given twice."),
        (("--prior", "e_n=0.98"), "--prior e_n=0.98: write it as NAME="),
        (("--gamma-min", "50", "--gamma-max", "20"), "--gamma-min 50 is above --gamma-max 20"),
        (("--convention", "angle=from-wall"), "kharaz-2001 is a dataset in the common schema"),
    ],
)
def test_a_wrong_call_is_2(cli, options, says):
    found = cli("fit", "kharaz-2001", *options)
    assert found.returncode == 2
    assert says in sentence(found)


@pytest.mark.parametrize(
    "arguments",
    [
        ("--nonsense",),
        ("fit",),
        ("fit", "kharaz-2001", "--unheard-of"),
        ("fit", "kharaz-2001", "--gamma-min", "steep"),
        ("fit", "kharaz-2001", "--seed", "-1"),
        ("frobnicate",),
        ("report", ""),
        ("predict", "result.json"),
        ("datasets", "install", "cross-2019"),
    ],
)
def test_what_the_command_line_does_not_know_is_2(cli, arguments):
    found = cli(*arguments)
    assert found.returncode == 2
    assert "Traceback" not in found.stderr
    assert found.stderr.rstrip().splitlines()[-1].startswith("Error: ")


def test_a_missing_file_is_3_and_close_names_are_offered(cli):
    found = cli("fit", "kharaz")
    assert found.returncode == 3
    assert "there is neither a file nor a dataset of that name. Did you mean kharaz-2001?" in sentence(found)


def test_a_name_too_long_is_3(cli):
    found = cli("fit", "a" * 5000)
    assert found.returncode == 3
    assert sentence(found) == f"{'a' * 60}: File name too long."


def test_an_empty_name_stands_for_no_data(cli):
    for command in (("fit", ""), ("campaign", "", "--by", "run", "--out", "found")):
        found = cli(*command)
        assert found.returncode == 2
        assert sentence(found).startswith("An empty name stands for no data.")


@pytest.mark.usefixtures("small_page")
@pytest.mark.parametrize("form", [(), ("--json",), ("--quiet",), ("--out", "kept")])
def test_strict_is_4_when_a_constant_is_not_determined_and_the_result_is_delivered(cli, impacts, form):
    path = impacts(gamma=range(5, 85, 5), sigma=0.01, noise=0.01)
    assert cli("fit", path, *form, *(("--force",) if form == ("--out", "kept") else ())).returncode == 0
    found = cli("fit", path, "--strict", *form, *(("--force",) if form == ("--out", "kept") else ()))
    assert found.returncode == 4
    assert found.stderr == "ifrfit: --strict: e_n, mu not determined by the data.\n"
    if form == ("--json",):
        assert json.loads(found.stdout)["constants"]["e_n"]["status"] == "not_determined"
    elif form == ("--quiet",):
        assert found.stdout == ""
    else:
        assert "kappa" in found.stdout
    assert Path("kept/result.json").exists() == (form == ("--out", "kept"))


def test_strict_is_0_when_everything_is_determined(cli, impacts):
    path = impacts(gamma=range(5, 85, 5), sigma=0.01, noise=0.01)
    found = cli("fit", path, "--strict", "--fix", "e_n=0.94")
    assert (found.returncode, found.stderr) == (0, "")


def test_strict_is_4_when_a_fact_fails_however_well_the_constants_come_out(cli):
    """chi2 of 1e7: values of no law, at a sigma that is far too small."""
    values = {10: 0.9, 20: -0.5, 30: 0.3, 40: -0.4, 50: 0.6, 60: -0.9, 70: 0.2, 80: 0.4}
    rows = "".join(f"{gamma},{beta},0.0005\n" for gamma, beta in values.items())
    Path("wild.csv").write_text(f"gamma_deg,beta,sigma\n{rows}", encoding="utf-8")
    asked = ("fit", "wild.csv", "--fix", "e_n=0.94", "--noise", "known")
    result = json.loads(cli(*asked, "--json").stdout)
    assert result["fit"]["chi2"] > 1e7
    assert not [name for name, c in result["constants"].items() if c["status"] == "not_determined"]
    found = cli(*asked, "--strict", "--quiet")
    assert (found.returncode, found.stdout) == (4, "")
    assert found.stderr.startswith("ifrfit: --strict: the data contradict one set of constants")


def test_strict_is_4_when_the_residuals_call_for_an_effect(cli):
    found = cli("fit", "kharaz-2001", "--prior", "e_n=0.98,0.01", "--strict", "--quiet")
    assert found.returncode == 4
    assert "the residuals call for tangential compliance" in found.stderr


def test_strict_lets_notes_pass(cli):
    """e_t lies near its bound, which its status tells."""
    asked = ("fit", "cross-2019", "--fix", "e_n=0.94")
    assert not json.loads(cli(*asked, "--json").stdout)["facts"]["at_bound"]["ok"]
    assert cli(*asked, "--strict", "--quiet").returncode == 0


@pytest.mark.parametrize(("options", "status"), [((), 4), (("--gamma-min", "30"), 0)])
def test_strict_comparison_insists_on_what_it_says_with_look(cli, options, status):
    asked = (
        "compare",
        "kharaz-2001",
        "--prior",
        "e_n=0.98,0.01",
        "--closure",
        "ifr,f",
        "--no-loo",
        *options,
    )
    said = cli(*asked)
    assert ("LOOK" in said.stdout) == (status == 4)
    found = cli(*asked, "--strict", "--quiet")
    assert found.returncode == status


@pytest.fixture
def broken(monkeypatch):
    """A bug in the library."""

    def fail(*_arguments: object, **_options: object) -> None:
        raise ZeroDivisionError("no such luck")

    monkeypatch.setattr("ifrfit.inference.fit.fit", fail)


@pytest.mark.usefixtures("broken")
def test_a_bug_is_1_and_told_without_a_traceback(cli):
    found = cli("fit", "kharaz-2001", "--out", "results")
    assert found.returncode == 1
    assert found.stdout == ""
    assert found.stderr.count("\n") == 1
    assert found.stderr.startswith("ifrfit: internal error, ZeroDivisionError: no such luck.")
    assert "IFRFIT_DEBUG=1" in found.stderr
    assert "Traceback" not in found.stderr
    assert list(Path().iterdir()) == []


@pytest.mark.usefixtures("broken")
def test_debug_shows_where_a_bug_is(cli, monkeypatch):
    monkeypatch.setenv("IFRFIT_DEBUG", "1")
    with pytest.raises(ZeroDivisionError, match="no such luck"):
        cli("fit", "kharaz-2001")


def test_debug_does_not_turn_bad_data_into_a_traceback(cli, monkeypatch):
    monkeypatch.setenv("IFRFIT_DEBUG", "1")
    assert cli("fit", "nix.csv").returncode == 3


@pytest.mark.parametrize(("stopped_by", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_command_that_keeps_nothing_leaves_as_stopped(
    python, stopped_by: signal.Signals, status: int
) -> None:
    found = python(
        "-c",
        "import os, signal, sys\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # a job in the background ignores it
        "from ifrfit.cli import main\n"
        "from ifrfit.data import convention_meanings as meanings\n"
        f"meanings.convention_lines = lambda width: os.kill(os.getpid(), {int(stopped_by)}) or []\n"
        "sys.argv = ['ifrfit', 'conventions']\n"
        "main.main()",
    )
    assert (found.returncode, found.stderr) == (status, "")


def test_what_is_no_whole_number_is_called_so(cli) -> None:
    found = cli("fit", "x.csv", "--seed", "1.5")
    assert found.returncode == 2
    assert "'1.5' is not a valid integer." in found.stderr
