"""Help texts whose options stand in groups by what they are about, as wide as the terminal."""

from __future__ import annotations

import re
from typing import Any

from typer.core import TyperCommand

DATA, MODEL, NOISE, METHOD, OUTPUT = "Data", "Model", "Noise", "Method", "Output"
_GROUPS = (DATA, MODEL, NOISE, METHOD, OUTPUT)

# a short default that stands in brackets is not broken into two lines
_DEFAULT = re.compile(r"\[[^][]{1,30}\]$")
_NO_BREAK = "\N{NO-BREAK SPACE}"

# lines longer than this are hard to read
WIDEST = {"max_content_width": 120}


class GroupedCommand(TyperCommand):
    """A command whose help has a section for each group of options, in a fixed order.

    The group is what typer calls a panel (`rich_help_panel`); panels are drawn by rich, whose import alone
    takes longer than all of the help. What names no group is about the output.
    """

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments, then the groups."""
        arguments: list[tuple[str, str]] = []
        groups: dict[str, list[tuple[str, str]]] = {name: [] for name in _GROUPS}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx)
            if record is None:
                continue
            if parameter.param_type_name == "argument":
                arguments.append((record[0].split()[0], record[1]))  # without its type
            else:
                groups.setdefault(getattr(parameter, "rich_help_panel", None) or OUTPUT, []).append(record)
        for name, records in {"Arguments": arguments, **groups}.items():
            if records:
                with formatter.section(name):
                    formatter.write_dl(
                        [(first, _DEFAULT.sub(_unbroken, second)) for first, second in records]
                    )
        formatter.buffer[:] = [part.replace(_NO_BREAK, " ") for part in formatter.buffer]


def _unbroken(default: re.Match[str]) -> str:
    return default[0].replace(" ", _NO_BREAK)
