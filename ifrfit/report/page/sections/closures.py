"""Closures side by side, or why they are not: verdict, table, and a picture of data and evidence."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd

from ifrfit.inference.comparison import Comparison
from ifrfit.inference.comparison.result import Entry as ComparedClosure
from ifrfit.inference.comparison.verdict import INDIFFERENT, title
from ifrfit.report import panels
from ifrfit.report.axis_words import plain, shortened
from ifrfit.report.comparison.figure import (
    LINEAR,
    evidence_limits,
    observables_over_angle,
    rows_of,
    strip_labels,
    strip_limit,
)
from ifrfit.report.comparison.text import CROSS_VALIDATION, criteria, cross_validated, findings, prior_line
from ifrfit.report.figures import series_label
from ifrfit.report.page.blocks import Block, Findings, Paragraph, Picture, Pictures, Table
from ifrfit.report.page.charts.chart import (
    Axis,
    Bars,
    Box,
    Chart,
    Entry,
    Legend,
    Line,
    Mark,
    Panel,
    Points,
    Words,
)
from ifrfit.report.page.charts.scales import SymmetricLogarithmic, Ticks, number_text
from ifrfit.report.page.charts.typesetting import width
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.panels import Curve, numbers
from ifrfit.report.provenance import STAND_IN, stand_in_words
from ifrfit.report.sentences import sentence
from ifrfit.report.style import GREY, PANEL_WIDTH_MM, SeriesStyle, series_styles

# millimetres
LEFT, RIGHT, TOP, DATA, STRIP, GAP, BAR = 22.5, 3.0, 3.0, 56.0, 10.0, 0.6, 4.4
NUMBER = 11.0  # room for a log Bayes factor left of its bar
UNDER, UNDER_EVIDENCE = 13.0, 16.0  # for ticks and label of an axis
WORDS = (
    "log Bayes factor against the best (bars)",
    f"grey: no preference; logarithmic beyond {LINEAR:g}",
)
LOO = "LOO difference ± se (points)"
LONGEST = 26  # characters of a series' name in the legend
ANGLES = Ticks(tuple(15.0 * i for i in range(7)), tuple(str(15 * i) for i in range(7)))


def build(given: ReportInput) -> Sequence[Block] | None:
    """Verdict, table and picture of a comparison, or the sentence that says why there is none."""
    comparison = given.appraisal.comparison
    if comparison is None:
        missing = given.appraisal.without_comparison
        return (Paragraph(sentence(missing)),) if missing else None
    columns = criteria(comparison) + (CROSS_VALIDATION if cross_validated(comparison) else [])
    rows = tuple(
        (title(name), *(cell(comparison.entries[name]) for _, cell in columns)) for name in comparison.ranked
    )
    head = ("closure", *(name for name, _ in columns))
    says = sentence(comparison.verdict.says)
    picture = Picture("closures", "Closures", says, draw_closures(comparison))
    shown_above = set(given.result.warnings)
    return (
        Paragraph(says),
        Table(prior_line(comparison), head, rows, frozenset(range(1, len(head)))),
        Pictures(
            (picture,),
            f"{stand_in_words(given.result)}{_caption(comparison)}",
        ),
        Findings(tuple(item for item in findings(comparison) if item[1] not in shown_above)),
    )


def _caption(comparison: Comparison) -> str:
    scale = f"a closure at -5 is {math.exp(5.0):.0f} times less probable than the best"
    if not observables_over_angle(comparison):
        return f"Log Bayes factors against the best: {scale}."
    return (
        "Data with the best curve of each closure, the residuals of each in units of its own sigma, and log "
        f"Bayes factors against the best: {scale}."
    )


def draw_closures(comparison: Comparison) -> Chart:
    """Draw the observables that depend on the angle, at most three, and log Bayes factors under them."""
    observables = observables_over_angle(comparison)
    names = list(comparison.entries)
    styles = series_styles(names)
    wide = max(1, len(observables)) * PANEL_WIDTH_MM
    found: list[Panel] = []
    for column, observable in enumerate(observables):
        found += _observable(comparison, observable, styles, column * PANEL_WIDTH_MM + LEFT)
    body = DATA + len(names) * (STRIP + GAP) + UNDER if observables else 0.0
    tall = 1.0 + BAR * len(names)
    found.append(_evidence(comparison, styles, TOP + body, wide - LEFT - RIGHT, tall))
    legend = Legend(
        TOP + body + tall + UNDER_EVIDENCE, _rows_of_legend(_entries(comparison, styles, observables), wide)
    )
    height = legend.top + Legend.ROW * len(legend.rows) + 1.0
    return Chart(wide, height, tuple(found), legend)


def _observable(
    comparison: Comparison, observable: str, styles: dict[str, SeriesStyle], left: float
) -> list[Panel]:
    """Data and curves, and under them a strip of standardised residuals for each closure."""
    rows = rows_of(comparison.best.points, observable)
    gamma, value, error = numbers(rows, "gamma_deg", "value", "sigma_used")
    crowded = len(rows) > panels.CROWD
    lines, drawn = _curves(comparison, observable, rows, styles, crowded)
    limits = panels.value_limits(rows, drawn, gamma)
    size, ink = panels.look_of(len(rows)).size, "0.6" if crowded else "0"
    markers = series_styles([str(name) for name in comparison.best.points["series"].unique()])
    marks: list[Mark] = [] if crowded else [*lines]
    error = np.where(np.isfinite(error), error, 0.0)
    for series in rows["series"].unique():
        at = (rows["series"] == series).to_numpy()
        low, high = value[at] - error[at], value[at] + error[at]
        marks.append(Bars(gamma[at], low, high, colour=ink if crowded else GREY, width=0.6))
        marks.append(Points(gamma[at], value[at], markers[str(series)].marker, size, "#fff", ink, 0.7))
    marks += lines if crowded else []
    if (rows["provenance"] == STAND_IN).any():
        middle = 0.5 * (limits[0] + limits[1])
        marks.insert(0, Words(45.0, middle, "STAND-IN", 34.0, "0.55", turn=18.0, is_bold=True, opacity=0.2))
    inner = PANEL_WIDTH_MM - LEFT - RIGHT
    x = Axis(0.0, 90.0, ticks=ANGLES, mirrored=True, labelled=False)
    y = Axis(*limits, panels.axis_label(observable), mirrored=True, most=7)
    found, top = [Panel(left, TOP, inner, DATA, x, y, tuple(marks))], TOP + DATA + GAP
    names = list(comparison.entries)
    for name in names:
        strip = rows_of(comparison.entries[name].fit.points, observable)
        bottom = Axis(0.0, 90.0, panels.ANGLE, ticks=ANGLES, mirrored=True)
        found.append(
            _strip(strip, name, styles[name], size, (left, top, inner), bottom if name == names[-1] else x)
        )
        top += STRIP + GAP
    return found


def _curves(
    comparison: Comparison,
    observable: str,
    rows: pd.DataFrame,
    styles: dict[str, SeriesStyle],
    crowded: bool,
) -> tuple[list[Line], list[Curve]]:
    """Lines of every closure over the set angle, and the curves they come from."""
    lines, drawn = [], []
    series = [str(name) for name in rows["series"].unique()]
    for name, entry in comparison.entries.items():
        own, offset = styles[name], entry.fit.noise.angle_offset
        shift = 0.0 if offset is None else offset.value or 0.0
        for curve in panels.curves(entry.fit, observable, series, bands=False):
            halo = 3.2 if crowded else 0.0
            lines.append(Line(curve.x - shift, curve.y, own.colour, 1.2, own.line, halo=halo))
            drawn.append(curve)
    return lines, drawn


def _strip(
    rows: pd.DataFrame,
    name: str,
    own: SeriesStyle,
    size: float,
    place: tuple[float, float, float],
    x: Axis,
) -> Panel:
    gamma, z = numbers(rows, "gamma_deg", "standardised")
    top, tick = strip_limit(z)
    ticks = Ticks((-tick, tick), strip_labels(tick))
    y = Axis(-top, top, f"{title(name)}\n(σ)", ticks=ticks, mirrored=True, label_turned=False)
    ends = np.array([0.0, 90.0])
    marks: tuple[Mark, ...] = (
        Box((-math.inf, math.inf), (-2.0, 2.0), "0.93"),
        Line(ends, np.zeros(2), GREY, 0.6),
        Points(gamma, z, own.marker, 0.75 * size, own.colour, own.colour, 0.4),
    )
    left, upper, inner = place
    return Panel(left, upper, inner, STRIP, x, y, marks)


def _evidence(
    comparison: Comparison, styles: dict[str, SeriesStyle], top: float, wide: float, tall: float
) -> Panel:
    """Bars of log Bayes factors and points of cross-validation, against the best closure."""
    ranked = comparison.ranked
    marks: list[Mark] = [Box((-INDIFFERENT, 0.0), (-math.inf, math.inf), "0.9")]
    crossed: list[Mark] = []
    for place, name in enumerate(ranked):
        entry, at = comparison.entries[name], np.array([float(place)])
        ends = min(entry.log_bayes_factor, 0.0), max(entry.log_bayes_factor, 0.0)
        marks.append(Box(ends, (place - 0.275, place + 0.275), styles[name].colour, 0.75))
        if entry.loo is not None:
            difference, se = np.array([entry.loo.difference]), np.nan_to_num(entry.loo.se_difference)
            crossed.append(Bars(at, difference - se, difference + se, "x", width=0.8, cap=4.0))
            crossed.append(Points(difference, at, "o", 3.2, "#fff", "#000"))
    words = WORDS + ((LOO,) if crossed else ())
    low, high = evidence_limits(comparison)
    scale = SymmetricLogarithmic(LINEAR)
    low = scale.widened(low, high, NUMBER / wide)
    x = Axis(low, high, "\n".join(words), scale, mirrored=True, most=8)
    for place, name in enumerate(ranked):
        entry = comparison.entries[name]
        left = scale.shifted(_lowest(entry), -0.01, low, high)
        marks.append(Words(left, place, evidence_text(entry.log_bayes_factor), 6.5, anchor="end"))
    names = Ticks(tuple(map(float, range(len(ranked)))), tuple(title(name) for name in ranked))
    y = Axis(len(ranked) - 0.4, -0.6, ticks=names, mirrored=True)
    return Panel(LEFT, top, wide, tall, x, y, (*marks, *crossed))


def _lowest(entry: ComparedClosure) -> float:
    """Where the bar of a closure ends, or what cross-validation says of it."""
    ends = [0.0, entry.log_bayes_factor]
    if entry.loo is not None:
        ends.append(entry.loo.difference - float(np.nan_to_num(entry.loo.se_difference)))
    return min(ends)


def evidence_text(log_bayes_factor: float) -> str:
    """A log Bayes factor, to a tenth where it is small; the best closure's is 0."""
    if log_bayes_factor == 0.0:
        return "best"
    return number_text(log_bayes_factor, 1 if abs(log_bayes_factor) < 10.0 else 0)


