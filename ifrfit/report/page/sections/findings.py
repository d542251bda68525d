"""What was checked, and what came out."""

from __future__ import annotations

from ifrfit.report.page.blocks import Findings, Paragraph, Section, Tone
from ifrfit.report.page.material import Material
from ifrfit.report.provenance import (
    STAND_IN,
    contents,
    kinds_of,
    left_out,
    provenance_sentences,
    reference,
)
from ifrfit.report.regimes import regime_lines
from ifrfit.report.words import findings, misfit_line, model_line


def section(material: Material) -> Section:
    """Data, model, regimes and facts in sentences."""
    result = material.result
    paragraphs = []
    for source in result.inputs:
        sentences = [
            f"{source.name}: {contents(result, source)}.",
            *provenance_sentences(result, source),
            reference(source, full=True),
            left_out(source),
        ]
        tone: Tone = "stand-in" if STAND_IN in kinds_of(result, source) else "plain"
        paragraphs.append(Paragraph(" ".join(part for part in sentences if part), tone))
    misfit = misfit_line(result)
    lines = [f"{model_line(result)}", *regime_lines(result, "±"), *([misfit] if misfit else [])]
    paragraphs.append(Paragraph(" ".join(f"{line[:1].upper()}{line[1:]}." for line in lines)))
    return Section("findings", "Data, model and findings", (*paragraphs, Findings(tuple(findings(result)))))
