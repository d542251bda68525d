"""Posterior predictive checks: their p-values on one axis."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from ifrfit.inference.diagnostics.thresholds import REFUTED
from ifrfit.report.page.drawings.canvas import lines_panel
from ifrfit.report.style import COLOURS, GREY, drawing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEAST = 1e-6  # smaller ones are drawn at the edge


def draw_checks(p: Mapping[str, float]) -> Figure:
    """Draw each p-value over a logarithmic axis; what lies in the shade fails."""
    with drawing():
        figure, axes = lines_panel(list(p), 110.0, 42.0)
        # logarithms on a plain axis: a logarithmic one costs ten times as long to draw
        least, refuted = math.log10(LEAST), math.log10(REFUTED)
        axes.set_xlim(least, 0.1)
        axes.set_ylim(len(p) + 0.1, -0.6)
        axes.axvspan(least, refuted, color=COLOURS[1], alpha=0.15, lw=0.0)
        axes.text(refuted - 0.1, len(p) - 0.02, "fails", ha="right", va="bottom", color=GREY, fontsize=6.5)
        for place, value in enumerate(p.values()):
            low = value < REFUTED
            axes.plot([least, 0.0], [place, place], color="0.85", lw=0.6, zorder=0.5)
            axes.plot(
                [math.log10(max(value, LEAST))],
                [place],
                marker="<" if value < LEAST else "X" if low else "o",
                ms=6,
                color=COLOURS[1] if low else COLOURS[0],
                clip_on=False,
            )
        powers = range(round(least), 1)
        axes.set_xticks(powers, [f"{10.0**power:g}" for power in powers])
        axes.set_xlabel("p")
    return figure
