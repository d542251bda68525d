"""What options of several commands share: their forms, and how their text is read."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from typing import Annotated, Any

import typer

from ifrfit.errors import UsageError

Repeated = list[str]
Data = Annotated[Repeated, typer.Argument(metavar="DATA...", help="Files, or names of bundled datasets.")]


def pairs(option: str, given: Sequence[str], form: str) -> dict[str, Any]:
    """NAME=VALUE, or NAME=A,B, as a dictionary."""
    numbers = form.count(",") + 1
    found: dict[str, Any] = {}
    for text in given:
        name, equals, rest = text.partition("=")
        try:
            values = [float(part) for part in rest.split(",")]
        except ValueError:
            values = []
        if not equals or len(values) != numbers:
            raise UsageError(f"{option} {text}: write it as {form}, with decimal points.")
        if name in found:
            raise UsageError(f"{option} {name} is given twice.")
        found[name] = values[0] if numbers == 1 else tuple(values)
    return found


def ends(option: str, text: str | None) -> tuple[float, float] | None:
    """LO,HI as two numbers."""
    if text is None:
        return None
    try:
        low, high = (float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"{option} {text}: write it as LO,HI, with decimal points.") from None
    return low, high


def numbers(option: str, text: str) -> list[float]:
    """Numbers from ``1,2,3`` or ``from:to:step``."""
    import numpy as np

    try:
        if ":" in text:
            low, high, step = (float(part) for part in text.split(":"))
            if not (step > 0.0 and high >= low and (high - low) / step < 1e6):
                raise ValueError
            return [float(x) for x in np.arange(low, high + 0.5 * step, step)]
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise UsageError(f"{option} {text}: write numbers as 10,20,30 or as FROM:TO:STEP.") from None


def command_line() -> str:
    """The command as text, for the record; file names that are no UTF-8 lose those bytes."""
    return shlex.join(["ifrfit", *sys.argv[1:]]).encode("utf-8", "replace").decode("utf-8")
