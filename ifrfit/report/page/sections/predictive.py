"""Posterior predictive checks, and their p-values on one axis."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ifrfit.inference.diagnostics.thresholds import REFUTED
from ifrfit.report.page.blocks import Block, Paragraph, Picture, Pictures, Table
from ifrfit.report.page.charts.chart import Axis, Box, Chart, Line, Mark, Points, Words, lines_panel
from ifrfit.report.page.charts.scales import Logarithmic
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.sentences import CHECKS, sentence
from ifrfit.report.style import COLOURS, GREY
from ifrfit.text import p_text

MEANING = {
    "chi2": "whether the scatter is as large as sigma says",
    "runs": "whether signs of neighbours along the slip ratio are like tosses of a coin",
    "largest": "whether the largest residual is larger than chance allows",
    "share": "whether as many rows as should lie inside the 95 % band",
}
LEAST = 1e-6  # smaller ones are drawn at the edge


def build(given: ReportInput) -> Sequence[Block]:
    """Whether the posterior would bring forth such data again."""
    fact = given.result.facts.get("predictive")
    if fact is None or not any(f"p_{name}" in fact.figures for name in CHECKS):
        says = "This method has no posterior to predict with. ifrfit fit --method exact makes these checks."
        if given.result.is_sampled and given.result.is_posterior:
            says = "These checks look at the rows one by one, and no sample has rows of all series."
        return (Paragraph(says, "note"),)
    p = {name: fact.figures.get(f"p_{name}") for name in CHECKS}
    known = {CHECKS[name]: float(value) for name, value in p.items() if value is not None}
    rows = tuple(
        (CHECKS[name], MEANING[name], "-" if value is None else p_text(float(value)), _verdict(value))
        for name, value in p.items()
    )
    described = "; ".join(f"{name}: p = {p_text(value)}" for name, value in known.items())
    return (
        Paragraph(sentence(fact.says), "plain" if fact.ok else "look"),
        Table("The checks.", ("check", "asks", "p", "verdict"), rows, frozenset({2})),
        Pictures(
            (Picture("checks", "Predictive p-values", f"{described}.", draw_checks(known)),),
            f"p-values of the checks; below {REFUTED:g} a check fails. The data serve twice, for the "
            "posterior and for its check, so these p-values are conservative: a small one is a "
            "strong sign.",
        ),
    )


def _verdict(p: Any) -> str:
    if p is None:
        return "not applicable"
    return "ok" if p >= REFUTED else "fails"


def draw_checks(p: Mapping[str, float]) -> Chart:
    """Each p-value over a logarithmic axis; what lies in the shade fails."""
    marks: list[Mark] = [
        Box((LEAST, REFUTED), (-math.inf, math.inf), COLOURS[1], 0.15),
        Words(0.8 * REFUTED, len(p) - 0.1, "fails", colour=GREY, anchor="end", height="bottom"),
    ]
    for place, value in enumerate(p.values()):
        fails = value < REFUTED
        colour = COLOURS[1] if fails else COLOURS[0]
        marker = "<" if value < LEAST else "X" if fails else "o"
        at = np.array([float(place)])
        marks += [
            Line(np.array([LEAST, 1.0]), np.repeat(at, 2), "0.85", 0.6),
            Points(np.array([max(value, LEAST)]), at, marker, 6.0, colour, colour, is_clipped=False),
        ]
    x = Axis(LEAST, 10.0**0.1, "p", Logarithmic(), most=7)
    return lines_panel(list(p), x, marks, 110.0, 42.0, below=0.5)


SECTION = ReportSection("predictive", "Posterior predictive checks", build, frozenset({"pictures"}))
