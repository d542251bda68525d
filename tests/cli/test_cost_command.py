"""`ifrfit cost` as a user runs it."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

CROSS = ("cost", "cross-2019", "--fix", "e_n=0.94", "--kind", "inference", "--quick")


@pytest.mark.usefixtures("brief_costs", "blank_pictures")
def test_contact_laws_and_precisions_stand_beside_one_another(cli):
    found = cli(
        "cost", "kharaz-2001", "--prior", "e_n=0.98,0.01", "--quick", "--out", "out",
        "--kind", "physics", "--kind", "arithmetic",
    )  # fmt: skip
    assert (found.returncode, found.stderr) == (0, "")
    text = " ".join(found.stdout.split())
    assert "physics: time an impact, and error of beta against the converged solution of Maw" in text
    assert "arithmetic: time an impact, and error against 50 digits; at e_n = 0.98" in text
    assert "Cheapest for an error of at most so much in beta" in text
    assert "Single precision keeps velocities and spins" in text
    assert "which is in none of the errors of physics" in text
    assert max(len(line) for line in found.stdout.splitlines() if "written:" not in line) <= 100
    table = pd.read_csv("out/cost.csv", keep_default_na=False)
    assert set(table["kind"]) == {"physics", "arithmetic"}
    arithmetic = table[table["kind"] == "arithmetic"]
    assert arithmetic[arithmetic["method"] == "50 digits"]["on_front"].all()
    names = {path.name for path in Path("out").iterdir()}
    assert names == {"cost.csv"} | {
        f"cost-{kind}.{suffix}" for kind in ("physics", "arithmetic") for suffix in ("svg", "png")
    }


@pytest.mark.usefixtures("brief_costs", "blank_pictures")
def test_json_is_all_that_is_printed(cli):
    found = cli(*CROSS, "--tails", "student-t", "--json", "--out", "out")
    assert (found.returncode, found.stderr) == (0, "")
    content = json.loads(found.stdout)
    assert content["schema"] == "ifrfit/cost/1"
    assert content["input"][0]["provenance"] == "stand-in"
    assert content["noise"]["scatter"]["tails"] == "student-t"
    methods = {row["method"] for row in content["costs"]}
    assert {"lsq", "exact"} <= methods  # chains only where they are fast enough
    out = {note.partition(" ")[0] for note in content["notes"] if " is left out: " in note}
    assert {"profile", "bootstrap"} <= out - methods
    table = pd.read_csv("out/cost.csv", keep_default_na=False)
    assert table["time_s"].tolist() == pytest.approx([row["time_s"] for row in content["costs"]], rel=1e-5)
    assert table["error"].tolist() == pytest.approx([row["error"] for row in content["costs"]], rel=1e-5)
    again = cli(*CROSS, "--out", "out")  # refused before anything is measured
    assert again.returncode == 2
    assert "holds an earlier measurement of costs; add --force" in again.stderr


def test_quiet_needs_a_folder(cli):
    found = cli(*CROSS, "--quiet")
    assert found.returncode == 2
    assert found.stderr == (
        "ifrfit: --quiet without --out leaves nothing of the measurement: add --out DIR.\n"
    )


@pytest.mark.parametrize(
    ("arguments", "status", "says"),
    [
        (("nix.csv",), 3, "there is neither a file nor a dataset of that name"),
        (("cross-2019", "--kind", "time"), 2, "--kind time: choose inference, physics or arithmetic."),
        (("cross-2019", "--closure", "brach"), 2, "brach"),
        (("cross-2019", "--angle-population", "0-90"), 2, "--angle-population 0-90: write it as LO,HI"),
        (("cross-2019", "--angle-errors", "set"), 3, "no row states an uncertainty of its angle or spin"),
        (
            (
                "cross-2019",
                "--fix",
                "e_n=0.94",
                "--fix",
                "e_t=-0.9",
                "--fix",
                "mu=0.1",
                "--kind",
                "inference",
            ),
            2,
            "Every constant is fixed: no method has anything to find.",
        ),
        (
            ("cross-2019", "--closure", "fr", "--bounds", "beta0=-1.5,1", "--kind", "inference"),
            2,
            "The exact posterior needs beta0 >= -1",
        ),
    ],
)
def test_impossible_calls_write_nothing(cli, arguments, status, says):
    found = cli("cost", *arguments, "--quick", "--out", "out")
    assert found.returncode == status
    assert says in found.stderr
    assert found.stdout == ""
    assert not Path("out").exists()
