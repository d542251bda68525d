"""Impacts of the intervals of tau that a transition may lie in, kept one by one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.stream.impact_stream import Batch, Values
from ifrfit.physics.compiled_incidence import incidence_of, read_only
from ifrfit.physics.compiling import compiled

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]
Part = Sequence[NDArray[Any]] | Array

_SERIES, _PLACE, _GAMMA, _SPIN_X, _SPIN_Y, _VALUE, _SIGMA = range(7)


@dataclass
class WindowRows:
    """Rows of some intervals.

    Attributes
    ----------
    inside : ndarray of bool, (bins,)
        The intervals.
    parts : dict of str to list of seven ndarray, (k,) each, or of ndarray, (7, k)
        By observable, in the order of the rows: series, interval, angle in degrees, spins, value, sigma.
    """

    inside: Mask
    parts: dict[str, list[Part]] = field(default_factory=dict)

    def add(self, name: str, batch: Batch, values: Values, place: NDArray[np.int32]) -> None:
        """Keep those values of an observable that lie inside; `place` is of all impacts of the batch."""
        if not self.inside.any():
            return
        if values.at.size < place.size:
            place = place[values.at]
        i = batch.incidence
        of_impacts: tuple[NDArray[Any], ...] = (batch.series, batch.gamma_deg, i.spin_x, i.spin_y)
        if values.at.size < batch.gamma_deg.size:
            of_impacts = tuple(each[values.at] for each in of_impacts)
        series, *setting = of_impacts
        part: Part = (series, place, *setting, values.value, values.sigma)
        if not self.inside.all():  # of the first rows all are kept, as they are
            here = _inside_of(place, self.inside)
            part = _chosen(part, here)
        if len(part[_PLACE]):
            self.parts.setdefault(name, []).append(part)

    def merge(self, following: WindowRows, series: Index) -> None:
        """Add those of later rows; `series` are the places here of their series."""
        same = np.array_equal(series, np.arange(series.size))
        for name, parts in following.parts.items():
            numbered = parts
            if not same:
                numbered = [np.stack([series[part[_SERIES].astype(np.intp)], *part[1:]]) for part in parts]
            self.parts.setdefault(name, []).extend(numbered)

    def narrow(self, inside: Mask) -> None:
        """Let go of what lies in other intervals than these."""
        self.inside = self.inside & inside
        if not self.inside.any():
            self.parts = {name: [np.empty((7, 0))] for name in self.parts}
            return
        for name, parts in self.parts.items():
            kept = (_chosen(part, np.flatnonzero(self.inside[_whole(part[_PLACE])])) for part in parts)
            self.parts[name] = [part for part in kept if part.size] or [np.empty((7, 0))]

    def batches(self, name: str) -> Iterator[Batch]:
        """The rows of an observable as impacts of their own."""
        for part in self.parts.get(name, []):
            values = Values(np.arange(len(part[_VALUE])), part[_VALUE], part[_SIGMA])
            incidence = incidence_of(*(part[each].copy() for each in (_GAMMA, _SPIN_X, _SPIN_Y)))
            yield Batch(incidence, part[_GAMMA], _whole(part[_SERIES]), {name: values})

    def arrays(self) -> dict[str, Array]:
        """By observable, (7, n)."""
        return {
            name: np.concatenate([np.stack(list(part)) for part in parts], axis=1)
            for name, parts in self.parts.items()
        }

    def rows(self, intervals: Mask) -> dict[str, Array]:
        """The rows of some intervals of each series, (series, bins), by observable.

        Returns
        -------
        dict of str to ndarray, (6, n)
            Series, angle in degrees, spins, value, sigma.
        """
        found = {}
        for name, parts in sorted(self.parts.items()):
            # few of many: chosen before they are joined
            rows = np.concatenate([_chosen(part, _in_intervals(part, intervals)) for part in parts], axis=1)
            if rows.shape[1]:
                found[name] = np.delete(rows, _PLACE, axis=0)
        return found


def _whole(column: NDArray[Any]) -> NDArray[Any]:
    """A column of whole numbers as such."""
    return column if column.dtype.kind == "i" else column.astype(np.intp)


def _in_intervals(part: Part, intervals: Mask) -> Index:
    """Rows that lie in some intervals of their series, (series, bins)."""
    place = _whole(part[_PLACE])
    if len(intervals) == 1:
        return _inside_of(place.astype(np.int32, copy=False), intervals[0])
    return np.flatnonzero(intervals[_whole(part[_SERIES]), place])


def _chosen(part: Part, rows: Index) -> Array:
    """Some rows of a part, (7, k)."""
    return np.stack([column[rows].astype(np.float64, copy=False) for column in part])


def _inside_of(place: NDArray[np.int32], inside: Mask) -> Index:
    """Rows whose interval is among some, (bins,)."""
    found: Index = compiled(_inside)(read_only(place), read_only(inside))
    return found


def _inside(place: NDArray[np.int32], inside: Mask) -> Index:
    rows = np.empty(place.size, dtype=np.intp)
    count = 0
    for i in range(place.size):
        rows[count] = i
        count += inside[place[i]]
    return rows[:count].copy()
