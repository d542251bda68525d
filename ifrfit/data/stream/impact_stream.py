"""Tables of impacts that need not fit in memory: columns of files, some rows at a time.

Wide tables of numbers, as Parquet or CSV (also .gz and .zst), a file or a folder of them. What a column means
is decided where every reader decides it, by `identify` and `Layout`; rows that cannot be are counted by
reason and left out, because one cell in a thousand million must not refuse the rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.column_layout import Layout
from ifrfit.data.column_roles import identify
from ifrfit.data.conventions import Conventions
from ifrfit.data.double_counting import COUNTED_ALREADY, TakenMeasurements
from ifrfit.data.readings_below_zero import has_sign
from ifrfit.data.schema import BY_NOISE, SIGMA_RANGE, SPEED_RANGE, TINY, provenance_name
from ifrfit.data.selection import Selection, check_ranges
from ifrfit.data.stream.files import NotStreamableError, is_text, refuse_copies, stream_files, unreadable
from ifrfit.data.stream.plain_rows import PlainRows, all_rows, same_in_all
from ifrfit.data.stream.portions import Piece, Portion, portions_of
from ifrfit.data.stream.read_ahead import read_ahead
from ifrfit.data.stream.refusals import refuse_other_columns, refuse_same_rows, refuse_summaries
from ifrfit.data.stream.row_places import excluded_rows, name_of, place_of
from ifrfit.data.stream.sample import Sample
from ifrfit.data.stream.table_batches import cells_of, labels_of, table_batches
from ifrfit.data.stream.tally import Tally
from ifrfit.data.stream.used_columns import SPINS, UsedColumns, keys_that_count
from ifrfit.data.table_folders import possible_duplicates
from ifrfit.data.validate import impossible, undefined_at
from ifrfit.errors import DataError, UsageError
from ifrfit.physics.angles import Incidence
from ifrfit.physics.compiled_incidence import incidence_of
from ifrfit.physics.observables import FREE, OBSERVABLES

if TYPE_CHECKING:
    import pyarrow as pa

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_NO_ROWS = np.empty(0, dtype=np.intp)
_KEPT = 1 << 20  # numbers: some columns of a batch
_IN_NUMPY = partial(Incidence.of, degrees=True)
_NO_COLUMNS = UsedColumns()


class Values(NamedTuple):
    """Measured values of one observable.

    Attributes
    ----------
    at : ndarray of int, (n,)
        Impacts of the batch.
    value, sigma : ndarray, (n,)
        Sigma is nan without one.
    """

    at: NDArray[np.intp]
    value: Array
    sigma: Array

    def of_all(self, n: int) -> Array:
        """The values of all impacts of a batch, (n,); nan where there is none."""
        if self.at.size == n:
            return self.value
        found = np.full(n, np.nan)
        found[self.at] = self.value
        return found


@dataclass(frozen=True)
class Batch:
    """Some impacts.

    Attributes
    ----------
    incidence : Incidence
    gamma_deg : ndarray, (n,)
    series : ndarray of int, (n,)
        Index into `Tally.series`.
    values : mapping of str to Values
        By observable.
    number, first : int
        Of the file, and of the row in it that is the first here.
    ends : mapping of str to (float, float)
        Least and largest number of columns without gaps, by key, as far as they are known.
    """

    incidence: Incidence
    gamma_deg: Array
    series: NDArray[np.intp]
    values: Mapping[str, Values]
    number: int = 0
    first: int = 0
    ends: Mapping[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class ImpactStream:
    """How the impacts of some files are read: a value, which other processes may be given.

    Attributes
    ----------
    path : Path
        A file, or a folder.
    portions : tuple of Portion
        All rows.
    conventions : Conventions
    selection : Selection
    inertia_factor : float
    used : UsedColumns
        Of the first file that has rows.
    excluded : tuple of (int, int)
        Rows that are left out: file, and row in it from 0 on.
    """

    path: Path
    portions: tuple[Portion, ...]
    conventions: Conventions
    selection: Selection
    inertia_factor: float
    used: UsedColumns = _NO_COLUMNS
    excluded: tuple[tuple[int, int], ...] = ()

    @classmethod
    def of(
        cls, path: Path, conventions: Conventions, selection: Selection, inertia_factor: float
    ) -> ImpactStream:
        """Look at the files, and choose the observables by the first one that has rows.

        Raises
        ------
        NotStreamableError, UsageError, DataError
            As `UsedColumns.of`; or a file cannot be read or stands there twice, or there is none, or no row.
        """
        check_ranges(selection)
        files = stream_files(path)
        excluded = excluded_rows([str(entry).strip() for entry in selection.exclude], files, path)
        portions = tuple(portions_of(files))
        stream = cls(path, portions, conventions, selection, inertia_factor, excluded=excluded)
        some = (piece.path for piece in stream._pieces() if piece.rows or is_text(piece.path))
        refuse_copies(list(dict.fromkeys(some)))
        stream._refuse_duplicates(files)
        for piece in stream._pieces():
            for batch in _reading(piece, few=True):
                if batch.num_rows:
                    cells = cells_of(batch, piece.path, 0)
                    layout = identify(cells, conventions, note_open=_left_open)
                    _refuse_unclear(selection, layout, name_of(piece.path, path))
                    return stream.choosing_by(layout)._with_spins_met(layout, piece.path)
        raise DataError(f"{path}: there is no row in these files.")

    def _refuse_duplicates(self, files: Sequence[Path]) -> None:
        """Refuse the same rows in files of two kinds, as far as their first rows tell."""
        firsts = {}
        for pair in possible_duplicates(files):
            for path in pair:
                if path not in firsts:
                    pieces = (piece for piece in self._pieces() if piece.path == path)
                    batches = (batch for piece in pieces for batch in _reading(piece) if batch.num_rows)
                    batch = next(batches, None)
                    firsts[path] = None if batch is None else cells_of(batch, path, 0)
            one, other = (firsts[path] for path in pair)
            if one is not None and other is not None:
                refuse_same_rows(one, other)

    def choosing_by(self, layout: Layout) -> ImpactStream:
        """With what is used of the columns of a table.

        Raises
        ------
        NotStreamableError, DataError, UsageError
            As `UsedColumns.of`.
        """
        return replace(self, used=UsedColumns.of(layout, self.selection))

    def _with_spins_met(self, layout: Layout, path: Path) -> ImpactStream:
        """Knowing which columns of spins hold a value in the first file; read until each of them does."""
        counts = dict.fromkeys(self.used.spins, 0)
        for piece in (piece for piece in self._pieces() if piece.path == path):
            for batch in _reading(piece) if not all(counts.values()) else ():
                cells = cells_of(batch, path, 0)
                for key in [key for key, count in counts.items() if not count]:
                    values = cells.numbers(layout.columns[key].index)
                    counts[key] = int(np.count_nonzero(~np.isnan(values)))
                if all(counts.values()):
                    break
        return replace(self, used=self.used.with_spins_met(counts))

    def without_sigma(self) -> ImpactStream:
        """Whose uncertainties are not used."""
        return replace(self, used=replace(self.used, has_sigma=False))

    @property
    def observables(self) -> tuple[str, ...]:
        """Those that are used."""
        return self.used.observables

    @property
    def has_sigma(self) -> bool:
        """Whether every observable that is used has an uncertainty, which is used."""
        return self.used.has_sigma

    @property
    def has_spin(self) -> bool:
        """Whether there is a spin before impact."""
        return self.used.has_spin

    @property
    def notes(self) -> tuple[str, ...]:
        """What the user should hear about the choice."""
        return self.used.notes

    @property
    def rows(self) -> int:
        """How many rows the files have, from what they say of themselves or their size."""
        return sum(piece.rows for piece in self._pieces())

    @property
    def is_counted(self) -> bool:
        """Whether all files say how many rows they have."""
        return not any(is_text(piece.path) for piece in self._pieces())

    def _pieces(self) -> Iterator[Piece]:
        return (piece for portion in self.portions for piece in portion)

    def batches(self, portion: Portion, tally: Tally, sample: Sample | None = None) -> Iterator[Batch]:
        """The impacts of a portion, which are counted, and drawn from where there is a sample.

        Raises
        ------
        DataError
            A file cannot be read, or changed since it was parted, or a column is not a column of numbers.
        """
        # glibc's malloc keeps what arrays leave that are no larger than one it has had back: else the pages
        # of each batch are made anew
        np.empty(_KEPT)
        for piece in portion:
            seen_rows = 0
            piece.check_unchanged()
            layout: Layout | None = None
            plain: PlainRows | None = None
            excluded = self._excluded_in(piece)
            for batch in read_ahead(_reading(piece)):
                if batch.num_rows:
                    if layout is None:
                        cells = cells_of(batch, piece.path, 0)
                        layout = identify(cells, self.conventions, note_open=_left_open)
                        refuse_other_columns(
                            layout,
                            self.used.keys,
                            keys_that_count(layout, self.observables, self.selection),
                        )
                        if not self.used.empty_spins:  # which have to stay empty
                            ranges = self.selection.ranges
                            plain = PlainRows.of(layout, self.observables, self.has_sigma, ranges)
                    first = piece.first + seen_rows
                    own = excluded[(excluded >= seen_rows) & (excluded < seen_rows + batch.num_rows)]
                    before = piece.rows_before() if own.size else 0
                    tally.excluded.update(((piece.number, before + row), None) for row in own.tolist())
                    seen = None if own.size else self._plain_batch(batch, layout, plain, tally)
                    out = own - seen_rows
                    found, usable = seen or self._batch(batch, piece, seen_rows, tally, layout, out)
                    if self.has_sigma:
                        for name, values in found.values.items():
                            known = found.ends.get(f"sigma:{name}")
                            least = values.sigma if known is None else np.array(known[:1])
                            tally.note_sigma(name, least, piece.path)
                    if sample is not None:
                        sample.draw(batch, layout, piece.number, first, usable)
                    yield replace(found, number=piece.number, first=first)
                seen_rows += batch.num_rows
                tally.rows += batch.num_rows
            tally.read[place_of(piece.number, piece.first)] = seen_rows
            piece.check_unchanged()

    def _plain_batch(
        self, batch: pa.RecordBatch, layout: Layout, plain: PlainRows | None, tally: Tally
    ) -> tuple[Batch, Mask] | None:
        """As `_batch`, where every row is good and every series is wanted; else None, and nothing counted."""
        columns = None if plain is None or self.selection.series else plain.read(batch)
        if plain is None or columns is None:
            return None
        gamma, n = columns["gamma"].values, batch.num_rows
        spins = [columns[name].values if name in columns else None for name in SPINS]
        if any(spin is not None for spin in spins):
            spins = [same_in_all(0.0, n) if spin is None else spin for spin in spins]
        incidence = incidence_of(gamma, *spins)
        if not plain.moves(incidence):
            return None
        values = {}
        ends = {"gamma": columns["gamma"].ends}
        taken = TakenMeasurements(n)
        for name, key in plain.observables:
            column, at = columns[name], all_rows(n)
            value = column.values
            sigma = same_in_all(math.nan, n) if key is None else columns[key].values
            if column.has_gaps:
                at = np.flatnonzero(~np.isnan(value))
            tally.skipped["not measured"] += n - at.size
            if self.used.beside:
                at = self._not_taken(name, at, taken, tally)
            if at.size < n:
                value, sigma = value[at], sigma[at]
            else:
                ends[name] = column.ends
                if key is not None:
                    ends[f"sigma:{name}"] = columns[key].ends
            values[name] = Values(at, value, sigma)
        for key, column in columns.items():
            tally.note_largest(layout.header(key), column.size)
        made = Batch(incidence, gamma, self._series_of(batch, layout, tally), values, ends=ends)
        return made, _all_usable(n)

    def _batch(
        self,
        batch: pa.RecordBatch,
        piece: Piece,
        seen_rows: int,
        tally: Tally,
        layout: Layout,
        excluded: NDArray[np.intp],
    ) -> tuple[Batch, Mask]:
        """The impacts of a batch, and which of its rows have nothing that was left out."""
        cells = cells_of(batch, piece.path, piece.rows_before() + seen_rows)
        known = replace(layout, cells=cells, note_sizes=tally.note_sizes, note_open=tally.note_open)
        series = self._series_of(batch, known, tally)
        return self.impacts_of(known, series, tally, incidence_of, excluded)

    def _excluded_in(self, piece: Piece) -> NDArray[np.intp]:
        """Rows of a piece that are left out, from its first on."""
        own = [row for number, row in self.excluded if number == piece.number]
        if not own:  # lines before a piece of text are counted where somebody asks
            return np.empty(0, dtype=np.intp)
        return np.unique(np.array(own, dtype=np.intp)) - piece.rows_before()

    def refuse_unmet(self, tally: Tally) -> None:
        """Refuse rows that were to be left out and are not there.

        Raises
        ------
        UsageError
            With the entry.
        """
        for entry, place in zip(self.selection.exclude, self.excluded, strict=True):
            if place not in tally.excluded:
                raise UsageError(f"--exclude {entry}: there is no such row. Give file and row, FILE:ROW.")

    def impacts_of(
        self,
        layout: Layout,
        series: NDArray[np.intp],
        tally: Tally,
        state_of: Callable[[Array, Array, Array], Incidence] = _IN_NUMPY,
        excluded: NDArray[np.intp] = _NO_ROWS,
    ) -> tuple[Batch, Mask]:
        """The impacts of a table, and which of its rows have nothing that was left out; some are excluded."""
        cells = layout.cells
        spins, spin_known = self._spins_of(layout)
        gamma = layout.gamma()
        settings = self._settings(layout, gamma, spins)
        if excluded.size:
            settings["excluded"] = np.isin(np.arange(gamma.size), excluded)
        if self.selection.series:
            wanted = np.array([name in self.selection.series for name in tally.series])
            settings["outside the series"] = ~wanted[series]
        # impossible ones are left out below; what is computed of them only has to be a number
        spins = [np.clip(spin, -2.0 * FREE, 2.0 * FREE) for spin in spins]
        incidence = state_of(np.clip(np.nan_to_num(gamma), 0.0, 90.0), *spins)
        undefined = undefined_at(incidence.sine, incidence.cosine, *spins)
        values = {}
        taken = TakenMeasurements(gamma.size)
        usable = np.ones(gamma.size, dtype=bool)
        for name in self.observables:
            if not layout.has(name):
                raise DataError(f"{cells.file}: there is no column {name}, which other files have.")
            value, sigma = layout.numbers(name), layout.sigmas(name)
            of = OBSERVABLES[name]
            measured = np.isfinite(value) & (np.isfinite(gamma) if of.has_angle else True)
            tally.skipped["not measured"] += int(value.size - np.count_nonzero(measured))
            if of.has_angle and not spin_known.all():
                tally.skipped["spin not measured"] += int(np.count_nonzero(measured & ~spin_known))
                measured &= spin_known
            if self.used.beside:
                measured = _at(self._not_taken(name, np.flatnonzero(measured), taken, tally), gamma.size)
            good = measured
            refused = dict(settings)
            bad = impossible(of, value, sigma if self.has_sigma else None)
            refused[f"{name} impossible"] = bad
            for kind in of.undefined:
                refused[f"{name} has no value there"] = undefined[kind]
            if self.has_sigma:
                low, high = SIGMA_RANGE
                refused[f"sigma of {name}"] = ~((sigma >= low) & (sigma <= high))
            unused = bad & measured & ~np.any([*settings.values()], axis=0)
            self._note_cut(tally, name, unused, layout, incidence, series)
            for reason, bad in refused.items():
                tally.leave_out(good & bad, reason, cells)
                good = good & ~bad
            usable &= good | ~measured
            at = np.flatnonzero(good)
            values[name] = Values(at, value[at], sigma[at])
        return Batch(incidence, np.nan_to_num(gamma), series, values), usable

    def _note_cut(
        self,
        tally: Tally,
        name: str,
        unused: Mask,
        layout: Layout,
        incidence: Incidence,
        series: NDArray[np.intp],
    ) -> None:
        """Count values just below the least one among those that are left out."""
        of, value = OBSERVABLES[name], layout.numbers(name)
        at = np.flatnonzero(unused & (value < of.low) & (value > of.low - BY_NOISE))
        if at.size:
            slope = np.ones(value.size) if of.by_e_n is None else of.by_e_n(incidence)
            sigma = layout.sigmas(name) if self.has_sigma else np.ones(value.size)
            known = at[sigma[at] > 0.0]
            pull = float((slope[known] / sigma[known]).sum())
            gamma = np.nan_to_num(layout.gamma()[at], nan=math.inf)  # readings of e_n need no angle
            tally.note_cut(name, at.size, float(value[at].min()), float(gamma.min()), pull)
            z, s = value[known] / sigma[known], slope[known] / sigma[known]
            for number in np.unique(series[known]) if has_sign(of) else ():
                z_own, s_own = (each[series[known] == number] for each in (z, s))
                sums = float(s_own @ z_own), float(s_own @ s_own), float(z_own @ z_own)
                tally.note_below(name, tally.series[number], z_own.size, sums)

    def _not_taken(
        self, name: str, at: NDArray[np.intp], taken: TakenMeasurements, tally: Tally
    ) -> NDArray[np.intp]:
        """Those of some impacts of which no observable before this one has taken the same measurement."""
        free = taken.take(name, at)
        tally.skipped[COUNTED_ALREADY] += free.size - int(np.count_nonzero(free))
        return at[free]

    def _spins_of(self, layout: Layout) -> tuple[list[Array], Mask]:
        """Spins before impact, and where they are known: nothing in a column of spins is no zero."""
        found = []
        known = np.ones(len(layout.cells), dtype=bool)
        for name in SPINS:
            spin = layout.numbers(name)
            if name in self.used.empty_spins:
                layout.cells.refuse_first(
                    ~np.isnan(spin),
                    layout.header(name),
                    lambda row: (
                        "a spin, where the first file with rows has none in this column. Fill it in there: 0 "
                        "if there was none."
                    ),
                )
            elif layout.has(name):
                known &= ~np.isnan(spin)
            found.append(np.nan_to_num(spin))
        return found, known

    def _settings(self, layout: Layout, gamma: Array, spins: Sequence[Array]) -> dict[str, Mask]:
        """Impacts whose setting is impossible, or not among those that were asked for, by reason."""
        speed = layout.numbers("speed")
        low, high = SPEED_RANGE
        size = [np.abs(spin) for spin in spins]
        found = {
            "angle outside 0 to 90 degrees": (gamma < 0.0) | (gamma > 90.0),
            "spin impossible": np.any([(x > FREE) | ((x < TINY) & (x > 0.0)) for x in size], axis=0),
            "speed impossible": (speed < low) | (speed > high),
        }
        for name, (least, most) in self.selection.ranges.items():
            values = gamma if name == "gamma" else speed
            inside = (values >= (-math.inf if least is None else least)) & (
                values <= (math.inf if most is None else most)
            )
            if name == "gamma":
                inside |= np.isnan(gamma)
            found[f"outside {name} range"] = ~inside
        return {reason: bad for reason, bad in found.items() if bad.any()}

    def _series_of(self, batch: pa.RecordBatch, layout: Layout, tally: Tally) -> NDArray[np.intp]:
        self._note_provenance(batch, layout, tally)
        refuse_summaries(batch, layout)
        if not layout.has("series"):
            return same_in_all(tally.numbers_of([self.path.stem])[0].item(), batch.num_rows, whole=True)
        encoded = labels_of(batch, layout, "series").dictionary_encode()
        names = [text.strip() for text in encoded.dictionary.to_pylist()]
        numbers = tally.numbers_of([name or self.path.stem for name in names])
        return np.asarray(numbers[encoded.indices.to_numpy()], dtype=np.intp)

    def _note_provenance(self, batch: pa.RecordBatch, layout: Layout, tally: Tally) -> None:
        said = self.conventions.provenance
        if not layout.has("provenance"):
            tally.provenances[said] = None
            return
        for text in labels_of(batch, layout, "provenance").unique().to_pylist():
            name = provenance_name(text)
            if name is None:
                raise DataError(f"{layout.cells.file}: '{text:.40}' is no provenance.")
            tally.provenances[name or said] = None


@lru_cache(maxsize=4)
def _all_usable(n: int) -> Mask:
    found = np.ones(n, dtype=bool)
    found.flags.writeable = False
    return found


def _at(places: NDArray[np.intp], n: int) -> Mask:
    """Some of n rows, by their places."""
    found = np.zeros(n, dtype=bool)
    found[places] = True
    return found


def _refuse_unclear(selection: Selection, layout: Layout, file: str) -> None:
    """Refuse a number to be left out that may be that of a row or of an impact."""
    for entry in map(str, selection.exclude) if layout.has("impact_id") else ():
        if ":" not in entry:
            raise NotStreamableError(
                f"--exclude {entry}: could be a row or the impact called {entry}. Write {file}:{entry} for "
                "the row; impacts are left out of data that are held in memory."
            )


def _left_open(header: str, said: str, answered: bool) -> None:
    """What headers leave open is judged by all rows, not by the first."""


def _reading(piece: Piece, *, few: bool = False) -> Iterator[pa.RecordBatch]:
    """As `table_batches`; whatever is wrong with the file is said with its name."""
    import pyarrow as pa

    try:
        yield from table_batches(piece, few=few)
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        raise unreadable(piece.path, error) from None
