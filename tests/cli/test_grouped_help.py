"""`--help` of the commands that put a question to data: groups, defaults, choices, width, colours."""

from __future__ import annotations

import re

import click
import pytest

from ifrfit.cli.main import app
from ifrfit.inference.option_fields import options_of
from ifrfit.inference.options import Model, Noise

COMMANDS = ("fit", "compare", "campaign", "cost")


def options(command: str) -> list[click.Option]:
    _, found, _ = app.resolve_command(click.Context(app), [command])
    return [each for each in found.params if each.param_type_name == "option" and each.name != "help"]


def sections(text: str) -> dict[str, str]:
    """Text under each heading."""
    parts = re.split(r"^(\w+):\n", text, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


@pytest.mark.parametrize("command", COMMANDS)
def test_options_stand_in_groups_each_once(cli, command: str) -> None:
    found = sections(cli(command, "--help").stdout)
    assert list(found) == ["Arguments", "Data", "Model", "Noise", "Method", "Output"]
    for each in options(command):
        flag = re.escape(each.opts[0])
        homes = [
            name
            for name, text in found.items()
            if re.search(rf"^  (-\w, )?{flag}\b(?!-)", text, re.MULTILINE)
        ]
        assert len(homes) == 1, flag


def test_a_group_is_that_of_the_class(cli) -> None:
    found = sections(cli("fit", "--help").stdout)
    assert [each.flag for each in options_of(Model).values() if each.flag not in found["Model"]] == []
    assert [each.flag for each in options_of(Noise).values() if each.flag not in found["Noise"]] == []
    assert {"--gamma-min", "--convention"} <= set(re.findall(r"--[\w-]+", found["Data"]))
    assert {"--out", "--json", "--quiet", "--strict"} <= set(re.findall(r"--[\w-]+", found["Output"]))


def test_every_option_with_a_value_says_its_default(cli) -> None:
    spoken = re.split(r"^  (?=--)", cli("fit", "--help").stdout, flags=re.MULTILINE)
    texts = {part.split()[0].rstrip(","): " ".join(part.split()) for part in spoken[1:]}
    silent = [
        each.opts[0]
        for each in options("fit")
        if not each.is_flag and each.name != "out" and "default: " not in texts[each.opts[0]]
    ]
    assert silent == []


@pytest.mark.parametrize("keyword", ["noise", "angle_errors", "integrator", "resample"])
def test_fixed_choices_are_all_named(cli, keyword: str) -> None:
    from ifrfit.inference.estimators import method_options

    option = (options_of(Noise) | method_options())[keyword]
    assert option.choices is not None
    assert [word for word in option.choices() if word not in option.help] == []


@pytest.mark.parametrize("width", [60, 80, 120])
def test_the_width_is_that_of_the_terminal(python, width: int) -> None:
    lines = python("-m", "ifrfit", "fit", "--help", COLUMNS=str(width)).stdout.splitlines()
    assert max(map(len, lines)) <= width
    assert max(map(len, lines)) > width - 15


def test_a_default_is_not_broken_in_two(cli) -> None:
    assert [line for line in cli("fit", "--help").stdout.splitlines() if line.endswith("[default:")] == []


def test_help_has_no_escape_sequences_with_or_without_no_color(cli, monkeypatch) -> None:
    plain = cli("fit", "--help").stdout
    monkeypatch.setenv("NO_COLOR", "1")
    assert cli("fit", "--help").stdout == plain
    assert "\x1b" not in plain


def test_names_may_stand_in_one_list(cli) -> None:
    fixed = ("fit", "cross-2019", "--series", "no spin", "--series", "spin 0.225", "--fix", "e_n=0.94")
    fixed += ("--method", "lsq")
    two = cli(*fixed, "--separate", "e_t", "--separate", "mu")
    one = cli(*fixed, "--separate", "e_t,mu")
    spaced = cli(*fixed, "--separate", "e_t, mu")
    assert two.returncode == 0
    assert one.stdout == two.stdout == spaced.stdout
    assert cli(*fixed, "--separate", "e_t,nu").returncode == 2


@pytest.mark.parametrize(
    ("command", "groups"),
    [
        (("simulate",), ["Arguments", "Method", "Output"]),
        (("predict",), ["Arguments", "Data", "Model", "Output"]),
        (("report",), ["Arguments", "Output"]),
        (("datasets", "install"), ["Arguments", "Data", "Output"]),
        (("datasets", "validate"), ["Arguments", "Data", "Output"]),
        (("datasets", "list"), ["Output"]),
    ],
)
def test_other_commands_have_groups_and_words_of_the_field_for_their_values(cli, command, groups) -> None:
    text = cli(*command, "--help").stdout
    assert list(sections(text)) == groups
    assert not re.search(r"<\w+|\bby default\b", text, re.IGNORECASE)
