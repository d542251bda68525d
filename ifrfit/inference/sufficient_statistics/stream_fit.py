"""The fit of impacts that are not held in memory: sums by intervals of tau, and the rows these do not decide.

A pass over the files gives the sums (`moments`). They tell which intervals the transition may lie in:
elsewhere it costs more than the best fit by so much that neither the optimum nor any mass of the posterior is
there (`transition_bounds`). The impacts of these intervals are kept on the way (`passes`); all others are
condensed (`condensed_rows`). The problem of both is one like any other, with the same certificate and
posterior.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.observations import Observations, Source
from ifrfit.data.readers import observe
from ifrfit.data.stream.refusals import check_series, refuse_tiny_sigmas
from ifrfit.data.stream.repeated_ids import without_repeated_ids
from ifrfit.data.stream.row_places import Place
from ifrfit.data.stream.unused_values import without_impossible
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.estimator import Estimator
from ifrfit.inference.estimators import Bootstrap
from ifrfit.inference.model.noise import Policy
from ifrfit.inference.model.parameters import Parameter
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit
from ifrfit.inference.posterior.integrators import ExactPosterior
from ifrfit.inference.result.assumptions import COMPLETE
from ifrfit.inference.result.build import build_result
from ifrfit.inference.result.deferred import Deferred, Postponed, replaced
from ifrfit.inference.result.estimation import Estimation
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Fact
from ifrfit.inference.sufficient_statistics.accumulated import (
    BINS,
    MOST_SUMS,
    Accumulated,
    ManySumsError,
    source_of,
)
from ifrfit.inference.sufficient_statistics.condensed_transition import solve_condensed
from ifrfit.inference.sufficient_statistics.copied_impacts import copied_impacts
from ifrfit.inference.sufficient_statistics.cut_readings import cut_readings
from ifrfit.inference.sufficient_statistics.facts_of_all import (
    Correction,
    assumed_by,
    facts_of_all,
    likelihood_correction,
    refuse_lost_digits,
    statistics_of_all,
    warnings_of,
)
from ifrfit.inference.sufficient_statistics.lack_of_fit_of_means import Rounding, lack_of_fit_of_means
from ifrfit.inference.sufficient_statistics.moments import N
from ifrfit.inference.sufficient_statistics.negative_constants import refuse_negative
from ifrfit.inference.sufficient_statistics.passes import Reader
from ifrfit.inference.sufficient_statistics.shown_points import shown_points
from ifrfit.inference.sufficient_statistics.tau_intervals import Intervals
from ifrfit.inference.sufficient_statistics.transition_window import Question, Solved, foreseen, solve_each
from ifrfit.physics.closure import Closure
from ifrfit.physics.compiling import available
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.text import joined

if TYPE_CHECKING:
    import pandas as pd

SampleFit = Callable[[Observations], FitResult]
Sampled = Postponed[FitResult | DataError]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

_MANY = (3_000_000, 300_000_000)  # rows from each of which on there are four times as many intervals
_SPARE = 4  # times the sums of equal steps, for intervals that are parted
_FEWEST_STEPS = 16
_METHODS = ("exact", "lsq", "profile", "bootstrap")
_BEATEN = 100.0  # of minus twice the log likelihood, beyond which a closure has no hope
_SHOWN = 0.997  # level up to which a profile is looked at


@dataclass(frozen=True)
class Asked:
    """A closure that is put to a stream.

    Attributes
    ----------
    closure : Closure
        A bilinear one.
    parameters : tuple of Parameter
    fit_sample : callable
        Fits a sample that is held in memory, for the facts that look at single rows.
    assumed : tuple of str
        As `ifrfit.inference.result.build.build_result`.
    """

    closure: Closure
    parameters: tuple[Parameter, ...]
    fit_sample: SampleFit
    assumed: tuple[str, ...]


@dataclass(frozen=True)
class StreamedFit:
    """A fit of impacts that are not held in memory.

    Attributes
    ----------
    result : FitResult
        Of all impacts, with points of a sample.
    condensed : FitResult
        The same statistics and facts beside the problem of condensed rows, and these as points.
    correction : Correction
        From the likelihood and evidence of condensed rows to those of all.
    """

    result: FitResult
    condensed: FitResult
    correction: Correction


def fit_stream(
    reader: Reader,
    asked: Sequence[Asked],
    policy: str | None,
    estimator: Estimator,
    *,
    separate_noise: bool,
    seed: int = 0,
    command: str = "",
) -> list[StreamedFit]:
    """Recover the constants of one or several closures from impacts that are not held in memory.

    Parameters
    ----------
    reader : Reader
        Of the stream.
    asked : sequence of Asked
        Closures, which are put to the same sums of one pass.
    policy : {"known", "unknown"} or None
        None: known where every observable has a column of uncertainties.
    estimator : Estimator
        exact, lsq, profile, or bootstrap by cases.
    separate_noise : bool
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
    for each in asked:
        _refuse(each.closure, policy, estimator)
    if policy == "unknown":  # no sigma is used, and none is missed
        reader = replace(reader, stream=reader.stream.without_sigma())
    stream = reader.stream
    weighted = stream.has_sigma if policy is None else policy == "known"
    if weighted and not stream.has_sigma:
        raise DataError(f"{stream.path}: --noise known needs a column of uncertainties for each observable.")
    noise: Policy = "known" if weighted else "unknown"

    def questions_of(of: Accumulated) -> list[Question]:
        return [Question(of, each.closure, each.parameters, noise, separate_noise) for each in asked]

    of = _accumulated(reader, weighted, partial(foreseen, questions_of))
    check_series(stream.path, stream.selection.series, of.tally.series)
    for sizes in of.tally.sizes.values():
        sizes.refuse()
    of.tally.refuse_open()
    stream.refuse_unmet(of.tally)
    if not of.groups or not of.sums[:, :, N].any():
        reasons = "; ".join(f"{count} {reason}" for reason, count in of.tally.skipped.items() if count)
        raise DataError(f"{stream.path}: no row can be used ({reasons}). Fill in what was measured.")
    refuse_negative(of)
    _refuse_few_sigmas(of)
    refuse_tiny_sigmas(stream.path, stream.conventions, of.tally, of.sample, of.largest_sigmas())
    questions = questions_of(of)
    solved = solve_each(questions, reader)
    if solved is None:
        of.window.narrow(np.zeros(of.intervals.count, dtype=bool))
        solved = solve_condensed(questions, reader)
    values = [found.question.value(found.problem, found.optimum.optimum.theta) for found in solved]
    best = values.index(min(values))
    drawn = {
        place: Postponed(partial(_sample, of, asked[place].fit_sample))
        for place, value in enumerate(values)
        if value - values[best] <= _BEATEN
    }
    samples = [
        drawn[place] if place in drawn else Postponed(partial(_under, drawn[best], each))
        for place, each in enumerate(asked)
    ]
    return [
        _estimated(
            each,
            solved[k],
            samples[k],
            estimator,
            reader,
            seed,
            command,
            values[k] - values[best],
        )
        for k, each in enumerate(asked)
    ]


