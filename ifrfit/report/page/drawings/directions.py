"""Which directions among the constants are tight and which are loose."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.diagnostics.thresholds import HALF
from ifrfit.report.page.drawings.canvas import symbol
from ifrfit.report.style import COLOURS, MM_PER_INCH, drawing, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

CELL_MM, BAR_MM, LEFT_MM, LINE_MM, BOTTOM_MM = 15.0, 42.0, 20.0, 9.0, 12.0
MOST = math.log10(2.0)  # end of the axis of ratios


@dataclass(frozen=True)
class Directions:
    """Principal directions of a posterior, measured in standard deviations of the prior.

    Attributes
    ----------
    names : tuple of str, (p,)
    ratio : ndarray, (p,)
        Posterior over prior standard deviation along each direction, loosest first.
    parts : ndarray, (p, p)
        A row a direction: its components along the constants, the largest positive.
    """

    names: tuple[str, ...]
    ratio: Array
    parts: Array

    @classmethod
    def of(cls, names: tuple[str, ...], covariance: Array, prior_sd: Array) -> Directions:
        """Directions of a covariance, (p, p), in units of the priors' standard deviations, (p,)."""
        values, vectors = np.linalg.eigh(covariance / np.outer(prior_sd, prior_sd))
        order = np.argsort(-values, kind="stable")
        parts = vectors.T[order]
        largest = parts[np.arange(len(names)), np.abs(parts).argmax(axis=1)]
        return cls(names, np.sqrt(np.maximum(values[order], 0.0)), parts * np.sign(largest)[:, None])


def draw_directions(found: Directions) -> Figure:
    """A line a direction: what it is made of, and how wide the posterior is along it."""
    n = len(found.names)
    width = LEFT_MM + n * CELL_MM + 6.0 + BAR_MM + 12.0
    height = BOTTOM_MM + n * LINE_MM + 8.0
    with drawing():
        figure = new_figure(width, height / MM_PER_INCH)
        bottom, tall = BOTTOM_MM / height, n * LINE_MM / height
        parts = figure.add_axes((LEFT_MM / width, bottom, n * CELL_MM / width, tall))
        _parts(parts, found)
        start = LEFT_MM + n * CELL_MM + 6.0
        bars = figure.add_axes((start / width, bottom, BAR_MM / width, tall))
        _bars(bars, found.ratio)
    return figure


def _parts(axes: Axes, found: Directions) -> None:
    n = len(found.names)
    axes.set_xlim(-0.5, n - 0.5)
    axes.set_ylim(n - 0.5, -0.5)
    for row, part in enumerate(found.parts):
        for column, share in enumerate(part):
            axes.fill_between(
                [column - 0.47, column + 0.47],
                row - 0.44,
                row + 0.44,
                color=COLOURS[0] if share >= 0 else COLOURS[1],
                alpha=0.75 * float(share) ** 2,
                lw=0.0,
            )
            axes.text(column, row, share_text(float(share)), ha="center", va="center", fontsize=6.8)
    axes.set_xticks(range(n), [symbol(name, 4) for name in found.names])
    axes.set_yticks(range(n), ["loosest", *([""] * (n - 2)), "tightest"])
    axes.tick_params(length=0)
    axes.set_title("made of", fontsize=7.5)
    for spine in axes.spines.values():
        spine.set_visible(False)


def share_text(share: float) -> str:
    """A component with its sign and two digits; none where it rounds to nothing."""
    text = f"{share:+.2f}".replace("-", "−")
    return "0" if text[1:] == "0.00" else text


def _bars(axes: Axes, ratio: Array) -> None:
    """Bars over a logarithmic axis, drawn on a plain one, which is ten times as fast."""
    low = min(-3, math.floor(math.log10(max(float(ratio.min()), 1e-12))))
    axes.set_xlim(low, MOST)
    axes.set_ylim(ratio.size - 0.5, -0.5)
    axes.axvspan(math.log10(HALF), MOST, color=COLOURS[1], alpha=0.15, lw=0.0)
    for row, value in enumerate(ratio):
        loose = value >= HALF
        axes.fill_between(
            [low, math.log10(max(float(value), 10.0**low))],
            row - 0.28,
            row + 0.28,
            lw=0.6,
            ec="black",
            fc=COLOURS[1] if loose else COLOURS[0],
            alpha=0.7,
            hatch="////" if loose else None,
        )
    axes.yaxis.tick_right()
    axes.set_yticks(range(ratio.size), [f"{value:.2g}" for value in ratio])
    axes.tick_params(axis="y", length=0)
    powers = range(low, 1, max(1, -low // 4))
    axes.set_xticks(powers, [f"{10.0**power:g}" for power in powers])
    axes.set_xlabel("posterior sd / prior sd")
    axes.set_title("loose if shaded", fontsize=7.5)
