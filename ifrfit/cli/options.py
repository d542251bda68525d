"""What options of several commands share: their forms, and how their text is read."""

from __future__ import annotations

import inspect
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, get_type_hints

import typer

from ifrfit.errors import UsageError

Repeated = list[str]
Data = Annotated[Repeated, typer.Argument(metavar="DATA...", help="Files, or names of bundled datasets.")]

_PAIRS = {"fix": "NAME=VALUE", "prior": "NAME=MEAN,SD", "bounds": "NAME=LO,HI"}


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


def choices_of(chosen: Mapping[str, Any]) -> dict[str, Any]:
    """Keywords of the library from options that are shared with `fit`."""
    found: dict[str, Any] = {
        name: pairs(f"--{name}", value, _PAIRS[name]) if name in _PAIRS else value
        for name, value in chosen.items()
    }
    if "angle_population" in found:
        found["angle_population"] = ends("--angle-population", found["angle_population"])
    return found


def with_options_of(
    model: Callable[..., None], shared: Sequence[str], own: Callable[..., None]
) -> Callable[..., None]:
    """Put shared options of one command before another's own, in the place of its keywords."""
    found = []
    for function, names in ((model, shared), (own, None)):
        hints = get_type_hints(inspect.unwrap(function), include_extras=True)
        parameters = inspect.signature(function).parameters
        for name in names or parameters:
            if parameters[name].kind is not inspect.Parameter.VAR_KEYWORD:
                kind = inspect.Parameter.KEYWORD_ONLY
                found.append(parameters[name].replace(annotation=hints[name], kind=kind))
    own.__signature__ = inspect.Signature(found)  # type: ignore[attr-defined]
    own.__annotations__ = {parameter.name: parameter.annotation for parameter in found}
    return own
