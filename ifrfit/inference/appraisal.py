"""What a report shows beyond a fit, as frozen values: see `ifrfit.inference.appraise`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

    from ifrfit.inference.comparison.result import Comparison
    from ifrfit.inference.distributions.marginal_density import MarginalDensity
    from ifrfit.inference.profile.types import ProfileLikelihood


@dataclass(frozen=True)
class Appraisal:
    """Answers of other methods, and of other closures, to the question of a fit.

    Attributes
    ----------
    draws : DataFrame
        Draws of the constants and of kappa from what the result keeps in its file.
    profiles : mapping of str to ProfileLikelihood
        Profile likelihoods of the free constants and of what follows from them, by name.
    without_profiles : str
        Why profiles or intervals are missing.
    intervals : DataFrame or None
        Central 95 % intervals by covariance, profile and exact posterior, see
        `ifrfit.inference.diagnostics.interval_comparison.intervals`; None without profiles, or where the
        result does not keep its question.
    comparison : Comparison or None
        All closures by the same data and choices.
    without_comparison : str
        Why closures were not compared; empty where they were, or where nobody asked for it.
    densities : mapping of str to MarginalDensity
        Of the free constants and of kappa, by name, where the method is the exact posterior and was
        integrated by quadrature.
    """

    draws: pd.DataFrame
    profiles: Mapping[str, ProfileLikelihood]
    without_profiles: str = ""
    intervals: pd.DataFrame | None = None
    comparison: Comparison | None = None
    without_comparison: str = ""
    densities: Mapping[str, MarginalDensity] = field(default_factory=dict)
