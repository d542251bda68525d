"""Marginals and pairs of the constants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.distributions.marginal_density import MarginalDensity, marginal_window
from ifrfit.inference.estimators import title_of
from ifrfit.inference.model.entry_names import quantity_of
from ifrfit.inference.model.prior_density import kappa_prior_density, prior_density
from ifrfit.inference.result.types import Interval
from ifrfit.report.axis_words import symbol
from ifrfit.report.credible_regions import contours, regions
from ifrfit.report.modes import modes_of
from ifrfit.report.page.blocks import Block, Paragraph, Picture, Pictures, Table
from ifrfit.report.page.charts.chart import Axis, Band, Chart, Line, Mark, Panel, Points
from ifrfit.report.page.charts.scales import Ticks
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.style import COLOURS, GREY, RESIDUAL_DASHES

MOST = 6
Array = NDArray[np.float64]

CELL_MM, LEFT_MM, BOTTOM_MM, GAP_MM, TOP_MM = 36.0, 15.0, 11.0, 3.2, 2.0  # the gap holds a note on ticks
BINS = 30
PRIOR_PLACES = 61
LONGEST = 10  # characters of a series' name
SHOWN = 400  # draws drawn as points


def build(given: ReportInput) -> Sequence[Block] | None:
    """Corner plot of the draws, and the correlations; None where every constant is fixed."""
    result = given.result
    draws = given.appraisal.draws
    estimates = given.free | given.kappas
    names = [name for name in estimates if name in draws and draws[name].std() > 0.0]
    if not names:
        return None
    if not any(quantity_of(name) == "e_n" for name in given.free):
        # kappa is mu times a number then
        names = [name for name in names if not name.startswith("kappa")]
    shown = names[:MOST]
    columns = {name: draws[name].to_numpy(dtype=float) for name in shown}
    if result.state.sample is None:
        law = "Gaussian around the optimum, cut at the bounds"
    else:
        law = title_of(result.method)
    left_out = f" Not shown: {', '.join(names[MOST:])}." if len(names) > MOST else ""
    described = "; ".join(
        f"{name}: mean {column.mean():.4g}, sd {column.std():.2g}" for name, column in columns.items()
    )
    blocks: list[Block] = [
        Pictures(
            (
                Picture(
                    "corner",
                    "Marginals and pairs",
                    f"{described}.",
                    draw_corner(
                        columns,
                        {name: estimates[name].interval95 for name in shown},
                        marginals(given, columns),
                    ),
                ),
            ),
            f"{_caption(given, shown, law, len(draws))}{left_out}",
        )
    ]
    labels, matrix = result.correlation.names, result.correlation.matrix
    if len(labels) > 1:
        rows = tuple(
            (label, *(f"{matrix[i, j]:+.3f}" for j in range(len(labels)))) for i, label in enumerate(labels)
        )
        blocks.append(
            Table(
                "Correlation of the free constants.",
                ("constant", *labels),
                rows,
                frozenset(range(1, len(labels) + 1)),
            )
        )
    if result.state.sample is None:
        blocks.append(
            Paragraph("This method has no posterior: the draws show the curvature at the optimum.", "note")
        )
    return blocks


def _caption(given: ReportInput, shown: Sequence[str], law: str, count: int) -> str:
    """What is seen, and how it was made."""
    exact = all(name in given.appraisal.densities for name in shown)
    diagonal = "marginal density as integrated" if exact else f"histogram of {count} draws"
    prior = "; grey: its prior" if given.result.is_posterior and given.result.asked else ""
    modes = "; triangles: the modes that the fit found" if modes_of(given.result) else ""
    return (
        f"{law[:1].upper()}{law[1:]}. Diagonal: {diagonal}, with its median and the stated 95 % interval "
        f"(dashed){prior}{modes}. Below: pairs by {count} draws, with the contours that hold 68 % (solid) "
        "and 95 % (dashed)."
    )


def draw_corner(
    columns: Mapping[str, Array],
    intervals: Mapping[str, Interval],
    diagonal: Mapping[str, Marginal] | None = None,
) -> Chart:
    """Marginals on the diagonal; points with the contours of 68 and 95 % under it.

    Parameters
    ----------
    columns : mapping of str to ndarray, (m,)
        Draws by name of the constant.
    intervals : mapping of str to tuple of float
        95 % interval of each; infinite ends run out of the picture.
    diagonal : mapping of str to Marginal, optional
        What is drawn of each by itself; histograms of the draws where it is not given.
    """
    names = list(columns)
    n = len(names)
    extent = n * CELL_MM + (n - 1) * GAP_MM
    windows = {name: marginal_window(column, intervals.get(name, ())) for name, column in columns.items()}
    alone = {name: Marginal.of_draws(column, windows[name]) for name, column in columns.items()}
    alone |= diagonal or {}
    panels = []
    for row, below in enumerate(names):
        for column, across in enumerate(names[: row + 1]):
            x = _axis(across, windows[across], is_outer=row == n - 1)
            if row == column:
                marks, top = _marginal(alone[across], windows[across], intervals.get(across))
                y = Axis(0.0, top, ticks=Ticks((), ()))
            else:
                marks = _pair(columns[across], columns[below], windows[across], windows[below])
                y = _axis(below, windows[below], is_outer=column == 0)
            left, top = (
                edge + place * (CELL_MM + GAP_MM) for edge, place in ((LEFT_MM, column), (TOP_MM, row))
            )
            panels.append(Panel(left, top, CELL_MM, CELL_MM, x, y, tuple(marks)))
    return Chart(LEFT_MM + extent + TOP_MM, TOP_MM + extent + BOTTOM_MM, tuple(panels))


def _axis(name: str, window: Interval, *, is_outer: bool) -> Axis:
    label = symbol(name, LONGEST) if is_outer else ""
    return Axis(*window, label, most=4, labelled=is_outer, inside=True)


def _marginal(shown: Marginal, window: Interval, interval: Interval | None) -> tuple[list[Mark], float]:
    """The prior in grey, a density or a histogram over it, median, interval, modes; and the axis' end."""
    x, heights = shown.outline
    top = 1.12 * float(heights.max())
    marks: list[Mark] = []
    if shown.prior is not None:
        at, prior = shown.prior
        marks += [Band(at, np.zeros(at.size), prior, "0.5", 0.25), Line(at, prior, "0.5", 0.8)]
    marks += [
        Band(x, np.zeros(x.size), heights, COLOURS[0], 0.3),
        Line(x, heights, COLOURS[0], 1.0),
        Line(np.full(2, shown.median), np.array([0.0, top]), GREY, 1.0),
    ]
    for end in interval or ():
        if window[0] < end < window[1]:
            marks.append(Line(np.full(2, end), np.array([0.0, top]), GREY, 0.8, RESIDUAL_DASHES))
    modes = np.array([mode for mode in shown.modes if window[0] < mode < window[1]])
    if modes.size:
        marks.append(Points(modes, np.full(modes.size, 0.96 * top), "v", 4.5, COLOURS[1], "#000", 0.6))
    return marks, top


