"""`ifrfit campaign`: constants of thousands of groups, and of the population that they are drawn from."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from ifrfit.cli.completion import completer
from ifrfit.cli.grouped_help import DATA, METHOD
from ifrfit.cli.options import Scheduler, SharedCommand, Workers, command_line
from ifrfit.cli.output import Quiet, interrupted, say, working
from ifrfit.errors import UsageError

_WORK = "ifrfit.campaign.many_groups.plain_groups"  # of the workers


@partial(SharedCommand)
def campaign(
    question: dict[str, Any],
    by: Annotated[
        str,
        typer.Option(
            metavar="NAME,...",
            help="Columns that form the groups; 'file' is the name of the file.",
            rich_help_panel=DATA,
        ),
    ],
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Write campaign.json, results.parquet and index.html there.")
    ],
    method: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="exact, lsq or profile.",
            autocompletion=completer(lambda: ("exact", "lsq", "profile")),
            rich_help_panel=METHOD,
        ),
    ] = "exact",
    facts: Annotated[
        bool,
        typer.Option(
            "--facts/--no-facts",
            help="Look for slips, effects and lack of fit in each group.",
            rich_help_panel=METHOD,
        ),
    ] = True,
    workers: Workers = 1,
    scheduler: Scheduler = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with an unfinished campaign.", rich_help_panel=METHOD)
    ] = False,
    force: Annotated[
        bool,
        typer.Option(
            "--force", help="Replace an earlier campaign in DIR; without --resume an unfinished one, too."
        ),
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Constants of thousands of groups of impacts, and of the population they are drawn from."""
    from ifrfit.campaign.report.contents import CAMPAIGN, unfinished
    from ifrfit.data.table_folders import table_files
    from ifrfit.inference.workers.crews import crew_of
    from ifrfit.report.atomic_folder import check_free, standing

    if question.pop("scene") is not None:
        raise UsageError("--scene says what hit what in one experiment: leave it out of a campaign.")
    check_free(out, force=force, of=CAMPAIGN)
    table_files(list(map(Path, question["data"])))  # what is not there is said at once
    before = standing(out, CAMPAIGN)
    columns = [name.strip() for name in by.split(",") if name.strip()]
    try:
        with working(quiet, "reading", of="groups") as progress, crew_of(workers, scheduler, _WORK) as crew:
            # a second of imports, while the workers do theirs
            from ifrfit.campaign.report.folder import write_campaign
            from ifrfit.campaign.run import run_campaign

            found, written = run_campaign(
                question.pop("data"),
                columns,
                out,
                lambda done: write_campaign(done, out, force=force),
                method=method,
                facts=facts,
                crew=crew,
                resume=resume,
                force=force,
                command=command_line(),
                progress=progress,
                **question,
            )
    except KeyboardInterrupt:
        interrupted("What was found is kept: --resume goes on." if unfinished(out).exists() else "")
    if not quiet:
        from ifrfit.campaign.report.text import summary

        say(summary(found), out, written, before)
