"""What a fit found, as frozen values: constants with statuses, facts, and the points it rests on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ifrfit.data import Source
from ifrfit.errors import UsageError
from ifrfit.inference.accuracy.types import Effort
from ifrfit.inference.diagnostics.omitted_effects.types import EffectLine, SceneOfData
from ifrfit.inference.distributions.protocol import Distribution
from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquares
from ifrfit.inference.profile.types import Profile
from ifrfit.inference.result.display import Display, Renderer, appraisal_of
from ifrfit.inference.result.estimation import Saves
from ifrfit.inference.result.state import distribution_of
from ifrfit.inference.result.types import Constants, Estimate, Fact, FitStatistics, Noise, State

if TYPE_CHECKING:
    import pandas as pd


class FitRenderer(Renderer, Protocol):
    """What draws fits: tables in three styles, and a report."""

    def summary(self, shown: Any, style: str = "text", /) -> str:
        """Table of the findings."""

    def check_report(self, path: Path, /) -> None:
        """Refuse a path where no report can be written."""

    def write_report(self, result: Any, appraisal: Any, path: Path, /) -> list[str]:
        """Write the uncertainty report."""


@dataclass(frozen=True)
class FitResult(Display):
    """Everything that a fit found. Frozen; `to_dict` gives exactly result.json.

    Attributes
    ----------
    closure, method : str
    inertia_factor : float
    inputs : tuple of Source
        Files or datasets with hash, rows used and skipped, provenance and selection.
    noise : Noise
    constants : mapping
        Name to `Estimate`, or to a mapping of series to `Estimate` where the constant is separate.
    derived : mapping
        kappa, transition_angle_deg (by series; None where there is no transition), beta_sticking;
        poisson_ratio in the place of the latter under closure maw.
    correlation : tuple
        Names of the free constants and their correlation matrix.
    fit : FitStatistics
    facts : mapping of str to Fact
    warnings : tuple of str
    state : State
    points : DataFrame
        Rows used: the common schema plus sigma_used, fitted, residual, standardised, tau and sticking.
    command, seed, created, versions
        How to repeat it.
    asked : tuple of Parameter
        The constants as they were asked for: domain, fixed value, prior, separate or shared. Empty where the
        file that the result was read from does not say.
    effort : Effort or None
        What --accuracy or --budget asked and reached; None where neither was given.
    scene : SceneOfData or None
        What is known of what hit what; None where nothing is.
    effects : tuple of EffectLine
        Each effect's criterion on that scene; empty without one. What the residuals call for is the fact
        ``effects``.
    distribution : Distribution
        Of the parameters, kappa, the transition and free noises:
        ``fit.distribution.quantile("kappa", [0.025, 0.975])``. Of a result that was read from a file it is
        what the file keeps: draws, or the Gaussian about the optimum.
    problem, least_squares
        The question and its optimum, for further questions; None where the result was read from a file.
    profiles : mapping of str to Profile
        By name of the quantity, of --method profile; not kept in result.json.
    files : mapping of str to Saves
        File name to what the method writes beside result.json.
    """

    closure: str
    inertia_factor: float
    method: str
    inputs: tuple[Source, ...]
    noise: Noise
    constants: Constants
    derived: Mapping[str, Any]
    correlation: tuple[tuple[str, ...], NDArray[np.float64]]
    fit: FitStatistics
    facts: Mapping[str, Fact]
    warnings: tuple[str, ...]
    state: State
    points: pd.DataFrame
    seed: int = 0
    command: str = ""
    created: str = ""
    versions: Mapping[str, str] = field(default_factory=dict)
    asked: tuple[Parameter, ...] = ()
    effort: Effort | None = None
    scene: SceneOfData | None = None
    effects: tuple[EffectLine, ...] = ()
    problem: Problem | None = field(default=None, repr=False, compare=False)
    least_squares: LeastSquares | None = field(default=None, repr=False, compare=False)
    # None stands for what `state` keeps of it, see __post_init__
    distribution: Distribution = field(default=None, repr=False, compare=False)  # type: ignore[assignment]
    profiles: Mapping[str, Profile] = field(default_factory=dict, repr=False, compare=False)
    files: Mapping[str, Saves] = field(default_factory=dict, repr=False, compare=False)
    drawn_by: ClassVar[str] = "ifrfit.report"

    def __post_init__(self) -> None:
        if cast("Distribution | None", self.distribution) is None:
            object.__setattr__(self, "distribution", distribution_of(self.state))

    def problem_and_optimum(self) -> tuple[Problem, LeastSquares]:
        """The question of the fit and its optimum.

        Raises
        ------
        UsageError
            For a result that was read from a file, which holds neither.
        """
        if self.problem is None or self.least_squares is None:
            raise UsageError(
                "A result that was read from a file holds no problem any more: fit the data again."
            )
        return self.problem, self.least_squares

    @property
    def provenance(self) -> tuple[str, ...]:
        """Distinct provenances of the data used."""
        return tuple(dict.fromkeys(source.provenance for source in self.inputs))

    def flat_constants(self) -> dict[str, Estimate]:
        """Constants by name, with the series in brackets where separate."""
        flat: dict[str, Estimate] = {}
        for name, found in self.constants.items():
            if isinstance(found, Estimate):
                flat[name] = found
            else:
                flat |= {f"{name}[{series}]": each for series, each in found.items()}
        return flat

    def draws(self, n: int, rng: np.random.Generator) -> pd.DataFrame:
        """Draw constants from the estimator's distribution.

        The exact posterior's draws are independent and come from its quadrature; those of mcmc are picked
        from the kept steps of its chains (from the 2,000 kept ones, where the result was loaded); those of a
        bootstrap are fits of its replicates; those of lsq and profile come from the local truncated Gaussian.

        Parameters
        ----------
        n : int
            Number of draws.
        rng : numpy.random.Generator

        Returns
        -------
        DataFrame
            n rows; a column a constant, with the series in brackets where separate, and kappa.
        """
        from ifrfit.inference.result.prediction import draw

        return draw(self, n, rng)

    def predict(
        self,
        gamma: ArrayLike,
        spin_x: ArrayLike = 0.0,
        spin_y: ArrayLike = 0.0,
        *,
        observable: str = "beta",
        series: str | None = None,
        degrees: bool = True,
        sigma: ArrayLike | None = None,
        bands: bool = True,
    ) -> pd.DataFrame:
        """Predict an observable with credible and predictive bands.

        Parameters
        ----------
        gamma : array_like
            Incidence angles, degrees (radians if not `degrees`).
        spin_x, spin_y : array_like
            R omega/u before, broadcast against gamma.
        observable : str
            Name in the common schema.
        series : str, optional
            Whose constants and noise to take; needed where constants are separate.
        degrees : bool
            Whether gamma is in degrees.
        sigma : array_like, optional
            Standard deviation of one more measurement, broadcast against gamma; the noise of the fit if not
            given.
        bands : bool
            Whether bands are wanted; without them the table ends at the value.

        Returns
        -------
        DataFrame
            gamma_deg, spin_x, spin_y, value, lo68, hi68, lo95, hi95 (credible) and
            new_lo68, new_hi68, new_lo95, new_hi95 (predictive: one more measurement, nan without a sigma).

        Raises
        ------
        UsageError
            For an unknown observable or series.
        """
        from ifrfit.inference.result.prediction import predict

        return predict(
            self,
            gamma,
            spin_x,
            spin_y,
            observable=observable,
            series=series,
            degrees=degrees,
            sigma=sigma,
            bands=bands,
        )

    def intervals(self) -> pd.DataFrame:
        """Central 95 % intervals of each constant and of kappa by covariance, profile and exact posterior.

        All three, whatever the method of this fit: that is what they are compared for.

        Returns
        -------
        DataFrame
            See `ifrfit.inference.diagnostics.interval_comparison`; `interval_disagreements` beside it says
            where they differ and which to believe.

        Raises
        ------
        UsageError
            For a result that was read from a file: it does not hold the problem any more. For a scatter that
            profiles do not know.
        """
        from ifrfit.inference.diagnostics.interval_comparison import intervals
        from ifrfit.inference.posterior import QuadraturePosterior, integrate

        if self.problem is None:
            raise UsageError(
                "A result that was read from a file has no intervals to compare: fit the data again."
            )
        if not self.noise.error_model.is_plain:
            raise UsageError(
                "Intervals are compared for independent Gaussian errors of the values only: leave out "
                "--intervals, or the choice of scatter."
            )
        problem, optimum = self.problem_and_optimum()
        own = self.distribution
        posterior = own if isinstance(own, QuadraturePosterior) else integrate(problem, start=optimum)
        return intervals(problem, optimum, posterior, self.profiles or None)

    def to_arviz(self) -> Any:
        """The posterior as ArviZ's object; its own ``to_netcdf`` writes it.

        Returns
        -------
        xarray.DataTree
            Groups posterior (free constants, kappa, noises), log_likelihood (by impact), sample_stats (lp)
            and observed_data. Exact: 4 chains of 1,000 independent draws. mcmc: a chain an ensemble, its
            walkers' draws in the order of time, thinned until they are independent; what was discarded and
            thinned is in the attributes, with versions, seed, data and provenance. Fewer draws where there
            are very many rows.

        Raises
        ------
        UsageError
            Without ArviZ, for a method without a posterior, or for a result that was read from a file.
        """
        from ifrfit.inference.io.arviz import to_arviz

        return to_arviz(self)

    def to_dict(self) -> dict[str, Any]:
        """Exactly the content of result.json."""
        from ifrfit.inference.io.write_result import to_dict

        return to_dict(self)

    def save(self, path: str | Path) -> None:
        """Write result.json; it appears whole or not at all."""
        from ifrfit.inference.io.write_result import save

        save(self, Path(path))

    def summary(self, style: str = "text") -> str:
        """Table of the findings as "text", "markdown" or "latex"."""
        return self._renderer().summary(self, style)

    def report(self, path: str | Path) -> None:
        """Write the uncertainty report: one self-contained page, by the suffix html, md or pdf.

        The file appears whole or not at all; an earlier report is replaced, any other file is not.

        Parameters
        ----------
        path : str or Path
            ``report.html``, ``report.md`` (with its figures beside it) or ``report.pdf``.

        Raises
        ------
        UsageError
            For another suffix, or where something else lies there.
        """
        renderer, path = self._renderer(), Path(path)
        renderer.check_report(path)
        renderer.write_report(self, appraisal_of(self), path)

    def _renderer(self) -> FitRenderer:
        return cast("FitRenderer", super()._renderer())

    @property
    def lmfit_result(self) -> Any:
        """The same optimum as an ``lmfit.minimizer.MinimizerResult`` (imports lmfit)."""
        from ifrfit.inference.io.lmfit import minimizer_result

        return minimizer_result(self)
