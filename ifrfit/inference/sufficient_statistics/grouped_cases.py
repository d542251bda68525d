"""A bootstrap of cases from sums: random groups of impacts are drawn in the place of impacts.

Each impact belongs to one of `GROUPS` groups by a number that its place in the files alone decides. Sums of a
group on either side of the transition, and its impacts about it one by one, say what a replicate needs. The
theory is in docs/theory/sufficient-statistics.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.stream.impact_stream import Batch, ImpactStream, Values
from ifrfit.data.stream.portions import Portion
from ifrfit.data.stream.sample import lots_of_rows
from ifrfit.data.stream.tally import Tally
from ifrfit.errors import DataError
from ifrfit.inference.bootstrap.batched_solver import BatchedSolver
from ifrfit.inference.bootstrap.estimator import BootstrapDraws, bootstrap
from ifrfit.inference.bootstrap.schemes import FEWEST, Cases, prior_means
from ifrfit.inference.model.problem import Problem
from ifrfit.inference.optimize.least_squares import LeastSquaresFit, least_squares
from ifrfit.inference.sufficient_statistics.accumulated import Accumulated
from ifrfit.inference.sufficient_statistics.condensed_rows import condensed_groups
from ifrfit.inference.sufficient_statistics.moments import Moments, N, Place
from ifrfit.inference.sufficient_statistics.passes import Progress, Reader, Tell
from ifrfit.inference.sufficient_statistics.problem_rows import ProblemRows
from ifrfit.inference.sufficient_statistics.tau_intervals import Intervals
from ifrfit.inference.sufficient_statistics.transition_window import FAR, Question
from ifrfit.physics.observables import OBSERVABLES

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

GROUPS = 1024  # of impacts: an sd from them is known to 1/sqrt(2 GROUPS), as from as many impacts
_MOST_SUMS = 200_000  # groups times series and observables
_MOST_ROWS = 200_000  # of all groups and of the impacts about the transition together
_ROWS = "rows "
_BELOW, _ABOVE = 0, 1
_SERIES, _GAMMA, _SPIN_X, _SPIN_Y, _VALUE, _SIGMA, _GROUP = range(7)


@dataclass
class GroupedSums:
    """Sums of random groups of impacts.

    Attributes
    ----------
    stream : ImpactStream
    series : tuple of str
    low, high : ndarray of int, (series,)
        First and last interval of those in which impacts stand for themselves.
    weighted : bool
    intervals : Intervals
    moments : Moments
        Of each group of each series and observable, below and above these intervals; x is 1/tau itself.
    parts : dict of str to list of ndarray, (7, k)
        Impacts within, by observable: series, angle in degrees, spins, value, sigma, group.
    """

    stream: ImpactStream
    series: tuple[str, ...]
    low: Index
    high: Index
    weighted: bool
    intervals: Intervals
    moments: Moments
    parts: dict[str, list[Array]] = field(default_factory=dict)

    @classmethod
    def nothing(cls, of: Accumulated, low: Index, high: Index) -> GroupedSums:
        """Of no impacts of a stream, all of which were summed before."""
        stream = replace(of.stream, portions=())
        of_groups = Moments.nothing(1, 2 * low.size * len(stream.observables) * GROUPS)
        return cls(stream, tuple(of.series), low, high, of.weighted, of.intervals, of_groups)

    def anew(self) -> GroupedSums:
        """Of no impacts, with the same intervals."""
        return replace(self, moments=Moments.nothing(*self.moments.high.shape[:2]), parts={})

    def question(self) -> bytes:
        """See `ifrfit.inference.sufficient_statistics.unfinished_pass.Part`."""
        asked = self.stream, self.series, self.weighted, self.intervals, GROUPS
        return repr(asked).encode() + self.low.tobytes() + self.high.tobytes()

    def to_arrays(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """What a part of the pass found, as JSON takes it and as arrays."""
        seen = np.flatnonzero(self.moments.high[0, :, N] > 0.0)
        kept = {name: np.concatenate(parts, axis=1) for name, parts in self.parts.items()}
        sums = {"seen": seen, "high": self.moments.high[0, seen], "low": self.moments.low[0, seen]}
        return {}, {**sums, **{f"{_ROWS}{name}": rows for name, rows in kept.items()}}

    def with_arrays(self, found: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> GroupedSums:
        """What `to_arrays` gave, as a part of the same pass as this one, which is of nothing."""
        part = self.anew()
        for of, name in ((part.moments.high, "high"), (part.moments.low, "low")):
            of[0, arrays["seen"]] = arrays[name]
        for name, rows in arrays.items():
            if name.startswith(_ROWS):
                part.parts[name.removeprefix(_ROWS)] = [rows]
        return part

    def add(self, batch: Batch) -> None:
        """Add the impacts of a batch."""
        lots = lots_of_rows(batch.number, batch.first, batch.gamma_deg.size)
        groups = (lots % np.uint64(GROUPS)).astype(np.intp)
        place, _ = self.intervals.places(batch.incidence)
        for number, name in enumerate(self.stream.observables):
            self._add(batch, groups, place, number, name, batch.values[name])

    def _add(
        self,
        batch: Batch,
        groups: Index,
        place_of: Place,
        number: int,
        name: str,
        values: Values,
    ) -> None:
        at, value, sigma = values
        if not at.size:
            return
        incidence, series, group = batch.incidence.take(at), batch.series[at], groups[at]
        w = sigma**-2.0 if self.weighted else np.ones(at.size)
        of = OBSERVABLES[name]
        if of.linear is None:
            slope = np.ones(at.size) if of.by_e_n is None else np.asarray(of.by_e_n(incidence))
            r, x = value, np.zeros(at.size)
            side = np.full(at.size, _BELOW)
        else:
            offset, slope = of.linear(incidence, self.stream.inertia_factor)
            slides = incidence.slip > 0.0
            x = np.divide(incidence.cosine, incidence.slip, out=np.zeros(at.size), where=slides)
            r, slope = value - offset, np.where(slides, slope, 0.0)
            place = place_of[at]
            side = np.where(place > self.high[series], _ABOVE, _BELOW)
            inside = (place >= self.low[series]) & (place <= self.high[series])
            own = at[inside]
            columns = (series[inside], batch.gamma_deg[own], incidence.spin_x[inside])
            more = (incidence.spin_y[inside], value[inside], sigma[inside], group[inside])
            self.parts.setdefault(name, []).append(np.stack([*columns, *more]).astype(float))
            kept = np.flatnonzero(~inside)
            side, w, slope, r, x = side[kept], w[kept], slope[kept], r[kept], x[kept]
            series, group = series[kept], group[kept]
        row = (series * len(self.stream.observables) + number) * GROUPS + group
        self.moments.add(0, (2 * row + side).astype(np.int32), w, slope, r, x)

    def merge(self, following: GroupedSums) -> None:
        """Add what was found of later portions."""
        self.moments = self.moments.merge(following.moments)
        for name, parts in following.parts.items():
            self.parts.setdefault(name, []).extend(parts)


def bootstrap_of_groups(
    question: Question,
    problem: Problem,
    optimum: LeastSquaresFit,
    reader: Reader,
    replicates: int,
    seed: int,
    progress: Progress | None = None,
) -> tuple[BootstrapDraws, LeastSquaresFit]:
    """Draw groups of impacts with replacement within each series, and fit each replicate.

    Parameters
    ----------
    question : Question
    problem, optimum : Problem, LeastSquaresFit
        Of all impacts.
    reader : Reader
        Of the stream, which is read once more.
    replicates, seed, progress
        As `ifrfit.inference.bootstrap.bootstrap`.

    Returns
    -------
    draws : BootstrapDraws
    optimum : LeastSquaresFit
        Of the rows that were drawn from: that of all impacts, to rounding.

    Raises
    ------
    DataError
        For too many series or impacts about the transition, constants that some series share and others not,
        and replicates whose transition lies where impacts do not stand for themselves.
    """
    of, path = question.of, question.of.stream.path
    observables = of.stream.observables
    if len(of.series) * len(observables) * GROUPS > _MOST_SUMS:
        raise DataError(f"{path}: --method bootstrap of so many series takes them one by one: --series NAME.")
    low, high = _hull(question, problem, optimum)
    places = np.arange(of.intervals.count)
    # told by the sums, before any is held
    _refuse_many(str(path), question.rows_in((places >= low[:, None]) & (places <= high[:, None])))
    sums = GroupedSums.nothing(of, low, high)
    for part in reader.parts(partial(_sums, sums.anew()), sums):
        sums.merge(part)
    drawn, scheme = _problem(question, sums)
    solved = least_squares(drawn)
    if BatchedSolver.of(drawn, solved) is None:
        raise DataError(
            f"{path}: --method bootstrap fits replicates of sums together, which constants that some series "
            "share and others not do not allow. Take --method exact, or a part of the data in one file."
        )
    found = bootstrap(drawn, solved, scheme=scheme, replicates=replicates, seed=seed, progress=progress)
    _refuse_beyond(question, found, solved, low, high)
    return found, solved


def _hull(question: Question, problem: Problem, optimum: LeastSquaresFit) -> tuple[Index, Index]:
    """First and last interval of each series in which the transition of a replicate may lie, (series,) each.

    Replicates scatter as the values do, whatever sigma says: what is far is so over the reduced chi2.
    """
    of = question.of
    n = problem.noise.count(np.arange(len(problem.rows)))
    value = question.value(problem, optimum.optimum.theta)
    wider = max(1.0, value / n) if question.noise == "known" else 1.0
    near = question.least_values < value + FAR * wider
    # none where no value knows a transition
    last = of.intervals.count - 1
    low = np.where(near.any(axis=1), near.argmax(axis=1), 0)
    high = np.where(near.any(axis=1), last - near[:, ::-1].argmax(axis=1), last)
    return np.maximum(low - 1, 0), np.minimum(high + 1, last)


def _sums(nothing: GroupedSums, tell: Tell | None, portions: Sequence[Portion]) -> list[GroupedSums]:
    """The sums of each portion."""
    found = []
    for portion in portions:
        tally, sums = Tally(series=list(nothing.series)), nothing.anew()
        for batch in nothing.stream.batches(portion, tally):
            sums.add(batch)
            if tell is not None:
                tell(tally.rows)
        found.append(sums)
    return found


def _problem(question: Question, sums: GroupedSums) -> tuple[Problem, Cases]:
    """Rows that stand for the groups, impacts about the transition, and what of them is drawn together."""
    of, stream = question.of, question.of.stream
    parts: list[ProblemRows] = []
    tau = sums.intervals.edges
    by_group = sums.moments.high.reshape(len(of.groups), GROUPS, 2, -1)
    with np.errstate(divide="ignore"):
        of_tau = 1.0 / tau
    for number, known in enumerate(of.groups):
        name, series = of.observable_of(number), of.series_of(number)
        span = (known.least_gamma, known.largest_gamma)
        # all that knows no transition stands at 1/tau = 0
        least = float(of_tau[sums.low[series]]) if OBSERVABLES[name].linear is not None else 0.0
        ends = (least, np.inf), (0.0, float(of_tau[sums.high[series] + 1]))
        for side in (_BELOW, _ABOVE):
            made, group = condensed_groups(
                by_group[number, :, side], name, stream.inertia_factor, ends[side], span
            )
            if not made.value.size:
                continue
            rows = made.gamma_deg, made.value, made.sigma, made.count
            parts.append(ProblemRows.condensed(number % len(stream.observables), series, rows, group))
    for name, kept in sorted(sums.parts.items()):
        own = np.concatenate(kept, axis=1)
        if own.shape[1]:
            parts.append(question.standing(name, own[:_GROUP], own[_GROUP].astype(np.intp)))
    _refuse_many(str(stream.path), sum(map(len, parts)))
    problem = question.problem_of(parts, [str(group) for group in range(GROUPS)])
    return problem, _cases(problem, str(stream.path))


def _refuse_many(path: str, n: float) -> None:
    """Refuse to draw from very many rows.

    Raises
    ------
    DataError
        With their number.
    """
    if n > _MOST_ROWS:
        raise DataError(
            f"{path}: the data leave open where sliding ends: {n:,.0f} rows would have to be "
            f"drawn from at once ({_MOST_ROWS:,} at most). Take --method exact, or say more by --fix, "
            "--prior or --bounds."
        )


def _cases(problem: Problem, path: str) -> Cases:
    """Groups within each series."""
    group = problem.observations.table["impact_id"].to_numpy(dtype=object).astype(np.intp)
    numbers, impact = np.unique(problem.rows.series * GROUPS + group, return_inverse=True)
    kinds = tuple(np.flatnonzero(numbers // GROUPS == series) for series in range(len(problem.series)))
    for name, members in zip(problem.series, kinds, strict=True):
        if members.size < FEWEST:
            raise DataError(
                f"{path}: {members.size} impacts in series {name} are too few to draw from. Use --method "
                "exact."
            )
    return Cases(name="cases", impact=impact.reshape(-1), kinds=kinds, prior=prior_means(problem))


def _refuse_beyond(
    question: Question, found: BootstrapDraws, optimum: LeastSquaresFit, low: Index, high: Index
) -> None:
    """Refuse replicates whose transition lies where impacts do not stand for themselves."""
    problem = found.problem
    tau, law = question.of.intervals.edges, problem.closure.law(problem.inertia_factor)
    if not found.answered:
        return
    theta = np.tile(optimum.optimum.theta, (found.answered, 1))
    for place, entry in enumerate(problem.parameters.names):
        if entry in found.draws:
            theta[:, place] = found.draws[entry]
    places = problem.parameters.positions
    for series, name in enumerate(problem.series):
        own = question.of.series.index(name)
        e_n, mu = (theta[:, places[constant][series]] for constant in ("e_n", "mu"))
        c = theta[:, places[problem.closure.constant][series]] if problem.closure.constant else np.zeros(1)
        with np.errstate(divide="ignore", invalid="ignore"):
            at = mu * (1.0 + e_n) / law.bound(c)
        outside = int(np.count_nonzero((at < tau[low[own]]) | (at > tau[high[own] + 1])))
        if problem.has_oblique and outside:
            raise DataError(
                f"{question.of.stream.path}: the transition of {outside} of {found.answered:,} "
                "replicates lies where impacts were not kept one by one, because values scatter unlike "
                "their sigma. Take --noise unknown, or a part of the data in one file."
            )
