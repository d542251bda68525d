"""What a command leaves: its text or JSON on standard output, and the names of its files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Protocol

import typer

Quiet = Annotated[bool, typer.Option("--quiet", help="Say nothing but errors.")]
NOT_REACHED = 4  # exit status of --strict


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
        typer.echo(f"ifrfit: --strict: {'; '.join(reasons)}.", err=True)
        raise typer.Exit(NOT_REACHED)
