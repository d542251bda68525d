"""What was checked, and what came out."""

from __future__ import annotations

from collections.abc import Sequence

from ifrfit.report.page.blocks import Block, Findings, Paragraph
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.provenance import STAND_IN, kinds_of, source_sentences
from ifrfit.report.regimes import regime_lines
from ifrfit.report.sentences import assumed_line, findings, misfit_line, model_line, sentence


def build(given: ReportInput) -> Sequence[Block]:
    """Data, model, regimes and facts in sentences."""
    result = given.result
    paragraphs = []
    for source in result.inputs:
        sentences = source_sentences(result, source)
        if STAND_IN in kinds_of(result, source):
            # of several kinds this one is told first
            paragraphs.append(Paragraph(f"{source.name}: {sentences.pop(1)}", "stand-in"))
        paragraphs.append(Paragraph(" ".join(sentences)))
    further = misfit_line(result), assumed_line(result)
    lines = [model_line(result), *regime_lines(result, "±"), *(line for line in further if line)]
    paragraphs.append(Paragraph(" ".join(sentence(line) for line in lines)))
    return (*paragraphs, Findings(tuple(findings(result))))


SECTION = ReportSection("findings", "Data, model and findings", build)
