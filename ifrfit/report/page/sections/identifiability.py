"""Which constants the data determine, in words and as a picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.diagnostics.thresholds import HALF
from ifrfit.inference.model.entry_names import quantity_of
from ifrfit.inference.result.types import Fact
from ifrfit.report.axis_words import symbol
from ifrfit.report.page.blocks import Block, Paragraph, Picture, Pictures
from ifrfit.report.page.charts.chart import Axis, Box, Chart, Mark, Panel, Words
from ifrfit.report.page.charts.scales import Logarithmic, Ticks
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.sentences import sentence
from ifrfit.report.style import COLOURS

MOST = 6
Array = NDArray[np.float64]

CELL_MM, BAR_MM, LEFT_MM, LINE_MM, BOTTOM_MM = 15.0, 42.0, 20.0, 9.0, 12.0
TOP_MM = 8.0
END = 2.0  # end of the axis of ratios


def build(given: ReportInput) -> Sequence[Block] | None:
    """What is determined, what is loose; None where the result does not judge it."""
    result = given.result
    fact = result.facts.get("identifiable")
    if fact is None:
        return None
    figures = fact.figures
    counts = (
        f" The data see {_counted(figures['rank'], 'independent combination')} of "
        f"{_counted(figures['free'], 'free constant')}."
        if {"rank", "free"} <= set(figures)
        else ""
    )
    words = f"{sentence(fact.says)}{counts}"
    blocks: list[Block] = [Paragraph(words, "plain" if fact.ok else "look")]
    found = directions(given)
    if found is not None:
        loosest = " ".join(
            f"{share:+.2f} {name}" for share, name in zip(found.parts[0], found.names, strict=True)
        )
        how = "loose" if found.ratio[0] >= HALF else "tight"
        blocks.append(
            Pictures(
                (
                    Picture(
                        "directions",
                        "Loose and tight directions",
                        f"The loosest direction is {loosest}, in prior standard deviations; the posterior is "
                        f"{found.ratio[0]:.2g} times as wide as the prior along it: {how}.",
                        draw_directions(found),
                    ),
                ),
                "Principal directions of the posterior in the space of the free constants, each measured in "
                "standard deviations of its default prior. Left: what a direction is made of. Right: how "
                "wide the posterior is along it, as a share of the prior; beyond "
                f"{HALF:g} the data leave it loose.{_of_bounds(fact, found)}",
            )
        )
    return blocks


def _of_bounds(fact: Fact, found: Directions) -> str:
    """Why nothing is shaded where the data leave something loose."""
    if fact.ok or found.ratio[0] >= HALF:
        return ""
    return " That none is here is owed to bounds and priors, which the sentence above leaves out."


def directions(given: ReportInput) -> Directions | None:
    """Principal directions of the draws; None without two free constants, or where no domain is known."""
    prior_sd = {constant.name: constant.prior_sd for constant in given.result.asked}
    names = [name for name in given.free if quantity_of(name) in prior_sd and name in given.appraisal.draws]
    if not 2 <= len(names) <= MOST:
        return None
    covariance = np.cov(given.appraisal.draws[names].to_numpy(dtype=float), rowvar=False)
    return Directions.of(tuple(names), covariance, np.array([prior_sd[quantity_of(name)] for name in names]))


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


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"


def share_text(share: float) -> str:
    """A component with its sign and two digits; none where it rounds to nothing."""
    text = f"{share:+.2f}".replace("-", "−")
    return "0" if text[1:] == "0.00" else text


def _ratios(ratio: Array, left: float, wide: float, tall: float) -> Panel:
    """Bars over a logarithmic axis, hatched where the direction is loose."""
    low = 10.0 ** min(-3, math.floor(math.log10(max(float(ratio.min()), 1e-12))))
    marks: list[Mark] = [Box((HALF, END), (-math.inf, math.inf), COLOURS[1], 0.15)]
    for row, value in enumerate(ratio.tolist()):
        loose = value >= HALF
        bar = (low, max(value, low)), (row - 0.28, row + 0.28)
        marks.append(Box(*bar, COLOURS[1] if loose else COLOURS[0], 0.7, edge="#000", is_hatched=loose))
    values = Ticks(tuple(map(float, range(ratio.size))), tuple(f"{value:.2g}" for value in ratio.tolist()))
    x = Axis(low, END, "posterior sd / prior sd", Logarithmic(), most=5, mirrored=True)
    y = Axis(ratio.size - 0.5, -0.5, ticks=values, marked=False, is_far=True)
    return Panel(left, TOP_MM, wide, tall, x, y, tuple(marks), "loose if shaded")


SECTION = ReportSection("identifiability", "Identifiability", build, frozenset({"pictures"}))
