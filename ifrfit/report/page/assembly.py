"""A report of a result: its sections in order."""

from __future__ import annotations

from ifrfit.inference.appraisal import Appraisal
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.report.page.blocks import Report, Section
from ifrfit.report.page.registries import SECTIONS
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.page.verdict import badges, verdict
from ifrfit.report.sentences import closure_title, headline
from ifrfit.text import joined


def assemble(result: FitResult, appraisal: Appraisal, figure: str | None = None) -> Report:
    """Everything that the report of a result says and shows.

    Parameters
    ----------
    result : FitResult
        Of a fit, or read from a file.
    appraisal : Appraisal
        What was computed for the report.
    figure : str, optional
        The figure of the fit as svg, where it has been drawn before.
    """
    given = ReportInput(result, appraisal, figure)
    sections = tuple(
        Section(section.name, section.title, tuple(blocks))
        for section in SECTIONS.values()
        if (blocks := section.build(given)) is not None
    )
    foot = {"ifrfit": result.versions.get("ifrfit", ""), "fitted": result.created}
    return Report(
        title(result),
        badges(result),
        verdict(result),
        bool(headline(result)),
        sections,
        {name: text for name, text in foot.items() if text},
    )


def title(result: FitResult) -> str:
    """What was fitted, and with which closure."""
    return f"{joined([source.name for source in result.inputs]) or 'No source'}: {closure_title(result)}"
