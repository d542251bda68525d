"""Which directions among the constants are tight and which are loose."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.diagnostics.thresholds import HALF
from ifrfit.report.page.charts.chart import Axis, Box, Chart, Mark, Panel, Words
from ifrfit.report.page.charts.scales import Logarithmic, Ticks
from ifrfit.report.page.drawings.canvas import symbol
from ifrfit.report.style import COLOURS

Array = NDArray[np.float64]

CELL_MM, BAR_MM, LEFT_MM, LINE_MM, BOTTOM_MM = 15.0, 42.0, 20.0, 9.0, 12.0
TOP_MM = 8.0
MOST = 2.0  # end of the axis of ratios


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


def draw_directions(found: Directions) -> Chart:
    """A line a direction: what it is made of, and how wide the posterior is along it."""
    n = len(found.names)
    tall, start = n * LINE_MM, LEFT_MM + n * CELL_MM + 6.0
    panels = (
        _parts(found, LEFT_MM, n * CELL_MM, tall),
        _ratios(found.ratio, start, BAR_MM, tall),
    )
    return Chart(start + BAR_MM + 12.0, TOP_MM + tall + BOTTOM_MM, panels)


def _parts(found: Directions, left: float, wide: float, tall: float) -> Panel:
    n = len(found.names)
    places = tuple(map(float, range(n)))
    marks: list[Mark] = []
    for row, part in enumerate(found.parts):
        for column, share in enumerate(part.tolist()):
            colour = COLOURS[0] if share >= 0 else COLOURS[1]
            cell = (column - 0.47, column + 0.47), (row - 0.44, row + 0.44)
            marks += [Box(*cell, colour, 0.75 * share**2), Words(column, row, share_text(share), 6.8)]
    names = Ticks(places, tuple(symbol(name, 4) for name in found.names))
    ends = Ticks(places, ("loosest", *([""] * (n - 2)), "tightest"))
    x = Axis(-0.5, n - 0.5, ticks=names, marked=False)
    y = Axis(n - 0.5, -0.5, ticks=ends, marked=False)
    return Panel(left, TOP_MM, wide, tall, x, y, tuple(marks), "made of", has_frame=False)


def share_text(share: float) -> str:
    """A component with its sign and two digits; none where it rounds to nothing."""
    text = f"{share:+.2f}".replace("-", "−")
    return "0" if text[1:] == "0.00" else text


def _ratios(ratio: Array, left: float, wide: float, tall: float) -> Panel:
    """Bars over a logarithmic axis, hatched where the direction is loose."""
    low = 10.0 ** min(-3, math.floor(math.log10(max(float(ratio.min()), 1e-12))))
    marks: list[Mark] = [Box((HALF, MOST), (-math.inf, math.inf), COLOURS[1], 0.15)]
    for row, value in enumerate(ratio.tolist()):
        loose = value >= HALF
        bar = (low, max(value, low)), (row - 0.28, row + 0.28)
        marks.append(Box(*bar, COLOURS[1] if loose else COLOURS[0], 0.7, edge="#000", is_hatched=loose))
    values = Ticks(tuple(map(float, range(ratio.size))), tuple(f"{value:.2g}" for value in ratio.tolist()))
    x = Axis(low, MOST, "posterior sd / prior sd", Logarithmic(), most=5, mirrored=True)
    y = Axis(ratio.size - 0.5, -0.5, ticks=values, marked=False, is_far=True)
    return Panel(left, TOP_MM, wide, tall, x, y, tuple(marks), "loose if shaded")
