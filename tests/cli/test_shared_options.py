"""Every option of `ifrfit fit` is one of `compare` and `cost`, or a stated exception."""

from __future__ import annotations

import pytest
import typer

from ifrfit.cli.main import app
from ifrfit.physics import CLOSURES

COMMANDS = typer.main.get_command(app).commands  # type: ignore[attr-defined]
ONE_METHOD = "a comparison is by exact posterior, and costs are of every method: neither takes one"
EXCEPTIONS = {
    "method": ONE_METHOD,
    "accuracy": ONE_METHOD,
    "budget": ONE_METHOD,
    "workers": ONE_METHOD,
    "max_steps": ONE_METHOD,
    "resume": ONE_METHOD,
    "resample": ONE_METHOD,
    "replicates": ONE_METHOD,
    "intervals": "puts the methods beside the fit's own; costs have all of them, a comparison has one",
}
EXCEPTIONS_OF = {
    "compare": EXCEPTIONS,
    "cost": {**EXCEPTIONS, "strict": "times and errors are no statement that could fail to converge"},
}
OWN = {"compare": {"loo"}, "cost": {"kind", "quick"}}


def options(command: str) -> dict[str, typer.core.TyperOption]:
    return {each.name: each for each in COMMANDS[command].params}


@pytest.mark.parametrize("command", ["compare", "cost"])
def test_every_option_of_fit_is_there_or_a_stated_exception(command: str) -> None:
    fit, other = options("fit"), options(command)
    assert set(fit) - set(other) == set(EXCEPTIONS_OF[command])
    assert set(other) - set(fit) == OWN[command]


@pytest.mark.parametrize("command", ["compare", "cost"])
def test_a_shared_option_is_written_alike(command: str) -> None:
    fit, other = options("fit"), options(command)
    for name in set(fit) & set(other):
        assert fit[name].opts == other[name].opts, name
        assert fit[name].metavar == other[name].metavar or name == "closure", name


def test_the_help_text_names_every_closure_of_the_package() -> None:
    text = str(options("fit")["closure"].help)
    assert all(name in text.replace(",", " ").rstrip(".").split() for name in CLOSURES)
