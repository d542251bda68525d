"""Help texts whose options stand in groups by what they are about, as wide as the terminal."""

from __future__ import annotations

import re

import click

from ifrfit.cli.parameters import DATA, METHOD, MODEL, NOISE, OUTPUT

_GROUPS = (DATA, MODEL, NOISE, METHOD, OUTPUT)

# a short default that stands in brackets is not broken into two lines
_DEFAULT = re.compile(r"\[[^][]{1,30}\]$")
_NO_BREAK = "\N{NO-BREAK SPACE}"

# lines longer than this are hard to read
WIDEST = {"max_content_width": 120}


class Command(click.Command):
    """A command whose help says what its arguments are."""

    def format_arguments(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write them under the heading that the groups of options have, too."""
        arguments = [each for each in self.get_params(ctx) if isinstance(each, click.Argument)]
        if arguments:
            with formatter.section("Arguments"):
                formatter.write_dl([each.get_help_record(ctx) for each in arguments])


class GroupedCommand(Command):
    """A command whose help has a section for each group of options, in a fixed order."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the groups."""
        groups: dict[str, list[tuple[str, str]]] = {name: [] for name in _GROUPS}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx)
            if record is not None and not isinstance(parameter, click.Argument):
                groups.setdefault(getattr(parameter, "group", OUTPUT), []).append(record)
        for name, records in groups.items():
            if records:
                with formatter.section(name):
                    formatter.write_dl(
                        [(first, _DEFAULT.sub(_unbroken, second)) for first, second in records]
                    )
        formatter.buffer[:] = [part.replace(_NO_BREAK, " ") for part in formatter.buffer]


def _unbroken(default: re.Match[str]) -> str:
    return default[0].replace(" ", _NO_BREAK)


class Group(click.Group):
    """Commands, listed in the order in which they are defined."""

    command_class = Command

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the commands."""
        return list(self.commands)
