"""The fit of impacts that are not held in memory: sums by intervals of tau, and the rows these do not decide.

A pass over the files gives the sums (`moments`). They tell which intervals the transition may lie in:
elsewhere it costs more than the best fit by so much that neither the optimum nor any mass of the posterior is
there (`transition_bounds`). The impacts of these intervals are kept on the way (`passes`); all others are
condensed (`condensed_rows`). The problem of both is one like any other, with the same certificate and
posterior.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from ifrfit.data.observations import Observations
from ifrfit.data.readers import observe
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.estimators import Estimator
from ifrfit.inference.model.noise import Policy
from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.result.build import build_result
from ifrfit.inference.result.deferred import Deferred
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.sufficient_statistics.accumulated import BINS, Accumulated, source_of
from ifrfit.inference.sufficient_statistics.facts_of_all import (
    assumed_by,
    facts_of_all,
    likelihood_correction,
    statistics_of_all,
    warnings_of,
)
from ifrfit.inference.sufficient_statistics.moments import N
from ifrfit.inference.sufficient_statistics.passes import Reader
from ifrfit.inference.sufficient_statistics.shown_points import shown_points
from ifrfit.inference.sufficient_statistics.transition_window import Question
from ifrfit.physics.closure import Closure
from ifrfit.physics.compiling import available
from ifrfit.physics.observables import OBSERVABLES

SampleFit = Callable[[Observations], FitResult]

_MANY = (3_000_000, 300_000_000)  # rows from each of which on there are four times as many intervals
_METHODS = ("exact", "lsq")


def fit_stream(
    reader: Reader,
    closure: Closure,
    parameters: Sequence[Parameter],
    policy: str | None,
    estimator: Estimator,
    fit_sample: SampleFit,
    *,
    separate_noise: bool,
    assumed: tuple[str, ...],
    seed: int = 0,
    command: str = "",
) -> FitResult:
    """Recover one set of constants from impacts that are not held in memory.

    Parameters
    ----------
    reader : Reader
        Of the stream.
    closure : Closure
        A bilinear one.
    parameters : sequence of Parameter
    policy : {"known", "unknown"} or None
        None: known where every observable has a column of uncertainties.
    estimator : Estimator
        exact or lsq.
    fit_sample : callable
        Fits a sample that is held in memory, for the facts that look at single rows.
    separate_noise : bool
    assumed : tuple of str
    seed, command
        As `ifrfit.fit`.

    Raises
    ------
    UsageError
        For what needs the rows one by one.
    DataError
        As the stream; and where the data leave open where the transition lies, so that too many impacts would
        have to be held.
    """
    _refuse(closure, policy, estimator)
    stream = reader.stream
    weighted = stream.has_sigma if policy is None else policy == "known"
    if weighted and not stream.has_sigma:
        raise DataError(f"{stream.path}: --noise known needs a column of uncertainties for each observable.")
    noise: Policy = "known" if weighted else "unknown"

    def asked_of(of: Accumulated) -> Question:
        return Question(of, closure, tuple(parameters), noise, separate_noise)

    bins = BINS * 4 ** sum(stream.rows >= many for many in _MANY)
    of = reader.accumulate(weighted, bins, lambda part, coming: asked_of(part).expected_window(coming))
    if not of.groups or not of.sums[:, :, N].any():
        reasons = "; ".join(f"{count} {reason}" for reason, count in of.tally.skipped.items() if count)
        raise DataError(f"{stream.path}: no row can be used ({reasons}). Fill in what was measured.")
    if not stream.has_spin and any(OBSERVABLES[name].linear is not None for name in stream.observables):
        assumed = (*assumed, "no spin before impact")
    question = asked_of(of)
    problem, optimum, fetched = question.solve(reader)
    if not problem.has_oblique:
        assumed = ()
    estimation = estimator.run(problem, optimum, seed=seed, progress=None)
    result = build_result(problem, optimum, estimation, seed=seed, command=command, brief=True)
    sample = _sample(of, fit_sample)
    kinds = problem.observations.table["impact_id"].to_numpy(dtype=object)
    source = source_of(of)
    proven = question.gap(problem, optimum, fetched)
    optimum = replace(optimum, optimum=replace(optimum.optimum, gap=proven))
    correction = likelihood_correction(problem, optimum, of)
    evidence = result.fit.log_evidence
    if isinstance(sample, DataError):
        said = f"no fact on single rows was looked for, because a sample of them is refused: {sample}"
        points = result.points.iloc[:0]
    else:
        said = (
            f"facts on single rows were looked for in a sample of {len(sample.points):,} values of "
            f"{source.rows_used:,}"
        )
        points = shown_points(sample, problem, optimum, seed)
        assumed = (*assumed, *assumed_by(sample, result))
        if len(points) < source.rows_used:
            said = f"{said}; the result keeps {len(points):,} of them, for figure and report"
    return replace(
        result,
        inputs=(source,),
        fit=replace(
            statistics_of_all(problem, optimum, result, of, correction),
            log_evidence=None if evidence is None else evidence + correction.of_evidence,
        ),
        facts=Deferred(lambda: facts_of_all(problem, optimum, result, estimation, sample, kinds)),
        warnings=(*result.warnings, *warnings_of(of, source), said),
        points=points,
        assumed=assumed,
        problem=None,
        least_squares=None,
    )


def _refuse(closure: Closure, policy: str | None, estimator: Estimator) -> None:
    if not available():
        raise UsageError("Data that are not held in memory need numba: pip install 'ifrfit[scale]'.")
    if not closure.bilinear:
        raise UsageError(
            f"--closure {closure.name}: its law is not linear on either side of a transition, so that it "
            "needs the rows one by one. Take a part of the data in one file."
        )
    if policy not in (None, "known", "unknown"):
        raise UsageError(f"--noise {policy}: data that are not held in memory take known or unknown.")
    if estimator.name not in _METHODS:
        raise UsageError(
            f"--method {estimator.name}: data that are not held in memory take {' or '.join(_METHODS)}."
        )


def _sample(of: Accumulated, fit_sample: SampleFit) -> FitResult | DataError:
    """The fit of the sample, or why there is none."""
    stream = of.stream
    if not of.sample.drawn:
        return DataError("no row is whole; of each some value is left out.")
    try:
        return fit_sample(observe(of.sample.cells(stream.path), stream.conventions, stream.inertia_factor))
    except DataError as error:
        return error
