"""`ifrfit compare`: closures side by side on the same impacts."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from ifrfit.cli.completion import completer
from ifrfit.cli.grouped_help import METHOD, MODEL
from ifrfit.cli.options import (
    Repeated,
    Scheduler,
    SharedCommand,
    Workers,
    are_streamed,
    command_line,
    words,
)
from ifrfit.cli.output import Quiet, Verbose, insist, interrupted, show, verbosely, working


def _closures() -> Iterable[str]:
    from ifrfit.physics.closures import CLOSURES

    return CLOSURES


@partial(SharedCommand, closure=False)
def compare(
    question: dict[str, Any],
    closure: Annotated[
        Repeated,
        typer.Option(
            metavar="NAME,...",
            help="Closures to compare.  [repeatable; default: all there are]",
            autocompletion=completer(_closures, "words"),
            rich_help_panel=MODEL,
        ),
    ] = [],  # noqa: B006
    loo: Annotated[
        bool,
        typer.Option(
            "--loo/--no-loo",
            help="Cross-validate by leaving impacts out; slower.",
            rich_help_panel=METHOD,
        ),
    ] = True,
    workers: Workers = 1,
    scheduler: Scheduler = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write compare.json, .svg and .png there.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an earlier comparison in DIR.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="compare.json on standard output, nothing else.")
    ] = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    strict: Annotated[
        bool,
        typer.Option(
            "--strict",
            help="Exit with 4 if an evidence did not converge, or a fact of the best closure fails (LOOK).",
        ),
    ] = False,
) -> None:
    """Closures side by side: which of them the data prefer."""
    from ifrfit.inference.comparison.compare import ComparisonInterrupted
    from ifrfit.inference.comparison.compare import compare as run
    from ifrfit.report.atomic_folder import check_free, standing
    from ifrfit.report.comparison.figure import COMPARISON, write_comparison

    if out is not None:
        check_free(out, force=force, of=COMPARISON)
    before = "" if out is None else standing(out, COMPARISON)
    stopped = ""
    try:
        of = "rows" if are_streamed(question["data"]) else "steps"
        with verbosely(verbose, quiet), working(quiet or as_json, "comparing", of) as progress:
            found = run(
                closures=words(closure) or None,
                loo=loo,
                workers=workers,
                scheduler=scheduler,
                command=command_line(),
                progress=progress,
                **question,
            )
    except KeyboardInterrupt as interrupt:
        if not isinstance(interrupt, ComparisonInterrupted):
            interrupted("")
        found, stopped = interrupt.so_far, str(interrupt)
    with working(quiet or as_json, "drawing"):
        written = write_comparison(found, out, force=force) if out is not None else []
    show(found, out, written, as_json=as_json, quiet=quiet, before=before)
    if stopped:
        interrupted(stopped.removeprefix("Interrupted: "))
    if strict:
        from ifrfit.report.comparison.text import findings

        insist([says for kind, says in findings(found) if kind == "LOOK"])