def _accumulated(
    reader: Reader, weighted: bool, focus: Callable[[Accumulated, int], Accumulated]
) -> Accumulated:
    """The sums of all rows, by fewer intervals the more series there are: they are held all together.

    Raises
    ------
    DataError
        There are very many series and observables.
    """
    steps = BINS * 4 ** sum(reader.stream.rows >= many for many in _MANY)
    while True:
        try:
            return reader.accumulate(weighted, Intervals(steps), focus)
        except ManySumsError as many:
            room = MOST_SUMS // (_SPARE * many.groups)
            steps = min(steps // 2, 1 << max(room.bit_length() - 1, 0))
            if steps < _FEWEST_STEPS:
                raise DataError(
                    f"{reader.stream.path}: {many.groups} series times observables are too many to be held "
                    "together. Choose some by --series or --observable; ifrfit campaign fits each by itself."
                ) from None


def _refuse_few_sigmas(of: Accumulated) -> None:
    """Refuse an observable most of whose values lack the sigma that others have: too many would be left out.

    Raises
    ------
    DataError
        With the remedies.
    """
    names = of.stream.observables
    used = of.sums[:, :, N].sum(axis=1).reshape(-1, len(names)).sum(axis=0)
    for name, count in zip(names, used.tolist(), strict=True):
        reason = f"sigma of {name}"
        lost = of.tally.skipped[reason]
        if lost > count > 0:
            first = next(iter(of.tally.places.get(reason, [])), of.stream.path)
            whole = int(count + lost)
            raise DataError(
                f"{first}: no sigma, and only {int(count)} of {whole} values of {name} have one. Give it to "
                "the others, leave them out, or take --noise unknown, which uses no sigma."
            )


def _estimated(
    asked: Asked,
    solved: Solved,
    sample: Sampled,
    estimator: Estimator,
    reader: Reader,
    seed: int,
    command: str,
    beaten: float,
) -> StreamedFit:
    """What a method finds beyond an optimum, and what is said of all impacts.

    Single rows are not looked at under a closure that another one beats by far: all of them misfit. The
    sample is fitted when something of it is asked for; spins before impact ask for it at once.
    """
    question = solved.question
    of, stream = question.of, question.of.stream
    problem, optimum, fetched = solved.problem, solved.optimum, solved.fetched
    refuse_lost_digits(of, problem, optimum.optimum.theta)
    assumed = asked.assumed
    if not stream.has_spin and any(OBSERVABLES[name].linear is not None for name in stream.observables):
        assumed = (*assumed, "no spin before impact")
    if not problem.has_oblique:
        assumed = ()
    spins = _median_spins(problem, sample.value) if stream.has_spin else ((0.0, 0.0),) * len(problem.series)
    problem = replace(problem, quoted_spins=spins)
    estimation = _estimation(estimator, question, problem, optimum, reader, seed)
    if estimation.profiles:
        least = question.least_rise(problem, optimum, fetched) - solved.error
        _refuse_far_profiles(stream.path, estimation, least)
    result = build_result(problem, optimum, estimation, seed=seed, command=command, brief=True)
    source = source_of(of)
    proven = question.gap(problem, optimum, fetched)
    if proven is not None:
        proven += 2.0 * solved.error
    optimum = replace(optimum, optimum=replace(optimum.optimum, gap=proven))
    correction = likelihood_correction(problem, optimum, of)
    evidence = result.fit.log_evidence
    statistics = replace(
        statistics_of_all(problem, optimum, result, of, correction),
        log_evidence=None if evidence is None else evidence + correction.of_evidence,
    )
    copied = Postponed(partial(copied_impacts, of, problem, optimum))
    rounding = Rounding.of(of)
    cut = cut_readings(of)

    def looked_at() -> FitResult | DataError:
        if beaten > _BEATEN:
            said = f"another closure has less of minus twice the log likelihood by {beaten:,.0f}."
            return DataError(said)
        return sample.value

    def facts() -> dict[str, Fact]:
        kinds = problem.observations.table["impact_id"].to_numpy(dtype=object)
        effect = 1.0 if copied.value is None else copied.value.effect
        means = lack_of_fit_of_means(problem, optimum, kinds, rounding, effect)
        rows = looked_at()
        return facts_of_all(
            problem, optimum, result, statistics, estimation, rows, means, copied.value, cut, seed
        )

    def shown_of_sample() -> pd.DataFrame:
        drawn = sample.value
        if isinstance(drawn, DataError):
            return result.points.iloc[:0]
        return shown_points(drawn, problem, optimum, seed)

    points = Postponed(shown_of_sample)

    def warnings() -> tuple[str, ...]:
        title, kept = asked.closure.title, len(points.value)
        of_sample = _of_sample(sample.value, looked_at(), kept, source, title, has_spin=stream.has_spin)
        left_out = warnings_of(of, source)
        return *result.warnings, *left_out, *_of_ids(of), *_of_condensing(solved), of_sample

    def taken() -> tuple[str, ...]:
        drawn = sample.value
        if isinstance(drawn, DataError) or beaten > _BEATEN:
            return assumed
        said = assumed_by(drawn, result, assumed)
        return tuple(each for each in said if each != COMPLETE) if of.tally.cut else said

    condensed = replaced(
        result,
        inputs=(source,),
        fit=statistics,
        facts=Deferred(facts),
        warnings=Postponed(warnings),
        assumed=Postponed(taken),
    )
    whole = result.distribution
    if isinstance(whole, ExactPosterior):  # of condensed rows, whose evidence is another one
        whole = replace(whole, log_evidence=whole.log_evidence + correction.of_evidence)
    shown = replaced(condensed, points=points, distribution=whole, problem=None, least_squares=None)
    return StreamedFit(shown, condensed, correction)


def _estimation(
    estimator: Estimator,
    question: Question,
    problem: Problem,
    optimum: LeastSquaresFit,
    reader: Reader,
    seed: int,
) -> Estimation:
    """What a method finds beyond an optimum: from condensed rows, or from groups that are drawn anew."""
    if not isinstance(estimator, Bootstrap):
        return estimator.run(problem, optimum, seed=seed, progress=None)
    from ifrfit.inference.bootstrap import REPLICATES
    from ifrfit.inference.bootstrap.summary import estimation_of
    from ifrfit.inference.sufficient_statistics.grouped_cases import GROUPS, bootstrap_of_groups

    replicates = REPLICATES if estimator.replicates is None else estimator.replicates
    found = estimation_of(*bootstrap_of_groups(question, problem, optimum, reader, replicates, seed))
    known_to = 100.0 / math.sqrt(2.0 * GROUPS)
    said = (
        f"Drawn were {GROUPS:,} random groups of impacts within each series in the place of impacts: an sd "
        f"of the bootstrap is known to {known_to:.1f} %, beside what {replicates:,} replicates leave open."
    )
    return replace(found, warnings=(*found.warnings, said))


def _of_sample(
    sample: FitResult | DataError,
    looked_at: FitResult | DataError,
    kept: int,
    source: Source,
    title: str,
    *,
    has_spin: bool,
) -> str:
    """What is said of the sample, of which some points are kept, under a closure."""
    if isinstance(sample, DataError):
        said = (
            f"no fact on single rows was looked for, because a sample of them is refused: {sample.in_shell}"
        )
        return f"{said} Transition angles are those without spin before impact" if has_spin else said
    if isinstance(looked_at, DataError):
        return f"no fact on single rows was looked for under {title}: {looked_at.in_shell}"
    drawn = len(sample.points)
    said = f"facts on single rows were looked for in a sample of {drawn:,} values of {source.rows_used:,}"
    if has_spin and drawn < source.rows_used:
        said = f"{said}, and transition angles are those at its median spin"
    if kept < source.rows_used:
        said = f"{said}; the result keeps {kept:,} of them, for figure and report"
    return said


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
        those = joined(_METHODS, "or")
        raise UsageError(f"--method {estimator.name}: data that are not held in memory take {those}.")
    if isinstance(estimator, Bootstrap) and estimator.replicates is not None:
        from ifrfit.inference.bootstrap.estimator import check_replicates

        check_replicates(estimator.replicates)
    if isinstance(estimator, Bootstrap) and estimator.scheme not in (None, "cases"):
        raise UsageError(
            f"--resample {estimator.scheme}: data that are not held in memory are drawn by cases; residuals "
            "would need every row again in each replicate. Leave it out."
        )


def _refuse_far_profiles(path: Path, estimation: Estimation, least: float) -> None:
    """Refuse profiles that would have to be followed to where impacts do not stand for themselves."""
    highest = max(profile.cut(_SHOWN) for profile in estimation.profiles.values())
    if least <= highest:
        raise DataError(
            f"{path}: a profile is drawn to a rise of {highest:.3g}, and the sums prove it only to "
            f"{least:.3g}, because an unknown noise rests on so few values. Fit a part of the data in "
            "memory, or take --method exact."
        )


def _median_spins(problem: Problem, sample: FitResult | DataError) -> tuple[tuple[float, float], ...]:
    """Of each series in the sample, of all its rows where a series is not in it; none without a sample.

    Condensed rows have angles without spin.
    """
    if isinstance(sample, DataError):
        return ((0.0, 0.0),) * len(problem.series)
    drawn = sample.problem
    assert drawn is not None
    i = drawn.rows.incidence

    def of(rows: Index | slice) -> tuple[float, float]:
        return float(np.median(i.spin_x[rows])), float(np.median(i.spin_y[rows]))

    known = {name: of(np.flatnonzero(drawn.rows.series == k)) for k, name in enumerate(drawn.series)}
    return tuple(known.get(name) or of(slice(None)) for name in problem.series)


def _sample(of: Accumulated, fit_sample: SampleFit) -> FitResult | DataError:
    """The fit of the sample, or why there is none."""
    stream = of.stream
    if not of.sample.drawn:
        return DataError("no row is whole; of each some value is left out.")
    try:
        places = of.sample.places(stream.portions, stream.path, of.tally.read)
        cells, _ = without_repeated_ids(of.sample.cells(stream.path, places), stream.conventions)
        cells = without_impossible(cells, stream.conventions, stream.observables)
        return fit_sample(_at(places, observe(cells, stream.conventions, stream.inertia_factor)))
    except DataError as error:
        return error


def _at(places: Sequence[Place], drawn: Observations) -> Observations:
    """A sample whose rows have the files and rows that they stand in: they are numbered from 1."""
    (whole,) = drawn.sources
    table = drawn.table
    first = 2 if whole.word == "line" else 1
    number = table["row"].to_numpy(dtype=np.intp) - first
    file = np.array([place.file for place in places], dtype=object)
    row = np.array([place.row for place in places])
    called = np.array([f"{whole.word} {first + k}" for k in range(len(places))], dtype=object)
    anew = np.array([f"{place.word} {place.row}" for place in places], dtype=object)
    ids = table["impact_id"].to_numpy(dtype=object)
    count = Counter(file[number].tolist())
    words = {place.file: place.word for place in places}
    sources = tuple(
        replace(whole, name=name, rows=rows, rows_used=rows, rows_skipped={}, word=words[name])
        for name, rows in sorted(count.items())
    )
    own_ids = np.where(ids == called[number], anew[number], ids)
    table = table.assign(source=file[number], row=row[number], impact_id=own_ids)
    return replace(drawn, table=table, sources=sources)


def _of_ids(of: Accumulated) -> tuple[str, ...]:
    """What is said of ids that name no single impact."""
    if not of.sample.drawn:
        return ()
    try:
        _, said = without_repeated_ids(of.sample.cells(of.stream.path), of.stream.conventions)
    except DataError:  # which is said of the sample
        return ()
    return (said,) if said else ()


def _of_condensing(solved: Solved) -> tuple[str, ...]:
    """What is said of impacts about the transition that stand together."""
    if not solved.error:
        return ()
    many, intervals = solved.question.rows_in(solved.fetched), int(np.count_nonzero(solved.fetched))
    return (
        f"the data leave open where sliding ends: {many:,.0f} values lie where it may, and stand together in "
        f"{intervals:,} narrow intervals, which changes minus twice the log likelihood by {solved.error:.1g} "
        "at most",
    )


def _under(sample: Sampled, asked: Asked) -> FitResult | DataError:
    """The rows of a sample under a closure that has no hope, for which constants of their own say nothing."""
    found = sample.value
    if isinstance(found, DataError) or found.problem is None:
        return found
    return replace(found, problem=found.problem.with_closure(asked.closure, asked.parameters))
