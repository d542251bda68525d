"""Posterior predictive checks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ifrfit.inference.diagnostics.thresholds import REFUTED
from ifrfit.report.page.blocks import Block, Paragraph, Picture, Pictures, Table
from ifrfit.report.page.drawings.checks import draw_checks
from ifrfit.report.page.phrases import sentence
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.sentences import CHECKS
from ifrfit.text import p_text

MEANING = {
    "chi2": "whether the scatter is as large as sigma says",
    "runs": "whether signs of neighbours along the slip ratio are like tosses of a coin",
    "largest": "whether the largest residual is larger than chance allows",
    "share": "whether as many rows as should lie inside the 95 % band",
}


def build(given: ReportInput) -> Sequence[Block]:
    """Whether the posterior would bring forth such data again."""
    fact = given.result.facts.get("predictive")
    if fact is None or not any(f"p_{name}" in fact.figures for name in CHECKS):
        says = "This method has no posterior to predict with. ifrfit fit --method exact makes these checks."
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


SECTION = ReportSection("predictive", "Posterior predictive checks", build)
