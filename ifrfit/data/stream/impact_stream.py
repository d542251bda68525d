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
from ifrfit.data.double_counting import measurements_of
from ifrfit.data.readings_below_zero import has_sign
from ifrfit.data.schema import BY_NOISE, SIGMA_RANGE, SPEED_RANGE, TINY, provenance_name
from ifrfit.data.selection import Selection, check_ranges
from ifrfit.data.stream.files import NotStreamableError, is_text, refuse_copies, stream_files, unreadable
from ifrfit.data.stream.plain_rows import PlainRows, all_rows, same_in_all
from ifrfit.data.stream.portions import Piece, Portion, portions_of
from ifrfit.data.stream.read_ahead import read_ahead
from ifrfit.data.stream.refusals import (
    refuse_other_columns,
    refuse_same_rows,
    refuse_summaries,
    refuse_tables_in_memory,
)
from ifrfit.data.stream.row_places import excluded_rows, name_of, place_of
from ifrfit.data.stream.sample import Sample
from ifrfit.data.stream.table_batches import cells_of, labels_of, table_batches
from ifrfit.data.stream.tally import Tally
from ifrfit.data.table_folders import possible_duplicates
from ifrfit.data.table_forms import check_uncertainties
from ifrfit.data.validate import impossible, undefined_at
from ifrfit.errors import DataError, UsageError
from ifrfit.physics.angles import Incidence
from ifrfit.physics.compiled_incidence import incidence_of
from ifrfit.physics.observables import FREE, OBSERVABLES
from ifrfit.text import joined

