"""The constants: table, and intervals of several methods, or of several results, side by side."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ifrfit.inference.diagnostics.interval_disagreements import disagreements
from ifrfit.inference.estimators import label_of, title_of
from ifrfit.inference.model.entry_names import quantity_of
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Estimate, Interval
from ifrfit.physics.closures import CLOSURES
from ifrfit.report.axis_words import shortened, symbol
from ifrfit.report.constants_rows import table_rows
from ifrfit.report.page.blocks import Block, Download, Findings, Paragraph, Picture, Pictures, Table
from ifrfit.report.page.charts.chart import Axis, Chart, Line, Mark, Points, lines_panel
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.regimes import spin_words, transitions
from ifrfit.report.sentences import by_series, labelled, places_of, status_words, value_text
from ifrfit.report.style import COLOURS, GREY, RESIDUAL_DASHES
from ifrfit.report.tables import csv_text, latex
from ifrfit.text import interval_text, sd_text

if TYPE_CHECKING:
    import pandas as pd

HEAD = ("constant", "value", "sd", "68 % interval", "95 % interval", "status")
MOST_PICTURES = 8
LONGEST = 34  # characters of a result's name
_CHARACTER, _GAP = 1.6, 4.0  # mm: a character of such a name, and what is left of a line beside it


def build(given: ReportInput) -> Sequence[Block]:
    """Every constant with its intervals and status, and what other methods say of it."""
    blocks: list[Block] = [
        Table(
            f"Constants, what follows from them, and the noise. Method: {title_of(given.result.method)}.",
            HEAD,
            tuple(_rows(given.result)),
            frozenset({1, 2, 3, 4}),
        ),
        Download("constants.csv", "text/csv", csv_text(given.result), "This table with all digits."),
        Download("constants.tex", "text/x-tex", latex(given.result), "The same for LaTeX."),
    ]
    pictures = tuple(_pictures(given))
    if pictures:
        blocks.append(
            Pictures(
                pictures,
                "Intervals side by side. Thin bar: 95 %; thick bar: 68 %, where the method gives it; circle: "
                "the value; dashed: a bound of the domain. The first line is what this report states; those "
                "below are central intervals.",
            )
        )
    if given.appraisal.intervals is None:
        blocks.append(
            Paragraph(f"Other methods are not shown here. {given.appraisal.without_profiles}", "note")
        )
    else:
        notes = [("note", sentence) for sentence in disagreements(given.appraisal.intervals)]
        if "exact" in _methods(given.appraisal.intervals):
            blocks.append(Findings(tuple(notes or [("ok", "the methods agree")])))
    return blocks


def _rows(result: FitResult) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for row in table_rows(result):
        if row.estimate is None:
            rows.append((row.label, row.plain, "", "", "", row.remark))
        else:
            rows.append(_row(row.label, row.estimate, row.remark))
    for series in result.transitions:
        spin = spin_words(result, series)
        for label, angle in transition_angles_of(result, series):
            rows.append(_row(label, angle, f"{status_words(angle)}; {spin}"))
    return rows + [_row(label, estimate, status_words(estimate)) for label, estimate in meanings(result)]


def _row(label: str, estimate: Estimate, remark: str) -> tuple[str, ...]:
    places = places_of(estimate)
    if estimate.status == "fixed":
        return (label, value_text(estimate), "", "", "", remark)
    sd = "" if estimate.stderr is None or estimate.value is None else sd_text(estimate.stderr)
    inner, outer = (interval_text(each, places) for each in (estimate.interval68, estimate.interval95))
    return (label, value_text(estimate), sd, inner, outer, remark)


def transition_angles_of(result: FitResult, series: str) -> list[tuple[str, Estimate]]:
    """Transition angles of a series, by name."""
    whose = f" [{series}]" if len(result.transitions) > 1 else ""
    return [(f"transition angle, deg{whose}", angle) for angle in transitions(result, series)]


def meanings(result: FitResult) -> list[tuple[str, Estimate]]:
    """What the closure's constant stands for, by name, where that has no row beside it."""
    closure = CLOSURES.get(result.closure)
    meaning = None if closure is None or (closure.own and closure.own.meaning) else closure.meaning
    if meaning is None:
        return []  # what a closure itself declares stands beside its constant
    each = by_series(result.derived.get(meaning.name))
    return [(labelled(meaning.words, series), estimate) for series, estimate in each.items()]


def _pictures(given: ReportInput) -> list[Picture]:
    """One picture for each free constant and kappa."""
    domains = {constant.name: (constant.lower, constant.upper) for constant in given.result.asked}
    found: list[Picture] = []
    for name, estimate in (given.free | given.kappas).items():
        spans = _spans(given, name, estimate)
        domain = domains.get(quantity_of(name), (-math.inf, math.inf))
        described = "; ".join(
            f"{span.label}: {interval_text(span.outer, places_of(estimate))}" for span in spans
        )
        found.append(
            Picture(
                f"intervals-{len(found) + 1}",
                f"Intervals of {name}",
                f"95 % intervals. {described}.",
                draw_intervals(name, spans, domain),
            )
        )
    return found[:MOST_PICTURES]


