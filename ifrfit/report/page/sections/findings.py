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
    further = [sentence(line) for line in (misfit_line(result), assumed_line(result)) if line]
    # a line of a series begins with its name, which stays as it is
    regimes = [f"{line}." for line in regime_lines(result, "±")]
    paragraphs.append(Paragraph(" ".join([sentence(model_line(result)), *regimes, *further])))
    return (*paragraphs, Findings(tuple(findings(result))))


SECTION = ReportSection("findings", "Data, model and findings", build, frozenset({"findings"}))
