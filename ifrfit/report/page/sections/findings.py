"""What was checked, and what came out."""

from __future__ import annotations

from ifrfit.report.page.blocks import Findings, Paragraph, Section
from ifrfit.report.page.material import Material
from ifrfit.report.page.phrases import sentence
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


def section(material: Material) -> Section:
    """Data, model, regimes and facts in sentences."""
    result = material.result
    paragraphs = []
    for source in result.inputs:
        told = provenance_sentences(result, source)
        if STAND_IN in kinds_of(result, source):
            # of several kinds this one is told first
            paragraphs.append(Paragraph(f"{source.name}: {told[0]}", "stand-in"))
            told = told[1:]
        sentences = [
            f"{source.name}: {contents(result, source)}.",
            *told,
            reference(source, full=True),
            left_out(source),
        ]
        paragraphs.append(Paragraph(" ".join(part for part in sentences if part)))
    misfit = misfit_line(result)
    lines = [f"{model_line(result)}", *regime_lines(result, "±"), *([misfit] if misfit else [])]
    paragraphs.append(Paragraph(" ".join(sentence(line) for line in lines)))
    return Section("findings", "Data, model and findings", (*paragraphs, Findings(tuple(findings(result)))))
