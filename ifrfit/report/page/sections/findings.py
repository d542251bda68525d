"""What was checked, and what came out."""

from __future__ import annotations

from collections.abc import Sequence

from ifrfit.report.page.blocks import Block, Findings, Paragraph
from ifrfit.report.page.phrases import sentence
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.provenance import (
    STAND_IN,
    contents,
    kinds_of,
    left_out,
    provenance_sentences,
    reference,
)
from ifrfit.report.regimes import regime_lines
from ifrfit.report.sentences import findings, misfit_line, model_line


def build(given: ReportInput) -> Sequence[Block]:
    """Data, model, regimes and facts in sentences."""
    result = given.result
    paragraphs = []
    for source in result.inputs:
        origin = provenance_sentences(result, source)
        if STAND_IN in kinds_of(result, source):
            # of several kinds this one is told first
            paragraphs.append(Paragraph(f"{source.name}: {origin[0]}", "stand-in"))
            origin = origin[1:]
        sentences = [
            f"{source.name}: {contents(result, source)}.",
            *origin,
            reference(source, full=True),
            left_out(source),
        ]
        paragraphs.append(Paragraph(" ".join(part for part in sentences if part)))
    misfit = misfit_line(result)
    lines = [f"{model_line(result)}", *regime_lines(result, "±"), *([misfit] if misfit else [])]
    paragraphs.append(Paragraph(" ".join(sentence(line) for line in lines)))
    return (*paragraphs, Findings(tuple(findings(result))))


SECTION = ReportSection("findings", "Data, model and findings", build)
