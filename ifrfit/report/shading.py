"""Sticking and sliding in a figure: shaded, named, with the transition between them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Estimate
from ifrfit.report.regimes import regime_name, transition_is_open, transition_words, transitions
from ifrfit.report.style import GREY, STICKING_SHADE, SeriesStyle

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NARROW = 4.0  # degrees; no room for a word, even an upright one

# the transitions as (value, low, high) in degrees, ascending; or one word where there is none
Regimes = tuple[tuple[float, float, float], ...] | str


def regime_key(result: FitResult, series: str) -> Regimes | None:
    """What is drawn as the regimes of a series: its transitions (value, low, high), or one word.

    A word where there is no transition: "sticking" or "sliding"; None where it is not known.
    """
    if transition_is_open(result, series):
        return None
    angles = transitions(result, series)
    if angles:
        return tuple(_angle(angle) for angle in angles)
    rows = result.points[(result.points["series"] == series) & result.points["gamma_deg"].notna()]
    sticking = rows["sticking"].map(bool)
    if not sticking.any():
        return "sliding"
    return "sticking" if sticking.all() else None


def _angle(estimate: Estimate) -> tuple[float, float, float]:
    low, high = (
        end if math.isfinite(end) else default
        for end, default in zip(estimate.interval95, (0.0, 90.0), strict=True)
    )
    return float(estimate.value or 0.0), max(low, 0.0), min(high, 90.0)


def spans(key: Regimes) -> list[tuple[float, float, str]]:
    """Angle ranges with their regime, ascending: grazing impacts slide, below that regimes take turns."""
    if isinstance(key, str):
        return [(0.0, 90.0, key)]
    edges = [0.0, *(angle[0] for angle in key), 90.0]
    count = len(edges) - 1
    return [
        (edges[i], edges[i + 1], "sliding" if (count - 1 - i) % 2 == 0 else "sticking") for i in range(count)
    ]


def draw_regimes(axes: Axes, key: Regimes, result: FitResult, *, labels: bool) -> None:
    """Shade sticking, name both regimes and mark the transitions with their 95 % intervals."""
    for low, high, regime in spans(key):
        if regime == "sticking":
            axes.axvspan(low, high, color=STICKING_SHADE, lw=0.0, zorder=0)
        width = high - low
        if labels and width > NARROW:
            # a word takes about 15 degrees across
            upright = width < 15.0
            axes.text(
                (low + high) / 2.0,
                0.975,
                regime_name(result, regime),
                transform=axes.get_xaxis_transform(),
                ha="center",
                va="top",
                rotation=90.0 if upright else 0.0,
                color=GREY,
                style="italic",
                zorder=1,
            )
    if not isinstance(key, str):
        for value, low, high in key:
            axes.axvspan(low, high, color="0.5", alpha=0.3, lw=0.0, zorder=1)
            axes.axvline(value, color=GREY, lw=0.9, zorder=1.5)


def draw_strip(
    axes: Axes, keys: dict[str, Regimes | None], styles: dict[str, SeriesStyle], result: FitResult
) -> None:
    """Draw the regimes of several series that differ, one bar a series, above the data."""
    axes.set_xlim(0.0, 90.0)
    axes.set_ylim(len(keys), 0)
    for row, (series, key) in enumerate(keys.items()):
        style = styles[series]
        axes.plot(
            [-0.025],
            [row + 0.5],
            marker=style.marker,
            ms=4.2,
            color=style.colour,
            transform=axes.get_yaxis_transform(),
            clip_on=False,
        )
        if key is None:
            axes.text(45.0, row + 0.5, "transition not determined", ha="center", va="center", fontsize=6)
            continue
        for low, high, regime in spans(key):
            shade = "0.86" if regime == "sticking" else "white"
            axes.barh(row + 0.5, high - low, left=low, height=0.84, color=shade, ec=style.colour, lw=0.6)
            if high - low > 12.0:
                name = regime_name(result, regime)
                axes.text((low + high) / 2, row + 0.5, name, ha="center", va="center", fontsize=6)
        for value, low, high in () if isinstance(key, str) else key:
            axes.barh(row + 0.5, high - low, left=low, height=0.84, color=style.colour, alpha=0.45, lw=0.0)
            axes.plot([value, value], [row + 0.08, row + 0.92], color=style.colour, lw=1.2)
    axes.set_axis_off()


def note_open_transition(axes: Axes, result: FitResult, series: str) -> None:
    """Say in the picture what is known of a transition that the data do not determine."""
    if not transition_is_open(result, series):
        return
    axes.text(
        0.5,
        0.975,
        transition_words(result, series, None, "±"),
        transform=axes.transAxes,
        ha="center",
        va="top",
        color=GREY,
        style="italic",
        fontsize=6.5,
    )
