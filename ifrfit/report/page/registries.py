"""Sections and formats of reports. A further section, or format, is one more file and one more line."""

from __future__ import annotations

from ifrfit.registry import Registry
from ifrfit.report.page import (
    html,
    markdown,
)
from ifrfit.report.page.plugins import ReportFormat, ReportSection
from ifrfit.report.page.sections import (
    chains,
    closures,
    constants,
    effects,
    findings,
    fitted,
    guide,
    identifiability,
    methods,
    posterior,
    predictive,
    profiles,
    repeat,
    residuals,
)

# in the order of the page
SECTIONS: Registry[ReportSection] = Registry(
    "report section",
    ReportSection,
    (
        constants.SECTION,
        guide.SECTION,
        findings.SECTION,
        fitted.SECTION,
        residuals.SECTION,
        effects.SECTION,
        posterior.SECTION,
        profiles.SECTION,
        predictive.SECTION,
        closures.SECTION,
        identifiability.SECTION,
        chains.SECTION,
        methods.SECTION,
        repeat.SECTION,
    ),
)
FORMATS: Registry[ReportFormat] = Registry(
    "report format",
    ReportFormat,
    (
        html.FORMAT,
        markdown.FORMAT,
    ),
)
