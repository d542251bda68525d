"""A random sample of rows for who must see them one by one, the same however the rows are parted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.cell_table import Cells
from ifrfit.data.column_layout import Layout
from ifrfit.data.stream.portions import Portion
from ifrfit.data.stream.row_places import Place, place_of, places_of
from ifrfit.data.stream.table_batches import cells_of, rows_like_others
from ifrfit.physics.compiled_incidence import read_only
from ifrfit.physics.compiling import compiled

if TYPE_CHECKING:
    import pyarrow as pa

SAMPLE = 20_000  # impacts that are looked at one by one
# odd multipliers of splitmix64 (Steele, Lea & Flood 2014, OOPSLA, 453)
MIX_A, MIX_B, MIX_C = 0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB
_BLOCK = 1024  # lots at once
_SPARE, _SPARE_OF_COUNTED = 4.0, 1.5  # a guess of how many rows there are may be so many times too large


@dataclass
class Sample:
    """The rows with the least lots.

    Attributes
    ----------
    below : int
        Rows with greater lots need not be looked at: there are enough of others.
    drawn : list
        Lots and rows, batch by batch.
    most : int
        Lots from here on are those of none of the sample, as what was drawn shows.
    """

    below: int
    drawn: list[tuple[NDArray[np.uint64], Any]] = field(default_factory=list)
    most: int = 2**64

    @staticmethod
    def below_of(rows: int, *, counted: bool) -> int:
        """See `lot_of_some`."""
        return lot_of_some(SAMPLE, rows, counted=counted)

    def draw(
        self, batch: pa.RecordBatch, layout: Layout, number: int, first: int, usable: NDArray[np.bool_]
    ) -> None:
        """Draw from some rows of file `number`, from `first` on."""
        lots, at = _lots(number, first, usable, min(self.below, self.most) - 1)
        if at.size:
            self.drawn.append((lots.copy(), rows_like_others(batch, layout, at)))
        self._tidy()

    def merge(self, following: Sample) -> None:
        """Add what was drawn elsewhere."""
        self.drawn += following.drawn
        self._tidy()

    def _tidy(self) -> None:
        """Let go of what is beyond the sample, and put many small parts together."""
        if sum(lot.size for lot, _ in self.drawn) <= 2 * SAMPLE and len(self.drawn) <= 50:
            return
        lots, rows = self._joined()
        best = np.sort(np.argpartition(lots, SAMPLE)[:SAMPLE]) if lots.size > SAMPLE else np.arange(lots.size)
        if lots.size > SAMPLE:
            self.most = int(lots[best].max())
        self.drawn = [(lots[best], rows.take(best).combine_chunks().to_batches()[0])]

    def _joined(self) -> tuple[NDArray[np.uint64], pa.Table]:
        import pyarrow as pa

        tables = [pa.Table.from_batches([rows]) for _, rows in self.drawn]
        lots = np.concatenate([lot for lot, _ in self.drawn])
        return lots, pa.concat_tables(tables, promote_options="permissive")

    def cells(self, path: Path, places: Sequence[Place] = ()) -> Cells:
        """The sample as a table, in the order in which its rows stand; `places` are those of its rows."""
        lots, rows = self._joined()
        least = np.argsort(lots, kind="stable")[:SAMPLE]
        order = least[np.argsort(_rows_of_lots(lots[least]), kind="stable")]
        cells = cells_of(rows.take(order).combine_chunks().to_batches()[0], path, 0, texts=True)
        return replace(cells, places=[f"{place.path}, {place.word} {place.row}" for place in places])

    def places(self, portions: Sequence[Portion], path: Path, read: Mapping[int, int]) -> list[Place]:
        """Where the rows of the sample stand, in their order; see `places_of`."""
        lots = np.sort(np.concatenate([lot for lot, _ in self.drawn]))[:SAMPLE]
        return places_of(np.sort(_rows_of_lots(lots)).tolist(), portions, path, read)

    def to_bytes(self) -> tuple[NDArray[np.uint64], NDArray[np.uint8]]:
        """Lots, and the rows as an Arrow file."""
        import pyarrow as pa

        if not self.drawn:
            return np.empty(0, dtype=np.uint64), np.empty(0, dtype=np.uint8)
        lots, rows = self._joined()
        sink = pa.BufferOutputStream()
        with pa.ipc.new_stream(sink, rows.schema) as writer:
            writer.write_table(rows)
        return lots, np.frombuffer(sink.getvalue(), dtype=np.uint8)

    @classmethod
    def of_bytes(cls, below: int, lots: NDArray[np.uint64], rows: NDArray[np.uint8]) -> Sample:
        """What `to_bytes` gave."""
        import pyarrow as pa

        if not lots.size:
            return cls(below)
        table = pa.ipc.open_stream(rows.tobytes()).read_all().combine_chunks()
        return cls(below, [(lots, table.to_batches()[0])])


def lot_of_some(some: int, rows: int, *, counted: bool) -> int:
    """The lot below which those of some rows lie, though rows are left out, or are fewer than was guessed.

    Parameters
    ----------
    some, rows : int
        How many, of how many.
    counted : bool
        Whether that is no guess.
    """
    spare = _SPARE_OF_COUNTED if counted else _SPARE
    return min(2**64 - 1, (2**64 // max(rows, 1)) * round(some * spare))


def lots_of_rows(number: int, first: int, n: int) -> NDArray[np.uint64]:
    """A random number of each row of a file, the same whenever it is asked for, (n,)."""
    return _lots(number, first, np.ones(n, dtype=bool), 2**64 - 1)[0]


def _rows_of_lots(lots: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """The numbers of the rows that have some lots: those of `place_of`, by splitmix64 undone."""
    z = lots
    for shift, factor in ((31, MIX_C), (27, MIX_B)):
        z = (z ^ (z >> np.uint64(shift)) ^ (z >> np.uint64(2 * shift))) * np.uint64(pow(factor, -1, 2**64))
    z = z ^ (z >> np.uint64(30)) ^ (z >> np.uint64(60))
    return np.asarray(z * np.uint64(pow(MIX_A, -1, 2**64)) - np.uint64(1))


def _lots(
    number: int, first: int, is_free: NDArray[np.bool_], most: int
) -> tuple[NDArray[np.uint64], NDArray[np.intp]]:
    """The lots of rows of a file that are free and have such a number at most, and which rows these are."""
    seed = np.uint64(place_of(number, first))
    lots, rows = compiled(_drawn)(seed, is_free.size, np.uint64(most), read_only(is_free))
    return lots, rows


def _drawn(
    seed: np.uint64, n: int, most: int, is_free: NDArray[np.bool_]
) -> tuple[NDArray[np.uint64], NDArray[np.intp]]:
    lots, rows = np.empty(n, dtype=np.uint64), np.empty(n, dtype=np.intp)
    some = np.empty(_BLOCK, dtype=np.uint64)
    count = 0
    for begin in range(0, n, _BLOCK):
        here = min(_BLOCK, n - begin)
        for k in range(here):  # next to one another, so that the processor takes them together
            z = (seed + np.uint64(begin + k) + np.uint64(1)) * np.uint64(MIX_A)
            z = (z ^ (z >> np.uint64(30))) * np.uint64(MIX_B)
            z = (z ^ (z >> np.uint64(27))) * np.uint64(MIX_C)
            some[k] = z ^ (z >> np.uint64(31))
        for k in range(here):
            if some[k] <= most and is_free[begin + k]:
                lots[count], rows[count] = some[k], begin + k
                count += 1
    return lots[:count], rows[:count]
