"""Closures side by side, or why they are not."""

from __future__ import annotations

from collections.abc import Sequence

from ifrfit.inference.comparison import Comparison
from ifrfit.inference.comparison.verdict import title
from ifrfit.report.comparison.criteria_columns import CROSS_VALIDATION, criteria, cross_validated
from ifrfit.report.comparison.figure import observables_over_angle
from ifrfit.report.comparison.findings import findings, prior_line
from ifrfit.report.page.blocks import Block, Findings, Paragraph, Picture, Pictures, Table
from ifrfit.report.page.drawings.closures import draw_closures
from ifrfit.report.page.phrases import sentence, stand_in_words
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput


def build(given: ReportInput) -> Sequence[Block] | None:
    """Verdict, table and picture of a comparison, or the sentence that says why there is none."""
    comparison = given.appraisal.comparison
    if comparison is None:
        missing = given.appraisal.without_comparison
        return (Paragraph(sentence(missing)),) if missing else None
    columns = criteria(comparison) + (CROSS_VALIDATION if cross_validated(comparison) else [])
    rows = tuple(
        (title(name), *(cell(comparison.entries[name]) for _, cell in columns)) for name in comparison.ranked
    )
    head = ("closure", *(name for name, _ in columns))
    says = sentence(comparison.verdict.says)
    picture = Picture("closures", "Closures", says, draw_closures(comparison))
    shown_above = set(given.result.warnings)
    return (
        Paragraph(says),
        Table(prior_line(comparison), head, rows, frozenset(range(1, len(head)))),
        Pictures(
            (picture,),
            f"{stand_in_words(given.result)}{_caption(comparison)}",
        ),
        Findings(tuple(item for item in findings(comparison) if item[1] not in shown_above)),
    )


def _caption(comparison: Comparison) -> str:
    if not observables_over_angle(comparison):
        return "Log Bayes factors against the best."
    return (
        "Data with the best curve of each closure, the residuals of each in units of its own sigma, and log "
        "Bayes factors against the best."
    )


SECTION = ReportSection("closures", "Closures compared", build)
