"""Tables to paste: Markdown, LaTeX, HTML and CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Sequence

from ifrfit.inference.result.fit_result import FitResult
from ifrfit.report.constants_rows import Row, constant_symbols, table_rows
from ifrfit.report.provenance import is_stand_in, kinds_of, provenance_words, source_sentences
from ifrfit.report.regimes import regime_lines
from ifrfit.report.sentences import (
    assumed_line,
    findings,
    headline,
    misfit_line,
    model_line,
    plus_minus,
    span_text,
)
from ifrfit.report.templating import environment

CSV_HEAD = ("constant", "series", "value", "sd", "low68", "high68", "low95", "high95", "remark")
_LATEX_SPECIAL = str.maketrans(
    {
        "\\": r"\textbackslash{}",
        "{": r"\{",
        "}": r"\}",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        "<": r"$<$",
        ">": r"$>$",
        "|": r"$|$",
        **{character: "\\" + character for character in "&%$#_"},
    }
)


def markdown(result: FitResult) -> str:
    """A Markdown table, with provenance and notes under it."""
    rows = [_cells(row) for row in table_rows(result)]
    return _filled("result.md.j2", result, "±", rows, _markdown)


def latex(result: FitResult) -> str:
    """A LaTeX tabular that needs no package, with provenance and notes under it."""
    data = ", ".join(f"{s.name} ({provenance_words(kinds_of(result, s))})" for s in result.inputs)
    rows = [_latex_cells(row) for row in table_rows(result)]
    return _filled("result.tex.j2", result, "+-", rows, latex_text, data=data)


def csv_text(result: FitResult) -> str:
    """Constants and what follows from them as CSV: all digits, empty cells for what is not known."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(CSV_HEAD)
    for row in table_rows(result):
        if row.estimate is None:
            writer.writerow([row.name, row.series, row.plain, *[""] * 5, row.remark])
            continue
        one = row.estimate
        ends = () if one.status == "fixed" else (*one.interval68, *one.interval95)
        numbers = [_number(x) for x in (one.value, one.stderr, *(ends or (None,) * 4))]
        writer.writerow([row.name, row.series, *numbers, row.remark])
    return text.getvalue()


def _number(value: float | None) -> str:
    return "" if value is None or math.isnan(value) else repr(float(value))


def _filled(
    template: str,
    result: FitResult,
    sign: str,
    rows: Sequence[Sequence[str]],
    escaped: Callable[[str], str],
    **more: str,
) -> str:
    """A table to paste, as its template has it; the filter ``escaped`` makes text of what a name holds."""
    notes = [f"{model_line(result)}.", *_provenance(result), *_regimes(result, sign)]
    notes += [f"{kind}: {says}" for kind, says in findings(result) if kind != "ok"]
    found = environment(autoescape=False)
    found.filters["escaped"] = escaped
    shown = {"alarm": headline(result), "stand_in": is_stand_in(result), "rows": rows, "notes": notes}
    return found.get_template(template).render(shown | more)


def html(result: FitResult) -> str:
    """The findings as an HTML fragment for notebooks.

    Everything that comes from data is escaped; nothing is loaded from elsewhere.
    """
    return (
        environment()
        .get_template("result.html.j2")
        .render(
            alarm=headline(result),
            tag="strong" if is_stand_in(result) else "span",
            provenance=_provenance(result),
            model=model_line(result),
            rows=[_cells(row) for row in table_rows(result)],
            notes=[*_regimes(result, "±"), *(f"{kind}: {says}" for kind, says in findings(result))],
        )
    )


def _cells(row: Row) -> tuple[str, ...]:
    return row.label, _plus_minus(row, "±"), _interval(row), row.remark


def _plus_minus(row: Row, sign: str) -> str:
    return row.plain if row.estimate is None else plus_minus(row.estimate, sign)


def _interval(row: Row) -> str:
    return "" if row.estimate is None or row.estimate.status == "fixed" else span_text(row.estimate)


def _latex_cells(row: Row) -> tuple[str, ...]:
    name = constant_symbols().get(row.name, latex_text(row.name)) + (
        f" ({latex_text(row.series)})" if row.series else ""
    )
    value, span = _plus_minus(row, r"\pm"), _interval(row)
    return (
        name,
        "--" if value == "-" else f"${value}$",
        span if span in ("", "any value") else f"${span}$",
        latex_text(row.remark),
    )


def _provenance(result: FitResult) -> list[str]:
    return [" ".join(source_sentences(result, source)) for source in result.inputs]


def _regimes(result: FitResult, sign: str) -> list[str]:
    lines = *regime_lines(result, sign), misfit_line(result), assumed_line(result)
    return [f"{line}." for line in lines if line]


def _markdown(text: str) -> str:
    for character in ("\\", "|", "*", "`", "<", "["):
        text = text.replace(character, "\\" + character)
    return text


def latex_text(text: str) -> str:
    """Text whose characters mean nothing in LaTeX."""
    return text.translate(_LATEX_SPECIAL)
