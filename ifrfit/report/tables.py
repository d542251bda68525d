"""Tables to paste: Markdown, LaTeX and HTML."""

from __future__ import annotations

from ifrfit.inference.result.fit_result import FitResult
from ifrfit.report.constants_rows import Row, constant_symbols, table_rows
from ifrfit.report.page.html import environment
from ifrfit.report.provenance import is_stand_in, kinds_of, provenance_words, source_sentences
from ifrfit.report.regimes import regime_lines
from ifrfit.report.rounding import plus_minus, span_text
from ifrfit.report.sentences import assumed_line, findings, headline, misfit_line, model_line

_LATEX_NAMES = {
    "e_n": "$e_n$",
    "mu": r"$\mu$",
    "kappa": r"$\kappa$",
}
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
    lines = ["| constant | value | 95 % interval | status |", "|---|---|---|---|"]
    for row in table_rows(result):
        lines.append("| " + " | ".join(_markdown(cell) for cell in _cells(row)) + " |")
    notes = [f"{model_line(result)}.", *_provenance(result), *_regimes(result, "±"), *_notes(result)]
    lines += ["", *(f"- {_markdown(note)}" for note in notes)]
    alarm = headline(result)
    heads = [f"**LOOK: {_markdown(alarm)}.**", ""] if alarm else []
    heads += ["**STAND-IN data, not an experiment.**", ""] if is_stand_in(result) else []
    return "\n".join([*heads, *lines])


def latex(result: FitResult) -> str:
    """A LaTeX tabular that needs no package, with provenance and notes under it."""
    alarm = headline(result)
    lines = [f"% LOOK: {alarm}"] if alarm else []
    lines += [
        r"\begin{tabular}{llll}",
        r"\hline",
        r"constant & value & 95\,\% interval & status \\",
        r"\hline",
    ]
    for row in table_rows(result):
        name = (_LATEX_NAMES | constant_symbols()).get(row.name, _latex(row.name)) + (
            f" ({_latex(row.series)})" if row.series else ""
        )
        value = _plus_minus(row, r"\pm")
        cells = (name, "--" if value == "-" else f"${value}$", _latex_interval(row), _latex(row.remark))
        lines.append(" & ".join(cells) + r" \\")
    data = ", ".join(f"{s.name} ({provenance_words(kinds_of(result, s))})" for s in result.inputs)
    # inside the table, so that the provenance is pasted with it
    lines += [r"\hline", rf"\multicolumn{{4}}{{l}}{{data: {_latex(data)}}} \\", r"\end{tabular}", ""]
    notes = [f"{model_line(result)}.", *_provenance(result), *_regimes(result, "+-"), *_notes(result)]
    lines += [_latex(note).replace("+-", r"$\pm$") + r"\\" for note in notes]
    lines[-1] = lines[-1].removesuffix(r"\\")
    return "\n".join(lines)


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


def _latex_interval(row: Row) -> str:
    text = _interval(row)
    return text if text in ("", "any value") else f"${text}$"


def _provenance(result: FitResult) -> list[str]:
    return [" ".join(source_sentences(result, source, full=True)) for source in result.inputs]


def _regimes(result: FitResult, sign: str) -> list[str]:
    lines = *regime_lines(result, sign), misfit_line(result), assumed_line(result)
    return [f"{line}." for line in lines if line]


def _notes(result: FitResult) -> list[str]:
    return [f"{kind}: {says}" for kind, says in findings(result) if kind != "ok"]


def _markdown(text: str) -> str:
    for character in ("\\", "|", "*", "`", "<", "["):
        text = text.replace(character, "\\" + character)
    return text


def _latex(text: str) -> str:
    return text.translate(_LATEX_SPECIAL)