def _entries(comparison: Comparison, styles: dict[str, SeriesStyle], observables: list[str]) -> list[Entry]:
    """Each closure's line and mark, and the mark of each series that is drawn."""
    none = np.zeros(0)
    entries = [
        Entry(
            title(name),
            Line(none, none, own.colour, 1.2, own.line),
            _mark(own.marker, 3.2, own.colour, own.colour),
        )
        for name, own in styles.items()
    ]
    points = comparison.best.points
    markers = series_styles([str(name) for name in points["series"].unique()])
    for name in map(str, points["series"][points["observable"].isin(observables)].unique()):
        short = shortened(name, LONGEST)  # the provenance stays
        own_rows = points[points["series"] == name].assign(series=short)
        label = " ".join(series_label(own_rows, short, LONGEST).split())
        entries.append(Entry(label, None, _mark(markers[name].marker, 4.2, "#fff", "#000")))
    return entries


def _mark(marker: str, size: float, fill: str, edge: str) -> Points:
    return Points(np.zeros(0), np.zeros(0), marker, size, fill, edge)


def _rows_of_legend(entries: Iterable[Entry], wide: float) -> tuple[tuple[Entry, ...], ...]:
    """Entries in rows that are no wider than the chart."""
    rows: list[list[Entry]] = [[]]
    room = 0.0
    for entry in entries:
        own = 11.0 + width(plain(entry.label), Legend.LETTERS) / 72.0 * 25.4
        if rows[-1] and room + own > wide - 4.0:
            rows.append([])
            room = 0.0
        rows[-1].append(entry)
        room += own
    return tuple(tuple(row) for row in rows)


SECTION = ReportSection("closures", "Closures compared", build, frozenset({"pictures"}))
