"""What a fit found, as frozen values: constants with statuses, facts, and the points it rests on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ifrfit.data import Source
from ifrfit.errors import UsageError
from ifrfit.inference.calling.lines import EffectLine, SceneOfData
from ifrfit.inference.constants import Constant
from ifrfit.inference.effort.told import Effort
from ifrfit.inference.scatter.law import PLAIN, Scatter

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

Status = Literal["determined", "one_sided", "prior", "not_determined", "fixed"]
Interval = tuple[float, float]


@dataclass(frozen=True)
class Estimate:
    """One constant (or a quantity derived from the constants).

    Attributes
    ----------
    value : float or None
        Best value; None if the data do not determine it.
    stderr : float or None
        Standard deviation; None where there is none (fixed, not determined).
    interval68, interval95 : tuple of float
        Credible or confidence interval; an end may be infinite.
    status : str
        determined, one_sided, prior, not_determined or fixed.
    reason : str
        Why the status is not simply "determined", in a few words.
    mean : float or None
        Posterior mean, where the method has one.
    """

    value: float | None
    stderr: float | None
    interval68: Interval
    interval95: Interval
    status: Status
    reason: str = ""
    mean: float | None = None

    def interval(self, level: float = 0.95) -> Interval:
        """Interval of the given level, 0.68 or 0.95.

        Raises
        ------
        UsageError
            For any other level.
        """
        if level == 0.95:
            return self.interval95
        if level == 0.68:
            return self.interval68
        raise UsageError(f"Intervals are kept at 0.68 and 0.95, not at {level}.")


@dataclass(frozen=True)
class Fact:
    """One named finding about a fit, with its number and its threshold.

    Attributes
    ----------
    ok : bool
        Whether all is well.
    says : str
        The finding in one sentence (with the remedy where it is not well).
    figures : mapping
        The numbers behind it.
    threshold : str
        The rule.
    """

    ok: bool
    says: str
    figures: Mapping[str, Any]
    threshold: str


@dataclass(frozen=True)
class Noise:
    """What sigma meant.

    Attributes
    ----------
    policy : str
        known, scaled or unknown.
    sigma : mapping
        Sigma of each "series/observable".
    estimates : mapping
        What the data say of each unknown sigma, by the same names; of the common factor under "".
    prior : mapping
        Bounds of the log-uniform prior of each of these; empty where the method needs none.
    scatter : Scatter
        How values scatter about the model, where that is not plainly Gaussian.
    """

    policy: str
    sigma: Mapping[str, float]
    estimates: Mapping[str, Estimate] = field(default_factory=dict)
    prior: Mapping[str, Interval] = field(default_factory=dict)
    scatter: Scatter = PLAIN


@dataclass(frozen=True)
class FitStatistics:
    """Counts and misfit. chi2 holds no prior terms; those are in prior_chi2. None where not defined."""

    n: int
    n_sliding: int
    n_sticking: int
    rank: int
    prior_chi2: float
    chi2: float
    dof: int
    reduced_chi2: float | None
    p_value: float | None
    rmse: float
    log_likelihood: float
    aic: float
    bic: float
    log_evidence: float | None = None


@dataclass(frozen=True)
class State:
    """The optimum in the coordinates in which it was found, for predictions.

    Attributes
    ----------
    names : tuple of str
        e_n, the closure constant, kappa; with a series in brackets where separate: ``kappa[run 1]``.
    point : ndarray
        The optimum.
    center, covariance : ndarray
        Of the local Gaussian (the centre lies beyond a bound that holds the optimum back); directions
        that the data leave loose have the variance of the default prior.
    lower, upper : ndarray
        Bounds, infinite where there is none.
    sample : ndarray or None
        Independent posterior draws, (n, names); None where the local Gaussian stands for the posterior.
    """

    names: tuple[str, ...]
    point: NDArray[np.float64]
    center: NDArray[np.float64]
    covariance: NDArray[np.float64]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    sample: NDArray[np.float64] | None = None


Constants = Mapping[str, "Estimate | Mapping[str, Estimate]"]


@dataclass(frozen=True)
class FitResult:
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
    asked : tuple of Constant
        The constants as they were asked for: domain, fixed value, prior, separate or shared. Empty where the
        file that the result was read from does not say.
    effort : Effort or None
        What --accuracy or --budget asked and reached; None where neither was given.
    scene : SceneOfData or None
        What is known of what hit what; None where nothing is.
    effects : tuple of EffectLine
        Each effect's criterion on that scene; empty without one. What the residuals call for is the fact
        ``effects``.
    problem, least_squares, law, profiles, sample
        What the result rests on, for further questions; not kept in result.json.
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
    asked: tuple[Constant, ...] = ()
    effort: Effort | None = None
    scene: SceneOfData | None = None
    effects: tuple[EffectLine, ...] = ()
    problem: Any = field(default=None, repr=False, compare=False)
    least_squares: Any = field(default=None, repr=False, compare=False)
    law: Any = field(default=None, repr=False, compare=False)
    profiles: Mapping[str, Any] = field(default_factory=dict, repr=False, compare=False)
    sample: Any = field(default=None, repr=False, compare=False)

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
        from ifrfit.inference.prediction import draw

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
        from ifrfit.inference.prediction import predict

        return predict(
            self,
            gamma,
            spin_x,
            spin_y,
            observable=observable,
            series=series,
            degrees=degrees,
            sigma=sigma,
        )

    def intervals(self) -> pd.DataFrame:
        """Central 95 % intervals of each constant and of kappa by covariance, profile and exact posterior.

        All three, whatever the method of this fit: that is what they are compared for.

        Returns
        -------
        DataFrame
            See `ifrfit.inference.intervals.intervals`; `disagreements` of it says where they differ and which
            to believe.

        Raises
        ------
        UsageError
            For a result that was read from a file: it does not hold the problem any more. For a scatter that
            profiles do not know.
        """
        from ifrfit.inference.intervals import intervals
        from ifrfit.inference.posterior import Posterior, explore

        if self.problem is None:
            raise UsageError(
                "A result that was read from a file has no intervals to compare: fit the data again."
            )
        if not self.noise.scatter.is_plain:
            raise UsageError(
                "Intervals are compared for independent Gaussian errors of the values only: leave out "
                "--intervals, or the choice of scatter."
            )
        law = self.law
        posterior = law if isinstance(law, Posterior) else explore(self.problem, start=self.least_squares)
        return intervals(self.problem, self.least_squares, posterior, self.profiles or None)

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
        from ifrfit.inference.arviz_bridge import to_arviz

        return to_arviz(self)

    def to_dict(self) -> dict[str, Any]:
        """Exactly the content of result.json."""
        from ifrfit.inference.serialise import to_dict

        return to_dict(self)

    def save(self, path: str | Path) -> None:
        """Write result.json; it appears whole or not at all."""
        from ifrfit.inference.serialise import save

        save(self, Path(path))

    # The report layer stands after inference; these methods hand the result on and import it only then.

    def summary(self, style: str = "text") -> str:
        """Table of the findings as "text", "markdown" or "latex"."""
        from ifrfit.report import summary

        return summary(self, style)

    def plot(self) -> Figure:
        """Figure of data, curves with bands, and standardised residuals; one panel an observable."""
        from ifrfit.report import plot

        return plot(self)

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
        from ifrfit.report.page import write_report

        write_report(self, Path(path))

    def _repr_html_(self) -> str:
        from ifrfit.report import html_table

        return html_table(self)

    @property
    def lmfit_result(self) -> Any:
        """The same optimum as an ``lmfit.minimizer.MinimizerResult`` (imports lmfit)."""
        from ifrfit.inference.lmfit_bridge import minimizer_result

        return minimizer_result(self)
