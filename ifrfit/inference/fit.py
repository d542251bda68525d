"""`fit`: from data to a result."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from ifrfit.data import Observations, combine, read, resolve, select
from ifrfit.data.catalogue import dataset_names
from ifrfit.data.conventions import parse_conventions
from ifrfit.data.covariance import with_covariance
from ifrfit.data.file_options import conventions_of
from ifrfit.data.selection import rows_with_sigma
from ifrfit.data.stream.files import NotStreamableError, is_stream
from ifrfit.data.table_objects import is_records, is_table, refuse_other
from ifrfit.errors import UsageError
from ifrfit.inference.accuracy.request import now
from ifrfit.inference.diagnostics.omitted_effects.experimental_conditions import Setting, setting_of
from ifrfit.inference.estimator import Estimator
from ifrfit.inference.keywords import (
    FitKeywords,
    estimator_of,
    model_of,
    noise_of,
    selection_of,
    split_columns,
)
from ifrfit.inference.method_limits import refuse_crew_in_memory, refuses
from ifrfit.inference.model.apply_error_model import with_error_model, with_propagated_sigma
from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.prior_specification import priors_beyond_domain
from ifrfit.inference.model.problem import Problem, make_problem, noise_policy
from ifrfit.inference.notebook_progress import shown_in_notebook
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.option_fields import check_form
from ifrfit.inference.options import Model, Noise
from ifrfit.inference.result.build import build_result, summarize_optimum
from ifrfit.inference.result.deferred import Postponed, replaced
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.physics.closure import Closure
from ifrfit.physics.closures import get_closure
from ifrfit.physics.effects.contact import SOLID
from ifrfit.text import joined

Table = Any  # a data frame of pandas or polars, an Arrow table, a mapping of columns
Data = str | Path | Observations | Table

if TYPE_CHECKING:
    from ifrfit.data.stream.impact_stream import ImpactStream
    from ifrfit.inference.sufficient_statistics.stream_fit import Asked

_LOG = logging.getLogger(__name__)

Progress = Callable[[int, int], None]


def fit(
    data: Data | Sequence[Data] | None = None,
    model: Model | None = None,
    *,
    noise: str | Noise | None = None,
    method: str | Estimator | None = None,
    seed: int = 0,
    scene: str | Path | None = None,
    progress: Progress | None = None,
    command: str = "",
    **keywords: Unpack[FitKeywords],
) -> FitResult:
    """Recover one set of constants from measured impacts, sticking and sliding together.

    Parameters
    ----------
    data : str, Path, table, Observations, or a sequence of them
        Files, names of bundled datasets, tables as `read` takes them (a data frame, a mapping of columns), or
        what `read` and `load_dataset` return. Without it columns are keywords: ``fit(gamma_deg=[...],
        beta=[...], sigma=0.02)``.
    model : Model, optional
        Closure and constants. Its fields may be given as keywords instead.
    noise : {"known", "scaled", "unknown", "mixed"} or Noise, optional
        What sigma means; by default the dataset's own policy, else known where every row has a sigma, else
        unknown. A `Noise` also says of heavy tails, errors of angles, and errors that are propagated.
    method : str or Estimator, optional
        exact (the default): the posterior by deterministic quadrature, or by importance sampling where grids
        would be large; lsq: least squares with a certificate
        of the global optimum; profile: the profile likelihood of each constant; mcmc: the posterior by Markov
        chains that stop when their diagnostics suffice; bootstrap: fits of experiments drawn anew. `Exact`,
        `LeastSquares`, `Profile`, `MCMC` and `Bootstrap` carry the options of the methods; `Automatic` picks
        one for an accuracy or a time.
    seed : int
        Of all random numbers.
    scene : str or Path, optional
        Scene file that says what hit what, for the effects' criteria; by default the conditions of the
        dataset. Its impacts are not looked at, but for the speed of rows that state none.
    progress : callable, optional
        Called with the steps or replicates done, and the most that there may be. By default a notebook shows
        a bar under the cell where that takes more than two seconds.
    command : str
        The command line, for the record.
    closure, fix, prior, prior_from, bounds, separate, tie, inertia_factor
        Fields of `Model`.
    params : lmfit.Parameters
        Fixed values, bounds and expressions (as `tie`) in lmfit's form.
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
    convention : sequence or mapping
        How columns are meant, see `read`.
    covariance : array_like, (n, n)
        Of the n values, in the order of ``ifrfit.read(data).table`` and in their units: errors that are not
        independent. It takes the place of sigma.

    Returns
    -------
    FitResult

    Raises
    ------
    UsageError
        For choices that do not exist or contradict, and where an object and a keyword both say something.
    DataError
        For data that are refused.

    Examples
    --------
    >>> import ifrfit
    >>> fit = ifrfit.fit(
    ...     gamma_deg=[10, 20, 30, 40, 50, 60, 70, 80],
    ...     beta=[0.46, 0.45, 0.43, 0.44, 0.11, -0.26, -0.56, -0.79],
    ...     sigma=0.02,
    ...     fix={"e_n": 0.9},
    ... )
    >>> fit
    <FitResult ifr, exact: e_n 0.9, e_t -0.9698(91), mu 0.1874(35); 8 values of table>
    >>> print(f"{fit.constants.mu:.2uS} {fit.constants.mu.status}")
    0.1874(35) determined
    """
    started = now()
    data, options = split_columns("fit", FitKeywords, data, keywords)
    chosen = model_of(model, options)
    estimator = estimator_of(method)
    closure = get_closure(chosen.closure)
    with shown_in_notebook(progress, "fitting", "steps") as seen:
        streamed = _streamed(
            data, chosen, closure, noise_of(noise), estimator, seed, scene, command, seen, options
        )
    if streamed is not None:
        return streamed
    question = make_question(data, chosen, noise_of(noise), seed, scene, options)
    if chosen.closure == Model.closure:  # the default, which the data may not tell from others
        question = replace(question, assumed=(f"closure {closure.title}", *question.assumed))
    problem = question.problem(closure, chosen.parameters(question.inertia_factor))
    with shown_in_notebook(progress, "fitting", "steps") as seen:
        return fit_problem(
            problem,
            estimator,
            seed=seed,
            command=command,
            conditions=question.conditions,
            assumed=question.assumed,
            progress=seen,
            started=started,
        )


def _streamed(
    data: Data | Sequence[Data],
    model: Model,
    closure: Closure,
    noise: Noise,
    estimator: Estimator,
    seed: int,
    scene: str | Path | None,
    command: str,
    progress: Progress | None,
    keywords: Mapping[str, Any],
) -> FitResult | None:
    """The fit of data that are not held in memory; None for all others."""
    path = stream_path(data)
    if path is None:
        refuse_crew_in_memory(estimator)
        return None
    if model.tie:
        if _is_plain_file(path):
            return None
        raise UsageError(f"{path}: --tie takes rows that are held in memory. Fit a part of them in one file.")
    from ifrfit.inference.sufficient_statistics.passes import Reader
    from ifrfit.inference.sufficient_statistics.stream_fit import fit_stream
    from ifrfit.inference.sufficient_statistics.unfinished_pass import UnfinishedPass
    from ifrfit.inference.workers.crews import crew_of

    stream = open_stream(path, model, noise, keywords)
    if stream is None:
        refuse_crew_in_memory(estimator, was_large=True)
        return None
    asked = asked_of_stream(stream, model, closure, noise, seed)
    if model.closure == Model.closure:
        asked = replace(asked, assumed=(f"closure {closure.title}", *asked.assumed))
    resume = getattr(estimator, "resume", None)
    unfinished = None if resume is None else UnfinishedPass.beside(Path(resume))
    try:
        with crew_of(getattr(estimator, "workers", 1), getattr(estimator, "scheduler", None)) as crew:
            (found,) = fit_stream(
                Reader(stream, crew, unfinished, progress),
                [asked],
                noise.policy,
                estimator,
                separate_noise=bool(model.separate),
                seed=seed,
                command=command,
            )
    except NotStreamableError:
        if not _is_plain_file(path):
            raise
        refuse_crew_in_memory(estimator, was_large=True)
        return None
    if unfinished is not None:
        unfinished.close()
    if scene is None:
        return found.result
    said = f"--scene {scene}: not looked at, because the criteria of effects take rows held in memory"
    warnings = Postponed(lambda: (*found.result.warnings, said))
    return replaced(found.result, warnings=warnings)


def stream_path(data: Data | Sequence[Data]) -> Path | None:
    """Where data lie that are not held in memory; None for all others."""
    parts = _parts(data)
    if len(parts) != 1 or not isinstance(parts[0], str | Path) or str(parts[0]) in dataset_names():
        return None
    path = Path(parts[0])
    return path if str(parts[0]).strip() and is_stream(path) else None


def open_stream(path: Path, model: Model, noise: Noise, keywords: Mapping[str, Any]) -> ImpactStream | None:
    """How data that are not held in memory are read; None where they are a file that must be held after all.

    Raises
    ------
    UsageError, DataError
        As `ImpactStream.of`, and for what needs single rows.
    """
    from ifrfit.data.stream.impact_stream import ImpactStream

    inertia = SOLID if model.inertia_factor is None else model.inertia_factor
    selection = selection_of(keywords)
    try:
        in_memory = noise.error_model.beyond_plain
        in_memory += ("a covariance",) if keywords.get("covariance") is not None else ()
        if in_memory:
            raise NotStreamableError(
                f"{path}: {joined(in_memory)} need the table in memory, and a folder or a compressed file is "
                "not held there. Leave them out, or fit a part of it in one file."
            )
        return ImpactStream.of(path, parse_conventions(keywords.get("convention", ())), selection, inertia)
    except NotStreamableError:
        if not _is_plain_file(path):
            raise
        return None


def _is_plain_file(path: Path) -> bool:
    """Whether data that are streamed are a plain file, which can be held in memory, if need be."""
    return not (path.is_dir() or path.name.lower().endswith((".gz", ".zst")))


def asked_of_stream(stream: ImpactStream, model: Model, closure: Closure, noise: Noise, seed: int) -> Asked:
    """What is asked of data that are not held in memory."""
    from ifrfit.inference.sufficient_statistics.stream_fit import Asked

    inertia = SOLID if model.inertia_factor is None else model.inertia_factor
    solid = (f"inertia factor {inertia:g} (solid sphere)",) if model.inertia_factor is None else ()
    assumed = (*model.published_words(), *solid)

    parameters = tuple(model.parameters(inertia))
    assumed += priors_beyond_domain(parameters)
    # least squares, which facts on single rows take, know the normal law in the place of another
    shaped = [one for one in parameters if one.shape is not None and one.prior is not None]
    for_sample = replace(
        model,
        prior={**model.prior, **{one.name: one.prior for one in shaped if one.prior is not None}},
        bounds={**model.bounds, **{one.name: (one.lower, one.upper) for one in shaped}},
    )

    def of_sample(observations: Observations) -> FitResult:
        # its rows are those of the selection already, but for the columns that are not used
        return fit(
            observations,
            for_sample,
            noise=noise,
            method="lsq",
            seed=seed,
            observable=() if stream.used.beside else stream.observables,
            independent=stream.selection.independent,
        )

    return Asked(closure, parameters, of_sample, assumed)


@dataclass(frozen=True)
class Question:
    """What is asked of a closure, before one is chosen.

    Attributes
    ----------
    observations : Observations
        The rows that are used, with propagated errors if they are to be.
    inertia_factor : float
    noise : Noise
    conditions : Setting or None
        The scene of the data.
    separate_noise : bool
        Whether each series has unknown noises of its own.
    assumed : tuple of str
        What nobody said of the ball and its impacts, and was taken all the same, in words.
    """

    observations: Observations
    inertia_factor: float
    noise: Noise
    conditions: Setting | None
    separate_noise: bool = False
    assumed: tuple[str, ...] = ()

    def problem(self, closure: Closure, parameters: Sequence[Parameter]) -> Problem:
        """The question for a closure.

        Raises
        ------
        UsageError, DataError
            As `make_problem` and `with_error_model`.
        """
        made = make_problem(
            self.observations,
            closure,
            self.inertia_factor,
            parameters,
            self.noise.policy,
            separate_noise=self.separate_noise,
            common=self.noise.counts_common_errors,
        )
        return with_error_model(made, self.noise.error_model)


def make_question(
    data: Data | Sequence[Data],
    model: Model,
    noise: Noise,
    seed: int,
    scene: str | Path | None,
    keywords: Mapping[str, Any],
) -> Question:
    """Read the data, and select the rows that are used; the arguments are those of `fit`.

    Raises
    ------
    UsageError, DataError
        As `fit`.
    """
    begin = time.perf_counter()
    observations = gather(data, keywords.get("convention", ()), model.inertia_factor)
    covariance = keywords.get("covariance")
    if covariance is not None:
        noise = _known(noise)
        observations = with_covariance(observations, covariance)
    observations = select(observations, selection_of(keywords))
    for source in observations.sources:
        left_out = "".join(f"; {count} {reason}" for reason, count in source.rows_skipped.items())
        _LOG.info("%s: %d of %d rows are used%s", source.name, source.rows_used, source.rows, left_out)
    _LOG.info("read and selected in %.3f s", time.perf_counter() - begin)
    stated = model.inertia_factor
    inertia_factor = stated if stated is not None else _inertia_factor(observations)
    check_form("--seed", "integer", seed)
    if seed < 0:
        raise UsageError(f"--seed {seed}: it must be 0 or more.")
    observations = with_propagated_sigma(observations, noise.error_model)
    sigma = observations.stored["sigma"].to_numpy(dtype=float)
    if noise_policy(observations, sigma, noise.policy) == "mixed":
        observations = rows_with_sigma(observations)
    conditions = setting_of(observations, inertia_factor, scene)
    assumed = (
        *model.published_words(),
        *_assumed(observations, inertia_factor, given=stated is not None),
    )
    # noises of its own: as said, or with constants of its own
    return Question(observations, inertia_factor, noise, conditions, bool(model.separate), assumed)


def _known(noise: Noise) -> Noise:
    """The noise beside a covariance matrix, which says how large errors are.

    Raises
    ------
    UsageError
        Where the noise says so, too.
    """
    if noise.policy not in (None, "known"):
        raise UsageError(
            f"covariance says how large errors are, and --noise {noise.policy} takes it from the scatter. "
            "Leave one of them out."
        )
    if noise.sigma_velocity is not None or not noise.counts_common_errors:
        what = "--sigma-velocity" if noise.counts_common_errors else "--common-errors ignored"
        raise UsageError(f"covariance and {what} both say what the errors are: leave one of them out.")
    return replace(noise, policy="known")


def _assumed(observations: Observations, inertia_factor: float, *, given: bool) -> tuple[str, ...]:
    """What of the inertia factor and the spin before impact neither the user nor a dataset states."""
    plain = [s for s in observations.sources if s.descriptor is None and s.rows_used > 0]
    solid = " (solid sphere)" if inertia_factor == SOLID else ""
    said = [f"inertia factor {inertia_factor:g}{solid}"] if plain and not given else []
    silent = [source for source in plain if "spin" not in source.headers]
    if silent:
        where = "" if len(silent) == len(observations.sources) else f" in {joined([s.name for s in silent])}"
        said.append(f"no spin before impact{where}")
    return tuple(said)


def fit_problem(
    problem: Problem,
    estimator: Estimator,
    *,
    seed: int = 0,
    command: str = "",
    conditions: Setting | None = None,
    assumed: tuple[str, ...] = (),
    progress: Progress | None = None,
    started: float | None = None,
) -> FitResult:
    """The certified optimum of a problem, what a method finds beyond it, and the result of both.

    Raises
    ------
    UsageError
        If the problem is not one for the method.
    DataError
        As the method.
    """
    if reason := refuses(estimator, problem):
        raise UsageError(reason)
    begin = time.perf_counter()
    optimum = least_squares(problem)
    _LOG.info("closure %s: optimum in %.3f s", problem.closure.title, time.perf_counter() - begin)
    summary = summarize_optimum(problem, optimum, conditions)
    begin = time.perf_counter()
    estimation = estimator.run(problem, optimum, seed=seed, progress=progress, started=started)
    _LOG.info(
        "closure %s: %s in %.3f s", problem.closure.title, estimation.method, time.perf_counter() - begin
    )
    begin = time.perf_counter()
    found = build_result(
        problem,
        optimum,
        estimation,
        seed=seed,
        command=command,
        conditions=conditions,
        assumed=(*assumed, *priors_beyond_domain(problem.parameters)),
        summary=summary,
    )
    _LOG.info("closure %s: facts in %.3f s", problem.closure.title, time.perf_counter() - begin)
    return found


def gather(
    data: Data | Sequence[Data], convention: Sequence[str] | Mapping[str, str], inertia_factor: float | None
) -> Observations:
    """Read what is to be read, and put several files or datasets together."""
    parts = _parts(data)
    tables = [part for part in parts if not isinstance(part, str | Path | Observations)]
    for part in tables:
        if not is_table(part):
            refuse_other(part)
    files = [part for part in parts if isinstance(part, str | Path)]
    found = []
    for part in parts:
        if isinstance(part, Observations):
            found.append(part)
        elif isinstance(part, str | Path):
            said = (
                convention
                if isinstance(convention, str | Mapping)
                else conventions_of(part, files, convention)
            )
            found.append(resolve(part, convention=said, inertia_factor=inertia_factor))
        else:
            named = part if len(tables) == 1 else {f"table {len(found) + 1}": part}
            j = SOLID if inertia_factor is None else inertia_factor
            found.append(read(named, convention=convention, inertia_factor=j))
    if not found:
        raise UsageError("There is nothing to fit: name a file or a dataset.")
    return combine(found)


def _parts(data: Data | Sequence[Data]) -> list[Data]:
    """Each file, dataset or table; a list of rows is one table."""
    if is_records(data):
        return [data]
    return list(data) if isinstance(data, Sequence) and not isinstance(data, str | bytes) else [data]


def _inertia_factor(observations: Observations) -> float:
    stated = {s.descriptor.inertia_factor for s in observations.sources if s.descriptor is not None}
    if len(stated) > 1:
        raise UsageError(
            f"The datasets have different inertia factors ({', '.join(f'{x:g}' for x in sorted(stated))}): "
            "fit them apart, or choose one with --inertia-factor."
        )
    found = stated.pop() if stated else 0.4
    if not 0.0 < found < math.inf:
        raise UsageError(f"--inertia-factor {found:g}: it must be positive (2/5 for a solid sphere).")
    return found
