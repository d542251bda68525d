"""`fit`: from data to a result."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from ifrfit.data import Observations, Selection, combine, resolve, select
from ifrfit.errors import UsageError
from ifrfit.inference.accuracy.request import Wanted, make_wanted
from ifrfit.inference.accuracy.select_method import problem_for, with_effort
from ifrfit.inference.diagnostics.omitted_effects.experimental_conditions import setting_of
from ifrfit.inference.model.apply_error_model import with_error_model, with_propagated_sigma
from ifrfit.inference.model.error_model import make_error_model
from ifrfit.inference.model.parameters import make_parameters
from ifrfit.inference.model.problem import make_problem
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.least_squares_result import optimum_of
from ifrfit.inference.result.method_results import with_chains, with_posterior, with_profiles, with_replicates
from ifrfit.physics.closures import get_closure

METHODS = ("exact", "lsq", "profile", "mcmc", "bootstrap")
# methods that an option belongs to
_OWN = {
    "max-steps": ("mcmc",),
    "resume": ("mcmc",),
    "resample": ("bootstrap",),
    "replicates": ("bootstrap",),
    "workers": ("mcmc", "bootstrap"),
}

Data = str | Path | Observations


def fit(
    data: Data | Sequence[Data],
    *,
    closure: str = "ifr",
    method: str | None = None,
    fix: Mapping[str, float] | None = None,
    prior: Mapping[str, tuple[float, float]] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    separate: str | Collection[str] = (),
    noise: str | None = None,
    observable: str | Sequence[str] = (),
    series: str | Sequence[str] = (),
    gamma_min: float | None = None,
    gamma_max: float | None = None,
    speed_min: float | None = None,
    speed_max: float | None = None,
    exclude: str | int | Sequence[str | int] = (),
    independent: bool = False,
    tails: str = "gaussian",
    dof: float | None = None,
    angle_errors: str = "none",
    angle_population: tuple[float, float] | None = None,
    sigma_gamma: float | None = None,
    sigma_velocity: float | None = None,
    sigma_spin: float | None = None,
    inertia_factor: float | None = None,
    convention: Sequence[str] | Mapping[str, str] = (),
    params: Any = None,
    accuracy: float | None = None,
    budget: float | str | None = None,
    scene: str | Path | None = None,
    max_steps: int | None = None,
    resume: str | Path | None = None,
    resample: str | None = None,
    replicates: int | None = None,
    workers: int = 1,
    progress: Callable[[int, int], None] | None = None,
    seed: int = 0,
    command: str = "",
) -> FitResult:
    """Recover one set of constants from measured impacts, sticking and sliding together.

    Parameters
    ----------
    data : str, Path, Observations, or a sequence of them
        Files, names of bundled datasets, or what `read` and `load_dataset` return.
    closure : str
        ifr, fr, f, ifr-contact or maw.
    method : str, optional
        exact (the default): the posterior by deterministic quadrature; lsq: least squares with a certificate
        of the global optimum; profile: the profile likelihood of each constant; mcmc: the posterior by Markov
        chains that stop on evidence; bootstrap: fits of experiments drawn anew.
    fix : mapping
        Constant to its known value.
    prior : mapping
        Constant to (mean, sd) of an earlier measurement.
    bounds : mapping
        Constant to (lower, upper), in the place of the passive domain.
    separate : str or collection of str
        Constants with a value of their own in each series.
    noise : {"known", "scaled", "unknown"}, optional
        What sigma means; by default the dataset's own policy, else known where every row has a sigma, else
        unknown.
    observable, series : str or sequence of str
        Use only these.
    gamma_min, gamma_max : float
        Degrees from the normal.
    speed_min, speed_max : float
        m/s.
    exclude : sequence
        Row numbers (lines of the file), FILE:ROW, or impact ids.
    independent : bool
        Take faces of the same impacts as independent all the same.
    tails : {"gaussian", "student-t"}
        Law of the errors of the values.
    dof : float, optional
        Degrees of freedom of Student's t, by default 4.
    angle_errors : {"none", "effective", "set", "measured"}
        Errors of angles and spins: taken as exact; added to sigma through the slope; true angles that scatter
        about the set ones, integrated out; measured angles that scatter about the true ones, integrated out.
    angle_population : (float, float), optional
        Degrees between which the true angles are spread evenly, for "measured".
    sigma_gamma : float, optional
        Standard uncertainty of the angle, degrees, in rows that state none.
    sigma_velocity, sigma_spin : float, optional
        Standard uncertainties of measured velocities and of R Omega after impact, per incoming speed: every
        row's sigma is propagated from them.
    inertia_factor : float, optional
        J = I/(m R^2); by default the dataset's, else 2/5.
    convention : sequence or mapping
        How columns are meant, see `read`.
    params : lmfit.Parameters, optional
        Fixed values and bounds in lmfit's form.
    accuracy : float, optional
        Largest error of a mean, an sd or an end of an interval, in posterior standard deviations, 1e-9 to
        0.5: picks method and settings, those of exact or mcmc where one of them is named. The result's
        `effort` says what was reached.
    budget : float or str, optional
        Seconds (or text, as "500ms") from this call on: as exact as the time allows, or until the accuracy is
        reached. Least squares where it is too short for any posterior.
    scene : str or Path, optional
        Scene file that says what hit what, for the effects' criteria; by default the conditions of the
        dataset. Its impacts are not looked at, but for the speed of rows that state none.
    max_steps : int, optional
        mcmc: steps of each ensemble after which it stops without enough evidence; 10,000 by default.
    resume : str or Path, optional
        mcmc: folder (or file) with the chains of an earlier run of the same question, to walk on with.
    resample : {"cases", "residual", "wild", "wild-mammen"}, optional
        bootstrap: what is drawn anew: impacts within each series (the default), residuals, or residuals
        times random weights (Rademacher's, or Mammen's); see `ifrfit.inference.bootstrap`.
    replicates : int, optional
        bootstrap: experiments drawn; 1,000 by default.
    workers : int
        mcmc, bootstrap: processes, where there is work for several. The draws do not depend on it. A script
        that asks for more than one needs ``if __name__ == "__main__":`` about what it does.
    progress : callable, optional
        mcmc, bootstrap: called with the steps or replicates done, and the most that there may be.
    seed : int
        Of the draws and bands.
    command : str
        The command line, for the record.

    Returns
    -------
    FitResult

    Raises
    ------
    UsageError
        For choices that do not exist or contradict.
    DataError
        For data that are refused.
    """
    if method is not None and method not in METHODS:
        raise UsageError(f"There is no method '{method}'. This version has {', '.join(METHODS)}.")
    wanted = make_wanted(accuracy, budget, method)
    asked, method = method, method or "exact"
    given = {"max-steps": max_steps, "resume": resume, "resample": resample, "replicates": replicates}
    used = {name: value is not None for name, value in given.items()} | {"workers": workers != 1}
    _check_own(method, used, max_steps, workers, wanted)
    chosen = get_closure(closure)
    observations = gather(data, convention, inertia_factor)
    selection = Selection(
        observable=_tuple(observable),
        series=_tuple(series),
        gamma_min=gamma_min,
        gamma_max=gamma_max,
        speed_min=speed_min,
        speed_max=speed_max,
        exclude=tuple(str(x) for x in _tuple(exclude)),
        independent=independent,
    )
    observations = select(observations, selection)
    j = inertia_factor if inertia_factor is not None else _inertia_factor(observations)
    if not 0.0 < j < math.inf:
        raise UsageError(f"--inertia-factor {j:g}: it must be positive (2/5 for a solid sphere).")
    if seed < 0:
        raise UsageError(f"--seed {seed}: it must be 0 or more.")
    choices: dict[str, Any] = {"fix": dict(fix or {}), "bounds": dict(bounds or {})}
    if params is not None:
        from ifrfit.inference.io.lmfit import constants_from

        for key, value in constants_from(params).items():
            choices[key] = value | choices[key]
    constants = make_parameters(chosen, j, prior=prior, separate=_tuple(separate), **choices)
    error_model = make_error_model(
        tails=tails,
        dof=dof,
        angle_errors=angle_errors,
        angle_population=angle_population,
        sigma_gamma=sigma_gamma,
        sigma_velocity=sigma_velocity,
        sigma_spin=sigma_spin,
    )
    observations = with_propagated_sigma(observations, error_model)
    setting = setting_of(observations, j, scene)
    problem = make_problem(observations, chosen, j, constants, noise)
    if wanted is not None:
        problem, cannot = problem_for(problem, error_model, asked)
        result = optimum_of(problem, seed, command, setting)
        return with_effort(result, wanted, cannot, workers=workers, progress=progress)
    problem = with_error_model(problem, error_model, method)
    result = optimum_of(problem, seed, command, setting)
    if method == "lsq":
        return result
    if method == "mcmc":
        place = None if resume is None else Path(resume)
        return with_chains(result, max_steps=max_steps, workers=workers, resume=place, progress=progress)
    if method == "bootstrap":
        return with_replicates(result, resample, replicates, workers, progress)
    return with_profiles(result) if method == "profile" else with_posterior(result)


def _check_own(
    method: str, given: Mapping[str, bool], max_steps: int | None, workers: int, wanted: Wanted | None
) -> None:
    """Refuse options of a method that is not the chosen one, and numbers that make no sense."""
    for name, is_given in given.items():
        if is_given and wanted is not None and name != "workers":
            raise UsageError(f"--accuracy and --budget pick the settings themselves: leave --{name} out.")
        if is_given and wanted is None and method not in _OWN[name]:
            owners = " or ".join(_OWN[name])
            raise UsageError(f"--{name} belongs to --method {owners}, not to --method {method}.")
    if max_steps is not None and max_steps < 1:
        raise UsageError(f"--max-steps {max_steps}: it must be 1 or more.")
    if workers < 1:
        raise UsageError(f"--workers {workers}: it must be 1 or more.")


def _tuple(value: Any) -> tuple[Any, ...]:
    if isinstance(value, str | int):
        return (value,)
    return tuple(value)


def gather(
    data: Data | Sequence[Data], convention: Sequence[str] | Mapping[str, str], inertia_factor: float | None
) -> Observations:
    """Read what is to be read, and put several files or datasets together."""
    parts = [data] if isinstance(data, str | Path | Observations) else list(data)
    read = [
        part
        if isinstance(part, Observations)
        else resolve(part, convention=convention, inertia_factor=inertia_factor)
        for part in parts
    ]
    if not read:
        raise UsageError("There is nothing to fit: name a file or a dataset.")
    return read[0] if len(read) == 1 else combine(read)


def _inertia_factor(observations: Observations) -> float:
    stated = {s.descriptor.inertia_factor for s in observations.sources if s.descriptor is not None}
    if len(stated) > 1:
        raise UsageError(
            f"The datasets have different inertia factors ({', '.join(f'{x:g}' for x in sorted(stated))}): "
            "fit them apart, or choose one with --inertia-factor."
        )
    return stated.pop() if stated else 0.4
