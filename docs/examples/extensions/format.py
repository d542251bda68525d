"""A format of the report: its headings as plain text."""

from ifrfit.report.page.blocks import Report
from ifrfit.report.page.plugins import GENERATOR, ReportFormat


def headings(report: Report, stem: str) -> dict[str, bytes]:
    """``STEM.toc``; `GENERATOR` marks it as a report, which a later one may replace."""
    lines = [GENERATOR, *(section.title for section in report.sections)]
    return {f"{stem}.toc": "\n".join(lines).encode()}


FORMAT = ReportFormat("toc", headings)
