"""`ifrfit fit`: one set of constants from tables of impacts."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ifrfit.cli.grouped_help import METHOD
from ifrfit.cli.options import SharedCommand, command_line
from ifrfit.cli.output import Quiet, insist, show, working
from ifrfit.errors import UsageError

if TYPE_CHECKING:
    from ifrfit.inference import FitResult


@partial(SharedCommand, methods=True)
def fit(
    question: dict[str, Any],
    intervals: Annotated[
        bool,
        typer.Option(
            "--intervals",
            help="Compare intervals by covariance, profile and exact posterior.",
            rich_help_panel=METHOD,
        ),
    ] = False,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write result.json, figures and report.html there.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an earlier result in DIR.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="result.json on standard output, nothing else.")
    ] = False,
    quiet: Quiet = False,
    strict: Annotated[
        bool,
        typer.Option("--strict", help="Exit with 4 if a constant is not determined, or a fact fails (LOOK)."),
    ] = False,
) -> None:
    """Constants from tables of impacts, with uncertainties."""
    from ifrfit.inference.fit import fit as run

    if intervals and (as_json or quiet):
        raise UsageError(f"--intervals prints a table, {'--json' if as_json else '--quiet'} none: keep one.")
    streams = _streams(question["data"])
    if streams and intervals:
        raise UsageError("--intervals: data that are not held in memory have no profiles. Leave it out.")
    resume = getattr(question["method"], "resume", None)
    if resume is not None and out is None:
        out, force = Path(resume), True
    elif streams and out is not None and hasattr(question["method"], "scheduler"):
        # what is read is kept beside the results to be, so that the same command goes on with it
        question["method"] = replace(question["method"], resume=out)
    if out is not None and not force:
        from ifrfit.report.atomic_folder import check_free
        from ifrfit.report.folder import FIT

        check_free(out, force=False, of=FIT)
    with working(quiet or as_json, of="rows" if streams else "steps") as progress:
        try:
            result = run(**question, progress=progress, command=command_line())
        except KeyboardInterrupt:
            kept = out is not None and out.with_name(f"{out.name}.unfinished").is_dir()
            more = " What was read is kept: the same command goes on." if kept else ""
            typer.echo(f"ifrfit: interrupted.{more}", err=True)
            raise typer.Exit(130) from None
        table = result.intervals() if intervals else None
        written = _write(result, out, force)
    more = ""
    if table is not None:
        from ifrfit.report import side_by_side

        more = f"\n\n{side_by_side(table)}"
    show(result, out, written, as_json=as_json, quiet=quiet, more=more)
    if strict:
        open_ones = [name for name, found in result.flat_constants().items() if found.value is None]
        from ifrfit.report.sentences import failing_facts

        reasons = [f"{', '.join(open_ones)} not determined by the data"] if open_ones else []
        insist([*reasons, *(fact.says for fact in failing_facts(result).values())])


def _streams(data: list[str]) -> bool:
    """Whether the data are not held in memory."""
    if len(data) != 1:
        return False
    from ifrfit.data.stream.files import is_stream

    return is_stream(Path(data[0]))


def _write(result: FitResult, out: Path | None, force: bool) -> list[str]:
    if out is None:
        return []
    from ifrfit.inference.appraise import appraise
    from ifrfit.report import write_folder

    return write_folder(result, appraise(result), out, force=force)
