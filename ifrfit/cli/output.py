"""What a command says: text or JSON, the names of its files, an error in a sentence, that work goes on."""

from __future__ import annotations

import contextlib
import functools
import os
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Protocol

import typer

from ifrfit.errors import IfrfitError

if TYPE_CHECKING:
    from rich.status import Status


Quiet = Annotated[bool, typer.Option("--quiet", help="Say nothing but errors.")]
NOT_REACHED = 4  # exit status of --strict


def text_width() -> int:
    """Columns that a text may take: those of the terminal, at most 100; 80 where there is none."""
    return max(min(shutil.get_terminal_size((80, 24)).columns, 100), 40)


class Shown(Protocol):
    """A result that a command prints."""

    def summary(self) -> str:
        """For a terminal."""

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""


def show(
    found: Shown, out: Path | None, written: Sequence[str], *, as_json: bool, quiet: bool, more: str = ""
) -> None:
    """Print a result: JSON and nothing else, or text with `more` and the names of the files, or nothing."""
    if as_json:
        from ifrfit.inference.io.json_text import dumps

        typer.echo(dumps(found.to_dict()), nl=False)
    elif not quiet:
        say(found.summary() + more, out, written)


def say(text: str, out: Path | None, written: Sequence[str]) -> None:
    """Print a text and the names of the files."""
    typer.echo(text)
    if written:
        typer.echo(f"\nwritten: {out}/  {'  '.join(written)}")


def insist(reasons: Sequence[str]) -> None:
    """Leave with status 4, saying why, if there is a reason."""
    if reasons:
        typer.echo(f"ifrfit: --strict: {'; '.join(reason.rstrip('.') for reason in reasons)}.", err=True)
        raise typer.Exit(NOT_REACHED)


def command(function: Callable[..., None]) -> Callable[..., None]:
    """Turn errors raised on purpose into a sentence and an exit status, and a bug into a short notice."""

    @functools.wraps(function)
    def run(*args: Any, **kwargs: Any) -> None:
        try:
            function(*args, **kwargs)
        except IfrfitError as error:
            typer.echo(f"ifrfit: {error}", err=True)
            raise typer.Exit(error.exit_status) from None
        except BrokenPipeError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        except (typer.Exit, typer.Abort):
            raise
        except Exception as error:
            if os.environ.get("IFRFIT_DEBUG"):
                raise
            typer.echo(
                f"ifrfit: internal error, {type(error).__name__}: {error}. "
                "This is a bug; IFRFIT_DEBUG=1 shows where it happened.",
                err=True,
            )
            raise typer.Exit(1) from None

    return run


@contextlib.contextmanager
def working(
    quiet: bool, what: str = "fitting", of: str = "steps"
) -> Iterator[Callable[[int, int], None] | None]:
    """Show that work goes on, on standard error if that is a terminal.

    Yields
    ------
    callable or None
        To be told the steps done and the most there may be; None where nobody looks.
    """
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeRemainingColumn

    shown = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Progress(*shown, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=None)

        def progress(done: int, most: int) -> None:
            speed = bar.tasks[0].speed
            rate = f", {speed:,.0f} a second" if speed else ""
            words = f"{done:,} {of}, {most:,} at most{rate}"
            bar.update(task, description=words, completed=done, total=most)

        yield progress


def status(quiet: bool, what: str) -> contextlib.AbstractContextManager[Status | None]:
    """Show that work of unknown length goes on; None where nobody looks."""
    if quiet or not sys.stderr.isatty():
        return contextlib.nullcontext()
    from rich.console import Console

    return Console(stderr=True, highlight=False).status(what)
