"""Impacts of the intervals of tau that a transition may lie in, kept one by one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ifrfit.data.observations import make_table
from ifrfit.data.stream.impact_stream import Batch, Values
from ifrfit.physics.compiled_incidence import incidence_of

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

_SERIES, _PLACE, _GAMMA, _SPIN_X, _SPIN_Y, _VALUE, _SIGMA = range(7)


@dataclass
class WindowRows:
    """Rows of some intervals.

    Attributes
    ----------
    inside : ndarray of bool, (bins,)
        The intervals.
    parts : dict of str to list of ndarray, (7, k)
        By observable, in the order of the rows: series, interval, angle in degrees, spins, value, sigma.
    """

    inside: Mask
    parts: dict[str, list[Array]] = field(default_factory=dict)

    def add(self, name: str, batch: Batch, values: Values, place: NDArray[np.int32]) -> None:
        """Keep those values of an observable that lie inside; `place` is of all impacts of the batch."""
        if not self.inside.any():
            return
        if values.at.size < place.size:
            place = place[values.at]
        # of the first rows all are kept, and need not be picked
        everything = slice(None)
        here: slice | Index = everything if self.inside.all() else np.flatnonzero(self.inside[place])
        if not values.at[here].size:
            return
        own: slice | Index = (
            everything if here is everything and place.size == batch.gamma_deg.size else values.at[here]
        )
        i = batch.incidence
        of_impacts = (batch.series[own], place[here], batch.gamma_deg[own], i.spin_x[own], i.spin_y[own])
        columns: tuple[NDArray[Any], ...] = (*of_impacts, values.value[here], values.sigma[here])
        part = np.empty((len(columns), columns[1].size))
        for row, column in zip(part, columns, strict=True):
            row[:] = column
        self.parts.setdefault(name, []).append(part)

    def merge(self, following: WindowRows, series: Index) -> None:
        """Add those of later rows; `series` are the places here of their series."""
        for name, parts in following.parts.items():
            for part in parts:
                part[_SERIES] = series[part[_SERIES].astype(np.intp)]
            self.parts.setdefault(name, []).extend(parts)

    def narrow(self, inside: Mask) -> None:
        """Let go of what lies in other intervals than these."""
        self.inside = self.inside & inside
        for name, parts in self.parts.items():
            kept = (part[:, self.inside[part[_PLACE].astype(np.intp)]] for part in parts)
            self.parts[name] = [part for part in kept if part.size] or [parts[0][:, :0]]

    def batches(self, name: str) -> Iterator[Batch]:
        """The rows of an observable as impacts of their own."""
        for part in self.parts.get(name, []):
            values = Values(np.arange(part.shape[1]), part[_VALUE], part[_SIGMA])
            incidence = incidence_of(*(part[each].copy() for each in (_GAMMA, _SPIN_X, _SPIN_Y)))
            yield Batch(incidence, part[_GAMMA], part[_SERIES].astype(np.intp), {name: values})

    def arrays(self) -> dict[str, Array]:
        """By observable, (7, n)."""
        return {name: np.concatenate(parts, axis=1) for name, parts in self.parts.items()}

    def tables(self, intervals: Mask, series: list[str], *, weighted: bool) -> list[pd.DataFrame]:
        """The rows of some intervals of each series, (series, bins), in the common schema."""
        found = []
        for name, parts in sorted(self.parts.items()):
            chosen = (
                intervals[part[_SERIES].astype(np.intp), part[_PLACE].astype(np.intp)] for part in parts
            )
            # few of many: chosen before they are joined
            rows = np.concatenate([part[:, kept] for part, kept in zip(parts, chosen, strict=True)], axis=1)
            if rows.shape[1]:
                columns = {
                    "series": np.array(series, dtype=object)[rows[_SERIES].astype(np.intp)],
                    "observable": np.full(rows.shape[1], name, dtype=object),
                    "gamma_deg": rows[_GAMMA],
                    "spin_x": rows[_SPIN_X],
                    "spin_y": rows[_SPIN_Y],
                    "value": rows[_VALUE],
                    "sigma": rows[_SIGMA] if weighted else np.full(rows.shape[1], np.nan),
                }
                found.append(make_table(columns))
        return found
