"""`ifrfit cost`: what accuracy costs in time, on the user's own data and machine."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ifrfit.cli.completion import completer
from ifrfit.cli.grouped_help import METHOD
from ifrfit.cli.options import Repeated, SharedCommand, command_line, words
from ifrfit.cli.output import Verbose, show, verbosely, working
from ifrfit.errors import UsageError


@SharedCommand
def cost(
    question: dict[str, Any],
    kind: Annotated[
        Repeated,
        typer.Option(
            metavar="KIND,...",
            help="inference, physics or arithmetic.  [repeatable; default: all three]",
            autocompletion=completer(lambda: ("inference", "physics", "arithmetic"), "words"),
            rich_help_panel=METHOD,
        ),
    ] = [],  # noqa: B006
    quick: Annotated[
        bool,
        typer.Option("--quick", help="Fewer settings and repeats: seconds.", rich_help_panel=METHOD),
    ] = False,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write cost.csv and the diagrams there.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace earlier costs in DIR.")] = False,
    as_json: Annotated[
        bool,
        typer.Option(
            "--json", help="cost.csv and what follows from it as JSON on standard output, nothing else."
        ),
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Say nothing but errors; needs --out.")] = False,
    verbose: Verbose = False,
) -> None:
    """What accuracy costs in time, measured now, on your data."""
    if quiet and out is None and not as_json:
        raise UsageError("--quiet without --out leaves nothing of the measurement: add --out DIR.")
    from ifrfit.cost.measure import measure_costs
    from ifrfit.cost.result import COSTS
    from ifrfit.report.atomic_folder import check_free, standing

    if out is not None:
        check_free(out, force=force, of=COSTS)
    before = "" if out is None else standing(out, COSTS)
    with verbosely(verbose, quiet), working(quiet or as_json, "measuring", "choices") as progress:
        found = measure_costs(
            kinds=words(kind),
            quick=quick,
            command=command_line(),
            progress=progress,
            **question,
        )
        written = found.save(out, force=force) if out is not None else []
    show(found, out, written, as_json=as_json, quiet=quiet, before=before)
