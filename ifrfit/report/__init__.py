"""How results are shown: text, tables, figures and the folder that holds them."""

from __future__ import annotations

from ifrfit.report.figures import plot
from ifrfit.report.folder import write_folder
from ifrfit.report.interval_comparison import side_by_side
from ifrfit.report.page.writing import check_report, write_report
from ifrfit.report.tables import html
from ifrfit.report.terminal import summary

__all__ = ["check_report", "html", "plot", "side_by_side", "summary", "write_folder", "write_report"]
