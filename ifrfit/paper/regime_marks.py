"""Sticking and sliding in a figure of the paper: shaded and named, with the transitions between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ifrfit.paper.scene import Mark, Regimes
from ifrfit.report.style import GREY, STICKING_SHADE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# of the axis: a word across, an upright word
_ACROSS, _UPRIGHT = 0.17, 0.035


def shade(axes: Axes, regimes: Regimes, *, words: bool) -> None:
    """Shade sticking, name both regimes, and draw the transitions: the recovered one with its interval."""
    to_axes = axes.transData + axes.transAxes.inverted()
    for low, high, regime in regimes.spans:
        if regime == "sticking":
            axes.axvspan(low, high, color=STICKING_SHADE, lw=0.0, zorder=0)
        left, right = (float(to_axes.transform((x, axes.get_ylim()[0]))[0]) for x in (low, high))
        if words and right - left > _UPRIGHT:
            axes.text(
                0.5 * (left + right),
                0.98,
                regime,
                transform=axes.transAxes,
                ha="center",
                va="top",
                rotation=0.0 if right - left > _ACROSS else 90.0,
                color=GREY,
                style="italic",
                zorder=1,
            )
    for mark in regimes.marks:
        _draw_mark(axes, mark)


def _draw_mark(axes: Axes, mark: Mark) -> None:
    if mark.kind == "printed_constants":
        axes.axvline(mark.x, color="black", lw=0.7, ls=(0, (5, 1.6)), zorder=1.6)
        return
    if mark.low is not None and mark.high is not None and mark.high > mark.low:
        axes.axvspan(mark.low, mark.high, color="0.5", alpha=0.3, lw=0.0, zorder=1)
    axes.axvline(mark.x, color=GREY, lw=0.9, zorder=1.5)


def draw_strip(axes: Axes, several: Sequence[Regimes]) -> None:
    """Draw the regimes of several series that differ, one bar a series, above the data."""
    axes.set_ylim(len(several), 0)
    for row, regimes in enumerate(several):
        colour = GREY if regimes.series_style is None else regimes.series_style.colour
        if regimes.series_style is not None:
            axes.plot(
                [-0.02],
                [row + 0.5],
                marker=regimes.series_style.marker,
                ms=3.8,
                color=colour,
                transform=axes.get_yaxis_transform(),
                clip_on=False,
            )
        if not regimes.spans:
            low, high = axes.get_xlim()
            axes.text((low + high) / 2.0, row + 0.5, "transition open", ha="center", va="center", fontsize=6)
        for low, high, regime in regimes.spans:
            shadow = "0.86" if regime == "sticking" else "white"
            axes.barh(row + 0.5, high - low, left=low, height=0.84, color=shadow, ec=colour, lw=0.6)
            axes.text((low + high) / 2.0, row + 0.5, regime, ha="center", va="center_baseline", fontsize=6)
        for mark in regimes.marks:
            ends = [row + 0.08, row + 0.92]
            if mark.kind == "printed_constants":
                axes.plot([mark.x, mark.x], ends, color="black", lw=0.8, ls=(0, (2, 1)))
                continue
            if mark.low is not None and mark.high is not None:
                axes.barh(
                    row + 0.5,
                    mark.high - mark.low,
                    left=mark.low,
                    height=0.84,
                    color=colour,
                    alpha=0.45,
                    lw=0.0,
                )
            axes.plot([mark.x, mark.x], ends, color=colour, lw=1.2)
    axes.set_axis_off()
