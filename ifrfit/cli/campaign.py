"""`ifrfit campaign`: constants of thousands of groups, and of the population that they are drawn from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ifrfit.cli.completion import completer
from ifrfit.cli.options import SharedCommand, command_line, scheduler_option, workers_option
from ifrfit.cli.output import interrupted, quiet_option, say, working
from ifrfit.cli.parameters import DATA, METHOD, PATH, flag, option
from ifrfit.errors import UsageError

_WORK = "ifrfit.campaign.many_groups.plain_groups"  # of the workers


@SharedCommand
@option(
    "--by",
    required=True,
    metavar="NAME,...",
    help="Columns that form the groups; 'file' is the name of the file.",
    group=DATA,
)
@option(
    "--out",
    required=True,
    type=PATH,
    metavar="DIR",
    help="Write campaign.json, results.parquet and index.html there.",
)
@option(
    "--method",
    default="exact",
    metavar="NAME",
    help="exact, lsq or profile.",
    complete=completer(lambda: ("exact", "lsq", "profile")),
    group=METHOD,
)
@option(
    "--facts/--no-facts",
    default=True,
    help="Look for slips, effects and lack of fit in each group.",
    group=METHOD,
)
@workers_option
@scheduler_option
@flag("--resume", help="Go on with an unfinished campaign.", group=METHOD)
@flag("--force", help="Replace an earlier campaign in DIR; without --resume an unfinished one, too.")
@quiet_option
def campaign(
    question: dict[str, Any],
    by: str,
    out: Path,
    method: str,
    facts: bool,
    workers: int,
    scheduler: str | None,
    resume: bool,
    force: bool,
    quiet: bool,
) -> None:
    """Constants of thousands of groups of impacts, and of the population they are drawn from."""
    from ifrfit.campaign.report.contents import CAMPAIGN, unfinished
    from ifrfit.data.table_folders import path_of, table_files
    from ifrfit.inference.workers.crews import crew_of
    from ifrfit.report.atomic_folder import check_free, standing

    if question.pop("scene") is not None:
        raise UsageError("--scene says what hit what in one experiment: leave it out of a campaign.")
    check_free(out, force=force, of=CAMPAIGN)
    table_files(list(map(path_of, question["data"])))  # what is not there is said at once
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
