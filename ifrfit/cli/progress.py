"""Progress at a terminal, silence anywhere else."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.status import Status


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
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn

    shown = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn())
    with Progress(*shown, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=None)

        def progress(done: int, most: int) -> None:
            words = f"{done:,} {of}, {most:,} at most"
            bar.update(task, description=words, completed=done, total=most)

        yield progress


def status(quiet: bool, what: str) -> contextlib.AbstractContextManager[Status | None]:
    """Show that work of unknown length goes on; None where nobody looks."""
    if quiet or not sys.stderr.isatty():
        return contextlib.nullcontext()
    from rich.console import Console

    return Console(stderr=True, highlight=False).status(what)
