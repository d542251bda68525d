"""The folder that holds the result of a fit."""

from __future__ import annotations

from pathlib import Path

from ifrfit.inference.appraisal import Appraisal
from ifrfit.inference.io.json_text import write_json
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.report.atomic_folder import Contents, deliver
from ifrfit.report.figures import plot
from ifrfit.report.page.writing import page
from ifrfit.report.style import save_svg_and_png

FIGURES = ("fit.svg", "fit.png")
CHAINS = "chains.npz"
REPORT = "report.html"
# chains of a run that was interrupted may lie alone
FIT = Contents(
    "result.json", (*FIGURES, CHAINS, REPORT), "result", {"result.json": '"ifrfit/', CHAINS: "schema.npy"}
)
RESULT = FIT.record


def write_folder(result: FitResult, appraisal: Appraisal | None, out: Path, *, force: bool) -> list[str]:
    """Write result.json, figures, report.html and the chains of mcmc into a folder, whole or not at all.

    Parameters
    ----------
    result : FitResult
    appraisal : Appraisal or None
        What was computed for the report; without it neither report nor figures are written.
    out : Path
        Folder; it is made if it is not there. Files in it that are not a fit's own are never touched.
    force : bool
        Replace an earlier result; what it left and this one does not write is removed.

    Returns
    -------
    list of str
        Names of the files written.

    Raises
    ------
    UsageError
        If the folder holds an earlier result and `force` is not given, or nothing can be written there.
    """
    return deliver(lambda folder: _fill(result, appraisal, folder), Path(out), FIT, force=force)


def _fill(result: FitResult, appraisal: Appraisal | None, folder: Path) -> list[str]:
    write_json(result.to_dict(), folder / RESULT)
    names = [RESULT]
    if appraisal is not None and len(result.points):
        names += save_svg_and_png(plot(result), folder, "fit")
        drawn = (folder / FIGURES[0]).read_text(encoding="utf-8")
        (folder / REPORT).write_text(page(result, appraisal, drawn), encoding="utf-8", newline="\n")
        names.append(REPORT)
    for name, own in result.files.items():
        own.save(folder / name)
        names.append(name)
    return names
