"""Many results: a page each, and an index that compares them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ifrfit.errors import UsageError
from ifrfit.inference.appraisal import Appraisal
from ifrfit.inference.estimators import title_of
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Estimate
from ifrfit.report.page.blocks import Picture
from ifrfit.report.page.html import asset, fill
from ifrfit.report.page.sections.constants import draw_forest
from ifrfit.report.page.sortable_table import Cell
from ifrfit.report.page.writing import check_free, put, report_files, title, verdict
from ifrfit.report.provenance import is_stand_in, kinds_of, provenance_words
from ifrfit.report.sentences import (
    by_series,
    closure_title,
    headline,
    labelled,
    plus_minus,
    span_text,
    value_text,
)
from ifrfit.text import fixed

INDEX = "index.html"
_SAFE = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-"


@dataclass(frozen=True)
class Entry:
    """A result in a batch: its short name, the file of its page, and itself."""

    name: str
    file: str
    result: FitResult


def write_batch(
    results: Sequence[tuple[Path, FitResult]],
    appraise: Callable[[FitResult], Appraisal],
    folder: Path,
    *,
    suffix: str = "html",
    force: bool = False,
    progress: Callable[[str], None] = lambda name: None,
) -> list[str]:
    """Write a report of each result and an index that compares them.

    Parameters
    ----------
    results : sequence of (Path, FitResult)
        Each with the file it was read from, which gives it its name.
    appraise : callable
        Gives the appraisal of a result when its turn comes, and no appraisal is kept: they are large.
    folder : Path
    suffix : str
        Format of the single reports, see `ifrfit.report.page.registries.FORMATS`; the index is a page.
    force : bool
        Replace files that are not reports, too.
    progress : callable
        Told the name of each result before it is drawn.

    Returns
    -------
    list of str
        Names of the files, the index first.

    Raises
    ------
    UsageError
        If something else lies there, or nothing can be written.
    KeyboardInterrupt
        By Ctrl-C; the reports that were drawn until then are written, with an index of them.
    """
    entries = named_entries(results, suffix)
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder} is a file. Name a folder with --out.")
    for name in (INDEX, *(entry.file for entry in entries)):
        check_free(folder / name, force=force)
    files: dict[str, bytes] = {}
    drawn: list[Entry] = []
    try:
        for entry in entries:
            progress(entry.name)
            files |= report_files(entry.result, appraise(entry.result), entry.file)
            drawn.append(entry)
    except KeyboardInterrupt:
        if not drawn:
            raise
        put(folder, {INDEX: index(drawn).encode("utf-8"), **files}, force=force)
        raise KeyboardInterrupt(f"{len(drawn)} of {len(entries)} reports are in {folder}.") from None
    put(folder, {INDEX: index(entries).encode("utf-8"), **files}, force=force)
    return [INDEX, *(entry.file for entry in entries)]


def named_entries(results: Sequence[tuple[Path, FitResult]], suffix: str) -> list[Entry]:
    """Short names: the stem of the file, or its folder's name for a result.json; numbered if they repeat."""
    entries: list[Entry] = []
    taken = {"index"}
    for path, result in results:
        own = path.absolute().parent.name if path.stem == "result" else path.stem
        stem = "".join(character if character in _SAFE else "-" for character in own).strip(".-") or "result"
        unique = next(
            name
            for name in (stem, *(f"{stem}-{i}" for i in range(2, len(results) + 3)))
            if name.lower() not in taken
        )
        taken.add(unique.lower())
        entries.append(Entry(unique, f"{unique}.{suffix}", result))
    return entries


def index(entries: Sequence[Entry]) -> str:
    """The page that compares results: a table to sort, and a forest plot of each constant."""
    constants = list(dict.fromkeys(name for entry in entries for name in _constants(entry.result)))
    head = ("result", "data", "provenance", "closure", "method", "rows", *constants, "log evidence", "look")
    rows = [_row(entry, constants) for entry in entries]
    pictures = [_forest(name, entries, number) for number, name in enumerate(constants, 1)]
    return fill(
        "index.html.j2",
        script=asset("index.js"),
        title=f"{len(entries)} results compared",
        head=head,
        rows=rows,
        numbers=frozenset(range(5, 7 + len(constants))),
        pictures=[picture for picture in pictures if picture is not None],
        verdicts=[(entry, title(entry.result), verdict(entry.result)) for entry in entries],
        stand_in=any(is_stand_in(entry.result) for entry in entries),
    )


def _constants(result: FitResult) -> dict[str, list[tuple[str, Estimate]]]:
    """Estimates by constant, with the series where separate; kappa and beta in sticking beside them."""
    entries = {**result.constants, "kappa": result.derived.get("kappa")}
    found = {name: list(by_series(entry).items()) for name, entry in entries.items()}
    return {name: estimates for name, estimates in found.items() if estimates}


def _row(entry: Entry, constants: Sequence[str]) -> list[Cell]:
    result = entry.result
    kinds = dict.fromkeys(kind for source in result.inputs for kind in kinds_of(result, source))
    data = ", ".join(source.name for source in result.inputs)
    evidence = result.fit.log_evidence
    own = _constants(result)
    texts = (
        entry.name,
        data,
        provenance_words(tuple(kinds)),
        closure_title(result),
        title_of(result.method),
    )
    return [
        *(Cell(text, text) for text in texts),
        Cell(str(result.fit.n), repr(result.fit.n)),
        *(_estimates(own.get(name, [])) for name in constants),
        Cell("-", "") if evidence is None else Cell(fixed(evidence, 2), repr(evidence)),
        Cell(headline(result), headline(result)),
    ]


def _estimates(found: Sequence[tuple[str, Estimate]]) -> Cell:
    """One value, or the first of several with the number of the others."""
    if not found:
        return Cell("-", "")
    estimate = found[0][1]
    more = f" and {len(found) - 1} more" if len(found) > 1 else ""
    if estimate.value is None:
        return Cell(span_text(estimate) + more, "", _status(estimate))
    return Cell(plus_minus(estimate) + more, repr(estimate.value), _status(estimate))


def _label(entry: Entry, series: str) -> str:
    """A line of a forest plot: a stand-in says so there, too."""
    kind = " (stand-in)" if is_stand_in(entry.result) else ""
    return labelled(f"{entry.name}{kind}", series)


def _status(estimate: Estimate) -> str:
    return estimate.status.replace("_", " ")


def _forest(name: str, entries: Sequence[Entry], number: int) -> Picture | None:
    lines = [
        (_label(entry, series), estimate)
        for entry in entries
        for series, estimate in _constants(entry.result).get(name, [])
    ]
    if not any(estimate.status != "fixed" for _, estimate in lines):
        return None
    described = "; ".join(
        f"{label}: {value_text(estimate)}, 95 % {span_text(estimate)}" for label, estimate in lines
    )
    return Picture(f"forest-{number}", f"{name} in each result", f"{described}.", draw_forest(name, lines))
