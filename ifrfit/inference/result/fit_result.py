"""The result of a fit: its findings, and what can be made of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, cast

import numpy as np
from numpy.typing import ArrayLike

from ifrfit.errors import UsageError
from ifrfit.inference.io.arviz import to_arviz
from ifrfit.inference.io.json_text import save_json
from ifrfit.inference.io.lmfit import minimizer_result
from ifrfit.inference.io.write_result import to_dict
from ifrfit.inference.option_fields import check_form
from ifrfit.inference.result.constants_table import with_uncertainties
from ifrfit.inference.result.display import Display, Renderer
from ifrfit.inference.result.findings import Findings
from ifrfit.inference.result.prediction import draw, predict
from ifrfit.inference.result.types import by_entry
from ifrfit.text import joined, meant

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

    def plot_data(self, result: Any, axes: Any, observable: str | None, /) -> Any:
        """Data and curves of one observable on axes."""

    def plot_residuals(self, result: Any, axes: Any, observable: str | None, /) -> Any:
        """Its residuals."""

    def plot_corner(self, result: Any, axes: Any, names: Sequence[str] | None, /) -> Any:
        """Marginals and pairs of the constants."""

    def plot_profile(self, profile: Any, axes: Any, /) -> Any:
        """A profile likelihood."""

    def plot_compare(self, comparison: Any, axes: Any, /) -> Any:
        """Closures by their evidence."""


@dataclass(frozen=True, repr=False)
class FitResult(Findings, Display):
    """What a fit found, and what can be made of it: predictions, files, reports, objects of other libraries.

    Its values are those of `Findings`; `to_dict` gives exactly result.json.

    Examples
    --------
    >>> import ifrfit
    >>> fit = ifrfit.fit("cornell-glass")
    >>> [round(end, 4) for end in fit.constants.e_n.interval95]
    [0.9584, 0.9903]
    >>> fit.predict([20.0, 60.0], observable="beta_cm")[["value", "lo95", "hi95"]].round(3)
       value   lo95   hi95
    0 -0.590 -0.600 -0.565
    1 -0.888 -0.906 -0.862
    """

    drawn_by: ClassVar[str] = "ifrfit.report"
    appraised_by: ClassVar[str] = "ifrfit.inference.appraise"
    compared_by: ClassVar[str] = "ifrfit.inference.comparison.compare"
    exported_by: ClassVar[str] = "ifrfit.exporters.export"

    def _headline(self) -> str:
        constants = ", ".join(f"{name} {found:.2uS}" for name, found in by_entry(self.constants).items())
        names = joined([source.name for source in self.inputs])
        return f"{self.closure}, {self.method}: {constants}; {self.fit.n} values of {names}"

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

        Examples
        --------
        >>> import ifrfit
        >>> import numpy as np
        >>> fit = ifrfit.fit("cornell-glass")
        >>> drawn = fit.draws(2000, np.random.default_rng(1))
        >>> list(drawn), bool((drawn.mu > 0.07).mean() > 0.95)
        (['e_n', 'e_t', 'mu', 'kappa'], True)
        """
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
            `attrs["warnings"]` is a tuple of sentences, of where the apparent friction exceeds 2 mu; empty
            where it does not.

        Raises
        ------
        UsageError
            For an unknown observable or series.

        Examples
        --------
        >>> import ifrfit
        >>> fit = ifrfit.fit("cornell-glass")
        >>> table = fit.predict([20.0, 60.0], observable="spin_y_after", bands=False)
        >>> table[["gamma_deg", "value"]].round(3)
           gamma_deg  value
        0       20.0 -0.350
        1       60.0 -0.242
        """
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
            For a result without its problem, which was read from a file or is of rows that were not held in
            memory. For a scatter that profiles do not know.

        Examples
        --------
        >>> import ifrfit
        >>> fit = ifrfit.fit("cornell-glass")
        >>> table = fit.intervals()
        >>> table.loc["mu", ["covariance_low", "profile_low", "exact_low"]].astype(float).round(3)
        covariance_low    0.074
        profile_low       0.075
        exact_low         0.072
        Name: mu, dtype: float64
        """
        from ifrfit.inference.diagnostics.interval_comparison import intervals
        from ifrfit.inference.model.common_errors import refuse
        from ifrfit.inference.posterior import ExactPosterior, exact_posterior

        problem, optimum = self.problem_and_optimum()
        if problem.parameters.is_tied:
            raise UsageError("Intervals are compared where no constants are tied: leave --intervals out.")
        if problem.common is not None:
            raise refuse("A comparison of intervals")
        if problem.offset is not None:
            raise UsageError("Intervals are not compared with an angle offset: leave --intervals out.")
        if not self.noise.error_model.is_plain:
            raise UsageError(
                "Intervals are compared for independent Gaussian errors of the values only: leave out "
                "--intervals, or the choice of scatter."
            )
        own = self.distribution
        posterior = own if isinstance(own, ExactPosterior) else exact_posterior(problem, start=optimum)
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

        Examples
        --------
        >>> import ifrfit
        >>> fit = ifrfit.fit("cornell-glass")
        >>> tree = fit.to_arviz()
        >>> sorted(tree.children)
        ['log_likelihood', 'observed_data', 'posterior', 'sample_stats']
        """
        return to_arviz(self)

    def to_uncertainties(self) -> dict[str, Any]:
        """The constants as correlated numbers of the package ``uncertainties``, to calculate with.

        Returns
        -------
        dict of str to uncertainties.UFloat or float
            A float for what is fixed; the series in brackets where constants are separate.

        Raises
        ------
        UsageError
            For a constant that the data do not determine.

        Examples
        --------
        >>> import ifrfit
        >>> fit = ifrfit.fit("cornell-glass")
        >>> constants = fit.to_uncertainties()
        >>> f"{constants['mu'] * (1 + constants['e_n']):.2u}"  # kappa, with what both share
        '0.177+/-0.017'
        """
        return with_uncertainties(self.constants, self.correlation.names, self.correlation.matrix)

    def to_dict(self) -> dict[str, Any]:
        """Exactly the content of result.json.

        Examples
        --------
        >>> import ifrfit
        >>> fit = ifrfit.fit("cornell-glass")
        >>> fit.to_dict()["constants"]["mu"]["status"]
        'determined'
        """
        return to_dict(self)

    def save(self, path: str | Path) -> None:
        """Write result.json, into a folder that is made where need be; it appears whole or not at all.

        Examples
        --------
        >>> import ifrfit
        >>> fit = ifrfit.fit("cornell-glass")
        >>> fit.save("result.json")
        >>> ifrfit.load_result("result.json").constants.mu == fit.constants.mu
        True
        """
        save_json(self.to_dict(), path)

    def export(
        self,
        target: str,
        *,
        draws: int = 0,
        angle: float | None = None,
        speed: float | None = None,
        series: str | None = None,
        fix: Mapping[str, float] | None = None,
        seed: int = 0,
    ) -> str:
        """Write the constants as a simulator takes them, with a block of comments on what is lost.

        Parameters
        ----------
        target : str
            ``lammps``, ``mujoco``, ``python``, ...: see docs/how-to/export.md.
        draws : int
            How many posterior draws to append as a table.
        angle : float, optional
            Incidence angle in degrees at which openfoam and dynamo match.
        speed : float, optional
            Normal speed of approach in m/s at which mujoco, pybullet and drake match.
        series : str, optional
            Whose constants, where they are separate.
        fix : mapping of str to float, optional
            Your values of constants that the data do not determine.
        seed : int
            Of the draws.

        Returns
        -------
        str
            Text of the file.

        Raises
        ------
        UsageError
            For a constant that is not determined, and for what the target would stop at.

        Examples
        --------
        >>> import ifrfit
        >>> text = ifrfit.fit("cornell-glass").export("python")
        >>> print(text.splitlines()[0][:20])
        # Exported by ifrfit
        """
        return self._export(target, draws=draws, angle=angle, speed=speed, series=series, fix=fix, seed=seed)

    def summary(self, style: str = "text") -> str:
        """Table of the findings as "text", "markdown" or "latex".

        Examples
        --------
        >>> import ifrfit
        >>> fit = ifrfit.fit("cornell-glass")
        >>> print(fit.summary("markdown").splitlines()[0])
        | constant | value | 95 % interval | status |
        """
        return self._renderer().summary(self, style)

    def plot(self, ax: Any = None, *, observable: str | None = None) -> Any:
        """Draw the fit.

        Parameters
        ----------
        ax : Axes, optional
            Where one observable is drawn, data and curves, in the style of the axes.
        observable : str, optional
            Which one; by default the first that depends on the angle.

        Returns
        -------
        Axes or Figure
            `ax`; without one, and without an observable, the whole figure, with residuals and legend.

        Raises
        ------
        UsageError
            For an observable that is not in the fit.

        Examples
        --------
        >>> import ifrfit
        >>> fit = ifrfit.fit("cornell-glass")
        >>> from matplotlib.figure import Figure
        >>> ax = Figure().add_subplot()
        >>> fit.plot(ax, observable="beta_cm") is ax
        True
        """
        if ax is None and observable is None:
            return self._renderer().plot(self)
        return self._renderer().plot_data(self, ax, observable)

    def plot_residuals(self, ax: Any = None, *, observable: str | None = None) -> Any:
        """Draw the standardised residuals of one observable, by default the first that depends on the angle.

        Returns
        -------
        Axes
            `ax`, or new ones.

        Examples
        --------
        >>> import ifrfit
        >>> fit = ifrfit.fit("cornell-glass")
        >>> fit.plot_residuals(observable="beta_cm").get_ylabel()
        'residual (σ)'
        """
        return self._renderer().plot_residuals(self, ax, observable)

    def plot_corner(self, axes: Any = None, *, names: Sequence[str] | None = None) -> Any:
        """Draw marginals of the constants, and pairs with contours that hold 68 and 95 % of 20,000 draws.

        A marginal is the density of the estimator's distribution; where that is made of draws, a histogram.

        Parameters
        ----------
        axes : ndarray of Axes, (k, k), optional
        names : sequence of str, optional
            The k names, by default the constants that are free.

        Returns
        -------
        ndarray of Axes, (k, k)

        Examples
        --------
        >>> import ifrfit
        >>> fit = ifrfit.fit("cornell-glass")
        >>> fit.plot_corner(names=["e_t", "mu"]).shape
        (2, 2)
        """
        return self._renderer().plot_corner(self, axes, names)

    def plot_profile(self, name: str, ax: Any = None) -> Any:
        """Draw the profile likelihood of a constant, of kappa or of another quantity of the fit.

        Returns
        -------
        Axes

        Raises
        ------
        UsageError
            For a name that does not exist, and as `intervals` for a result without its problem.

        Examples
        --------
        >>> import ifrfit
        >>> fit = ifrfit.fit("cornell-glass")
        >>> fit.plot_profile("mu").get_ylabel()
        'rise of the misfit'
        """
        return self._renderer().plot_profile(self._profile(name), ax)

    def plot_compare(self, ax: Any = None) -> Any:
        """Draw how the closures compare on these data, which fits each of them.

        Returns
        -------
        Axes

        Raises
        ------
        UsageError, DataError
            As `compare`.

        Examples
        --------
        >>> import ifrfit
        >>> fit = ifrfit.fit("cornell-glass")
        >>> fit.plot_compare().get_xlabel().splitlines()[0]
        'log Bayes factor against the best (bars)'
        """
        return self._renderer().plot_compare(self._comparison(), ax)

    def _profile(self, name: str) -> Any:
        profiles = self.profiles
        if not profiles and self.problem_and_optimum()[0].parameters.is_tied:
            raise UsageError("Profiles do not know constants that are tied.")
        if not profiles:
            from ifrfit.inference.profile.profile_all import profile_all

            profiles = profile_all(*self.problem_and_optimum())
        if name not in profiles:
            names = list(profiles)
            raise UsageError(
                f"There is no profile of '{name}'. There are {joined(names)}.{meant(name, names)}"
            )
        return profiles[name]

    def report(self, path: str | Path) -> None:
        """Write the uncertainty report in the format of the suffix; one self-contained page as html.

        The file appears whole or not at all; an earlier report is replaced, any other file is not.

        Parameters
        ----------
        path : str or Path
            ``report.html``, ``report.md`` (with its figures beside it), or of a registered format.

        Raises
        ------
        UsageError
            For another suffix, or where something else lies there.

        Examples
        --------
        >>> import ifrfit
        >>> fit = ifrfit.fit("cornell-glass")
        >>> fit.report("report.html")
        """
        check_form("path", "path", path)
        renderer, path = self._renderer(), Path(path)
        renderer.check_report(path)
        renderer.write_report(self, self._appraisal(), path)

    def _renderer(self) -> FitRenderer:
        return cast("FitRenderer", super()._renderer())

    @property
    def lmfit_result(self) -> Any:
        """The same optimum as an ``lmfit.minimizer.MinimizerResult`` (imports lmfit).

        Examples
        --------
        >>> import ifrfit
        >>> fit = ifrfit.fit("cornell-glass")
        >>> found = fit.lmfit_result
        >>> abs(found.params["mu"].value - 0.0933) < 1e-4
        True
        """
        return minimizer_result(self)
