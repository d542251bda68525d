"""The package's own methods of estimation with their options, and the registry that holds all.

This module imports nothing heavy: what a method computes stands in modules of its own, which `run` imports.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Unpack

from ifrfit.errors import UsageError
from ifrfit.inference.accuracy.request import check_request, make_request
from ifrfit.inference.estimator import Estimator, Method, PlainErrors, RunKeywords
from ifrfit.inference.option_fields import Option, build, option, options_of
from ifrfit.registry import Registry

if TYPE_CHECKING:
    from ifrfit.inference.model.problem import Problem
    from ifrfit.inference.optimize.least_squares import LeastSquaresFit
    from ifrfit.inference.result.estimation import Estimation

_RESUME = "Go on with the chains in DIR, or with what an unfinished fit has read, and replace what is there."
_INTEGRATORS = ("automatic", "quadrature", "sampling")


def _accuracy() -> Any:
    return option(
        None,
        "Largest error of mean, sd and interval, in posterior sd: picks method and settings.",
        form="number",
        metavar="SD",
        unset="the method's own",
    )


def _budget() -> Any:
    return option(None, "As exact as this time allows, as 2s, 500ms or 3min.", metavar="TIME")


def _workers() -> Any:
    says = "Processes, for mcmc, bootstrap and data not held in memory; no number depends on them."
    return option(1, says, form="integer", metavar="N", least=1)


def _schemes() -> Iterable[str]:
    from ifrfit.inference.bootstrap.schemes import SCHEMES

    return SCHEMES


def _scheduler() -> Any:
    says = "Dask scheduler whose workers read data not held in memory, as tcp://host:8786."
    return option(None, says, metavar="ADDRESS")


@dataclass(frozen=True, repr=False)
class Exact(Method):
    """The posterior by deterministic quadrature, or by importance sampling where that takes long.

    Attributes
    ----------
    accuracy : float or None
        Largest error of a mean, an sd or an end of an interval, in posterior standard deviations, 1e-9 to
        0.5. The result's `effort` says what was reached.
    budget : float, str or None
        Seconds (or text, as "500ms") from the call of `fit`: as exact as the time allows, or until the
        accuracy is reached.
    integrator : {"automatic", "quadrature", "sampling"}
        automatic: quadrature, or importance sampling where its grids would take more than a second or so.
    workers : int
        Processes that read data which are not held in memory; 1 is this process itself.
    scheduler : str or None
        Address of a Dask scheduler whose workers do so, as ``tcp://host:8786``.
    resume : str, Path or None
        Folder of the results to be: beside it is kept what was read of such data, from which the same fit
        goes on after it was interrupted.

    Raises
    ------
    UsageError
        For numbers that make no sense, an integrator that does not exist, or one beside `accuracy` or
        `budget`, which ask for quadrature.

    Examples
    --------
    >>> import ifrfit
    >>> fit = ifrfit.fit("cornell-glass", method=ifrfit.Exact(accuracy=1e-3))
    >>> f"{fit.constants.mu:.1uS}"
    '0.089(9)'
    """

    name: ClassVar[str] = "exact"
    takes_common_errors: ClassVar[bool] = True
    takes_every_prior: ClassVar[bool] = True
    fits_angle_offset: ClassVar[bool] = True
    title: ClassVar[str] = "exact posterior"
    label: ClassVar[str] = "exact"
    summary: ClassVar[str] = "the posterior"
    accuracy: float | None = _accuracy()
    budget: float | str | None = _budget()
    integrator: str | None = option(
        None,
        "exact: automatic, quadrature or sampling (importance sampling).",
        metavar="NAME",
        unset="automatic",
        choices=lambda: _INTEGRATORS,
    )
    workers: int = _workers()
    scheduler: str | None = _scheduler()
    resume: str | Path | None = option(None, _RESUME, form="path", metavar="DIR")

    def __post_init__(self) -> None:
        super().__post_init__()
        check_request(self.accuracy, self.budget)
        if self.integrator is None:
            return
        if self.integrator not in _INTEGRATORS:
            raise UsageError(f"--integrator {self.integrator}: choose {', '.join(_INTEGRATORS)}.")
        if self.accuracy is not None or self.budget is not None:
            raise UsageError(_picked("integrator"))

    def refuses(self, problem: Problem) -> str:
        """Why not: what quadrature alone is asked for, and does not take on."""
        if self.integrator != "quadrature":
            return ""
        from ifrfit.inference.posterior.integral_layout import no_grid

        return no_grid(problem)

    def run(self, problem: Problem, optimum: LeastSquaresFit, **asked: Unpack[RunKeywords]) -> Estimation:
        """Integrate the posterior."""
        from ifrfit.inference.accuracy.select_method import as_requested
        from ifrfit.inference.estimations import exact_estimation

        if self.accuracy is None and self.budget is None:
            integrator = self.integrator or _INTEGRATORS[0]
            return exact_estimation(problem, optimum, integrator=integrator, seed=asked.get("seed", 0))
        request = make_request(self.accuracy, self.budget, asked.get("started"))
        return as_requested(problem, optimum, request, [self.name])


@dataclass(frozen=True, repr=False)
class LeastSquares(Method):
    """Least squares with a certificate of the global optimum, and the Gaussian approximation about it.

    Attributes
    ----------
    workers, scheduler, resume
        As `Exact`.

    Examples
    --------
    >>> import ifrfit
    >>> fit = ifrfit.fit("cornell-glass", method=ifrfit.LeastSquares())
    >>> fit.facts["global_optimum"].ok
    True
    """

    name: ClassVar[str] = "lsq"
    takes_common_errors: ClassVar[bool] = True
    takes_ties: ClassVar[bool] = True
    fits_angle_offset: ClassVar[bool] = True
    title: ClassVar[str] = "least squares"
    label: ClassVar[str] = "least squares"
    summary: ClassVar[str] = "least squares"
    workers: int = _workers()
    scheduler: str | None = _scheduler()
    resume: str | Path | None = option(None, _RESUME, form="path", metavar="DIR")

    def refuses(self, problem: Problem) -> str:
        """Why not: true angles that are to be integrated out."""
        if not problem.error_model.integrates:
            return ""
        return (
            "--method lsq cannot integrate true angles out: use --method exact or mcmc with "
            f"{problem.error_model.option}, or --angle-errors effective."
        )

    def run(self, problem: Problem, optimum: LeastSquaresFit, **asked: Unpack[RunKeywords]) -> Estimation:
        """The optimum is the answer."""
        from ifrfit.inference.estimations import least_squares_estimation

        return least_squares_estimation(optimum)


@dataclass(frozen=True, repr=False)
class Profile(PlainErrors):
    """The profile likelihood of each constant.

    Attributes
    ----------
    workers, scheduler, resume
        As `Exact`.

    Examples
    --------
    >>> import ifrfit
    >>> fit = ifrfit.fit("cornell-glass", method=ifrfit.Profile())
    >>> fit.profiles["mu"].shape
    'bounded'
    """

    name: ClassVar[str] = "profile"
    title: ClassVar[str] = "profile likelihood"
    label: ClassVar[str] = "profile"
    summary: ClassVar[str] = "profile likelihood"
    workers: int = _workers()
    scheduler: str | None = _scheduler()
    resume: str | Path | None = option(None, _RESUME, form="path", metavar="DIR")

    def run(self, problem: Problem, optimum: LeastSquaresFit, **asked: Unpack[RunKeywords]) -> Estimation:
        """Profile every quantity."""
        from ifrfit.inference.diagnostics.optimum_facts import noise_converged
        from ifrfit.inference.profile.profile_all import profile_all, profile_converged
        from ifrfit.inference.result.estimation import Estimation

        profiles = profile_all(problem, optimum, progress=asked.get("progress"))
        converged = profile_converged(profiles, noise_converged(optimum))
        return Estimation(self.name, None, {"converged": converged}, profiles=profiles)


@dataclass(frozen=True, repr=False)
class MCMC(Method):
    """The posterior by Markov chains that stop when their diagnostics suffice.

    Attributes
    ----------
    max_steps : int or None
        Steps of each ensemble after which it stops in any case; 10,000 by default.
    resume : str, Path or None
        Folder (or file) with the chains of an earlier run of the same question, to walk on with.
    workers : int
        Processes. The draws do not depend on it. A script that asks for more than one needs
        ``if __name__ == "__main__":`` about what it does; a closure, an observable or a law of errors that it
        registered must stand at the top level of a module.
    accuracy : float or None
        As of `Exact`: largest standard error.
    budget : float, str or None
        As of `Exact`.
    keep : str, Path or None
        Folder in which chains are kept where the run is interrupted, and from which the same one goes on.

    Raises
    ------
    UsageError
        For numbers that make no sense; for `max_steps` and `resume` beside `accuracy` or `budget`, which pick
        the settings.

    Examples
    --------
    >>> import ifrfit
    >>> ifrfit.fit("cornell-glass", method=ifrfit.MCMC(max_steps=200)).facts["converged"].ok
    False
    """

    name: ClassVar[str] = "mcmc"
    takes_common_errors: ClassVar[bool] = True
    takes_ties: ClassVar[bool] = True
    takes_every_prior: ClassVar[bool] = True
    fits_angle_offset: ClassVar[bool] = True
    title: ClassVar[str] = "Markov chain Monte Carlo"
    label: ClassVar[str] = "MCMC"
    summary: ClassVar[str] = "Markov chains"
    max_steps: int | None = option(
        None, "mcmc: most steps.", form="integer", metavar="N", least=1, unset="10000"
    )
    resume: str | Path | None = option(None, _RESUME, form="path", metavar="DIR")
    workers: int = _workers()
    accuracy: float | None = _accuracy()
    budget: float | str | None = _budget()
    keep: str | Path | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        check_request(self.accuracy, self.budget)
        if self.accuracy is None and self.budget is None:
            return
        for name in ("max_steps", "resume"):
            if getattr(self, name) is not None:
                raise UsageError(_picked(name))

    def run(self, problem: Problem, optimum: LeastSquaresFit, **asked: Unpack[RunKeywords]) -> Estimation:
        """Sample the posterior."""
        from ifrfit.inference.accuracy.select_method import as_requested
        from ifrfit.inference.estimations import sample_estimation
        from ifrfit.inference.mcmc import MAX_STEPS, sample

        seed, progress = asked.get("seed", 0), asked.get("progress")
        if self.accuracy is not None or self.budget is not None:
            request = make_request(self.accuracy, self.budget, asked.get("started"))
            return as_requested(
                problem,
                optimum,
                request,
                [self.name],
                seed=seed,
                workers=self.workers,
                keep=None if self.keep is None else Path(self.keep),
                progress=progress,
            )
        found = sample(
            problem,
            optimum,
            seed,
            max_steps=MAX_STEPS if self.max_steps is None else self.max_steps,
            workers=self.workers,
            resume=None if self.resume is None else Path(self.resume),
            keep=None if self.keep is None else Path(self.keep),
            progress=progress,
        )
        return sample_estimation(found, optimum)


@dataclass(frozen=True, repr=False)
class Bootstrap(PlainErrors):
    """Fits of experiments drawn anew.

    Attributes
    ----------
    scheme : {"cases", "residual", "wild", "wild-mammen"}
        What is drawn anew: impacts within each series, residuals, or residuals times random weights
        (Rademacher's, or Mammen's); see `ifrfit.inference.bootstrap`.
    replicates : int or None
        Experiments drawn; 1,000 by default.
    workers : int
        As of `MCMC`.
    scheduler : str or None
        As of `Exact`.
    keep : str, Path or None
        Folder in which replicates are kept where the run is interrupted, and from which the same one goes on.
    resume : str, Path or None
        As of `Exact`.

    Examples
    --------
    >>> import ifrfit
    >>> fit = ifrfit.fit("cornell-glass", method=ifrfit.Bootstrap("wild", replicates=200))
    >>> fit.constants.mu.status
    'determined'
    """

    name: ClassVar[str] = "bootstrap"
    title: ClassVar[str] = "bootstrap"
    label: ClassVar[str] = "bootstrap"
    summary: ClassVar[str] = "fits of experiments drawn anew"
    scheme: str | None = option(
        None,
        "bootstrap: what is drawn anew: cases (impacts), residual, wild or wild-mammen.",
        metavar="SCHEME",
        keyword="resample",
        unset="cases",
        choices=_schemes,
    )
    replicates: int | None = option(
        None, "bootstrap: experiments drawn.", form="integer", metavar="N", unset="1000"
    )
    workers: int = _workers()
    scheduler: str | None = _scheduler()
    keep: str | Path | None = None
    resume: str | Path | None = option(None, _RESUME, form="path", metavar="DIR")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.replicates is not None:
            from ifrfit.inference.bootstrap.estimator import check_replicates

            check_replicates(self.replicates)

    def run(self, problem: Problem, optimum: LeastSquaresFit, **asked: Unpack[RunKeywords]) -> Estimation:
        """Draw experiments anew, and fit each."""
        from ifrfit.inference.bootstrap import REPLICATES, bootstrap
        from ifrfit.inference.bootstrap.summary import estimation_of

        found = bootstrap(
            problem,
            optimum,
            scheme=self.scheme or "cases",
            replicates=REPLICATES if self.replicates is None else self.replicates,
            seed=asked.get("seed", 0),
            workers=self.workers,
            keep=None if self.keep is None else Path(self.keep),
            progress=asked.get("progress"),
        )
        return estimation_of(found, optimum)


@dataclass(frozen=True, repr=False)
class Automatic(Method):
    """The posterior by whichever method reaches an accuracy, or comes closest within a time.

    Exact where it can do the problem, else Markov chains; least squares as they are where the budget is too
    short for either. The result's `method` and `effort` say what was picked and reached.

    Attributes
    ----------
    accuracy : float or None
        As of `Exact`.
    budget : float, str or None
        As of `Exact`.
    workers : int
        As of `MCMC`.

    Examples
    --------
    >>> import ifrfit
    >>> fit = ifrfit.fit("cornell-glass", method=ifrfit.Automatic(accuracy=1e-2))
    >>> fit.method
    'exact'
    """

    name: ClassVar[str] = "automatic"
    takes_common_errors: ClassVar[bool] = True
    takes_every_prior: ClassVar[bool] = True
    title: ClassVar[str] = "posterior"
    label: ClassVar[str] = "posterior"
    summary: ClassVar[str] = "whichever method reaches the accuracy"
    accuracy: float | None = _accuracy()
    budget: float | str | None = _budget()
    workers: int = _workers()

    def __post_init__(self) -> None:
        super().__post_init__()
        check_request(self.accuracy, self.budget)

    def run(self, problem: Problem, optimum: LeastSquaresFit, **asked: Unpack[RunKeywords]) -> Estimation:
        """Pick a method, and run it."""
        from ifrfit.inference.accuracy.select_method import as_requested

        return as_requested(
            problem,
            optimum,
            make_request(self.accuracy, self.budget, asked.get("started")),
            seed=asked.get("seed", 0),
            workers=self.workers,
            progress=asked.get("progress"),
        )


def _picked(keyword: str) -> str:
    return f"--accuracy and --budget pick the settings themselves: leave --{keyword.replace('_', '-')} out."


# the default first; an entry is an estimator with default options
ESTIMATORS: Registry[Estimator] = Registry(
    "method",
    Estimator,
    (
        Exact(),
        LeastSquares(),
        Profile(),
        MCMC(),
        Bootstrap(),
    ),
)


def title_of(method: str) -> str:
    """Title of a method by its name; the name where there is none, as of a package that is not installed."""
    found = ESTIMATORS.get(method)
    return method if found is None else found.title


def label_of(method: str) -> str:
    """Label of a method by its name; as `title_of`."""
    found = ESTIMATORS.get(method)
    return method if found is None else found.label


def method_options() -> dict[str, Option]:
    """Options of all methods by keyword; one that several of them have stands once."""
    found: dict[str, Option] = {}
    for owner in (*(type(each) for each in ESTIMATORS.values()), Automatic):
        found |= {key: each for key, each in options_of(owner).items() if key not in found}
    return found


def make_estimator(method: str | None, values: Mapping[str, Any]) -> Estimator:
    """An estimator by its name and by keywords, of which those that are no option of any method do not count.

    Parameters
    ----------
    method : str or None
        None: `Exact`, or `Automatic` where an accuracy or a budget is given.
    values : mapping of str to object
        Keywords as in `ifrfit.fit`.

    Raises
    ------
    UsageError
        For an unknown method, an option that belongs to another method, and as the estimator's class.
    """
    options = method_options()
    said = {key: value for key, value in values.items() if key in options and options[key].is_given(value)}
    owner = type(ESTIMATORS[method or Exact.name])
    if method is None and ("accuracy" in said or "budget" in said):
        owner = Automatic
    for keyword in said:
        if keyword in options_of(owner):
            continue
        if owner is Automatic:
            raise UsageError(_picked(keyword))
        owners = [name for name, each in ESTIMATORS.items() if keyword in options_of(type(each))]
        flag, those = options[keyword].flag, " or ".join(owners)
        raise UsageError(f"{flag} belongs to --method {those}, not to --method {owner.name}.")
    return build(owner, said)
