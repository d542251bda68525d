"""Data, curves and bands; and the interactive panel over them."""

from __future__ import annotations

from collections.abc import Sequence

from ifrfit.report.figures import plot
from ifrfit.report.page.blocks import Block, Panel, Paragraph, Picture, Pictures
from ifrfit.report.page.explorer import payload, reason_without_panel
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.provenance import amount_words, stand_in_words
from ifrfit.report.regimes import REGIMES, regime_lines, regime_name
from ifrfit.text import joined

NO_POINTS = "The result holds no points (it keeps at most 100,000 rows), so there is nothing to draw."


def build(given: ReportInput) -> Sequence[Block]:
    """The figure of the fit and the panel."""
    result = given.result
    if not len(result.points):
        return (Paragraph(NO_POINTS, "note"),)
    observables = joined([str(name) for name in result.points["observable"].unique()])
    stand_in = stand_in_words(result)
    shown = f"{amount_words(result).capitalize()} of {observables}"
    regimes = " ".join(f"{line}." for line in regime_lines(result, "±"))
    described = f"{stand_in}{shown} with the fitted curve. {regimes}"
    stick, slide = (regime_name(result, regime) for regime in REGIMES)
    shades = f" Shaded: {stick}; grey bar: where {stick} turns into {slide}."
    blocks: list[Block] = [
        Pictures(
            (Picture("fit", f"Fit to {observables}", described, given.figure or plot(result)),),
            f"{stand_in}Data, the fitted curve with its 68 and 95 % bands at the median spin of each series, "
            f"and standardised residuals.{shades if result.points['gamma_deg'].notna().any() else ''}",
        )
    ]
    reason = reason_without_panel(result)
    blocks.append(Paragraph(reason, "note") if reason else Panel(payload(result)))
    return blocks


SECTION = ReportSection("fit", "Fit", build, frozenset({"panel"}))
