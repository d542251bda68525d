"""Every option of `ifrfit fit` is one of `compare` and `cost`, or a stated exception."""

from __future__ import annotations

from collections.abc import Mapping

import click
import pytest

from ifrfit.cli.main import app
from ifrfit.inference.estimators import ESTIMATORS, method_options
from ifrfit.inference.model.error_law import ERROR_LAWS
from ifrfit.physics import CLOSURES

ONE_METHOD = "a comparison is by exact posterior, and costs are of every method: neither takes one"
EXCEPTIONS = {
    **dict.fromkeys(("method", *method_options()), ONE_METHOD),
    "tie": "known to least squares and mcmc alone",
    "intervals": "puts the methods beside the fit's own; costs have all of them, a comparison has one",
}
READS = ("workers", "scheduler")  # who reads data that are not held in memory
EXCEPTIONS_OF = {
    "compare": {name: why for name, why in EXCEPTIONS.items() if name not in READS},
    "cost": {**EXCEPTIONS, "strict": "times and errors are no statement that could fail to converge"},
}
OWN = {"compare": {"loo"}, "cost": {"kind", "quick"}}


def options(command: str) -> dict[str, click.Option]:
    """As they are looked up where the command is asked for."""
    _, found, _ = app.resolve_command(click.Context(app), [command])
    return {each.name: each for each in found.params if each.name != "help"}


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


@pytest.mark.parametrize(
    ("option", "names"), [("--closure", CLOSURES), ("--tails", ERROR_LAWS), ("--method", ESTIMATORS)]
)
def test_a_name_that_is_not_there_is_answered_with_all(cli, option: str, names: Mapping[str, object]) -> None:
    found = cli("fit", "cross-2019", option, "list")
    assert found.returncode == 2
    assert [
        name for name in names if name not in found.stderr.replace(",", " ").replace(".", " ").split()
    ] == []


def test_the_help_text_says_where_the_names_are() -> None:
    assert all("any other word lists all" in str(options("fit")[name].help) for name in ("closure", "tails"))
    assert [name for name in ESTIMATORS if name not in str(options("fit")["method"].help)] == []
