"""The constants: table, and intervals of several methods side by side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ifrfit.inference.diagnostics.interval_disagreements import disagreements
from ifrfit.inference.estimators import label_of, title_of
from ifrfit.inference.model.entry_names import quantity_of
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Estimate, Interval
from ifrfit.physics.closures import CLOSURES
from ifrfit.report.constants_rows import table_rows
from ifrfit.report.page.blocks import Block, Findings, Paragraph, Picture, Pictures, Table
from ifrfit.report.page.drawings.intervals import Span, draw_intervals
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.regimes import transitions
from ifrfit.report.rounding import by_series, labelled, places_of, value_text
from ifrfit.report.sentences import status_words
from ifrfit.text import interval_text, sd_text

if TYPE_CHECKING:
    import pandas as pd

HEAD = ("constant", "value", "sd", "68 % interval", "95 % interval", "status")
MOST_PICTURES = 8


def build(given: ReportInput) -> Sequence[Block]:
    """Every constant with its intervals and status, and what other methods say of it."""
    blocks: list[Block] = [
        Table(
            "Constants, what follows from them, and the noise. Values and standard deviations as the "
            f"{title_of(given.result.method)} gives them.",
            HEAD,
            tuple(_rows(given.result)),
            frozenset({1, 2, 3, 4}),
        )
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
    return rows + [_row(label, estimate, status_words(estimate)) for label, estimate in derived(result)]


def _row(label: str, estimate: Estimate, remark: str) -> tuple[str, ...]:
    places = places_of(estimate)
    if estimate.status == "fixed":
        return (label, value_text(estimate), "", "", "", remark)
    sd = "" if estimate.stderr is None or estimate.value is None else sd_text(estimate.stderr)
    inner, outer = (interval_text(each, places) for each in (estimate.interval68, estimate.interval95))
    return (label, value_text(estimate), sd, inner, outer, remark)


def derived(result: FitResult) -> list[tuple[str, Estimate]]:
    """Transition angles and the restitution in sticking, by name."""
    found = []
    for series in result.transitions:
        whose = f" [{series}]" if len(result.transitions) > 1 else ""
        for angle in transitions(result, series):
            found.append((f"transition angle, deg{whose}", angle))
    closure = CLOSURES.get(result.closure)
    meaning = None if closure is None or (closure.own and closure.own.meaning) else closure.meaning
    if meaning is None:
        return found  # what a closure itself declares stands beside its constant
    each = by_series(result.derived.get(meaning.name))
    return found + [(labelled(meaning.words, series), estimate) for series, estimate in each.items()]


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


SECTION = ReportSection("constants", "Constants", build)
