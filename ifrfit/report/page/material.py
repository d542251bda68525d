"""What the sections of a report are made of: the result, and what follows from it at some expense."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ifrfit.errors import IfrfitError
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.restore import question
from ifrfit.inference.result.types import Estimate

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from ifrfit.inference.comparison import Comparison
    from ifrfit.inference.model.problem import Problem
    from ifrfit.inference.optimize.least_squares import LeastSquares
    from ifrfit.inference.profile.types import Profile

DRAWS = 2000
# beyond these a profile takes long enough to be asked for with --method profile
MOST_CONSTANTS = 6
MOST_ROWS = 2000


@dataclass(frozen=True)
class Material:
    """A result with what is derived from it once, for all sections.

    Attributes
    ----------
    result : FitResult
        Of a fit, or read from a file.
    comparison : Comparison or None
        Closures side by side, where they were compared.
    figure : Figure or None
        The figure of the fit, where it has been drawn before.
    without_comparison : str
        Why closures were not compared, if a reader should know.
    """

    result: FitResult
    comparison: Comparison | None = None
    figure: Figure | None = None
    without_comparison: str = ""

    @cached_property
    def _asked(self) -> tuple[tuple[Problem, LeastSquares] | None, str]:
        try:
            return question(self.result), ""
        except IfrfitError as error:
            return None, str(error)

    @property
    def question(self) -> tuple[Problem, LeastSquares] | None:
        """Problem and optimum; None where `missing` says why."""
        return self._asked[0]

    @property
    def missing(self) -> str:
        """Why the question cannot be put again; empty where it can."""
        return self._asked[1]

    @cached_property
    def without_profiles(self) -> str:
        """Why there are no profiles; empty where there are."""
        if self.question is None:
            return self.missing
        problem, _ = self.question
        free = int(problem.parameters.free.sum())
        if free == 0:
            return "Every constant is fixed: there is nothing to profile."
        if not problem.error_model.is_plain:
            return "Profiles know independent Gaussian errors of the values only."
        if free > MOST_CONSTANTS or problem.rows.value.size > MOST_ROWS:
            return (
                f"{free} free constants and {problem.rows.value.size} rows: profiles take long here. "
                "ifrfit fit --method profile computes them."
            )
        return ""

    @cached_property
    def profiles(self) -> Mapping[str, Profile]:
        """Profile likelihoods; empty where `without_profiles` says why."""
        if self.result.profiles:
            return self.result.profiles
        if self.without_profiles or self.question is None:
            return {}
        from ifrfit.inference.profile.profile_all import profile_all

        return profile_all(*self.question)

    @cached_property
    def intervals(self) -> pd.DataFrame | None:
        """Central 95 % intervals by covariance, profile and exact posterior; None without profiles."""
        if not self.profiles or self.question is None:
            return None
        from ifrfit.inference.diagnostics.interval_comparison import intervals

        return intervals(*self.question, self._posterior, self.profiles)

    @property
    def _posterior(self) -> Any:
        from ifrfit.inference.posterior import QuadraturePosterior, integrate

        if isinstance(self.result.law, QuadraturePosterior):
            return self.result.law
        if self.result.method != "exact" or self.question is None:
            return None
        problem, optimum = self.question
        return integrate(problem, start=optimum)

    @cached_property
    def draws(self) -> pd.DataFrame:
        """Draws of the constants and of kappa: the ones that the result keeps, live or read from a file."""
        rng = np.random.default_rng(self.result.seed)
        return replace(self.result, law=None).draws(DRAWS, rng)

    @cached_property
    def free(self) -> dict[str, Estimate]:
        """Constants that were not fixed, by label, with the series in brackets where separate."""
        flat = self.result.flat_constants()
        return {name: found for name, found in flat.items() if found.status != "fixed"}

    @cached_property
    def kappas(self) -> dict[str, Estimate]:
        """kappa by label, where it is not fixed."""
        kappa = self.result.derived.get("kappa")
        found = kappa if isinstance(kappa, Mapping) else {"": kappa}
        return {
            f"kappa[{series}]" if series else "kappa": each
            for series, each in found.items()
            if isinstance(each, Estimate) and each.status != "fixed"
        }
