"""A section of the report: how much it rests on."""

from collections.abc import Sequence

from ifrfit.report.page.blocks import Block, Paragraph
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput


def build(given: ReportInput) -> Sequence[Block]:
    """One sentence; None in the place of blocks would leave the section out."""
    return (Paragraph(f"{len(given.result.points)} rows, {len(given.appraisal.draws)} draws."),)


SECTION = ReportSection("count", "How many", build)
