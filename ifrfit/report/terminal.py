"""The findings of a fit, and intervals of three methods, as text for a terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

from ifrfit.errors import UsageError
from ifrfit.inference.diagnostics.interval_disagreements import disagreements
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Interval
from ifrfit.report.constants_rows import Row, table_rows
from ifrfit.report.provenance import STAND_IN, contents, kinds_of, left_out, provenance_sentences, reference
from ifrfit.report.regimes import regime_lines
from ifrfit.report.sentences import (
    assumed_line,
    effort_line,
    findings,
    headline,
    misfit_line,
    model_line,
    places_of,
    value_text,
)
from ifrfit.text import decimals, interval_ends, interval_text, sd_text

if TYPE_CHECKING:
    import pandas as pd

_WIDTH: ContextVar[int] = ContextVar("width", default=100)
METHODS = ("covariance", "profile", "exact")
_SDS = 4.0  # an interval of 95 % is about four standard deviations wide


def text_width() -> int:
    """Columns that texts may take."""
    return _WIDTH.get()


@contextmanager
def as_wide_as(columns: int) -> Iterator[None]:
    """Write texts for a terminal of so many columns, of which no more than 100 are taken."""
    token = _WIDTH.set(max(60, min(columns, 100)))
    try:
        yield
    finally:
        _WIDTH.reset(token)


def summary(result: FitResult, style: str = "text") -> str:
    """Findings of a fit as text.

    Parameters
    ----------
    result : FitResult
    style : {"text", "markdown", "latex"}
        text: for a terminal, at most 100 columns. markdown, latex: a table to paste into a paper, with the
        provenance of the data and what needs attention under it (LaTeX needs no package).

    Returns
    -------
    str
        Values with two significant digits of their uncertainty; ends without a line feed.

    Raises
    ------
    UsageError
        For any other style.
    """
    if style == "text":
        return text(result)
    from ifrfit.report.tables import latex, markdown

    styles: dict[str, Callable[[FitResult], str]] = {"markdown": markdown, "latex": latex}
    if style not in styles:
        raise UsageError(f"There is no summary style '{style}'. Choose one of text, {', '.join(styles)}.")
    return styles[style](result)


def text(result: FitResult) -> str:
    """Findings of a fit for a terminal."""
    lines = []
    alarm = headline(result)
    if alarm:
        lines += [*wrapped(f"LOOK  {alarm}. Details below.", 6), ""]
    lines += source_lines(result)
    lines += wrapped(model_line(result), 2)
    lines += ["", *_table_lines(table_rows(result)), ""]
    regimes = regime_lines(result)
    further = misfit_line(result), assumed_line(result), effort_line(result)
    below = [*regimes, *(line for line in further if line)]
    for line in below:
        lines += ["  " + part for part in wrapped(line, 2, margin=2)]
    if below:
        lines.append("")
    for kind, sentence in findings(result):
        lines += finding_lines(kind, sentence)
    return "\n".join(line.rstrip() for line in lines).rstrip("\n")


def finding_lines(kind: str, sentence: str) -> list[str]:
    """A finding behind its kind: LOOK, ok or note."""
    return wrapped(sentence, 8, f"  {kind:<6}")


def wrapped(sentence: str, hang: int, start: str = "", margin: int = 0) -> list[str]:
    """Lines that leave a margin on the right: the first behind `start`, the others indented by `hang`."""
    return textwrap.wrap(
        sentence,
        text_width() - margin,
        initial_indent=start,
        subsequent_indent=" " * hang,
        break_on_hyphens=False,
    )


def aligned(rows: Sequence[Sequence[str]], sides: str, gap: str = "  ", indent: str = "  ") -> list[str]:
    """Rows as lines whose columns line up.

    Where a terminal is too narrow for all columns, the rest follow below, behind the first one again.

    Parameters
    ----------
    rows : sequence of sequence of str
        All of one length; the heads come first.
    sides : str
        "<" or ">" for each column.
    gap, indent : str
        Between columns, and before the first.
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    number, wide = 1, len(indent) + sum(widths[:1])
    while number < len(widths) and (number < 2 or wide + len(gap) + widths[number] <= text_width()):
        wide += len(gap) + widths[number]
        number += 1
    lines = []
    for row in rows:
        cells = zip(row[:number], sides, widths, strict=False)
        lines.append(indent + gap.join(f"{cell:{side}{width}}" for cell, side, width in cells).rstrip())
    if number == len(widths):
        return lines
    rest = [(row[0], *row[number:]) for row in rows]
    return [*lines, "", *aligned(rest, sides[0] + sides[number:], gap, indent)]


