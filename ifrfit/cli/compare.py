"""`ifrfit compare`: closures side by side on the same impacts."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

from ifrfit.cli.completion import completer
from ifrfit.cli.options import (
    SharedCommand,
    are_streamed,
    command_line,
    scheduler_option,
    words,
    workers_option,
)
from ifrfit.cli.output import (
    insist,
    interrupted,
    quiet_option,
    show,
    verbose_option,
    verbosely,
    working,
)
from ifrfit.cli.parameters import METHOD, MODEL, PATH, flag, option


def _closures() -> Iterable[str]:
    from ifrfit.physics.closures import CLOSURES

    return CLOSURES


@partial(SharedCommand, closure=False)
@option(
    "--closure",
    multiple=True,
    metavar="NAME,...",
    help="Closures to compare.  [repeatable; default: all there are]",
    complete=completer(_closures, "words"),
    group=MODEL,
)
@option(
    "--loo/--no-loo",
    default=True,
    help="Cross-validate by leaving impacts out; slower.",
    group=METHOD,
)
@workers_option
@scheduler_option
@option("--out", type=PATH, metavar="DIR", help="Write compare.json, .svg and .png there.")
@flag("--force", help="Replace an earlier comparison in DIR.")
@flag("--json", "as_json", help="compare.json on standard output, nothing else.")
@quiet_option
@verbose_option
@flag(
    "--strict",
    help="Exit with 4 if an evidence did not converge, or a fact of the best closure fails (LOOK).",
)
def compare(
    question: dict[str, Any],
    closure: list[str],
    loo: bool,
    workers: int,
    scheduler: str | None,
    out: Path | None,
    force: bool,
    as_json: bool,
    quiet: bool,
    verbose: bool,
    strict: bool,
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
