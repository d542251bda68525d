"""A report of a result: its sections in order."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from ifrfit.inference.result.fit_result import FitResult
from ifrfit.physics import CLOSURES
from ifrfit.report.page.blocks import Report, Section
from ifrfit.report.page.material import Material
from ifrfit.report.page.sections import (
    chains,
    closures,
    constants,
    effects,
    findings,
    fitted,
    identifiability,
    posterior,
    predictive,
    profiles,
    repeat,
    residuals,
)
from ifrfit.report.page.verdict import badges, verdict
from ifrfit.report.sentences import headline
from ifrfit.text import joined

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ifrfit.inference.comparison import Comparison

# a further section is one more file and one more line
SECTIONS: tuple[Callable[[Material], Section | None], ...] = (
    constants.section,
    findings.section,
    fitted.section,
    residuals.section,
    effects.section,
    posterior.section,
    profiles.section,
    predictive.section,
    closures.section,
    identifiability.section,
    chains.section,
    repeat.section,
)


def assemble(
    result: FitResult,
    comparison: Comparison | None = None,
    figure: Figure | None = None,
    without_comparison: str = "",
) -> Report:
    """Everything that the report of a result says and shows.

    Parameters
    ----------
    result : FitResult
        Of a fit, or read from a file.
    comparison : Comparison, optional
        Closures side by side.
    figure : Figure, optional
        The figure of the fit, where it has been drawn before.
    without_comparison : str
        Sentence in the place of a comparison; without either the section is left out.
    """
    material = Material(result, comparison, figure, without_comparison)
    sections = tuple(found for build in SECTIONS if (found := build(material)) is not None)
    made = {"ifrfit": result.versions.get("ifrfit", ""), "fitted": result.created}
    return Report(
        title(result),
        badges(result),
        verdict(result),
        bool(headline(result)),
        sections,
        {name: text for name, text in made.items() if text},
    )


def title(result: FitResult) -> str:
    """What was fitted, and with which closure."""
    closure = CLOSURES[result.closure].title if result.closure in CLOSURES else result.closure
    return f"{joined([source.name for source in result.inputs]) or 'No source'}: {closure}"
