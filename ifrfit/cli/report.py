"""The command that writes uncertainty reports of results."""

from __future__ import annotations

from pathlib import Path

import click

from ifrfit.cli.output import command, interrupted, quiet_option, working
from ifrfit.cli.parameters import PATH, argument, flag, option
from ifrfit.errors import UsageError


@argument("results", nargs=-1, required=True, type=PATH, metavar="RESULT.json...", help="Of ifrfit fit.")
@option(
    "--out",
    type=PATH,
    metavar="FILE|DIR",
    help="The report; with several results the folder for their reports and index.html.  "
    "[default: beside RESULT.json]",
)
@option(
    "--format",
    "form",
    metavar="NAME",
    help="html, md; any other word lists all.  [default: as FILE ends, else html]",
)
@flag("--force", help="Replace files that are no reports, too.")
@quiet_option
@command
def report(results: list[Path], out: Path | None, form: str | None, force: bool, quiet: bool) -> None:
    """Uncertainty report of a result: one self-contained page; of several results with an index."""
    if form is not None:
        from ifrfit.report.page.writing import check_format

        check_format(form, f"--format {form}")
    if len(results) > 1:
        written = _batch(results, out, form or "html", force, quiet)
    else:
        written = _single(results[0], out, form, force, quiet)
    if not quiet:
        click.echo(f"written: {written}")


def _single(path: Path, out: Path | None, form: str | None, force: bool, quiet: bool) -> str:
    from ifrfit.inference import load_result
    from ifrfit.inference.appraise import appraise
    from ifrfit.report import check_report, write_report

    if out is None:
        stem = "report" if path.stem == "result" else path.stem
        target = path.with_name(f"{stem}.{form or 'html'}")
    elif out.is_dir() or not out.suffix:
        target = out / f"report.{form or 'html'}"
    else:
        target = out
        if form is not None and target.suffix != f".{form}":
            raise UsageError(f"--out {out} does not end in .{form}, as --format says: change one of them.")
    check_report(target, force=force)
    result = load_result(path)
    with working(quiet, "drawing"):
        write_report(result, appraise(result), target, force=force)
    return str(target)


def _batch(paths: list[Path], out: Path | None, form: str, force: bool, quiet: bool) -> str:
    if out is None:
        raise UsageError("Several results need a folder for their reports: name it with --out.")
    from ifrfit.inference import load_result
    from ifrfit.inference.appraise import appraise
    from ifrfit.report.page import write_batch

    loaded = [(path, load_result(path)) for path in paths]
    told: list[str] = []
    try:
        with working(quiet, "drawing", "reports") as shown:

            def progress(name: str) -> None:
                if shown is not None and told:
                    shown(len(told), len(loaded))
                told.append(name)

            names = write_batch(loaded, appraise, out, suffix=form, force=force, progress=progress)
    except KeyboardInterrupt as interrupt:
        interrupted(str(interrupt))
    return f"{out}/  {names[0]} and {len(names) - 1} reports"
