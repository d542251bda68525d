"""The problem of all impacts: condensed rows, and the impacts of the intervals a transition may lie in."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.observations import Observations
from ifrfit.errors import DataError
from ifrfit.inference.model.noise import NoiseModel, Policy
from ifrfit.inference.model.parameters import Parameter, ParameterSet
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Rows
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares
from ifrfit.inference.profile.objective import Misfit
from ifrfit.inference.sufficient_statistics.accumulated import MOST_SUMS, Accumulated, source_of
from ifrfit.inference.sufficient_statistics.condensed_rows import condensed_rows
from ifrfit.inference.sufficient_statistics.moments import N
from ifrfit.inference.sufficient_statistics.passes import Reader
from ifrfit.inference.sufficient_statistics.problem_rows import JoinedRows, ProblemRows
from ifrfit.inference.sufficient_statistics.tau_intervals import Intervals
from ifrfit.inference.sufficient_statistics.transition_bounds import (
    kink_sizes,
    least_direct,
    least_misfit,
    least_without,
)
from ifrfit.physics.closure import Closure
from ifrfit.physics.compiled_incidence import PARTS
from ifrfit.physics.impulse_laws import Coefficients
from ifrfit.physics.observables import OBSERVABLES

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]
Bound = Callable[[Array, Intervals, Coefficients, tuple[float, float]], Array]

FAR = 80.0  # of minus twice the log likelihood above the best: less mass than exp(-40) lies there
MOST_ROWS = 500_000  # that are held, for all questions together
_FEW_ROWS = 20_000  # to come for a closure, up to which its intervals need not be parted
_MOST_PARTED = 64  # intervals at once: more of them are as narrow as the rows can tell
_PASSES = 4
_LEAST = 1e-300  # sum of squares whose logarithm is taken
_EXPONENT = 600.0  # beyond which an exponential is as good as infinite
KINDS = ("", "mean of an interval", "scatter within intervals")  # what the rows of a problem are
_, MEAN, SCATTER = KINDS
_ITSELF, _MEAN, _SCATTER = range(3)


@dataclass(frozen=True)
class Solved:
    """A problem with its optimum.

    Attributes
    ----------
    problem : Problem
    optimum : LeastSquaresFit
    fetched : ndarray of bool, (series, intervals)
        Where impacts stand for themselves, or together in intervals so narrow that it makes no difference.
    question : Question
        The one that was put to the sums in the end.
    error : float
        Of minus twice the log likelihood, at most, because impacts about the transition stand together.
    """

    problem: Problem
    optimum: LeastSquaresFit
    fetched: Mask
    question: Question
    error: float = 0.0


@dataclass(frozen=True)
class Question:
    """What is asked of the sums."""

    of: Accumulated
    closure: Closure
    parameters: tuple[Parameter, ...]
    noise: Policy
    separate_noise: bool

    def expected_window(self) -> Mask:
        """The intervals that will be fetched in the end, most likely, told from some rows, (bins,)."""
        # an estimate of the best value: as if an impulse factor could not differ from that of sticking
        best = self.bounds(spread=0.0).min(axis=1, keepdims=True)
        likely = _with_neighbours(self.least_values < best + 2.0 * FAR)
        return np.asarray((likely | self.each_by_itself()).any(axis=0))

    def expected_fetched(self) -> Mask:
        """The intervals of each series that a fit will call for, most likely, (series, bins).

        Of those whose rows were kept, and none where these are very many.
        """
        best = self.bounds(spread=0.0).min(axis=1, keepdims=True)
        found = _with_neighbours(self.least_values < best + FAR) | self.each_by_itself()
        found &= self.of.window.inside
        return found & (self.rows_in(found) <= MOST_ROWS / 2)

    def each_by_itself(self) -> Mask:
        """Where the transition of a series may lie that shares no constant, (series, bins): `pooling` asks.

        None where that would be too many impacts: they are not needed for the fit.
        """
        if len(self.of.series) < 2 or not self._share_constants():
            return np.zeros((len(self.of.series), self.of.intervals.count), dtype=bool)
        alone = replace(self, parameters=tuple(replace(p, separate=p.fixed is None) for p in self.parameters))
        best = alone.bounds(spread=0.0).min(axis=1, keepdims=True)
        found = _with_neighbours(alone.least_values < best + FAR)
        return found & (self.rows_in(found) <= MOST_ROWS / 2)

    def _share_constants(self) -> bool:
        return any(p.fixed is None and not p.separate for p in self.parameters)

    def rows_in(self, intervals: Mask) -> float:
        """Values of some intervals of each series, (series, bins), that know the transition."""
        of = self.of
        return sum(float(of.sums[g, intervals[of.series_of(g)], N].sum()) for g in self._oblique())

    def _oblique(self) -> list[int]:
        return [
            group
            for group in range(len(self.of.groups))
            if OBSERVABLES[self.of.observable_of(group)].linear is not None
        ]

    def problem(self, kept: Mapping[str, Array], fetched: NDArray[np.bool_]) -> Problem:
        """The condensed rows of all other intervals, and the impacts of these, by observable."""
        of, stream = self.of, self.of.stream
        parts = [self.standing(name, rows) for name, rows in kept.items()]
        for group, known in enumerate(of.groups):
            name, series = of.observable_of(group), of.series_of(group)
            sums = of.sums[group]
            if OBSERVABLES[name].linear is not None:
                sums = np.where(fetched[series][:, None], 0.0, sums)
            span = (known.least_gamma, known.largest_gamma)
            made = condensed_rows(sums, of.intervals, name, stream.inertia_factor, span)
            if made.value.size:
                rows = made.gamma_deg, made.value, made.sigma, made.count
                kind = np.where(made.is_scatter, _SCATTER, _MEAN)
                parts.append(ProblemRows.condensed(group % len(stream.observables), series, rows, kind))
        return self.problem_of(parts, KINDS)

    def standing(self, name: str, rows: Array, kind: Index | None = None) -> ProblemRows:
        """Impacts that stand for themselves, see `WindowRows.rows`."""
        series, gamma, spin_x, spin_y, value, sigma = rows
        ones = np.ones(value.size)
        if kind is None:
            kind = np.full(value.size, _ITSELF, dtype=np.intp)
        sigma = sigma if self.of.weighted else ones
        number, observable = series.astype(np.intp), self.of.stream.observables.index(name)
        return ProblemRows(observable, number, gamma, spin_x, spin_y, value, sigma, ones, kind)

    def problem_of(self, parts: Sequence[ProblemRows], kinds: Sequence[str]) -> Problem:
        """The problem of some rows; `kinds` are the names of what they are."""
        of, stream = self.of, self.of.stream
        joined = JoinedRows.of(
            parts,
            of.series,
            stream.observables,
            kinds,
            has_sigma=of.weighted,
            source=stream.path.name,
            provenance=next(iter(of.tally.provenances), ""),
        )
        arrays, names = Rows.of(joined.table.assign(impact_id=""))
        typical = np.array([self.typical(group) for group in range(len(of.groups))])
        noise = NoiseModel(
            self.noise,
            joined.table["sigma"].to_numpy(dtype=float),
            separate=self.separate_noise,
            scale=joined.sigma / typical[joined.group],
            counts=joined.count,
        )
        inertia = stream.inertia_factor
        parameters = ParameterSet(self.parameters, names)
        made_of = Problem(
            arrays, self.closure, inertia, parameters, noise, Observations(joined.table, (source_of(of),))
        )
        return made_of.with_noise(noise.with_bounds(self._noise_bounds(made_of)))

    def typical(self, group: int) -> float:
        """Root mean square of the sigma of a group; 1 where it is unknown."""
        of = self.of
        count = of.count_of(group)
        return math.sqrt(of.groups[group].square_sigma.high / count) if of.weighted and count else 1.0

    def _noise_bounds(self, problem: Problem) -> Mapping[str, tuple[float, float]]:
        """As `NoiseModel.bounds`, from all values."""
        found = {}
        for name in problem.noise_groups():
            parts = name.rpartition("/")
            groups = [
                known
                for group, known in enumerate(self.of.groups)
                if self.of.observable_of(group) == parts[2]
                and (not parts[0] or self.of.series[self.of.series_of(group)] == parts[0])
            ]
            low = min(known.last_decimal for known in groups) / math.sqrt(12.0)
            found[name] = (low, max(1.0, *(known.largest_value for known in groups)))
        return found

    def _of_groups(self, bound: Bound, direct: Callable[[Array], float]) -> Array:
        """A number of each group with the transition in each interval, (series, observables, bins)."""
        of = self.of
        series, observables = len(of.series), of.stream.observables
        constants = ParameterSet(self.parameters, tuple(of.series))
        own = constants[self.closure.constant] if self.closure.constant else None
        domain = (0.0, 0.0) if own is None else own.ends
        law = cast(Coefficients, self.closure.law(of.stream.inertia_factor))
        found = np.zeros((series, len(observables), of.intervals.count))
        for group in range(len(of.groups)):
            number = group % len(observables)
            if OBSERVABLES[observables[number]].linear is None:
                found[of.series_of(group), number] = direct(of.sums[group])
            else:
                found[of.series_of(group), number] = bound(of.sums[group], of.intervals, law, domain)
        return found

    def _least(self, spread: float) -> Array:
        """Least misfit of each group with the transition in each interval, (series, observables, bins)."""
        return self._of_groups(partial(least_misfit, spread=spread), least_direct)

    @property
    def has_one_transition(self) -> bool:
        """Whether all series have their transition in the same interval."""
        return not any(p.separate for p in self.parameters)

    @cached_property
    def least_values(self) -> Array:
        """Least value with the transition of a series in each interval, (series, bins), see `value`."""
        return self.bounds(spread=1.0)

    def bounds(self, spread: float) -> Array:
        """As `least_values`; `spread` is the part of the largest difference between sticking and sliding."""
        least = self._least(spread)
        return self._of_each_series(least, least)

    def _of_each_series(self, own: Array, least: Array) -> Array:
        """Value with the transition of a series in each interval, (series, bins), from the misfits of groups.

        `own` are those of groups of that series, and of all where these have but one transition; `least` are
        those of other series.
        """
        found = np.empty((len(own), self.of.intervals.count))
        for number in range(len(own)):
            # a series whose constants are its own has its transition where it likes
            groups = (
                own
                if self.has_one_transition
                else np.broadcast_to(least.min(axis=2, keepdims=True), least.shape).copy()
            )
            groups[number] = own[number]
            found[number] = self._combined(groups)
        return found

    def kinks(self, value: float) -> tuple[Array, Array]:
        """What decides how far a value may be off whose transition lies among condensed impacts.

        It holds of all constants that lie less than `FAR` above a value
        (docs/theory/sufficient-statistics.md, eq. 5).

        Returns
        -------
        sizes : ndarray, (series, bins)
            Root of the sum of squares by which the closure differs from a line within each interval, at most.
        misfits : ndarray, (series, bins)
            Root of the sum of squares of the impacts there, at most.
        """
        least = self._least(1.0)
        others = self._of_each_series(self._of_groups(least_without, least_direct), least)
        room = np.maximum(value + FAR - others, 0.0)
        kinks = self._of_groups(kink_sizes, lambda _: 0.0)
        if self.noise == "unknown":
            squares, counts = least.min(axis=2), self._counts()
            if not self.separate_noise:
                squares, counts = (
                    np.broadcast_to(each.sum(axis=0), each.shape) for each in (squares, counts)
                )
            knows = kinks.max(axis=2) > 0.0
            fewest = float(counts.min(where=knows, initial=math.inf))
            room = fewest * np.expm1(np.minimum(room / fewest, _EXPONENT)) if knows.any() else room
            kinks = kinks * (counts / np.maximum(squares, _LEAST))[:, :, None]
        size = np.sqrt(kinks.sum(axis=1))
        if self.has_one_transition:
            size = np.broadcast_to(np.sqrt(kinks.sum(axis=(0, 1))), size.shape)
        return np.asarray(size), np.sqrt(room)

    def _combined(self, least: Array) -> Array:
        """The misfit of all groups, (bins,), from that of each, (series, observables, bins)."""
        if self.noise == "known":
            return np.asarray(least.sum(axis=(0, 1)))
        parts = self._by_noise(least)
        return np.asarray(sum(n * np.log(np.maximum(q, _LEAST) / n) for q, n in parts))

    def _by_noise(self, least: Array) -> list[tuple[Array, float]]:
        """Least sum of squares, (bins,), and number of values of each unknown noise."""
        counts = self._counts()
        if self.separate_noise:
            parts = [
                (least[i, k], counts[i, k]) for i in range(least.shape[0]) for k in range(least.shape[1])
            ]
        else:
            parts = list(zip(least.sum(axis=0), counts.sum(axis=0), strict=True))
        return [(squares, float(n)) for squares, n in parts if n > 0.0]

    def _counts(self) -> Array:
        """Values of each group, (series, observables)."""
        return np.asarray(self.of.sums[:, :, N].sum(axis=1).reshape(len(self.of.series), -1))

    def value(self, problem: Problem, theta: Array) -> float:
        """chi2 at some constants; under unknown noises the sum of n log(S/n)."""
        residual = problem.residual(theta) / problem.noise.base
        prior = problem.parameters.prior_residuals(theta)
        total = float(prior @ prior)
        if self.noise == "known":
            return total + float(residual @ residual)
        for rows in problem.noise_groups().values():
            count = problem.noise.count(rows)
            total += count * math.log(float(residual[rows] @ residual[rows]) / count)
        return total

    def gap(self, problem: Problem, optimum: LeastSquaresFit, fetched: NDArray[np.bool_]) -> float | None:
        """The gap of the optimum, once no transition elsewhere can do better."""
        beyond = self.least_values[~fetched]
        if beyond.size and float(beyond.min()) < self.value(problem, optimum.optimum.theta):
            return None
        return optimum.optimum.gap

    def least_rise(self, problem: Problem, optimum: LeastSquaresFit, fetched: NDArray[np.bool_]) -> float:
        """How high a profile lies at least where a transition lies in an interval that was not fetched.

        The rise is that of `ifrfit.inference.profile.objective.Misfit`, in which a noise has n less its
        leverage degrees of freedom: docs/theory/sufficient-statistics.md, eq. (4).
        """
        beyond = self.least_values[~fetched]
        if not beyond.size:
            return math.inf
        least = float(beyond.min())
        misfit = Misfit.of(problem, optimum)
        found = []
        for mode in misfit.modes:
            prior = problem.parameters.prior_residuals(mode.theta)
            pull = float(prior @ prior)
            value = self.value(problem, mode.theta) - pull
            if self.noise == "known":
                found.append(mode.rise + least - value - pull)
                continue
            parts = self._by_noise(self._least(1.0))
            counts = np.array([problem.noise.count(rows) for rows in problem.noise_groups().values()])
            share = float(np.max(1.0 - mode.dof / counts))
            better = value - sum(n * math.log(max(float(q.min()), _LEAST) / n) for q, n in parts)
            found.append(mode.rise + (1.0 - share) * (least - value) - share * better - pull)
        return min(found)


def foreseen(
    questions_of: Callable[[Accumulated], Sequence[Question]], of: Accumulated, coming: int
) -> Accumulated:
    """What was found of some rows, narrowed to the intervals that a transition is expected in.

    They are parted as long as very many of the rows to come would lie in them, and the sums tell in which
    parts of them they need not be kept. No interval is kept for a question that calls for too many even so.

    Parameters
    ----------
    questions_of : callable
        What is asked of sums.
    of : Accumulated
    coming : int
        Rows that come before this is asked again.
    """
    while True:
        windows = [question.expected_window() & of.window.inside for question in questions_of(of)]
        inside = np.asarray(np.any(windows, axis=0))
        of.window.narrow(inside)
        wide = [
            window
            for window in windows
            if np.count_nonzero(window) <= _MOST_PARTED and of.expected_rows(window, coming) > _FEW_ROWS
        ]
        parted = np.asarray(np.any(wide, axis=0)) if wide else np.zeros_like(inside)
        count = of.intervals.count + (PARTS - 1) * np.count_nonzero(parted)
        finer = of.parted(parted) if count * len(of.groups) <= MOST_SUMS else of
        if finer.intervals == of.intervals:
            break
        of = finer
    few = [window for window in windows if of.expected_rows(window, coming) <= MOST_ROWS / 2]
    of.window.narrow(np.asarray(np.any(few, axis=0)) if few else np.zeros_like(inside))
    return of


def solve_each(questions: Sequence[Question], reader: Reader) -> list[Solved] | None:
    """The problem of each question with its optimum, and the intervals whose impacts stand for themselves.

    Each has the impacts that it calls for itself: a closure that the data refute leaves more of them open.
    None where these are more than `MOST_ROWS`.

    Parameters
    ----------
    questions : sequence of Question
        Put to the same sums, whose kept impacts are let go of in the end.
    reader : Reader
        Of the stream, for impacts that were not kept.
    """
    of = questions[0].of
    fetched = [question.expected_fetched() for question in questions]
    solved: dict[int, Solved] = {}
    for _ in range(_PASSES):
        if sum(map(Question.rows_in, questions, fetched)) > MOST_ROWS:
            return None
        open_ = [place for place in range(len(questions)) if place not in solved]
        inside = np.any([fetched[place].any(axis=0) for place in open_], axis=0)
        window = of.window
        if (inside & ~window.inside).any():
            window = reader.fetch(of.intervals, inside, of.series)
        for place in open_:
            question = questions[place]
            problem = question.problem(window.rows(fetched[place]), fetched[place])
            optimum = least_squares(problem)
            needed = question.least_values < question.value(problem, optimum.optimum.theta) + FAR
            if (needed & ~fetched[place]).any():
                fetched[place] |= _with_neighbours(needed) | question.each_by_itself()
            else:
                solved[place] = Solved(problem, optimum, fetched[place], question)
        if len(solved) == len(questions):
            of.window.narrow(np.zeros(of.intervals.count, dtype=bool))
            return [solved[place] for place in range(len(questions))]
    raise DataError(
        f"{of.stream.path}: where the transition lies did not settle. Fit a part of the data in memory."
    )


def _with_neighbours(intervals: Mask) -> Mask:
    """With the intervals on either side: the next optimum lies a little beside this one."""
    return np.asarray(intervals | np.roll(intervals, 1, axis=1) | np.roll(intervals, -1, axis=1))
