"""The figure of a comparison, and the folder that holds it.

Data with each closure's line, residuals, evidence beside cross-validation.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.comparison import Comparison
from ifrfit.inference.comparison.verdict import INDIFFERENT, title
from ifrfit.inference.io.json_text import write_json
from ifrfit.report import panels, style
from ifrfit.report.atomic_folder import Contents, deliver
from ifrfit.report.figures import MOST_COLUMNS, series_label
from ifrfit.report.panels import Pen, draw_curve, handle
from ifrfit.report.provenance import amount_words, is_stand_in
from ifrfit.report.regimes import has_angle
from ifrfit.report.style import GREY, save_svg_and_png
from ifrfit.text import power_of_ten

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_DATA, _STRIP, _BAR = 2.2, 0.42, 0.16  # inches
LINEAR = 5.0  # log Bayes factor up to which the axis is linear
MOST_DECADES, LONG = 4, 1e5  # about so many are labelled; numbers from here on as powers of ten
_LETTERS = 13.0  # of a title to an inch
COMPARISON = Contents("compare.json", ("compare.svg", "compare.png"), "comparison")


def plot(comparison: Comparison) -> Figure:
    """Draw data with each closure's line and residuals, and log Bayes factors beside cross-validation.

    Parameters
    ----------
    comparison : Comparison

    Returns
    -------
    matplotlib.figure.Figure
        85 mm wide an observable (at most three; those that depend on the angle), not known to pyplot.
    """
    observables = observables_over_angle(comparison)
    columns = max(1, len(observables))
    count = len(comparison.entries)
    width_mm = columns * style.PANEL_WIDTH_MM
    styles = style.series_styles(list(comparison.entries))
    heading = style.filled(comparison.verdict.says, width_mm, _LETTERS)
    body = (_DATA + count * _STRIP) if observables else 0.0
    bars = 0.2 + count * _BAR
    with style.drawing():
        legend = _legend(comparison, styles, observables)
        lines = math.ceil(len(legend) / (2 * columns))
        height = body + bars + 0.16 * len(heading.splitlines()) + 0.15 * lines + 0.7
        figure = style.new_figure(width_mm, height, "constrained")
        figure.get_layout_engine().set(w_pad=0.08, h_pad=0.03)  # type: ignore[union-attr, call-arg]
        grid = figure.add_gridspec(2, columns, height_ratios=[max(body, 1e-3), bars])
        for number, observable in enumerate(observables):
            inner = grid[0, number].subgridspec(
                1 + count, 1, height_ratios=[_DATA, *[_STRIP] * count], hspace=0.04
            )
            axes = [figure.add_subplot(inner[0])]
            axes += [figure.add_subplot(inner[i], sharex=axes[0]) for i in range(1, 1 + count)]
            _draw_observable(axes, comparison, observable, styles)
        draw_evidence(figure.add_subplot(grid[1, :]), comparison, styles)
        weight = "bold" if is_stand_in(comparison.best) else "normal"
        figure.suptitle(heading, fontsize=7.5, weight=weight)
        figure.legend(
            handles=[mark for mark, _ in legend],
            labels=[label for _, label in legend],
            loc="outside lower center",
            ncols=2 * columns,
            fontsize=6.6,
            handlelength=2.4,
        )
        style.fix_layout(figure)
    return figure


def observables_over_angle(comparison: Comparison) -> list[str]:
    """Observables that are drawn: those that depend on the angle, as many as there is room for."""
    names = comparison.best.points["observable"].unique()
    return [str(name) for name in names if has_angle(str(name))][:MOST_COLUMNS]


def _draw_observable(
    axes: list[Axes], comparison: Comparison, observable: str, styles: dict[str, style.SeriesStyle]
) -> None:
    """Data and lines on top, under them a strip of standardised residuals for each closure."""
    rows = rows_of(comparison.best.points, observable)
    names = [str(name) for name in rows["series"].unique()]
    x, value = (rows[column].to_numpy(dtype=float) for column in ("gamma_deg", "value"))
    crowded = len(rows) > panels.CROWD
    front, ink = (panels.IN_FRONT, "0.6") if crowded else (panels.BEHIND, "black")
    drawn = []
    for name, entry in comparison.entries.items():
        for curve in panels.curves(entry.fit, observable, names, bands=False):
            own, offset = styles[name], entry.fit.noise.angle_offset
            # over the set angle, whatever offset the closure has found
            x_set = curve.x - (0.0 if offset is None else offset.value or 0.0)
            drawn.append(replace(curve, x=x_set, pen=Pen(own.colour, own.line)))
            draw_curve(axes[0], drawn[-1], front=front)
    markers = style.series_styles([str(name) for name in comparison.best.points["series"].unique()])
    size = panels.look_of(len(rows)).size
    error = rows["sigma_used"].to_numpy(dtype=float)
    for series in names:
        at = (rows["series"] == series).to_numpy()
        axes[0].errorbar(
            x[at], value[at], yerr=error[at], fmt=markers[series].marker, ms=size, mfc="white", mec=ink,
            mew=0.7, ecolor=ink if crowded else GREY, elinewidth=0.6, zorder=4,
            rasterized=len(rows) > panels.PIXELS,
        )  # fmt: skip
    panels.mark_stand_in(axes[0], rows)
    axes[0].set_ylim(*panels.value_limits(rows, drawn, x))
    axes[0].set_ylabel(panels.axis_label(observable))
    for strip, (name, entry) in zip(axes[1:], comparison.entries.items(), strict=True):
        _draw_strip(strip, rows_of(entry.fit.points, observable), title(name), styles[name], size)
    for upper in axes[:-1]:
        upper.tick_params(labelbottom=False)
    panels.set_x(axes[-1], x, panels.ANGLE)
    axes[-1].set_xlabel(panels.ANGLE)


def _draw_strip(
    axes: Axes, rows: pd.DataFrame, words: str, series_style: style.SeriesStyle, size: float
) -> None:
    z = rows["standardised"].to_numpy(dtype=float)
    top, tick = strip_limit(z)
    axes.axhline(0.0, color=GREY, lw=0.6, zorder=1)
    axes.axhspan(-2.0, 2.0, color="0.93", lw=0.0, zorder=0)
    axes.plot(
        rows["gamma_deg"], z, ls="none", marker=series_style.marker, ms=0.75 * size, mfc=series_style.colour,
        mec=series_style.colour, mew=0.4, rasterized=len(rows) > panels.PIXELS,
    )  # fmt: skip
    axes.set_ylim(-top, top)
    axes.set_yticks([-tick, tick], strip_labels(tick))
    axes.set_ylabel(f"{words}\n(σ)", fontsize=6.0, rotation=0, ha="right", va="center")


def strip_limit(z: Array) -> tuple[float, float]:
    """Upper end of an axis of standardised residuals in a strip, and the one tick on either side of zero."""
    top = max(3.5, 1.25 * float(np.abs(z[np.isfinite(z)]).max(initial=0.0)))
    return top, 2.0 if top < 8.0 else float(f"{0.6 * top:.0e}")


def strip_labels(tick: float) -> tuple[str, str]:
    """Labels of the two ticks, short enough to stand beside the name of a closure."""
    text = f"{tick:.0f}" if tick < 1e3 else power_of_ten(tick)
    return f"\u2212{text}", text


def draw_evidence(axes: Axes, comparison: Comparison, styles: dict[str, style.SeriesStyle]) -> None:
    """Bars of log Bayes factors and points of cross-validation, both against the best."""
    ranked = comparison.ranked
    axes.axvspan(-INDIFFERENT, 0.0, color="0.9", lw=0.0, zorder=0)
    for place, name in enumerate(ranked):
        entry = comparison.entries[name]
        axes.barh(place, entry.log_bayes_factor, height=0.55, color=styles[name].colour, alpha=0.75)
        if entry.loo is not None:
            axes.errorbar(
                entry.loo.difference, place, xerr=np.nan_to_num(entry.loo.se_difference), fmt="o", ms=3.2,
                color="black", mfc="white", elinewidth=0.8, capsize=2.0, zorder=4,
            )  # fmt: skip
    _scale(axes, comparison)
    axes.set_yticks(range(len(ranked)), [title(name) for name in ranked])
    axes.set_ylim(len(ranked) - 0.4, -0.6)
    words = "log Bayes factor against the best (bars)\n"
    words += f"grey: no preference; axis logarithmic beyond {LINEAR:g}"
    if any(entry.loo for entry in comparison.entries.values()):
        words += "\nLOO difference ± se (points)"
    axes.set_xlabel(words, fontsize=7.0)


def _scale(axes: Axes, comparison: Comparison) -> None:
    """Linear to -5, logarithmic beyond: factors reach from nothing to thousands."""
    low, high = evidence_limits(comparison)
    axes.set_xscale("symlog", linthresh=LINEAR)
    axes.set_xlim(low, high)
    if low < -1.6 * LINEAR:
        powers = math.ceil(math.log10(-low))
        decades = [-(10.0**k) for k in range(1, powers, max(1, round(powers / MOST_DECADES)))]
        ticks = [*reversed(decades), 0.0]
    else:
        ticks = [float(x) for x in range(math.ceil(low), 1)]
    axes.set_xticks(ticks, [_thousands(x) for x in ticks])
    axes.minorticks_off()


def _thousands(x: float) -> str:
    text = f"{x:,.0f}" if abs(x) < LONG else f"-{power_of_ten(-x)}"
    return text.replace("-", "\u2212").replace(",", "\u2009")


def evidence_limits(comparison: Comparison) -> tuple[float, float]:
    """Ends of the axis of log Bayes factors, with cross-validation's standard errors in sight."""
    ends = [(entry.log_bayes_factor, 0.0) for entry in comparison.entries.values()]
    for loo in (entry.loo for entry in comparison.entries.values()):
        if loo is not None:
            se = float(np.nan_to_num(loo.se_difference))
            ends.append((loo.difference - se, loo.difference + se))
    low, high = min(-2.0, *(end for end, _ in ends)), max(0.3, *(end for _, end in ends))
    return 1.6 * low, 1.3 * high


