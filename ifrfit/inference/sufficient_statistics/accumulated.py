"""What a pass over impacts leaves: their sums, what else of their values a fit needs, and some of their rows.

Parts of a pass, wherever they were made, merge to what one pass would have left.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.observations import Source
from ifrfit.data.stream.copied_rows import CopiedRows
from ifrfit.data.stream.impact_stream import Batch, ImpactStream, Values
from ifrfit.data.stream.plain_rows import in_one_piece, same_in_all
from ifrfit.data.stream.row_places import place_of
from ifrfit.data.stream.sample import Sample
from ifrfit.data.stream.tally import Tally
from ifrfit.inference.model.noise import in_steps, resolution
from ifrfit.inference.sufficient_statistics.moments import SUMS, ExactSum, Moments, N, Place
from ifrfit.inference.sufficient_statistics.tau_intervals import Intervals
from ifrfit.inference.sufficient_statistics.window_rows import WindowRows
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.text import joined

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

_WINDOW = "window "
_FINEST = 1e-6  # last decimal that is told from others
BINS = 2048  # steps of tau/(1 + tau), unless there are very many rows
MOST_SUMS = 400_000  # intervals times series and observables: 0.2 GiB with what is made of them


class ManySumsError(Exception):
    """More sums than `MOST_SUMS` would be held: with fewer intervals they are fewer.

    Parameters
    ----------
    groups : int
        Series times observables so far.
    """

    def __init__(self, groups: int) -> None:
        super().__init__(groups)
        self.groups = groups


@dataclass
class GroupNotes:
    """What a pass found of one series and observable beside the sums."""

    smallest_sigma: float = math.inf
    largest_sigma: float = 0.0
    largest_value: float = 0.0
    square_sigma: ExactSum = field(default_factory=ExactSum)
    log_sigma: ExactSum = field(default_factory=ExactSum)
    last_decimal: float = 1.0
    last_decimal_of_gamma: float = 1.0
    least_gamma: float = 90.0
    largest_gamma: float = 0.0

    def merge(self, other: GroupNotes) -> GroupNotes:
        """Of both."""
        made: dict[str, Any] = {}
        for each in fields(self):
            ours, theirs = getattr(self, each.name), getattr(other, each.name)
            if isinstance(ours, ExactSum):
                made[each.name] = ours.merge(theirs)
            else:
                made[each.name] = (max if each.name.startswith("largest") else min)(ours, theirs)
        return GroupNotes(**made)


@dataclass
class Accumulated:
    """Sums of the impacts of a stream.

    Attributes
    ----------
    stream : ImpactStream
    weighted : bool
        Whether sigma gives the weights.
    intervals : Intervals
    tally : Tally
    moments : Moments
        Groups are series times observables.
    groups : list of GroupNotes
    sample : Sample
    copies : CopiedRows
    window : WindowRows
        Impacts of the intervals that a transition is expected in.
    """

    stream: ImpactStream
    weighted: bool
    intervals: Intervals
    tally: Tally
    moments: Moments
    groups: list[GroupNotes]
    sample: Sample
    copies: CopiedRows
    window: WindowRows

    @classmethod
    def nothing(cls, stream: ImpactStream, weighted: bool, intervals: Intervals, window: Mask) -> Accumulated:
        """Of no impacts; `window` are the intervals whose rows are to be kept, (bins,)."""
        rows, counted = stream.rows, stream.is_counted
        sample = Sample(Sample.below_of(rows, counted=counted))
        copies = CopiedRows(CopiedRows.below_of(rows, counted=counted))
        moments = Moments.nothing(0, intervals.count)
        return cls(stream, weighted, intervals, Tally(), moments, [], sample, copies, WindowRows(window))

    def anew(self) -> Accumulated:
        """Of no impacts, with what is to be looked for the same."""
        nothing, window = Moments.nothing(0, self.intervals.count), WindowRows(self.window.inside)
        fresh = replace(self, tally=Tally(), moments=nothing, groups=[], window=window)
        return replace(fresh, sample=Sample(self.sample.below), copies=CopiedRows(self.copies.below))

    def add(self, batch: Batch) -> None:
        """Add the impacts of a batch, of whose series the tally knows."""
        names = self.stream.observables
        self._make_room()
        place, x = self.intervals.places(batch.incidence)
        for number, name in enumerate(names):
            values = batch.values[name]
            for series, own in _by_series(batch.series, values, len(self.tally.series)):
                group = series * len(names) + number
                self._note(group, name, own, batch)
                self._add_rows(group, name, batch, own, place, x)
            if OBSERVABLES[name].linear is not None:
                self.window.add(name, batch, values, place)
        i = batch.incidence
        whole_columns = [batch.values[name].of_all(batch.gamma_deg.size) for name in names]
        first = place_of(batch.number, batch.first)
        self.copies.add((batch.gamma_deg, i.spin_x, i.spin_y), whole_columns, first)

    def _add_rows(self, group: int, name: str, batch: Batch, values: Values, place: Place, x: Array) -> None:
        """Add values of one group; `place` and `x` are of all impacts of the batch."""
        at, value, sigma = values
        incidence = batch.incidence
        if at.size < batch.gamma_deg.size:
            incidence, place, x = incidence.take(at), place[at], x[at]
        if not self.weighted:
            sigma = same_in_all(1.0, at.size)
        observable = OBSERVABLES[name]
        if observable.linear is None:
            slope = same_in_all(1.0, at.size)
            if observable.by_e_n is not None:
                slope = in_one_piece(observable.by_e_n(incidence))
            self.moments.add_direct(group, sigma, slope, value)
        else:
            # where nothing slips the slope is zero, or the observable has no value
            offset, slope = observable.linear(incidence, self.stream.inertia_factor)
            offset, slope = map(in_one_piece, (offset, slope))
            self.moments.add_values(group, place, sigma, slope, value, offset, x)

    def parted(self, requested: Mask) -> Accumulated:
        """The same impacts, with intervals parted as far as the rows in them are kept.

        Parameters
        ----------
        requested : ndarray of bool, (intervals,)
        """
        finer, former = self.intervals.part(requested & self.window.inside)
        same = np.bincount(former, minlength=self.intervals.count)[former] == 1
        sums = Moments.nothing(len(self.groups), finer.count)
        for fresh, known in ((sums.high, self.moments.high), (sums.low, self.moments.low)):
            fresh[:, same] = known[:, former[same]]
        made = replace(self, intervals=finer, moments=sums, window=WindowRows(self.window.inside[former]))
        names = self.stream.observables
        for number, name in enumerate(names):
            if OBSERVABLES[name].linear is None:  # all in the first interval
                groups = slice(number, None, len(names))
                sums.high[groups, 0], sums.low[groups, 0] = (
                    each[groups, 0] for each in (self.moments.high, self.moments.low)
                )
            for batch in self.window.batches(name):
                place, x = finer.places(batch.incidence)
                made.window.add(name, batch, batch.values[name], place)
                fresh_rows = np.flatnonzero(~same[place])
                rows = Values(fresh_rows, *(each[fresh_rows] for each in batch.values[name][1:]))
                for series, own in _by_series(batch.series, rows, len(self.tally.series)):
                    made._add_rows(series * len(names) + number, name, batch, own, place, x)
        return made

    def expected_rows(self, inside: Mask, coming: int) -> float:
        """How many values of some intervals are to be expected among rows to come."""
        names = self.stream.observables
        count = sum(
            float(self.sums[number :: len(names), inside, N].sum())
            for number, name in enumerate(names)
            if OBSERVABLES[name].linear is not None
        )
        return count / max(self.tally.rows, 1) * coming

    def merge(self, following: Accumulated) -> None:
        """Add what was found of later portions."""
        k = len(self.stream.observables)
        series = self.tally.merge(following.tally)
        self._make_room()
        at = (series[:, None] * k + np.arange(k)).ravel()
        theirs = Moments.nothing(len(self.groups), self.intervals.count)
        theirs.high[at], theirs.low[at] = following.moments.high, following.moments.low
        self.moments = self.moments.merge(theirs)
        for own, notes in zip(at.tolist(), following.groups, strict=True):
            self.groups[own] = self.groups[own].merge(notes)
        self.sample.merge(following.sample)
        self.copies.merge(following.copies)
        self.window.merge(following.window, series)

    def _make_room(self) -> None:
        groups = len(self.tally.series) * len(self.stream.observables)
        if len(self.groups) == groups:
            return
        if groups * self.intervals.count > MOST_SUMS:
            raise ManySumsError(groups)
        fresh = Moments.nothing(groups, self.intervals.count)
        fresh.high[: len(self.groups)] = self.moments.high
        fresh.low[: len(self.groups)] = self.moments.low
        self.moments = fresh
        self.groups += [GroupNotes() for _ in range(groups - len(self.groups))]

    def _note(self, group: int, name: str, values: Values, batch: Batch) -> None:
        known, (at, value, sigma) = self.groups[group], values
        whole = at.size == batch.gamma_deg.size
        gamma = batch.gamma_deg if whole else batch.gamma_deg[at]
        ends = batch.ends if whole else {}
        least, largest = ends.get("gamma") or _ends(gamma)
        known.least_gamma = min(known.least_gamma, least)
        known.largest_gamma = max(known.largest_gamma, largest)
        least, largest = ends.get(name) or _ends(value)
        known.largest_value = max(known.largest_value, largest, -least)
        known.last_decimal = _last_decimal(known.last_decimal, value)
        known.last_decimal_of_gamma = _last_decimal(known.last_decimal_of_gamma, gamma)
        if self.weighted:
            least, largest = ends.get(f"sigma:{name}") or _ends(sigma)
            known.smallest_sigma = min(known.smallest_sigma, least)
            known.largest_sigma = max(known.largest_sigma, largest)
            squares, logs = known.square_sigma, known.log_sigma
            if sigma.size > 1 and least == largest:
                known.square_sigma = squares.merge(ExactSum.of_equal(least * least, sigma.size))
                known.log_sigma = logs.merge(ExactSum.of_equal(math.log(least), sigma.size))
            else:
                known.square_sigma, known.log_sigma = squares.add_squares(sigma), logs.add(np.log(sigma))

    @property
    def sums(self) -> Array:
        """(groups, bins, 7)."""
        return self.moments.high

    @property
    def series(self) -> list[str]:
        """Those met."""
        return self.tally.series

    def observable_of(self, group: int) -> str:
        """Observable of a group."""
        return self.stream.observables[group % len(self.stream.observables)]

    def series_of(self, group: int) -> int:
        """Series of a group."""
        return group // len(self.stream.observables)

    def count_of(self, group: int) -> float:
        """Values of a group."""
        return float(self.sums[group, :, N].sum())

    def largest_sigmas(self) -> dict[str, float]:
        """The largest uncertainty of each observable; 0 where none is used."""
        names = self.stream.observables
        return {
            name: max((known.largest_sigma for known in self.groups[k :: len(names)]), default=0.0)
            for k, name in enumerate(names)
        }

    def question(self) -> bytes:
        """See `ifrfit.inference.sufficient_statistics.unfinished_pass.Part`."""
        asked = self.stream, self.weighted, self.intervals, self.sample.below
        return repr(asked).encode() + np.packbits(self.window.inside).tobytes()

    def to_arrays(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """What a part of a pass found, as JSON takes it and as arrays."""
        lots, rows = self.sample.to_bytes()
        seen = np.flatnonzero(self.moments.high[:, :, N].ravel() > 0.0)
        arrays: dict[str, NDArray[Any]] = {
            "seen": seen,
            "high": self.moments.high.reshape(-1, SUMS)[seen],
            "low": self.moments.low.reshape(-1, SUMS)[seen],
            "lots": lots,
            "rows": rows,
            **self.copies.to_arrays(),
            **{f"{_WINDOW}{name}": found for name, found in self.window.arrays().items()},
        }
        return {"tally": self.tally.to_dict(), "groups": [asdict(notes) for notes in self.groups]}, arrays

    def with_arrays(self, found: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Accumulated:
        """What `to_arrays` gave, as a part of the same pass as this one, which is of nothing."""
        groups = []
        for notes in found["groups"]:
            known: dict[str, Any] = {k: ExactSum(**v) if isinstance(v, dict) else v for k, v in notes.items()}
            groups.append(GroupNotes(**known))
        moments = Moments.nothing(len(groups), self.intervals.count)
        moments.high.reshape(-1, SUMS)[arrays["seen"]] = arrays["high"]
        moments.low.reshape(-1, SUMS)[arrays["seen"]] = arrays["low"]
        part = replace(self.anew(), tally=Tally.of_dict(found["tally"]), moments=moments, groups=groups)
        part.sample = Sample.of_bytes(self.sample.below, arrays["lots"], arrays["rows"])
        part.copies = CopiedRows.of_arrays(self.copies.below, arrays)
        for name, rows in arrays.items():
            if name.startswith(_WINDOW):
                part.window.parts[name.removeprefix(_WINDOW)] = [rows]
        return part


def _ends(values: Array) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def _last_decimal(known: float, more: Array) -> float:
    """The last decimal that numbers are written with, of which some were seen before."""
    if known <= _FINEST or in_steps(more, known):
        return known
    return min(known, resolution(more))


def _by_series(series: Index, values: Values, count: int) -> Iterator[tuple[int, Values]]:
    """The values of each series that has any."""
    if count == 1:
        if values.at.size:
            yield 0, values
        return
    own = series[values.at].astype(np.uint8)
    order = np.argsort(own, kind="stable")
    ends = np.cumsum(np.bincount(own, minlength=count))
    for number, rows in enumerate(np.split(order, ends[:-1])):
        if rows.size:
            yield number, Values(values.at[rows], values.value[rows], values.sigma[rows])


def source_of(of: Accumulated) -> Source:
    """Where the impacts come from, with how many were left out and why."""
    stream = of.stream
    used = round(float(of.sums[:, :, N].sum()))
    skipped = {reason: count for reason, count in of.tally.skipped.items() if count}
    ranges = list(stream.selection.ranges)
    return Source(
        name=stream.path.name or str(stream.path),
        sha256="",
        rows=used + sum(skipped.values()),
        rows_used=used,
        rows_skipped=skipped,
        provenance=", ".join(name for name in of.tally.provenances if name),
        selection=f"{joined(ranges)} range" if ranges else "",
    )
