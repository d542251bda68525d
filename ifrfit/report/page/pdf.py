"""A report as PDF: text, tables and figures one after another on sheets of A4; no browser is needed."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ifrfit.report.page.blocks import Report
from ifrfit.report.page.plugins import GENERATOR, ReportFormat
from ifrfit.report.style import drawing

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def pdf(report: Report) -> bytes:
    """The report as PDF, the same bytes on every run; text stays text, figures stay vector graphics."""
    from pypdf import PdfReader, PdfWriter, Transformation

    from ifrfit.report.page.a4.flow import sheets

    content, places = sheets(report)
    # begun anew: so who made it stands at its beginning
    writer = PdfWriter()
    writer.pdf_header = "%PDF-1.4"  # the first that knows transparency, which figures have
    writer.metadata = {"/Title": report.title, "/Creator": GENERATOR, "/Producer": "pypdf"}
    writer.append(io.BytesIO(content))
    if places:
        figures = PdfReader(io.BytesIO(_figures([place.picture.figure for place in places])))
        for place, figure in zip(places, figures.pages, strict=True):
            where = Transformation().scale(place.scale).translate(place.x, place.y)
            writer.pages[place.page].merge_transformed_page(figure, where)
    for page in writer.pages:
        page.compress_content_streams()
    buffer = io.BytesIO()
    writer.write(buffer)
    return buffer.getvalue()


def _figures(figures: Sequence[Figure]) -> bytes:
    """Figures as a PDF with a page of its own size for each; they share their type."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_pdf import PdfPages

    buffer = io.BytesIO()
    with (
        drawing(),
        rc_context({"pdf.fonttype": 42}),
        PdfPages(buffer, metadata={"CreationDate": None}) as pages,
    ):
        for figure in figures:
            pages.savefig(figure)
    return buffer.getvalue()


def _files(report: Report, stem: str) -> dict[str, bytes]:
    return {f"{stem}.pdf": pdf(report)}


FORMAT = ReportFormat("pdf", _files)
