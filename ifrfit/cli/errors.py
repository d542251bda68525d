"""What a command does with an error: a sentence and an exit status, never a traceback."""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Callable
from typing import Any

import typer

from ifrfit.errors import IfrfitError


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
