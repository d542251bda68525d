"""Which constants the data determine, in words and as a picture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ifrfit.inference.diagnostics.thresholds import HALF
from ifrfit.inference.model.entry_names import quantity_of
from ifrfit.report.page.blocks import Block, Paragraph, Picture, Pictures
from ifrfit.report.page.drawings.directions import Directions, draw_directions
from ifrfit.report.page.phrases import sentence
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput

MOST = 6


def build(given: ReportInput) -> Sequence[Block] | None:
    """What is determined, what is loose; None where the result does not judge it."""
    result = given.result
    fact = result.facts.get("identifiable")
    if fact is None:
        return None
    figures = fact.figures
    counts = (
        f" The data see {figures['rank']} independent combinations of {figures['free']} free constants."
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
                f"{HALF:g} the data leave it loose.",
            )
        )
    return blocks


def directions(given: ReportInput) -> Directions | None:
    """Principal directions of the draws; None without two free constants, or where no domain is known."""
    prior_sd = {constant.name: constant.prior_sd for constant in given.result.asked}
    names = [name for name in given.free if quantity_of(name) in prior_sd and name in given.appraisal.draws]
    if not 2 <= len(names) <= MOST:
        return None
    covariance = np.cov(given.appraisal.draws[names].to_numpy(dtype=float), rowvar=False)
    return Directions.of(tuple(names), covariance, np.array([prior_sd[quantity_of(name)] for name in names]))


SECTION = ReportSection("identifiability", "Identifiability", build)
