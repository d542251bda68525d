"""Residuals from three sides."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ifrfit.report import style
from ifrfit.report.page.blocks import Block, Picture, Pictures
from ifrfit.report.page.drawings.residuals import draw_against, draw_quantiles
from ifrfit.report.page.phrases import stand_in_words
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput


def build(given: ReportInput) -> Sequence[Block] | None:
    """Standardised residuals against angle, order and normal quantiles; None without points."""
    result = given.result
    points = result.points
    if not len(points):
        return None
    styles = style.series_styles([str(name) for name in points["series"].unique()])
    z = points["standardised"].to_numpy(dtype=float)
    largest = int(np.nanargmax(np.abs(z))) if np.isfinite(z).any() else 0
    place = points.iloc[largest]
    worst = f"The largest is {z[largest]:+.2f}, in {place['source']} line {place['row']}."
    beyond = f"{int((np.abs(z) > 2.0).sum())} of {z.size} lie beyond ±2 σ."
    pictures = []
    gamma = points["gamma_deg"].to_numpy(dtype=float)
    if np.isfinite(gamma).any():
        pictures.append(
            Picture(
                "residuals-angle",
                "Residuals against the incidence angle",
                f"Residuals from {np.nanmin(gamma):.3g} to {np.nanmax(gamma):.3g} degrees. {beyond}",
                draw_against(result, styles, gamma, "incidence angle γ (deg)"),
            )
        )
    order = np.arange(1.0, z.size + 1.0)
    pictures += [
        Picture(
            "residuals-order",
            "Residuals in the order of the rows",
            f"Standardised residuals row by row. {worst}",
            draw_against(result, styles, order, "row (number, in order)"),
        ),
        Picture(
            "residuals-quantiles",
            "Residuals against normal quantiles",
            f"Ordered residuals against the normal law. {beyond}",
            draw_quantiles(result, styles),
        ),
    ]
    caption = (
        f"{stand_in_words(result)}Standardised residuals at the optimum: each over its own standard "
        "deviation, which where the noise comes from the misfit does not rest on the row itself. Open: "
        "sticking; filled: sliding; ringed: outlier. Dashed: ±2 σ. Grey: where 95 % of each ordered residual "
        f"lies, one by one, if the noise is normal. {beyond} {worst}"
    )
    return (Pictures(tuple(pictures), caption),)


SECTION = ReportSection("residuals", "Residuals", build)
