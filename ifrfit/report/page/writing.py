"""Reports as files: each appears whole or not at all, and nothing of others is overwritten."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ifrfit.errors import UsageError
from ifrfit.inference.appraisal import Appraisal
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.report.atomic_folder import Contents, deliver
from ifrfit.report.page.assembly import assemble
from ifrfit.report.page.html import render
from ifrfit.report.page.plugins import GENERATOR
from ifrfit.report.page.registries import FORMATS

Files = Mapping[str, bytes]


def page(result: FitResult, appraisal: Appraisal, figure: str | None = None) -> str:
    """The report of a fit as one HTML page; its figure as svg, if it has been drawn before."""
    return render(assemble(result, appraisal, figure))


def report_files(result: FitResult, appraisal: Appraisal, name: str) -> Files:
    """The files of a report, by the suffix of `name`: one, or with pictures beside it."""
    stem, _, suffix = name.rpartition(".")
    return FORMATS[suffix].write(assemble(result, appraisal), stem)


def write_report(result: FitResult, appraisal: Appraisal, path: Path, *, force: bool = False) -> list[str]:
    """Write the report of a result.

    Parameters
    ----------
    result : FitResult
        Of a fit, or read from a file.
    appraisal : Appraisal
        What was computed for the report.
    path : Path
        Its suffix is the format, see `ifrfit.report.page.registries.FORMATS`.
    force : bool
        Replace files that are not reports, too.

    Returns
    -------
    list of str
        Names of the files written.

    Raises
    ------
    UsageError
        For another suffix, where something else lies there, or where nothing can be written.
    """
    check_report(path, force=force)
    put(path.parent, report_files(result, appraisal, path.name), force=force)
    return [path.name]


def check_report(path: Path, *, force: bool = False) -> None:
    """Refuse a path where no report can be written, so that nothing is computed in vain.

    Raises
    ------
    UsageError
        If its suffix is no format of reports, or where something else lies there.
    """
    check_format(path.suffix.removeprefix("."), str(path))
    check_free(path, force=force)


def check_format(name: str, where: str) -> None:
    """Refuse what is no format of reports; `where` it was asked for begins the message.

    Raises
    ------
    UsageError
    """
    if name not in FORMATS:
        remedy = "print the page from a browser for a PDF" if name == "pdf" else "choose one of them"
        raise UsageError(f"{where}: a report is {', '.join(FORMATS)}; {remedy}.")


def check_free(path: Path, *, force: bool) -> None:
    """Refuse a path where something lies that is no report of ours, unless `force`.

    Raises
    ------
    UsageError
    """
    if path.is_dir():
        raise UsageError(f"{path} is a folder. Name a file with --out.")
    if force or not path.exists() or _is_ours(path):
        return
    raise UsageError(f"{path} is not a report of ifrfit; add --force to replace it, or choose another name.")


def _is_ours(path: Path) -> bool:
    """Whether a file is an earlier report: it says so itself, at its beginning."""
    with path.open("rb") as file:
        return GENERATOR.encode() in file.read(4096)


def put(folder: Path, files: Files, *, force: bool) -> None:
    """Put the files of reports into a folder, all of them prepared before the first is in place.

    Raises
    ------
    UsageError
        If one of the names is taken by a file of others, or nothing can be written.
    """
    if folder.is_dir():
        for name in files:
            if "/" not in name:
                check_free(folder / name, force=force)

    def fill(fresh: Path) -> list[str]:
        for name, content in files.items():
            (fresh / name).parent.mkdir(exist_ok=True)
            (fresh / name).write_bytes(content)
        return [*files]

    # the first is in place last: it never refers to a picture that is not there yet
    deliver(fill, folder, Contents(next(iter(files)), (), "report"), force=True)
