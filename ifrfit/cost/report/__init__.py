"""Measured costs as text and figures."""

from __future__ import annotations

from ifrfit.cost.report.figure import plot
from ifrfit.cost.report.text import html, sentences, summary

__all__ = ["html", "plot", "sentences", "summary"]