@dataclass(frozen=True)
class Marginal:
    """What is drawn of one quantity.

    Attributes
    ----------
    outline : tuple of ndarray
        Values and heights of a density, or the steps of a histogram of that area, (n,) each.
    median : float
    prior : tuple of ndarray, or None
        Values and density of the prior, (m,) each, within the same window.
    modes : tuple of float
        The quantity at each of several modes; empty where there is one.
    """

    outline: tuple[Array, Array]
    median: float
    prior: tuple[Array, Array] | None = None
    modes: tuple[float, ...] = ()

    @classmethod
    def of_density(cls, found: MarginalDensity, **more: Any) -> Marginal:
        """By its own density, closed where it ends at a bound."""
        x = np.concatenate((found.edges[:1], found.middles, found.edges[-1:]))
        heights = np.concatenate((found.density[:1], found.density, found.density[-1:]))
        return cls((x, heights), found.median, **more)

    @classmethod
    def of_draws(cls, column: Array, window: Interval, **more: Any) -> Marginal:
        """By a histogram of draws, (n,)."""
        counts, edges = np.histogram(column, bins=BINS, range=window)
        heights = counts / (column.size * (edges[1] - edges[0]))
        outline = np.repeat(edges, 2), np.concatenate(([0.0], np.repeat(heights, 2), [0.0]))
        return cls(outline, float(np.median(column)), **more)


def marginals(given: ReportInput, columns: Mapping[str, Array]) -> dict[str, Marginal]:
    """What is drawn of each of some quantities, whose draws are the columns."""
    found = {}
    for name, column in columns.items():
        density = given.appraisal.densities.get(name)
        window = marginal_window(column)
        more: dict[str, Any] = {"prior": _prior(given, name, window), "modes": _modes(given, name)}
        found[name] = (
            Marginal.of_draws(column, window, **more)
            if density is None
            else Marginal.of_density(density, **more)
        )
    return found


def _prior(given: ReportInput, name: str, window: Interval) -> tuple[Array, Array] | None:
    """The prior of a constant or of kappa, where the method has one and the result says which."""
    asked = {each.name: each for each in given.result.asked}
    kind = quantity_of(name)
    if not given.result.is_posterior:
        return None
    if kind in asked:
        ends = max(window[0], asked[kind].lower), min(window[1], asked[kind].prior_upper)
        at = np.linspace(*ends, PRIOR_PLACES)
        return at, prior_density(asked[kind], at)
    at = np.linspace(*window, PRIOR_PLACES)
    if kind == "kappa" and {"e_n", "mu"} <= asked.keys():
        return at, kappa_prior_density(asked["e_n"], asked["mu"], at)
    return None


def _modes(given: ReportInput, name: str) -> tuple[float, ...]:
    """Values of a quantity at each of several modes that the fit found."""
    found = [mode["constants"] for mode in modes_of(given.result)]
    return tuple(float(mode[name]) for mode in found if name in mode)


def _pair(x: Array, y: Array, across: Interval, below: Interval) -> list[Mark]:
    """Some of the draws, and the contours around most of all of them."""
    step = max(1, x.size // SHOWN)
    marks: list[Mark] = [Points(x[::step], y[::step], "o", 0.9, COLOURS[0], "none", opacity=0.5)]
    found = regions(x, y, across, below)
    if found is not None:
        for level, colour, width, dashes in zip(
            found.levels, (COLOURS[1], COLOURS[0]), (0.9, 1.3), ("--", "-"), strict=True
        ):
            marks += [Line(line[:, 0], line[:, 1], colour, width, dashes) for line in contours(found, level)]
    return marks


SECTION = ReportSection("posterior", "Posterior", build, frozenset({"table"}))
