"""Closures side by side as text for a terminal, and for notebooks."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from html import escape

from ifrfit.inference.comparison import Comparison
from ifrfit.inference.comparison.result import PsiPlane, Slope
from ifrfit.inference.comparison.verdict import title
from ifrfit.inference.result.types import Interval
from ifrfit.report.comparison.criteria_columns import CROSS_VALIDATION, Column, criteria, cross_validated
from ifrfit.report.comparison.findings import findings, prior_line
from ifrfit.report.sentences import assumed_line, noise_words
from ifrfit.report.terminal import WIDTH, aligned, finding_lines, source_lines, wrapped
from ifrfit.text import decimals, fixed, interval_text, joined, sd_text


def summary(comparison: Comparison) -> str:
    """The comparison for a terminal, at most 100 columns; ends without a line feed."""
    best = comparison.best
    model = f"{len(comparison.entries)} closures, exact posterior, {noise_words(best)}"
    blocks = [
        [*source_lines(best), *wrapped(model, 2)],
        textwrap.wrap(comparison.verdict.says, WIDTH, initial_indent="VERDICT  ", subsequent_indent=" " * 9),
        [*_table(comparison, criteria(comparison)), *wrapped("  " + prior_line(comparison), 4)],
        _prior_lines(comparison),
        _table(comparison, CROSS_VALIDATION) if cross_validated(comparison) else [],
        _plane_lines(comparison),
        wrapped(f"  {assumed_line(comparison.best)}", 4) if comparison.best.assumed else [],
        [line for kind, says in findings(comparison) for line in finding_lines(kind, says)],
    ]
    lines = [line for block in blocks if block for line in (*block, "")]
    return "\n".join(line.rstrip() for line in lines).rstrip("\n")


def html(comparison: Comparison) -> str:
    """The comparison as an HTML fragment for notebooks; what comes from data is escaped."""
    table = comparison.table().rename(index=title).dropna(axis="columns", how="all")
    notes = "".join(f"<li>{escape(f'{kind}: {says}')}</li>" for kind, says in findings(comparison))
    return (
        f'<div class="ifrfit-comparison"><p><strong>{escape(comparison.verdict.says)}</strong></p>'
        f"{table.to_html(float_format='{:.4g}'.format)}<p>{escape(prior_line(comparison))}</p>"
        f"<ul>{notes}</ul></div>"
    )


def _table(comparison: Comparison, columns: Sequence[Column]) -> list[str]:
    """One line a closure, the best first."""
    ranked = comparison.ranked
    head = ["closure", *(head for head, _ in columns)]
    rows = [[title(name), *(cell(comparison.entries[name]) for _, cell in columns)] for name in ranked]
    return aligned([head, *rows], "<".ljust(len(head), ">"))


def _prior_lines(comparison: Comparison) -> list[str]:
    """How the evidence moves with the priors: log Bayes factors against the best."""
    if len(comparison.priors) == 1:
        return []
    best, *others = comparison.ranked
    rows = [[f"log BF against {title(best)}", *(title(name) for name in others)]]
    for row in comparison.priors:
        found = [row.log_bayes_factor(name, best) for name in others]
        rows.append([row.varied or "priors as stated", *("-" if x is None else fixed(x, 2) for x in found)])
    return aligned(rows, "<".ljust(len(rows[0]), ">"))


def _plane_lines(comparison: Comparison) -> list[str]:
    plane = comparison.psi_plane
    if plane.reason:
        return wrapped(f"  psi plane: not available, as {plane.reason}", 4)
    head = (
        f"  psi plane, V_t/U_n over U_t/U_n with free slopes: {plane.n} rows, {plane.n_sticking} stick, "
        f"{plane.n_sliding} slide"
    )
    slopes = _slopes(plane)
    cells = aligned([(words, *_slope_cells(slope)) for words, slope in slopes], "<>><", indent="    ")
    lines = wrapped(head, 4)
    for line, (_, slope) in zip(cells, slopes, strict=True):
        expected = textwrap.wrap(
            _expected(slope), WIDTH, initial_indent=" " * 6, subsequent_indent=" " * 8, break_on_hyphens=False
        )
        lines += [line, *expected]
    return lines


def _slopes(plane: PsiPlane) -> list[tuple[str, Slope]]:
    assert plane.sliding is not None
    assert plane.difference is not None
    return [("slope of sliding", plane.sliding), ("slope of sliding less sticking", plane.difference)]


def _slope_cells(slope: Slope) -> tuple[str, str, str]:
    if not slope.determined:
        return "-", "-", _open(slope.interval95)
    width = slope.interval95[1] - slope.interval95[0]
    places = decimals(slope.stderr or width / 4.0)
    error = "-" if slope.stderr is None else f"+- {sd_text(slope.stderr)}"
    return fixed(slope.value, places), error, f"95 % {interval_text(slope.interval95, places)}"


def _open(interval: Interval) -> str:
    finite = [abs(end) for end in interval if math.isfinite(end)]
    if not finite:
        return "not determined"
    return f"not determined, 95 % {interval_text(interval, decimals(0.1 * finite[0]) if finite[0] else 2)}"


def _expected(slope: Slope) -> str:
    """What the closures want, those that agree on it together."""
    wants: dict[str, list[str]] = {}
    for name, ends in slope.expected.items():
        if ends is None:
            words = "no straight line"
        elif ends[1] - ends[0] < 1e-6:
            words = fixed(ends[0], 3).rstrip("0").rstrip(".")
        else:
            low, high = (fixed(end, 3).rstrip("0").rstrip(".") for end in ends)
            words = f"{low} to {high}"
        against = " (contradicted)" if name in slope.contradicts else ""
        wants.setdefault(words, []).append(title(name) + against)
    return "; ".join(f"{joined(names)}: {words}" for words, names in wants.items())
