"""The uncertainty report: one page that a colleague can open in ten years; the same as Markdown."""

from __future__ import annotations

from ifrfit.report.page.batch import write_batch
from ifrfit.report.page.writing import assemble, page, write_report

__all__ = ["assemble", "page", "write_batch", "write_report"]
