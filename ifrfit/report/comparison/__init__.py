"""A comparison of closures as text, table, figure and folder."""

from __future__ import annotations

from ifrfit.report.comparison.figure import plot
from ifrfit.report.comparison.text import html, summary

__all__ = ["html", "plot", "summary"]
