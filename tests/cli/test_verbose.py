"""`-v`: what was read and how, and how long it took, on standard error; `--quiet`: nothing."""

from __future__ import annotations

import json
import logging
import re
from pathlib import Path

import pytest

TABLE = "angle [rad];beta;sigma\n" + "".join(
    f"{a};{b};0,02\n"
    for a, b in (("0,2", "0,9"), ("0,5", "0,8"), ("0,9", "0,1"), ("1,1", "-0,4"), ("1,3", "-0,7"))
)
ASKED = ("fit", "t.csv", "--fix", "e_n=0.94", "--convention", "beta=opposite-sign")


@pytest.fixture(autouse=True)
def table() -> None:
    Path("t.csv").write_text(TABLE.replace("angle [rad]", "gamma_rad"), encoding="utf-8")


@pytest.mark.parametrize("flag", ["-v", "--verbose"])
def test_columns_rows_and_times_are_told_on_standard_error(cli, flag: str) -> None:
    plain, found = cli(*ASKED), cli(*ASKED, flag)
    assert plain.returncode == found.returncode == 0
    assert plain.stderr == ""
    assert found.stdout == plain.stdout
    lines = found.stderr.splitlines()
    assert all(line.startswith("ifrfit: ") for line in lines)
    assert "ifrfit: t.csv: column 'gamma_rad' is gamma (rad, from the normal)" in lines
    assert "ifrfit: t.csv: column 'beta' is beta (with the other sign)" in lines
    assert "ifrfit: t.csv: 5 of 5 rows are used" in lines
    assert re.search(r"closure IFR: optimum in \d+\.\d{3} s", found.stderr)
    assert re.fullmatch(r"ifrfit: all in \d+\.\d{3} s", lines[-1])


def test_json_stays_alone_on_standard_output(cli) -> None:
    found = cli(*ASKED, "--json", "-v")
    assert json.loads(found.stdout)["closure"] == "ifr"
    assert "rows are used" in found.stderr


def test_both_at_once_is_refused_and_nothing_is_left_behind(cli) -> None:
    found = cli(*ASKED, "--quiet", "-v")
    assert (found.returncode, found.stdout) == (2, "")
    assert found.stderr == "ifrfit: --quiet says nothing and --verbose everything: keep one.\n"
    cli(*ASKED, "-v")
    assert logging.getLogger("ifrfit").handlers == []


def test_quiet_says_nothing(cli) -> None:
    found = cli(*ASKED, "--quiet")
    assert (found.returncode, found.stdout, found.stderr) == (0, "", "")


def test_a_comparison_tells_each_closure(cli) -> None:
    found = cli("compare", *ASKED[1:], "--closure", "ifr,fr", "--no-loo", "-v")
    assert found.returncode == 0
    assert "closure IFR: exact in" in found.stderr
    assert "closure FR: exact in" in found.stderr
