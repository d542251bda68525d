"""`fit`: from data to a result."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Unpack

from ifrfit.data import Observations, combine, resolve, select
from ifrfit.data.catalogue import dataset_names
from ifrfit.data.conventions import parse_conventions
from ifrfit.data.stream.files import NotStreamableError, is_stream
from ifrfit.data.stream.impact_stream import ImpactStream
from ifrfit.errors import UsageError
from ifrfit.inference.accuracy.request import now
from ifrfit.inference.diagnostics.omitted_effects.experimental_conditions import Setting, setting_of
from ifrfit.inference.estimators import Estimator, refuse_crew_in_memory, refuses_offset
from ifrfit.inference.keywords import (
    FitKeywords,
    check_keywords,
    estimator_of,
    model_of,
    noise_of,
    selection_of,
)
from ifrfit.inference.model.apply_error_model import with_error_model, with_propagated_sigma
from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.problem import Problem, make_problem
from ifrfit.inference.optimize.least_squares import least_squares
from ifrfit.inference.options import Model, Noise
from ifrfit.inference.result.build import build_result, summarize_optimum
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.physics.closure import Closure
from ifrfit.physics.closures import get_closure
from ifrfit.physics.effects.contact import SOLID
from ifrfit.text import joined

_LOG = logging.getLogger(__name__)

Data = str | Path | Observations
Progress = Callable[[int, int], None]


def fit(
    data: Data | Sequence[Data],
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
    data : str, Path, Observations, or a sequence of them
        Files, names of bundled datasets, or what `read` and `load_dataset` return.
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
        mcmc, bootstrap: called with the steps or replicates done, and the most that there may be.
    command : str
        The command line, for the record.
    closure, fix, prior, bounds, separate, inertia_factor
        Fields of `Model`.
    params : lmfit.Parameters
        Fixed values and bounds in lmfit's form.
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

    Returns
    -------
    FitResult

    Raises
    ------
    UsageError
        For choices that do not exist or contradict, and where an object and a keyword both say something.
    DataError
        For data that are refused.
    """
    started = now()
    check_keywords("fit", FitKeywords, keywords)
    chosen = model_of(model, keywords)
    estimator = estimator_of(method)
    closure = get_closure(chosen.closure)
    streamed = _streamed(
        data, chosen, closure, noise_of(noise), estimator, seed, scene, command, progress, keywords
    )
    if streamed is not None:
        return streamed
    question = make_question(data, chosen, noise_of(noise), seed, scene, keywords)
    if chosen.closure == Model.closure:  # the default, which the data may not tell from others
        question = replace(question, assumed=(f"closure {closure.title}", *question.assumed))
    problem = question.problem(closure, chosen.parameters(question.inertia_factor))
    return fit_problem(
        problem,
        estimator,
        seed=seed,
        command=command,
        conditions=question.conditions,
        assumed=question.assumed,
        progress=progress,
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
    parts = [data] if isinstance(data, str | Path | Observations) else list(data)
    path = None
    if len(parts) == 1 and not isinstance(parts[0], Observations) and str(parts[0]) not in dataset_names():
        path = Path(parts[0])
    if path is None or not is_stream(path):
        refuse_crew_in_memory(estimator)
        return None
    from ifrfit.inference.sufficient_statistics.passes import Reader
    from ifrfit.inference.sufficient_statistics.stream_fit import fit_stream
    from ifrfit.inference.sufficient_statistics.unfinished_pass import UnfinishedPass
    from ifrfit.inference.workers.crews import crew_of

    inertia = SOLID if model.inertia_factor is None else model.inertia_factor
    selection = selection_of(keywords)
    assumed = (f"closure {closure.title}",) if model.closure == Model.closure else ()
    if model.inertia_factor is None:
        assumed = (*assumed, f"inertia factor {inertia:g} (solid sphere)")

    def of_sample(observations: Observations) -> FitResult:
        return fit(observations, model, noise=noise, method="lsq", seed=seed)

    try:
        if not noise.error_model.is_plain or noise.error_model.offset is not None or selection.exclude:
            raise NotStreamableError(
                f"{path}: tails, errors of angles and single rows need the table in memory. Fit a part of it."
            )
        conventions = parse_conventions(keywords.get("convention", ()))
        stream = ImpactStream.of(path, conventions, selection, inertia)
        resume = getattr(estimator, "resume", None)
        unfinished = None if resume is None else UnfinishedPass.beside(Path(resume))
        with crew_of(getattr(estimator, "workers", 1), getattr(estimator, "scheduler", None)) as crew:
            found = fit_stream(
                Reader(stream, crew, unfinished, progress),
                closure,
                model.parameters(inertia),
                noise.policy,
                estimator,
                of_sample,
                separate_noise=bool(model.separate),
                assumed=assumed,
                seed=seed,
                command=command,
            )
        if unfinished is not None:
            unfinished.close()
        return found
    except NotStreamableError:
        if path.is_dir() or path.name.lower().endswith((".gz", ".zst")):
            raise
        refuse_crew_in_memory(estimator, was_large=True)
        return None  # a file can be held in memory, if need be


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
    observations = select(observations, selection_of(keywords))
    for source in observations.sources:
        left_out = "".join(f"; {count} {reason}" for reason, count in source.rows_skipped.items())
        _LOG.info("%s: %d of %d rows are used%s", source.name, source.rows_used, source.rows, left_out)
    _LOG.info("read and selected in %.3f s", time.perf_counter() - begin)
    stated = model.inertia_factor
    inertia_factor = stated if stated is not None else _inertia_factor(observations)
    if seed < 0:
        raise UsageError(f"--seed {seed}: it must be 0 or more.")
    observations = with_propagated_sigma(observations, noise.error_model)
    conditions = setting_of(observations, inertia_factor, scene)
    assumed = _assumed(observations, inertia_factor, given=stated is not None)
    # noises of its own: as said, or with constants of its own
    return Question(observations, inertia_factor, noise, conditions, bool(model.separate), assumed)


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
    reason = refuses_offset(estimator, problem) or estimator.refuses(problem)
    if reason:
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
        assumed=assumed,
        summary=summary,
    )
    _LOG.info("closure %s: facts in %.3f s", problem.closure.title, time.perf_counter() - begin)
    return found


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
    return combine(read)


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
