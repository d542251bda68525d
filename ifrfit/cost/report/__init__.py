"""Measured costs as text, JSON, figures and folder."""

from __future__ import annotations

from ifrfit.cost.report.figure import plot
from ifrfit.cost.report.folder import write_costs
from ifrfit.cost.report.sentences import sentences
from ifrfit.cost.report.text import html, summary
from ifrfit.cost.report.to_json import to_dict

__all__ = ["html", "plot", "sentences", "summary", "to_dict", "write_costs"]
