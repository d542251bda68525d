"""`ifrfit cost`: what accuracy costs in time, on the user's own data and machine."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ifrfit.cli.completion import completer
from ifrfit.cli.options import SharedCommand, command_line, words
from ifrfit.cli.output import show, verbose_option, verbosely, working
from ifrfit.cli.parameters import METHOD, PATH, flag, option
from ifrfit.errors import UsageError


@SharedCommand
@option(
    "--kind",
    multiple=True,
    metavar="KIND,...",
    help="inference, physics or arithmetic.  [repeatable; default: all three]",
    complete=completer(lambda: ("inference", "physics", "arithmetic"), "words"),
    group=METHOD,
)
@flag("--quick", help="Fewer settings and repeats: seconds.", group=METHOD)
@option("--out", type=PATH, metavar="DIR", help="Write cost.csv and the diagrams there.")
@flag("--force", help="Replace earlier costs in DIR.")
@flag(
    "--json",
    "as_json",
    help="cost.csv and what follows from it as JSON on standard output, nothing else.",
)
@flag("--quiet", help="Say nothing but errors; needs --out.")
@verbose_option
def cost(
    question: dict[str, Any],
    kind: list[str],
    quick: bool,
    out: Path | None,
    force: bool,
    as_json: bool,
    quiet: bool,
    verbose: bool,
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
