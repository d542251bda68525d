"""Whole texts as a user sees them; `assert_golden` says how to rewrite them.

A text that lists what is registered is asked for with the entries of `KEPT` alone: what is added to a
registry changes no text here, and is shown to be listed by the tests of plugins.

The error that the quadrature reached is a matter of the machine's last digit: it stands as 1e-?? here.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from factories import assert_golden

from ifrfit.inference.estimators import ESTIMATORS
from ifrfit.physics import CLOSURES
from ifrfit.physics.effects import EFFECTS

GOLDEN = Path(__file__).parent / "golden"
SCENES = Path(__file__).parents[2] / "docs" / "scenes"
TEXTS = {
    "help": ("--help",),
    "fit-help": ("fit", "--help"),
    "predict-help": ("predict", "--help"),
    "datasets-install-help": ("datasets", "install", "--help"),
    "kharaz": ("fit", "kharaz-2001", "--prior", "e_n=0.98,0.01"),
    "kharaz-oblique": ("fit", "kharaz-2001", "--prior", "e_n=0.98,0.01", "--gamma-min", "15"),
    "stand-in": ("fit", "cross-2019", "--fix", "e_n=0.94"),
    "least-squares": ("fit", "cross-2019", "--fix", "e_n=0.94", "--method", "lsq"),
    "bootstrap": ("fit", "cross-2019", "--fix", "e_n=0.94", "--method", "bootstrap", "--resample", "wild"),
    "beta-alone": ("fit", "cross-2019"),
    "separate": (
        "fit",
        "cross-2019",
        "--series",
        "no spin",
        "--series",
        "spin 0.225",
        "--separate",
        "mu",
        "--fix",
        "e_n=0.94",
        "--intervals",
    ),
    "accuracy": ("fit", "cross-2019", "--fix", "e_n=0.94", "--accuracy", "1e-3"),
    "campaign-help": ("campaign", "--help"),
    "compare-help": ("compare", "--help"),
    "compare": ("compare", "kharaz-2001", "--prior", "e_n=0.98,0.01", "--gamma-min", "15"),
    "compare-stand-in": ("compare", "cross-2019", "--fix", "e_n=0.94", "--no-loo"),
    "cost-help": ("cost", "--help"),
    "datasets-list": ("datasets", "list"),
    "datasets-show": ("datasets", "show", "kharaz-2001"),
    "datasets-show-stand-in": ("datasets", "show", "cross-2019"),
    "simulate-help": ("simulate", "--help"),
    "simulate-lateral-spin": ("simulate", str(SCENES / "lateral-spin.toml")),
    "simulate-wet-bead": ("simulate", str(SCENES / "wet-bead.toml"), "--samples", "20"),
    "template": ("template",),
    "template-raw": ("template", "--raw"),
}


KEPT = (
    (CLOSURES, ("f", "fr", "ifr", "ifr-contact", "maw")),
    (
        EFFECTS,
        ("lateral-spin", "viscoelastic", "plasticity", "adhesion", "compliance", "rolling", "fluid"),
    ),
    (ESTIMATORS, ("exact", "lsq", "profile", "mcmc", "bootstrap")),
)


@pytest.fixture(autouse=True)
def still(monkeypatch):
    """No time goes by for --accuracy and --budget, and nothing is registered beside `KEPT`."""
    monkeypatch.setattr("ifrfit.inference.accuracy.request.CLOCK", lambda: 0.0)
    for registry, names in KEPT:
        monkeypatch.setattr(registry, "_entries", {name: registry[name] for name in names})


@pytest.mark.parametrize("name", TEXTS)
def test_the_text_is_the_one_that_was_read_and_kept(cli, name):
    found = cli(*TEXTS[name])
    assert found.returncode == 0
    assert found.stderr == ""
    assert_golden(found.stdout, GOLDEN / f"{name}.txt")


def test_every_kept_text_is_still_asked_for():
    assert {path.stem for path in GOLDEN.iterdir()} == set(TEXTS)


@pytest.mark.parametrize("name", TEXTS)
def test_a_line_fits_a_terminal_and_nothing_trails(name):
    lines = (GOLDEN / f"{name}.txt").read_text(encoding="utf-8").splitlines()
    longest = 130 if name == "datasets-list" else 100  # a list has one dataset a line
    assert [line for line in lines if len(line) > longest and " " in line[:longest].strip()] == []
    assert [line for line in lines if line != line.rstrip()] == []
