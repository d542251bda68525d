"""Figures of the calibration: ranks of the exact posterior, coverage of all methods."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from calibration_methods import BOUNDED, COVARIANCE, EXACT, PROFILE, WRONG
from calibration_verdict import BINS, EVERYWHERE, LEVELS, Line, bin_limits

from ifrfit.report import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS = 4
LOOKS = {  # marker, colour, filled: told apart in grey, too
    EXACT: ("o", "#0072B2", True),
    COVARIANCE: ("s", "#D55E00", False),
    BOUNDED: ("^", "#009E73", False),
    PROFILE: ("D", "#CC79A7", True),
}
TITLES = {"e_n": "e_n", "e_t": "e_t", "mu": "μ", "kappa": "κ", "beta0": "β₀"}
SMALL = 6.5


def ranks(lines: Sequence[Line]) -> Figure:
    """Histograms of the ranks of the exact posterior, a row a scene; the last row are controls.

    85 mm wide. The grey band holds all bins of a right posterior together in 95 % of studies.
    """
    exact = [x for x in lines if x.method == EXACT and x.scene != EVERYWHERE and x.histogram]
    rows: list[tuple[str, list[Line]]] = []
    for scene in dict.fromkeys(x.scene for x in exact):
        own = [x for x in exact if x.scene == scene]
        rows += [("" if i else scene, own[i : i + COLUMNS]) for i in range(0, len(own), COLUMNS)]
    for control in WRONG:
        wrong = [x for x in lines if x.method == control and x.histogram][:COLUMNS]
        if wrong:
            rows.append((f"CONTROL, must fail: {control}", wrong))
    with style.drawing():
        figure = _figure(0.35 + 0.74 * len(rows))
        grid = figure.subplots(len(rows), COLUMNS, squeeze=False)
        for number, (axes_row, (title, own)) in enumerate(zip(grid, rows, strict=True)):
            for axes in axes_row[len(own) :]:
                axes.set_visible(False)
            for axes, line in zip(axes_row, own, strict=False):
                _draw_histogram(axes, line, labelled=number == len(rows) - 1)
            heading = axes_row[0].annotate(
                title, (0.0, 1.0), (0.0, 12.0), xycoords="axes fraction", textcoords="offset points",
                fontsize=SMALL + 0.5, weight="bold",
            )  # fmt: skip
            heading.set_in_layout(False)  # it runs over the whole row
        figure.supxlabel("rank of the truth in its posterior", fontsize=8.0)
        figure.supylabel(f"experiments a bin, over the expected ({BINS} bins)", fontsize=8.0)
        style.fix_layout(figure)
    return figure


def _draw_histogram(axes: Axes, line: Line, *, labelled: bool) -> None:
    expected = line.n / BINS
    low, high = bin_limits(line.n)
    axes.axhspan(low / expected, high / expected, color="0.88", lw=0)
    axes.axhline(1.0, color="0.5", lw=0.6)
    edges = np.linspace(0.0, 1.0, BINS + 1)
    axes.stairs(np.array(line.histogram) / expected, edges, color="black", lw=0.9)
    top = max(2.0, 1.15 * max(line.histogram) / expected)
    axes.set(xlim=(0.0, 1.0), ylim=(0.0, top), xticks=[0.0, 0.5, 1.0])
    axes.set_xticklabels(["0", "½", "1"] if labelled else [])
    axes.set_yticks([0, 1] if top <= 4.0 else [0, round(top / 2.0)])
    axes.tick_params(labelsize=SMALL, length=2.0, pad=2.0)
    axes.set_title("\n" + title_of(line.name), fontsize=SMALL + 0.5, pad=2.0)  # a line for the heading


def title_of(name: str) -> str:
    """Return a quantity's name as figures write it."""
    bare, _, rest = name.removesuffix("]").partition("[")
    if bare == "noise":
        return f"σ of {rest.split('/')[-1]}" if rest else "factor"
    return TITLES.get(bare, bare) + (f" of {rest}" if rest else "")


def coverage(lines: Sequence[Line]) -> Figure:
    """Coverage of the 68 and 95 % intervals of every method, a row of panels a scene; 85 mm wide.

    Bars are two binomial standard errors.
    """
    own = [x for x in lines if x.method in LOOKS and x.scene != EVERYWHERE]
    scenes = list(dict.fromkeys(x.scene for x in own))
    names = {s: list(dict.fromkeys(x.name for x in own if x.scene == s)) for s in scenes}
    with style.drawing():
        figure = _figure(0.75 + sum(0.2 + 0.24 * len(n) for n in names.values()))
        grid = figure.subplots(
            len(scenes),
            2,
            squeeze=False,
            sharex="col",
            gridspec_kw={"height_ratios": [len(names[s]) for s in scenes]},
        )
        for axes_row, scene in zip(grid, scenes, strict=True):
            for axes, level in zip(axes_row, (1, 2), strict=True):
                _draw_coverage(axes, [x for x in own if x.scene == scene], names[scene], level)
            axes_row[1].tick_params(labelleft=False)
            axes_row[0].set_title(scene, fontsize=SMALL + 0.5, weight="bold", loc="left", pad=2.0)
        for axes, level in zip(grid[-1], (1, 2), strict=True):
            low, high = axes.get_xlim()
            axes.set_xlim(low, min(high, 101.0))
            axes.set_xlabel(f"in the {100 * LEVELS[level]:.0f} % interval (%)")
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=2, handletextpad=0.3)
        style.fix_layout(figure)
    return figure


def _draw_coverage(axes: Axes, lines: Sequence[Line], names: Sequence[str], level: int) -> None:
    axes.axvline(100.0 * LEVELS[level], color="0.4", lw=0.8)
    for i, (method, (marker, colour, filled)) in enumerate(LOOKS.items()):
        points = [x for x in lines if x.method == method and not math.isnan(x.coverage[level])]
        at = [names.index(x.name) + 0.2 * (i - 1.5) for x in points]
        axes.errorbar(
            [100.0 * x.coverage[level] for x in points],
            at,
            xerr=[200.0 * x.errors[level] for x in points],
            fmt=marker,
            color=colour,
            mfc=colour if filled else "white",
            ms=3.2,
            mew=0.8,
            elinewidth=0.8,
            label=method,
        )
    axes.set_yticks(range(len(names)), [title_of(name) for name in names])
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.tick_params(labelsize=SMALL + 0.5)


def _figure(height: float) -> Figure:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(style.PANEL_WIDTH_MM / style.MM_PER_INCH, height), layout="constrained")
    FigureCanvasAgg(figure)
    figure.get_layout_engine().set(w_pad=0.02, h_pad=0.02, hspace=0.02, wspace=0.02)  # type: ignore[union-attr, call-arg]
    return figure