def _legend(
    comparison: Comparison, styles: dict[str, style.SeriesStyle], observables: list[str]
) -> list[tuple[Any, str]]:
    from matplotlib.lines import Line2D

    entries = [
        (Line2D([], [], color=own.colour, ls=own.line, marker=own.marker, ms=3.2), title(name))
        for name, own in styles.items()
    ]
    points = comparison.best.points
    markers = style.series_styles([str(name) for name in points["series"].unique()])
    shown = points["series"][points["observable"].isin(observables)].unique()
    for name in map(str, shown):
        entries.append((handle(markers[name].marker, 4.2, "white", "black"), series_label(points, name, 40)))
    if comparison.best.is_sampled:
        entries.append((handle("", 0.0, "none"), f"points: {amount_words(comparison.best)}"))
    return entries


def rows_of(points: pd.DataFrame, observable: str) -> pd.DataFrame:
    """Those that are drawn over the angle."""
    return points[(points["observable"] == observable) & points["gamma_deg"].notna()]


def write_comparison(comparison: Comparison, out: Path, *, force: bool) -> list[str]:
    """Write compare.json, compare.svg and compare.png into a folder, whole or not at all.

    Raises
    ------
    UsageError
        If the folder holds an earlier comparison and `force` is not given, or nothing can be written there.
    """

    def fill(folder: Path) -> list[str]:
        write_json(comparison.to_dict(), folder / COMPARISON.record)
        return [COMPARISON.record, *save_svg_and_png(comparison.plot(), folder, "compare")]

    return deliver(fill, Path(out), COMPARISON, force=force)
