"""A simulation as text, figure and folder."""

from __future__ import annotations

from ifrfit.report.simulation.figure import plot
from ifrfit.report.simulation.text import html, summary

__all__ = ["html", "plot", "summary"]