if TYPE_CHECKING:
    import pyarrow as pa

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_NO_ROWS = np.empty(0, dtype=np.intp)
_KEPT = 1 << 20  # numbers: some columns of a batch
_IN_NUMPY = partial(Incidence.of, degrees=True)
STREAMED = ("v_x", "v_n", "spin_y_after", "beta_cm", "e_n", "beta", "mu")  # linear, along the incoming path


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
    observables : tuple of str
        Those that are used.
    has_sigma : bool
        Whether every observable that is used has a column of uncertainties.
    has_spin : bool
        Whether there is a column of spins before impact.
    notes : tuple of str
    columns : frozenset of str
        What counts of the columns of the first file, by the names of the schema: every file has the same.
    empty_spins : frozenset of str
        Columns of spins in which nothing stands: no spin, as if there were no column.
    beside : frozenset of str
        Observables that are used where those before them, of the same impacts, are not measured.
    excluded : tuple of (int, int)
        Rows that are left out: file, and row in it from 0 on.
    """

    path: Path
    portions: tuple[Portion, ...]
    conventions: Conventions
    selection: Selection
    inertia_factor: float
    observables: tuple[str, ...] = ()
    has_sigma: bool = False
    has_spin: bool = False
    notes: tuple[str, ...] = ()
    columns: frozenset[str] = frozenset()
    empty_spins: frozenset[str] = frozenset()
    beside: frozenset[str] = frozenset()
    excluded: tuple[tuple[int, int], ...] = ()

    @classmethod
    def of(
        cls, path: Path, conventions: Conventions, selection: Selection, inertia_factor: float
    ) -> ImpactStream:
        """Look at the files, and choose the observables by the first one that has rows.

        Raises
        ------
        NotStreamableError
            For a long table, raw velocities, or observables that are not among `STREAMED`.
        DataError
            A file cannot be read or stands there twice, or there is none, or no row in any.
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
                    return stream.choosing_by(layout)._with_empty_spins(layout, piece.path)
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

    def _with_empty_spins(self, layout: Layout, path: Path) -> ImpactStream:
        """Knowing the columns of spins that hold no value in the first file: no spin, as if not there."""
        places = {key: layout.columns[key].index for key in ("spin_x", "spin_y") if layout.has(key)}
        empty = dict(places)
        for piece in (piece for piece in self._pieces() if piece.path == path):
            for batch in _reading(piece) if empty else ():
                cells = cells_of(batch, path, 0)
                empty = {key: at for key, at in empty.items() if np.isnan(cells.numbers(at)).all()}
                if not empty:
                    return self
        return replace(self, empty_spins=frozenset(empty), has_spin=len(empty) < len(places))

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
                            layout, self.columns, self._columns_that_count(layout, self.observables)
                        )
                        if not self.empty_spins:  # which have to stay empty
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
        spins = [columns[name].values if name in columns else None for name in ("spin_x", "spin_y")]
        if any(spin is not None for spin in spins):
            spins = [same_in_all(0.0, n) if spin is None else spin for spin in spins]
        incidence = incidence_of(gamma, *spins)
        if not plain.moves(incidence):
            return None
        values = {}
        ends = {"gamma": columns["gamma"].ends}
        taken: dict[str, Mask] = {}
        for name, key in plain.observables:
            column, at = columns[name], all_rows(n)
            value = column.values
            sigma = same_in_all(math.nan, n) if key is None else columns[key].values
            if column.has_gaps:
                at = np.flatnonzero(~np.isnan(value))
            tally.skipped["not measured"] += n - at.size
            if self.beside:
                at = np.flatnonzero(self._not_taken(name, ~np.isnan(value), taken, tally))
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
        taken: dict[str, Mask] = {}
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
            if self.beside:
                measured = self._not_taken(name, measured, taken, tally)
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

    def _not_taken(self, name: str, measured: Mask, taken: dict[str, Mask], tally: Tally) -> Mask:
        """Values of an observable in impacts of which no observable before it has taken the same measurement.

        `taken` are the impacts by measurement, to which these are added.
        """
        free = measured
        for slot in measurements_of(name):
            free = free & ~taken.get(slot, np.zeros(measured.size, dtype=bool))
        for slot in measurements_of(name):
            taken[slot] = taken.get(slot, np.zeros(measured.size, dtype=bool)) | free
        tally.skipped["same impacts counted already"] += int(np.count_nonzero(measured & ~free))
        return free

    def _spins_of(self, layout: Layout) -> tuple[list[Array], Mask]:
        """Spins before impact, and where they are known: nothing in a column of spins is no zero."""
        found = []
        known = np.ones(len(layout.cells), dtype=bool)
        for name in ("spin_x", "spin_y"):
            spin = layout.numbers(name)
            if name in self.empty_spins:
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

    def choosing_by(self, layout: Layout) -> ImpactStream:
        """With the observables that a table has, as far as none of them counts an impact twice.

        Raises
        ------
        NotStreamableError, DataError, UsageError
            As `of`.
        """
        path = layout.cells.file
        refuse_tables_in_memory(layout, STREAMED)
        there = [name for name in OBSERVABLES if layout.has(name)]
        if there:
            check_uncertainties(layout, there, there)
        wanted = self.selection.observable or tuple(there)
        missing = [name for name in wanted if name not in there]
        if missing or not wanted:
            raise UsageError(
                f"{path}: there is no column of {missing[0] if missing else 'an observable'}. "
                f"There is {joined(there) or 'none'}."
            )
        used, dropped = _of_different_impacts(wanted, independent=self.selection.independent)
        odd = [name for name in used if name not in STREAMED]
        if odd:
            raise NotStreamableError(
                f"{path}: {odd[0]} is read into memory; what is streamed is {', '.join(STREAMED)}. Choose "
                "one by --observable."
            )
        if any(OBSERVABLES[n].has_angle for n in used) and not (
            layout.has("gamma") or layout.has("tan_gamma")
        ):
            raise DataError(f"{path}: there is no incidence angle. Add a column gamma_deg (from the normal).")
        sigmas = [name for name in used if layout.has(f"sigma:{name}")]
        has_sigma = len(sigmas) == len(used) or (layout.has("sigma") and len(used) == 1)
        # as in memory, unless one that was asked for by name
        beside = [] if self.selection.observable else [name for name in dropped if name in STREAMED]
        if has_sigma:
            beside = [name for name in beside if layout.has(f"sigma:{name}")]
        rest = [name for name in dropped if name not in beside]
        words = [f"{joined(beside)} only where these are not measured"] if beside else []
        words += [f"{joined(rest)} left out"] if rest else []
        note = (
            f"{Path(path).name}: {joined(used)} used, {joined(words)}: they are of the same impacts and "
            "would count them twice"
        )
        first = layout.header(f"sigma:{sigmas[0]}") if sigmas else ""
        alone = (
            f"{Path(path).name}: {first} is not used, because "
            "not every observable has a column of uncertainties: errors are taken from the scatter"
        )
        return replace(
            self,
            observables=tuple(name for name in OBSERVABLES if name in used or name in beside),
            beside=frozenset(beside),
            has_sigma=has_sigma,
            has_spin=layout.has("spin_x") or layout.has("spin_y"),
            notes=((note,) if dropped else ()) + ((alone,) if sigmas and not has_sigma else ()),
            columns=self._columns_that_count(layout, [*used, *beside]),
        )

    def _columns_that_count(self, layout: Layout, used: Sequence[str]) -> frozenset[str]:
        """Observables, or those that were asked for; their uncertainties; the spins before impact."""
        seen = used if self.selection.observable else [name for name in OBSERVABLES if layout.has(name)]
        sigmas = [f"sigma:{name}" for name in used] + (["sigma"] if len(used) == 1 else [])
        return frozenset(key for key in (*seen, *sigmas, "spin_x", "spin_y") if layout.has(key))

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


def _of_different_impacts(names: Sequence[str], *, independent: bool) -> tuple[list[str], list[str]]:
    """Observables that count no impact twice, in the order of the registry, and the others."""
    taken: set[str] = set()
    used, dropped = [], []
    for name in (each for each in OBSERVABLES if each in names):
        own = measurements_of(name)
        if own & taken and not independent:
            dropped.append(name)
        else:
            taken |= own
            used.append(name)
    return used, dropped


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
