"""Arguments and options of commands: their group in the help text, and what a shell offers for them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

DATA, MODEL, NOISE, METHOD, OUTPUT = "Data", "Model", "Noise", "Method", "Output"


class _Named(click.Path):
    """Paths, of which an empty one is none."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The path."""
        if value == "":
            self.fail("an empty name is no file.", param, ctx)
        return super().convert(value, param, ctx)


PATH = _Named(path_type=Path)


class Whole(click.IntRange):
    """Whole numbers, which messages call so."""

    name = "integer"


NOT_NEGATIVE = Whole(min=0)

Complete = Callable[[str], list[str]]
_Function = TypeVar("_Function", bound=Callable[..., Any])


class Argument(click.Argument):
    """An argument; one that takes several words gives a list.

    Parameters
    ----------
    complete : callable or None
        Takes the beginning of a word and gives words for the shell to choose from; where none of them begins
        so, the shell offers files.
    """

    def __init__(self, *args: Any, complete: Complete | None = None, **more: Any) -> None:
        super().__init__(*args, shell_complete=_shell_complete(complete, files=True), **more)

    def process_value(self, ctx: click.Context, value: Any) -> Any:
        """The value that a command gets."""
        found = super().process_value(ctx, value)
        return found if self.nargs == 1 else list(found)


class GroupedOption(click.Option):
    """An option that stands in a group of the help text; one that is repeatable gives a list.

    Parameters
    ----------
    group : str
    complete : callable or None
        Takes the beginning of a word and gives words for the shell to choose from.
    """

    def __init__(
        self, *args: Any, group: str = OUTPUT, complete: Complete | None = None, **more: Any
    ) -> None:
        super().__init__(*args, shell_complete=_shell_complete(complete), **{"show_default": True} | more)
        self.group = group

    def process_value(self, ctx: click.Context, value: Any) -> Any:
        """The value that a command gets."""
        found = super().process_value(ctx, value)
        return list(found) if self.multiple else found


def argument(*names: str, **more: Any) -> Callable[[_Function], _Function]:
    """Decorate a command with an `Argument`; the keywords are its own and those of click."""
    return click.argument(*names, cls=Argument, **more)


def option(*names: str, **more: Any) -> Callable[[_Function], _Function]:
    """Decorate a command with a `GroupedOption`; the keywords are its own and those of click."""
    return click.option(*names, cls=GroupedOption, **more)


def flag(*names: str, **more: Any) -> Callable[[_Function], _Function]:
    """Decorate a command with an option that takes no value."""
    return option(*names, is_flag=True, **more)


def _shell_complete(complete: Complete | None, *, files: bool = False) -> Any:
    if complete is None:
        return None

    def offered(ctx: click.Context, parameter: click.Parameter, incomplete: str) -> Any:
        from click.shell_completion import CompletionItem

        found = [CompletionItem(word) for word in complete(incomplete) if word.startswith(incomplete)]
        return found or ([CompletionItem(incomplete, type="file")] if files else [])

    return offered
