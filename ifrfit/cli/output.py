"""What a command says: text or JSON, the names of its files, an error in a sentence, that work goes on."""

from __future__ import annotations

import contextlib
import errno
import functools
import os
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, Protocol, TextIO

import click

from ifrfit.cli.parameters import flag
from ifrfit.cli.stop_signals import status_of_interrupt
from ifrfit.errors import DataError, IfrfitError, UsageError
from ifrfit.text import progress_words

if TYPE_CHECKING:
    from rich.progress import Progress
    from rich.status import Status


quiet_option = flag("--quiet", help="Say nothing but errors.")
verbose_option = flag(
    "--verbose",
    "-v",
    help="Say on standard error what was read, how columns were understood, and how long each part took.",
)
NOT_REACHED = 4  # exit status of --strict


def text_width() -> int:
    """Columns that a text may take: those of the terminal, at most 100; 80 where there is none."""
    return max(min(shutil.get_terminal_size((80, 24)).columns, 100), 40)


def fitting(usual: int) -> int:
    """The usual columns of a text, or as many as the terminal has where it goes to one."""
    return min(usual, text_width()) if _is_terminal(sys.stdout) else usual


def _is_terminal(stream: TextIO | None) -> bool:
    """Whether a stream leads to a terminal; one that was closed from the beginning is None."""
    return stream is not None and stream.isatty()


def of_width(text: Callable[[], str]) -> str:
    """A text, made for the width of the terminal where it goes to one, for 100 columns elsewhere."""
    if not _is_terminal(sys.stdout):
        return text()
    from ifrfit.report.terminal import as_wide_as

    with as_wide_as(text_width()):
        return text()


class Shown(Protocol):
    """A result that a command prints."""

    def summary(self) -> str:
        """For a terminal."""

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""


def show(
    found: Shown,
    out: Path | None,
    written: Sequence[str],
    *,
    as_json: bool,
    quiet: bool,
    more: Callable[[], str] = str,
    before: str = "",
) -> None:
    """Print a result: JSON and nothing else, or text with `more` and the names of the files, or nothing."""
    if as_json:
        from ifrfit.inference.io.json_text import dumps

        click.echo(dumps(found.to_dict()), nl=False)
    elif not quiet:
        say(of_width(lambda: found.summary() + more()), out, written, before)


def say(text: str, out: Path | None, written: Sequence[str], before: str = "") -> None:
    """Print a text, the names of the files, and what became of what lay there before."""
    click.echo(text)
    if written:
        click.echo(f"\nwritten: {out}/  {'  '.join(written)}")
    if written and before:
        click.echo(f"         {before}")


def insist(reasons: Sequence[str]) -> None:
    """Leave with status 4, saying why, if there is a reason."""
    if reasons:
        click.echo(f"ifrfit: --strict: {'; '.join(reason.rstrip('.') for reason in reasons)}.", err=True)
        raise click.exceptions.Exit(NOT_REACHED)


def interrupted(kept: str) -> NoReturn:
    """Leave as one does after Ctrl-C, saying what is kept."""
    click.echo(f"ifrfit: interrupted. {kept}".rstrip(), err=True)
    raise click.exceptions.Exit(status_of_interrupt()) from None


_NO_BUG = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.ENAMETOOLONG}


def said_of(error: Exception) -> str:
    """What the system did not do; empty for a bug, and where bugs are looked for."""
    if not isinstance(error, OSError) or error.errno not in _NO_BUG or os.environ.get("IFRFIT_DEBUG"):
        return ""
    where = "standard output" if error.filename is None else f"{os.fsdecode(error.filename):.60}"
    return f"ifrfit: {where}: {error.strerror}."


