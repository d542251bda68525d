"""What the sections of a report are made of: a result and its appraisal."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from ifrfit.inference.appraisal import Appraisal
from ifrfit.inference.model.entry_names import entry_name
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Estimate
from ifrfit.report.sentences import by_series


@dataclass(frozen=True)
class ReportInput:
    """Everything a section may draw on; it computes nothing beyond it.

    Attributes
    ----------
    result : FitResult
        Of a fit, or read from a file.
    appraisal : Appraisal
        What was computed for the report.
    figure : str or None
        The figure of the fit as svg, where it has been drawn before.
    """

    result: FitResult
    appraisal: Appraisal
    figure: str | None = None

    @cached_property
    def free(self) -> dict[str, Estimate]:
        """Constants that were not fixed, by label, with the series in brackets where separate."""
        flat = self.result.flat_constants()
        return {name: found for name, found in flat.items() if found.status != "fixed"}

    @cached_property
    def kappas(self) -> dict[str, Estimate]:
        """kappa by label, where it is not fixed."""
        kappa = by_series(self.result.derived.get("kappa"))
        return {
            entry_name("kappa", series if len(kappa) > 1 else ""): each
            for series, each in kappa.items()
            if each.status != "fixed"
        }
