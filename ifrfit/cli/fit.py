"""`ifrfit fit`: one set of constants from tables of impacts."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ifrfit.cli.options import SharedCommand, are_streamed, command_line
from ifrfit.cli.output import (
    insist,
    interrupted,
    quiet_option,
    show,
    verbose_option,
    verbosely,
    working,
)
from ifrfit.cli.parameters import METHOD, PATH, flag, option
from ifrfit.errors import UsageError

if TYPE_CHECKING:
    from ifrfit.inference import FitResult


@partial(SharedCommand, methods=True, ties=True)
@flag(
    "--intervals",
    help="Compare intervals by covariance, profile and exact posterior.",
    group=METHOD,
)
@option("--out", type=PATH, metavar="DIR", help="Write result.json, figures and report.html there.")
@flag("--force", help="Replace an earlier result in DIR.")
@flag("--json", "as_json", help="result.json on standard output, nothing else.")
@quiet_option
@verbose_option
@flag("--strict", help="Exit with 4 if a constant is not determined, or a fact fails (LOOK).")
def fit(
    question: dict[str, Any],
    intervals: bool,
    out: Path | None,
    force: bool,
    as_json: bool,
    quiet: bool,
    verbose: bool,
    strict: bool,
) -> None:
    """Constants from tables of impacts, with uncertainties."""
    from ifrfit.inference.fit import fit as run

    if intervals and (as_json or quiet):
        raise UsageError(f"--intervals prints a table, {'--json' if as_json else '--quiet'} none: keep one.")
    streams = are_streamed(question["data"])
    if streams and intervals:
        raise UsageError(
            "--intervals: data that are not held in memory are put to one method at a time. Take --method "
            "exact, profile or lsq."
        )
    resume = getattr(question["method"], "resume", None)
    if resume is not None and out is None:
        out, force = Path(resume), True
    elif streams and out is not None and {"scheduler", "resume"} <= set(vars(question["method"])):
        # what is read is kept beside the results to be, so that the same command goes on with it
        question["method"] = replace(question["method"], resume=out)
    unfinished = _unfinished(out)
    if hasattr(question["method"], "keep"):
        question["method"] = replace(question["method"], keep=unfinished)
    before = ""
    if out is not None:
        from ifrfit.report.atomic_folder import check_free, standing
        from ifrfit.report.folder import FIT

        check_free(out, force=force, of=FIT)
        before = standing(out, FIT)
    try:
        with (
            verbosely(verbose, quiet),
            working(quiet or as_json, of="rows" if streams else "steps") as progress,
        ):
            result = run(**question, progress=progress, command=command_line())
            table = result.intervals() if intervals else None
            written = _write(result, out, force)
    except KeyboardInterrupt as interrupt:
        what = "read" if streams else "found"
        kept = f"What was {what} is kept: the same command goes on." if unfinished.is_dir() else ""
        interrupted(str(interrupt) or kept)

    def more() -> str:
        if table is None:
            return ""
        from ifrfit.report import side_by_side

        return f"\n\n{side_by_side(table)}"

    show(result, out, written, as_json=as_json, quiet=quiet, more=more, before=before)
    if hasattr(question["method"], "keep"):
        from ifrfit.inference.unfinished_run import remove_unfinished

        remove_unfinished(unfinished)
    if strict:
        open_ones = [name for name, found in result.flat_constants().items() if found.value is None]
        from ifrfit.report.sentences import failing_facts

        reasons = [f"{', '.join(open_ones)} not determined by the data"] if open_ones else []
        insist([*reasons, *(fact.says for fact in failing_facts(result).values())])


def _unfinished(out: Path | None) -> Path:
    """Where a run that is interrupted keeps what it found: beside its results, else here, by its command."""
    if out is not None:
        place = out.resolve()
        return place.with_name(f"{place.name}.unfinished")
    import hashlib  # `ifrfit --help` answers without

    return Path(f"ifrfit-{hashlib.sha256(command_line().encode()).hexdigest()[:8]}.unfinished")


def _write(result: FitResult, out: Path | None, force: bool) -> list[str]:
    if out is None:
        return []
    from ifrfit.inference.appraise import appraise
    from ifrfit.report import write_folder

    return write_folder(result, appraise(result), out, force=force)
