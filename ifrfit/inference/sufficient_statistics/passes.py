"""Passes over the portions of a stream, by this process or by others, with the same result to the last bit.

A portion is read where it lies, and what is found of it comes back: sums, counts, a few rows. Parts are put
together in the order of the rows, whoever made them and whenever they came.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.stream.impact_stream import ImpactStream
from ifrfit.data.stream.portions import FIRST_ROWS, Portion
from ifrfit.data.stream.tally import Tally
from ifrfit.errors import DataError
from ifrfit.inference.sufficient_statistics.accumulated import Accumulated
from ifrfit.inference.sufficient_statistics.tau_intervals import Intervals
from ifrfit.inference.sufficient_statistics.unfinished_pass import Part, UnfinishedPass
from ifrfit.inference.sufficient_statistics.window_rows import WindowRows
from ifrfit.inference.workers.crews import TRIES, Crew
from ifrfit.inference.workers.lots import in_order
from ifrfit.physics.observables import OBSERVABLES

Mask = NDArray[np.bool_]
Progress = Callable[[int, int], None]
Tell = Callable[[int], None]
P = TypeVar("P", bound=Part)

_MOST_KEPT = 3 * FIRST_ROWS  # rows that are all kept until the sums tell which to keep
_STAGE = 8  # times as many rows in each stage as in all before it


@dataclass(frozen=True)
class Reader:
    """Who reads the portions of a stream, and what an earlier run has kept of it.

    Attributes
    ----------
    stream : ImpactStream
    crew : Crew or None
        None: this process itself.
    unfinished : UnfinishedPass or None
        Where parts are kept.
    progress : callable or None
        Called with the rows read, and how many there are.
    """

    stream: ImpactStream
    crew: Crew | None = None
    unfinished: UnfinishedPass | None = None
    progress: Progress | None = None

    def accumulate(
        self, weighted: bool, intervals: Intervals, focus: Callable[[Accumulated, int], Accumulated]
    ) -> Accumulated:
        """The sums of all rows.

        Parameters
        ----------
        weighted, intervals
            As `Accumulated`; intervals may be parted on the way.
        focus : callable
            Narrows what was found so far to the intervals whose rows are to be kept, which it may part; it is
            told how many rows come before it is asked once more.
        """
        total = Accumulated.nothing(self.stream, weighted, intervals, np.ones(intervals.count, dtype=bool))
        first = _rows_of(self.stream.portions[0])
        if first > _MOST_KEPT:
            begun = focus(self._beginning(total.anew()), first)
            total = Accumulated.nothing(self.stream, weighted, begun.intervals, begun.window.inside)
        for stage in _stages(self.stream.portions):
            if total.tally.rows:
                total = focus(total, sum(map(_rows_of, stage)))
            # what goes along with each portion need not name all others
            nothing = replace(
                Accumulated.nothing(self.stream, weighted, total.intervals, total.window.inside),
                stream=replace(self.stream, portions=()),
            )
            # all rows of the first stage are kept, and had better not travel
            crew, unfinished = (self.crew, self.unfinished) if total.tally.rows else (None, None)
            tell = partial(self._tell, total.tally)
            work = partial(_sums, nothing, self._here(tell, crew))
            for part in _each(stage, work, nothing, crew, unfinished):
                total.merge(part)
                tell(0)
        return total

    def _beginning(self, part: Accumulated) -> Accumulated:
        """The sums of some rows of the first portion."""
        for batch in self.stream.batches(self.stream.portions[0], part.tally):
            part.add(batch)
            if part.tally.rows >= FIRST_ROWS:
                break
        return part

    def fetch(self, intervals: Intervals, inside: Mask, series: Sequence[str]) -> WindowRows:
        """The rows of some intervals, (intervals,), in a pass of its own; series are numbered as given."""
        total, tally = WindowRows(inside), Tally(series=list(series))
        tell = partial(self._tell, tally)
        work = partial(
            _rows, replace(self.stream, portions=()), intervals, inside, self._here(tell, self.crew)
        )
        found: Iterator[tuple[Tally, WindowRows]] = in_order(self.stream.portions, work, _lost, self.crew)
        for met, rows in found:
            total.merge(rows, tally.merge(met))
            tell(0)
        return total

    def parts(self, work: Callable[[Tell | None, Sequence[Portion]], list[P]], nothing: P) -> Iterator[P]:
        """What is found of each portion in a pass of its own, in their order.

        Parameters
        ----------
        work : callable
            Is told whom to tell of rows.
        nothing : Part
            What each part begins as.
        """
        done = Tally()
        tell = partial(self._tell, done)
        task = partial(work, self._here(tell, self.crew))
        found = _each(self.stream.portions, task, nothing, self.crew, self.unfinished)
        for portion, part in zip(self.stream.portions, found, strict=True):
            done.rows += _rows_of(portion)
            tell(0)
            yield part

    def _here(self, tell: Tell, crew: Crew | None) -> Tell | None:
        """Who is told of rows while a portion is read: nobody, where others read it."""
        return tell if crew is None and self.progress is not None else None

    def _tell(self, tally: Tally, rows: int) -> None:
        if self.progress is not None:
            self.progress(tally.rows + rows, max(self.stream.rows, tally.rows + rows))


def _each(
    portions: Sequence[Portion],
    work: Callable[[Sequence[Portion]], list[P]],
    nothing: P,
    crew: Crew | None,
    unfinished: UnfinishedPass | None,
) -> Iterator[P]:
    """What is found of each portion, in their order; what an earlier run has kept is not found again."""
    kept = unfinished.of(nothing) if unfinished is not None else None
    # asked once: the same command may be at work beside this one
    is_kept = [kept is not None and kept.has(portion) for portion in portions]
    missing = [portion for portion, there in zip(portions, is_kept, strict=True) if not there]
    fresh = in_order(missing, work, _lost, crew)
    for portion, there in zip(portions, is_kept, strict=True):
        if kept is not None and there:
            yield kept.load(portion)
            continue
        part = next(fresh)
        if kept is not None:
            kept.keep(portion, part)
        yield part


def _sums(nothing: Accumulated, tell: Tell | None, portions: Sequence[Portion]) -> list[Accumulated]:
    """What is found of each portion."""
    found = []
    for portion in portions:
        part = nothing.anew()
        for batch in nothing.stream.batches(portion, part.tally, part.sample):
            part.add(batch)
            if tell is not None:
                tell(part.tally.rows)
        found.append(part)
    return found


def _rows(
    stream: ImpactStream, intervals: Intervals, inside: Mask, tell: Tell | None, portions: Sequence[Portion]
) -> list[tuple[Tally, WindowRows]]:
    """The rows of some intervals in each portion."""
    found = []
    names = [name for name in stream.observables if OBSERVABLES[name].linear is not None]
    for portion in portions:
        tally, rows = Tally(), WindowRows(inside)
        for batch in stream.batches(portion, tally):
            place, _ = intervals.places(batch.incidence)
            for name in names:
                rows.add(name, batch, batch.values[name], place)
            if tell is not None:
                tell(tally.rows)
        found.append((tally, rows))
    return found


def _lost(portion: Portion) -> NoReturn:
    raise DataError(
        f"{portion[0].path}: the process that read it died {TRIES} times, as for want of memory. Read it in "
        "fewer processes at once."
    )


def _rows_of(portion: Portion) -> int:
    return sum(piece.rows for piece in portion)


def _stages(portions: Sequence[Portion]) -> list[list[Portion]]:
    """The portions in stages, each of several times the rows of those before it."""
    found: list[list[Portion]] = [[]]
    before = own = 0
    for portion in portions:
        if found[-1] and own + _rows_of(portion) > _STAGE * before:
            found.append([])
            before, own = before + own, 0
        found[-1].append(portion)
        own += _rows_of(portion)
    return found