def _spans(given: ReportInput, name: str, estimate: Estimate) -> tuple[Span, ...]:
    method = label_of(given.result.method)
    spans = [Span(f"this fit ({method})", estimate.value, estimate.interval68, estimate.interval95)]
    table = given.appraisal.intervals
    if table is None or name not in table.index:
        return tuple(spans)
    for other in _methods(table):
        outer = _ends(table, name, other)
        if math.isnan(outer[0]):
            continue
        profile = given.appraisal.profiles.get(name) if other == "profile" else None
        spans.append(
            Span(
                other,
                None if profile is None else profile.value,
                None if profile is None else profile.central68,
                outer,
            )
        )
    return tuple(spans)


def _methods(table: pd.DataFrame) -> list[str]:
    return [m for m in ("covariance", "profile", "exact") if table[f"{m}_low"].notna().any()]


def _ends(table: pd.DataFrame, name: str, method: str) -> Interval:
    return float(table.at[name, f"{method}_low"]), float(table.at[name, f"{method}_high"])  # type: ignore[arg-type]


@dataclass(frozen=True)
class Span:
    """One line: what gave the interval, and the interval; an infinite end runs out of the picture.

    Attributes
    ----------
    label : str
    value : float or None
    inner, outer : tuple of float or None
        68 and 95 %.
    """

    label: str
    value: float | None
    inner: Interval | None
    outer: Interval


def draw_intervals(name: str, spans: tuple[Span, ...], domain: Interval) -> Chart:
    """What several methods say of one constant as bars over one axis.

    Parameters
    ----------
    name : str
        The constant.
    spans : tuple of Span
        From top to bottom.
    domain : tuple of float
        Its bounds, drawn where they are in sight.
    """
    ends = [end for span in spans for end in (*span.outer, span.value)]
    window = _window(ends, domain, 0.12)
    marks: list[Mark] = [
        Line(np.full(2, bound), np.array([-0.6, len(spans) - 0.4]), GREY, 0.8, RESIDUAL_DASHES)
        for bound in domain
        if window[0] < bound < window[1]
    ]
    for place, span in enumerate(spans):
        marks += _bar(span, place, window, COLOURS[place % len(COLOURS)])
    x = Axis(*window, symbol(name), most=5, mirrored=True)
    labels = [span.label for span in spans]
    names = _room_for(labels, least=25.0)
    return lines_panel(labels, x, marks, names + 60.0, names)


def draw_forest(name: str, lines: Sequence[tuple[str, Estimate]]) -> Chart:
    """One constant in several results: value with 68 and 95 % intervals; a cross where it was fixed.

    Parameters
    ----------
    name : str
        The constant.
    lines : sequence of (str, Estimate)
        Label and estimate, from top to bottom.
    """
    known = [end for _, e in lines if e.value is not None for end in (e.value, *e.interval95)]
    window = _window(known or [end for _, e in lines for end in e.interval95], (0.0, 1.0), 0.08)
    marks: list[Mark] = []
    for place, (label, estimate) in enumerate(lines):
        marks.append(Line(np.array(window), np.full(2, float(place)), "0.9", 0.6))
        if estimate.status == "fixed" and estimate.value is not None:
            marks.append(
                Points(np.array([estimate.value]), np.array([float(place)]), "x", 5.0, "none", GREY, 1.0)
            )
        else:
            span = Span(label, estimate.value, estimate.interval68, estimate.interval95)
            loose = estimate.value is None
            marks += _bar(span, place, window, GREY if loose else COLOURS[0], ":" if loose else "-")
    labels = [shortened(label, LONGEST) for label, _ in lines]
    names = _room_for(labels)
    x = Axis(*window, symbol(name), mirrored=True)
    return lines_panel(labels, x, marks, names + 80.0, names, line=5.0)


def _room_for(labels: Sequence[str], least: float = 0.0) -> float:
    """Millimetres that labels take beside their lines."""
    return max(least, _GAP + _CHARACTER * max(map(len, labels), default=0))


def _bar(span: Span, place: int, window: Interval, colour: str, line: str = "-") -> list[Mark]:
    """Thin for 95 %, thick for 68 %, a circle at the value; an arrow where an end is out of sight."""
    at = np.array([float(place)])
    ends = np.clip(span.outer, *window)
    found: list[Mark] = [Line(ends, np.repeat(at, 2), colour, 1.4, line)]
    for end, shown, marker in zip(span.outer, ends.tolist(), "<>", strict=True):
        if end != shown:
            found.append(Points(np.array([shown]), at, marker, 5.0, colour, colour, is_clipped=False))
        else:
            found.append(Line(np.full(2, end), place + np.array([-0.14, 0.14]), colour, 1.1))
    if span.inner is not None:
        found.append(Line(np.clip(span.inner, *window), np.repeat(at, 2), colour, 4.5, opacity=0.55))
    if span.value is not None:
        found.append(Points(np.array([span.value]), at, "o", 4.5, "#fff", colour, 1.2))
    return found


def _window(numbers: Iterable[float | None], otherwise: Interval, share: float) -> Interval:
    """What is in sight: every finite number, with some room; what stands for them where there is none."""
    finite = [x for x in numbers if x is not None and math.isfinite(x)]
    finite = finite or [end for end in otherwise if math.isfinite(end)] or [0.0, 1.0]
    low, high = min(finite), max(finite)
    room = share * (high - low) or 0.1 * max(abs(low), 1e-3)
    return low - room, high + room


SECTION = ReportSection("constants", "Constants", build, frozenset({"pictures"}))
