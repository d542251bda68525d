"""Fit the bundled datasets, draw each fit, and put their constants into one table."""

from __future__ import annotations

import csv
import tempfile
import textwrap
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path

from ifrfit.errors import UsageError
from ifrfit.inference.result import Estimate, FitResult
from ifrfit.report.cases import CASES, LEVEL, Case, Done, Line, chance, fit_case, held
from ifrfit.report.figures import plot
from ifrfit.report.provenance import contents
from ifrfit.report.regimes import joined
from ifrfit.report.rounding import alone, interval_text, places_of, spread, value_text
from ifrfit.report.style import save_figure
from ifrfit.report.words import QUIET_FACTS

TABLE = "constants.csv"
FORMATS = ("svg", "png")
WIDTH = 100


def reproduce(out: Path, *, progress: bool = False) -> str:
    """Fit every bundled dataset, draw the fits and tabulate their constants.

    Parameters
    ----------
    out : Path
        Folder for NAME.svg and NAME.png of each case and constants.csv; the same bytes on every run. What an
        earlier run left there is replaced, nothing else is touched.
    progress : bool
        Show a bar on standard error.

    Returns
    -------
    str
        The table of constants, at most 100 columns wide, with a line feed at its end.

    Raises
    ------
    UsageError
        If nothing can be written there, or a constants.csv of another make lies there.
    """
    out = Path(out)
    _check_free(out)
    existing = next(place for place in (out, *out.absolute().parents) if place.exists())
    try:
        with tempfile.TemporaryDirectory(dir=existing, prefix=".ifrfit-") as scratch:
            done = _run(Path(scratch), progress)
            out.mkdir(parents=True, exist_ok=True)
            written = _move(Path(scratch), out)
    except OSError as error:
        raise UsageError(
            f"{out}: cannot be written ({error.strerror or error}). Choose another folder with --out."
        ) from None
    figures = sum(name != TABLE for name in written) // len(FORMATS)
    return _text(done) + f"\nwritten: {out}/  {TABLE} and {figures} figures (svg and png)\n"


def _header() -> list[str]:
    return [field.name for field in fields(Line)]


def _check_free(out: Path) -> None:
    if out.exists() and not out.is_dir():
        raise UsageError(f"{out} is a file. Name a folder with --out.")
    table = out / TABLE
    if table.is_file():
        with table.open(encoding="utf-8", errors="replace") as file:
            ours = file.readline().startswith(",".join(_header()[:4]))
        if not ours:
            raise UsageError(f"{table} is not a table of this command. Choose another folder with --out.")


def _run(folder: Path, progress: bool) -> list[Done]:
    from rich.console import Console
    from rich.progress import Progress

    done = []
    with Progress(console=Console(stderr=True), transient=True, disable=not progress) as bar:
        task = bar.add_task("", total=len(CASES))
        for case in CASES:
            bar.update(task, description=case.name)
            found = fit_case(case)
            if found.result is not None:
                figure = plot(found.result)
                for suffix in FORMATS:
                    save_figure(figure, folder / f"{case.name}.{suffix}")
            done.append(found)
            bar.advance(task)
    with (folder / TABLE).open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(_header())
        writer.writerows([_cell(getattr(line, name)) for name in _header()] for d in done for line in d.lines)
    return done


def _cell(value: object) -> str:
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _move(scratch: Path, out: Path) -> list[str]:
    """Put the files in place, the table last; what an earlier run left without a successor goes."""
    names = sorted((path.name for path in scratch.iterdir()), key=lambda name: (name == TABLE, name))
    for name in names:
        (scratch / name).replace(out / name)
    for name in {f"{case.name}.{suffix}" for case in CASES for suffix in FORMATS} - set(names):
        (out / name).unlink(missing_ok=True)
    return names


_COLUMNS = f"  {'':<4} {'printed':>7} {'value':>9} {'sd':>7}  {'95 % interval':<18}  {'status':<14}  "
_WARNING = (
    "STAND-INS, generated from the constants the paper prints. That a fit recovers what was put in shows "
    "that the tool works; it says nothing about the experiments."
)


def _text(done: Sequence[Done]) -> str:
    """Write the table: data proper first, then what the user's own data could not give, then stand-ins."""
    blocks: dict[bool, list[str]] = {False: [], True: []}
    for d in done:
        if d.result is not None:
            blocks[d.stand_in].append(_block(d.case, d.result, d.lines, d.stand_in))
    kinds = dict.fromkeys(line.provenance for d in done if not d.stand_in for line in d.lines)
    parts = [f"DATA, {joined(list(kinds))}", *blocks[False]] if blocks[False] else []
    parts += [
        "\n".join(_wrapped(f"{d.case.name}: not fitted to your own data. {d.refusal}", ""))
        for d in done
        if d.refusal
    ]
    if blocks[True]:
        score = _score([line for d in done if d.stand_in for line in d.lines])
        parts += ["\n".join(_wrapped(_WARNING, "", "")), *blocks[True], score]
    return "\n\n".join(parts) + "\n"


def _score(lines: Sequence[Line]) -> str:
    hits, k = held(lines)
    words = (
        f"{hits} of {k} identifiable 95 % intervals hold the value put in; {LEVEL * k:.1f} are expected, and "
        f"{hits} or fewer have the binomial probability {chance(hits, k):.2g}. Seeds are hashes of the "
        "datasets' names. Constants of one fit share their data, so the count is only roughly binomial."
    )
    return "\n".join(_wrapped(words, "", ""))


def _block(case: Case, result: FitResult, lines: Sequence[Line], stand_in: bool) -> str:
    rows = [
        *_wrapped(f"{case.name}   {contents(result, result.inputs[0])}", "", "    "),
        *_wrapped(case.reason),
        _COLUMNS + ("put in" if stand_in else "reading"),
    ]
    estimates = result.flat_constants()
    for line in lines:
        found = estimates[line.constant]
        printed = "" if line.printed is None else alone(line.printed)
        span = "" if found.status == "fixed" else interval_text(found.interval95, places_of(found))
        sd = "-" if found.stderr is None or found.value is None else spread(found.stderr)
        rows.append(
            f"  {line.constant:<4} {printed:>7} {value_text(found):>9} {sd:>7}  {span:<18}  "
            f"{found.status.replace('_', ' '):<14}  {_recovery(line) if stand_in else _reading(line, found)}"
        )
    if not stand_in:
        rows += _wrapped(f"verdict: {_verdict(result)}")
    return "\n".join(rows)


def _wrapped(sentence: str, indent: str = "  ", hang: str = "    ") -> list[str]:
    return textwrap.wrap(
        sentence, WIDTH, initial_indent=indent, subsequent_indent=hang, break_on_hyphens=False
    )


def _recovery(line: Line) -> str:
    if line.status == "fixed":
        return "given to the fit"
    if line.recovers is None:
        return "not recovered"
    return "recovered" if line.recovers else "missed"


def _reading(line: Line, found: Estimate) -> str:
    if found.status == "fixed":
        return "given to the fit"
    if not line.lack_of_fit_ok:
        return "not valid, see verdict"
    if line.recovers is not None:
        return "agrees with print" if line.recovers else "differs from print"
    plain = {
        "determined": "found",
        "prior": "rests on the prior",
        "not_determined": "these data do not tell",
    }
    return plain.get(found.status, found.reason)


def _verdict(result: FitResult) -> str:
    failing = [fact.says for name, fact in result.facts.items() if not fact.ok and name not in QUIET_FACTS]
    return "; ".join(failing) or result.facts["lack_of_fit"].says