def command(function: Callable[..., None]) -> Callable[..., None]:
    """Turn errors raised on purpose into a sentence and an exit status, and a bug into a short notice."""

    @functools.wraps(function)
    def run(*args: Any, **kwargs: Any) -> None:
        try:
            function(*args, **kwargs)
        except IfrfitError as error:
            click.echo(f"ifrfit: {error.in_shell}", err=True)
            raise click.exceptions.Exit(error.exit_status) from None
        except BrokenPipeError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        except (click.exceptions.Exit, click.Abort):
            raise
        except Exception as error:
            if os.environ.get("IFRFIT_DEBUG"):
                raise
            if said := said_of(error):
                click.echo(said, err=True)
                is_no_file = getattr(error, "errno", None) == errno.ENAMETOOLONG
                raise click.exceptions.Exit(DataError.exit_status if is_no_file else 1) from None
            click.echo(
                f"ifrfit: internal error, {type(error).__name__}: {error}. "
                "This is a bug; IFRFIT_DEBUG=1 shows where it happened.",
                err=True,
            )
            raise click.exceptions.Exit(1) from None

    return run


@contextlib.contextmanager
def verbosely(verbose: bool, quiet: bool) -> Iterator[None]:
    """Say on standard error what the library reports of its work, if that is asked for.

    Raises
    ------
    UsageError
        If silence is asked for, too.
    """
    if not verbose:
        yield
        return
    if quiet:
        raise UsageError("--quiet says nothing and --verbose everything: keep one.")
    import logging

    class Echo(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            click.echo(f"ifrfit: {record.getMessage()}", err=True)

    log, handler, begin = logging.getLogger("ifrfit"), Echo(), time.perf_counter()
    level = log.level
    log.addHandler(handler)
    log.setLevel(logging.INFO)
    try:
        yield
        log.info("all in %.3f s", time.perf_counter() - begin)
    finally:
        log.removeHandler(handler)
        log.setLevel(level)


_PATIENCE = 1.0  # seconds that nothing is shown: short work needs no bar, nor the import of what draws it


@contextlib.contextmanager
def working(
    quiet: bool, what: str = "fitting", of: str = "steps", *, after: float = _PATIENCE
) -> Iterator[Callable[[int, int], None] | None]:
    """Show that work goes on, with its rate and the time left, on standard error if that is a terminal.

    Parameters
    ----------
    quiet : bool
        Whether nobody wants to see it.
    what, of : str
        What is done, and what is counted: "fitting", "steps".
    after : float
        Seconds until it is shown.

    Yields
    ------
    callable or None
        To be told the steps done and the most there may be; None where nobody looks.
    """
    if quiet or not _is_terminal(sys.stderr):
        yield None
        return
    bar = _Bar(what, of)
    timer = threading.Timer(after, bar.show)
    timer.daemon = True
    timer.start()
    try:
        yield bar.update
    finally:
        timer.cancel()
        bar.close()


class _Bar:
    """A line of progress that appears when it is asked to, from whichever thread."""

    def __init__(self, what: str, of: str) -> None:
        self._what = what
        self._of = of
        self._lock = threading.Lock()
        self._latest: tuple[int, int] | None = None
        self._first: tuple[int, float] | None = None
        self._shown: Progress | None = None
        self._closed = False

    def show(self) -> None:
        """Draw it from now on."""
        from rich.console import Console
        from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

        with self._lock:
            if self._closed:
                return
            columns = (
                SpinnerColumn(),
                TextColumn("{task.description}"),
                BarColumn(bar_width=20),
                TimeElapsedColumn(),
            )
            self._shown = Progress(*columns, console=Console(stderr=True), transient=True)
            self._shown.add_task(self._what, total=None)
            self._shown.start()
        if self._latest is not None:
            self.update(*self._latest)

    def update(self, done: int, most: int) -> None:
        """Tell how far it is."""
        self._latest, now = (done, most), time.monotonic()
        since, begin = self._first = self._first or (done, now)
        with self._lock:
            if self._shown is not None:
                words = progress_words(done, most, self._of, done - since, now - begin)
                told = f"{self._what}: {words}"
                self._shown.update(self._shown.task_ids[0], description=told, completed=done, total=most)

    def close(self) -> None:
        """Take it away."""
        with self._lock:
            self._closed = True
            if self._shown is not None:
                self._shown.stop()


def status(quiet: bool, what: str) -> contextlib.AbstractContextManager[Status | None]:
    """Show that work of unknown length goes on; None where nobody looks."""
    if quiet or not _is_terminal(sys.stderr):
        return contextlib.nullcontext()
    from rich.console import Console

    return Console(stderr=True, highlight=False).status(what)