def source_lines(result: FitResult) -> list[str]:
    """Each source with its contents; a stand-in says so before anything else."""
    indent = min(max((len(source.name) for source in result.inputs), default=0), 30) + 3
    lines: list[str] = []
    for source in result.inputs:
        kinds, about = provenance_sentences(result, source), contents(result, source)
        first = [*kinds[:1], about, *kinds[1:]] if STAND_IN in kinds_of(result, source) else [about, *kinds]
        sentences = [*first, reference(source), left_out(source)]
        paragraphs = [
            part for sentence in sentences if sentence for part in wrapped(sentence, 0, margin=indent)
        ]
        name = source.name
        if len(name) > indent - 3:
            lines.append(name)
            name = ""
        for number, paragraph in enumerate(paragraphs):
            lines.append(f"{name if number == 0 else '':<{indent}}{paragraph}")
    return lines


def _table_lines(rows: Sequence[Row]) -> list[str]:
    """The aligned table; long remarks wrap under themselves."""
    shown = [None if row.estimate is None or row.estimate.status == "fixed" else row.estimate for row in rows]
    spans = iter(interval_column([e.interval95 for e in shown if e], [places_of(e) for e in shown if e]))
    intervals = [next(spans) if estimate else "" for estimate in shown]
    cells = [(row.label, *_numbers(row), row.remark) for row in rows]
    names = max(len("noise"), *(len(cell[0]) for cell in cells))
    values = max(9, *(len(cell[1]) for cell in cells))
    sds = max(5, *(len(cell[2]) for cell in cells))
    wide = max(len("95 % interval"), *map(len, intervals))
    lines = [f"  {'':<{names}} {'value':>{values}}  {'sd':>{sds}}   {'95 % interval':<{wide}}   status"]
    for (name, value, sd, remark), span in zip(cells, intervals, strict=True):
        start = f"  {name:<{names}} {value:>{values}}  {sd:>{sds}}   {span:<{wide}}   "
        parts = textwrap.wrap(remark, max(20, text_width() - len(start)), break_on_hyphens=False) or [""]
        lines.append(start + parts[0])
        lines += [" " * len(start) + part for part in parts[1:]]
    return lines


def interval_column(intervals: Sequence[Interval], places: Sequence[int | None]) -> list[str]:
    """Intervals in a column: the ends of all that have two line up."""
    ends = [interval_ends(own, places[i]) for i, own in enumerate(intervals)]
    width = max((len(end) for pair in ends if all(pair) for end in pair), default=0)
    return [interval_text(own, places[i], width) for i, own in enumerate(intervals)]


def _numbers(row: Row) -> tuple[str, str]:
    if row.estimate is None:
        return row.plain, "-"
    sd = row.estimate.stderr
    return value_text(row.estimate), "-" if sd is None or row.estimate.value is None else sd_text(sd)


def side_by_side(table: pd.DataFrame) -> str:
    """95 % intervals by covariance, profile and exact posterior, and where they disagree.

    Parameters
    ----------
    table : DataFrame
        What `FitResult.intervals` returned.

    Returns
    -------
    str
        One line a constant, then one sentence a disagreement; at most 100 columns unless a name is very long.
        Ends without a line feed.
    """
    if table.empty:
        return "  every constant is fixed: there are no intervals to compare"
    columns = {method: _column(table, method) for method in METHODS}
    names = [str(name).replace("[", " [") for name in table.index]
    rows = [("", *METHODS), *zip(names, *columns.values(), strict=True)]
    lines = ["  central 95 % intervals by three methods", "", *aligned(rows, "<<<<", "   "), ""]
    disagreeing = [("LOOK", sentence) for sentence in disagreements(table)]
    for kind, sentence in disagreeing or [("ok", "the three methods agree")]:
        lines += finding_lines(kind, sentence)
    return "\n".join(lines)


def _column(table: pd.DataFrame, method: str) -> list[str]:
    """Intervals of one method, with the digits that the exact one deserves and their ends aligned."""
    low, high = (table[f"{method}_{end}"].to_numpy(dtype=float).tolist() for end in ("low", "high"))
    places = [_places(table, i) for i in range(len(table))]
    return interval_column(list(zip(low, high, strict=True)), places)


def _places(table: pd.DataFrame, row: int) -> int | None:
    span = float(table["exact_high"].iloc[row] - table["exact_low"].iloc[row])
    return decimals(span / _SDS) if span > 0.0 else None
