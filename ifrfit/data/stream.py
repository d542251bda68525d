"""Tables of impacts that need not fit in memory: columns of files, some rows at a time.

Wide tables of numbers, as Parquet or CSV (also .gz and .zst), a file or a folder of them. What a column means
is decided where every reader decides it, by `identify` and `Layout`; rows that cannot be are counted by
reason and left out, because one cell in a thousand million must not refuse the rest.
"""

from __future__ import annotations

import contextlib
import csv
import hashlib
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.cell_table import NOT_MEASURED, Cells
from ifrfit.data.column_layout import Layout
from ifrfit.data.column_names import role_of
from ifrfit.data.column_roles import identify
from ifrfit.data.conventions import Conventions
from ifrfit.data.double_counting import measurements_of
from ifrfit.data.schema import SIGMA_RANGE, SPEED_RANGE, TINY, provenance_name
from ifrfit.data.selection import Selection
from ifrfit.data.validate import undefined_at
from ifrfit.errors import DataError, UsageError
from ifrfit.physics.angles import Incidence
from ifrfit.physics.observables import FREE, OBSERVABLES
from ifrfit.text import joined

if TYPE_CHECKING:
    import pyarrow as pa

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

STREAMED = ("v_x", "v_n", "spin_y_after", "beta_cm", "e_n", "beta", "mu")  # linear, along the incoming path
LARGE_ROWS, LARGE_BYTES = 500_000, 50_000_000  # of a file that is streamed unasked
SAMPLE = 20_000  # impacts that are looked at one by one
_SUFFIXES = (".parquet", ".csv", ".csv.gz", ".csv.zst")
_BATCH = 1 << 17
_MOST_SERIES = 200
_BYTES_A_LINE = 50
_FEW_PLACES = 3


class NotStreamableError(UsageError):
    """The table is one for the reader that holds it in memory."""


@dataclass(frozen=True)
class Batch:
    """Some impacts.

    Attributes
    ----------
    incidence : Incidence
    gamma_deg : ndarray, (n,)
    series : ndarray of int, (n,)
        Index into `ImpactStream.series`.
    values : mapping of str to (ndarray of int, ndarray, ndarray)
        By observable the impacts it was measured on, its values, and their sigma (nan without one).
    """

    incidence: Incidence
    gamma_deg: Array
    series: NDArray[np.intp]
    values: Mapping[str, tuple[NDArray[np.intp], Array, Array]]


@dataclass
class ImpactStream:
    """Impacts of files that are read as often as somebody asks for them.

    Attributes
    ----------
    path : Path
        A file, or a folder.
    conventions : Conventions
    selection : Selection
    inertia_factor : float
    observables : list of str
        Those that are used; after the first batch.
    series : list of str
        Those met so far.
    rows : int
        Rows of the files, in the last pass.
    skipped : Counter
        Values left out, by reason, in the last pass.
    places : dict
        First places of each reason.
    provenances : dict
        Those met so far, in order.
    has_sigma : bool
        Whether every observable that is used has a column of uncertainties.
    has_spin : bool
        Whether there is a column of spins before impact.
    notes : list of str
    sample : list
        Rows for who must see them one by one, with their lots.
    """

    path: Path
    conventions: Conventions
    selection: Selection
    inertia_factor: float
    observables: list[str] = field(default_factory=list)
    series: list[str] = field(default_factory=list)
    rows: int = 0
    skipped: Counter[str] = field(default_factory=Counter)
    places: dict[str, list[str]] = field(default_factory=dict)
    provenances: dict[str, None] = field(default_factory=dict)
    has_sigma: bool = False
    has_spin: bool = False
    notes: list[str] = field(default_factory=list)
    sample: list[tuple[NDArray[np.uint64], Any]] = field(default_factory=list)

    @property
    def files(self) -> list[Path]:
        """The file, or all tables of the folder in the order of their names."""
        return stream_files(self.path)

    def expected_rows(self) -> int:
        """How many rows the files have, from what they say of themselves or their size."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        total = 0
        for path in self.files:
            with contextlib.suppress(pa.ArrowException, OSError):  # said when it is read
                size = path.stat().st_size // _BYTES_A_LINE
                total += size if _is_text(path) else int(pq.read_metadata(path).num_rows)
        return total

    def batches(
        self, progress: Callable[[int, int], None] | None = None, *, sampled: bool = False
    ) -> Iterator[Batch]:
        """All impacts, once; with a sample of rows where `sampled`.

        Raises
        ------
        NotStreamableError
            For a long table, raw velocities, or observables that are not among `STREAMED`.
        DataError
            A file cannot be read, or a column is not a column of numbers.
        """
        import pyarrow as pa

        self.rows, self.skipped, self.places = 0, Counter(), {}
        if sampled:
            self.sample = []
            _refuse_copies(self.files)
        files = self.files
        for number, path in enumerate(files):
            try:
                own = 0
                for batch in _csv_batches(path) if _is_text(path) else _parquet_batches(path):
                    if batch.num_rows:
                        found, usable = self._batch(batch, path, own)
                        if sampled:
                            self._draw(batch, number, own, usable)
                        yield found
                    own += batch.num_rows
                    self.rows += batch.num_rows
                    if progress is not None:
                        progress(number + 1, len(files))
            except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
                reason = str(error).splitlines()[0] if str(error) else "damaged"
                raise DataError(f"{path}: cannot be read ({reason:.150}). Write it again.") from None

    def _batch(self, batch: pa.RecordBatch, path: Path, first: int) -> tuple[Batch, Mask]:
        """The impacts of a batch, and which of its rows have nothing that was left out."""
        cells = _cells(batch, path, first)
        layout = identify(cells, self.conventions)
        if not self.observables:
            self._choose(layout)
        spins = [np.nan_to_num(layout.numbers(name)) for name in ("spin_x", "spin_y")]
        gamma = layout.gamma()
        settings = self._settings(layout, gamma, spins)
        incidence = Incidence.of(np.nan_to_num(gamma), *spins, degrees=True)
        undefined = undefined_at(incidence.sine, incidence.cosine, *spins)
        values = {}
        usable = np.ones(gamma.size, dtype=bool)
        for name in self.observables:
            if not layout.has(name):
                raise DataError(f"{path}: there is no column {name}, which other files have.")
            value, sigma = layout.numbers(name), self._sigma(layout, name)
            of = OBSERVABLES[name]
            measured = np.isfinite(value) & (np.isfinite(gamma) if of.has_angle else True)
            self.skipped["not measured"] += int(value.size - np.count_nonzero(measured))
            good = measured
            for reason, bad in settings.items():
                good = self._without(good, bad, reason, cells)
            outside = (value < of.low) | (value > of.high) | ((np.abs(value) < TINY) & (value != 0.0))
            good = self._without(good, outside, f"{name} impossible", cells)
            for kind in of.undefined:
                good = self._without(good, undefined[kind], f"{name} has no value there", cells)
            if self.has_sigma:
                low, high = SIGMA_RANGE
                good = self._without(good, ~((sigma >= low) & (sigma <= high)), f"sigma of {name}", cells)
            usable &= good | ~measured
            at = np.flatnonzero(good)
            values[name] = (at, value[at], sigma[at])
        return Batch(incidence, np.nan_to_num(gamma), self._series_of(batch, layout), values), usable

    def _choose(self, layout: Layout) -> None:
        """Decide on the observables, as far as none of them counts an impact twice."""
        path = layout.cells.file
        if layout.has("observable") or layout.has("value"):
            raise NotStreamableError(f"{path}: a long table is read into memory; a wide one is streamed.")
        others = [key for key in layout.columns if key.startswith(("raw:", "sd:")) or key == "n_repeats"]
        if others:
            raise NotStreamableError(
                f"{path}: {layout.header(others[0])} needs the reader that holds the table in memory; a "
                f"table that is streamed has columns of {', '.join(STREAMED)}."
            )
        there = [name for name in OBSERVABLES if layout.has(name)]
        wanted = self.selection.observable or tuple(there)
        missing = [name for name in wanted if name not in there]
        if missing or not wanted:
            raise UsageError(
                f"{path}: there is no column of {missing[0] if missing else 'an observable'}. "
                f"There is {joined(there) or 'none'}."
            )
        taken: set[str] = set()
        dropped = []
        for name in (name for name in OBSERVABLES if name in wanted):
            own = measurements_of(name)
            if own & taken and not self.selection.independent:
                dropped.append(name)
                continue
            taken |= own
            self.observables.append(name)
        odd = [name for name in self.observables if name not in STREAMED]
        if odd:
            self.observables = []
            raise NotStreamableError(
                f"{path}: {odd[0]} is read into memory; what is streamed is {', '.join(STREAMED)}. Choose "
                "one by --observable."
            )
        if dropped:
            self.notes.append(
                f"{Path(path).name}: {joined(self.observables)} used, {joined(dropped)} left out: they are "
                "of the same impacts and would count them twice"
            )
        self.has_spin = layout.has("spin_x") or layout.has("spin_y")
        self.has_sigma = all(self._has_sigma(layout, name) for name in self.observables)
        if any(OBSERVABLES[n].has_angle for n in self.observables) and not (
            layout.has("gamma") or layout.has("tan_gamma")
        ):
            raise DataError(f"{path}: there is no incidence angle. Add a column gamma_deg (from the normal).")

    def _has_sigma(self, layout: Layout, name: str) -> bool:
        return layout.has(f"sigma:{name}") or (layout.has("sigma") and len(self.observables) == 1)

    def _sigma(self, layout: Layout, name: str) -> Array:
        return layout.numbers(f"sigma:{name}" if layout.has(f"sigma:{name}") else "sigma")

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

    def _without(self, good: Mask, bad: Mask, reason: str, cells: Cells) -> Mask:
        """What is left without the bad ones, which are counted."""
        both = good & bad
        count = int(np.count_nonzero(both))
        if not count:
            return good
        self.skipped[reason] += count
        places = [] if reason.startswith("outside ") else self.places.setdefault(reason, [])
        for row in np.flatnonzero(both)[:_FEW_PLACES].tolist():
            if len(places) < _FEW_PLACES and cells.at(row) not in places:
                places.append(cells.at(row))
        return good & ~bad

    def _series_of(self, batch: pa.RecordBatch, layout: Layout) -> NDArray[np.intp]:
        self._note_provenance(batch, layout)
        if not layout.has("series"):
            name = self.path.stem
            if name not in self.series:
                self.series.append(name)
            return np.full(batch.num_rows, self.series.index(name), dtype=np.intp)
        column = batch.column(layout.columns["series"].index).cast("string").fill_null("")
        encoded = column.dictionary_encode()
        names = [text or self.path.stem for text in encoded.dictionary.to_pylist()]
        self.series += [name for name in dict.fromkeys(names) if name not in self.series]
        if len(self.series) > _MOST_SERIES:
            raise UsageError(
                f"{self.path}: more than {_MOST_SERIES} series. ifrfit campaign fits each by itself."
            )
        codes = np.array([self.series.index(name) for name in names], dtype=np.intp)
        return np.asarray(codes[encoded.indices.to_numpy()], dtype=np.intp)

    def _note_provenance(self, batch: pa.RecordBatch, layout: Layout) -> None:
        said = self.conventions.provenance
        if not layout.has("provenance"):
            self.provenances[said] = None
            return
        column = batch.column(layout.columns["provenance"].index).cast("string").fill_null("")
        for text in column.unique().to_pylist():
            name = provenance_name(text)
            if name is None:
                raise DataError(f"{layout.cells.file}: '{text:.40}' is no provenance.")
            self.provenances[name or said] = None

    def _draw(self, batch: pa.RecordBatch, number: int, first: int, usable: Mask) -> None:
        """Keep the rows with the least lots of all so far: the same ones however the rows are parted."""
        if not usable.any():
            return
        lots = _lots(number, first, batch.num_rows)[usable]
        batch = batch.take(np.flatnonzero(usable))
        best = np.sort(np.concatenate([lots, *(lot for lot, _ in self.sample)]))[:SAMPLE]
        kept = [(lot, rows) for lot, rows in (*self.sample, (lots, batch))]
        self.sample = []
        for lot, rows in kept:
            at = np.flatnonzero(lot <= best[-1])
            if at.size:
                self.sample.append((lot[at], rows.take(at)))
        if len(self.sample) > 50:
            import pyarrow as pa

            joined_rows = pa.Table.from_batches([rows for _, rows in self.sample]).combine_chunks()
            self.sample = [(np.concatenate([lot for lot, _ in self.sample]), joined_rows.to_batches()[0])]

    def sampled(self) -> Cells:
        """The sample of the last pass as a table."""
        import pyarrow as pa

        table = pa.Table.from_batches([rows for _, rows in self.sample]).combine_chunks()
        lots = np.concatenate([lot for lot, _ in self.sample])
        table = table.take(np.argsort(lots, kind="stable"))
        return _cells(table.to_batches()[0], self.path, 0, texts=True)


def stream_files(path: Path) -> list[Path]:
    """The file, or the tables of a folder and of those in it, in the order of their names.

    Raises
    ------
    DataError
        There is none.
    """
    if not path.is_dir():
        return [path]
    found = sorted(
        each
        for each in path.rglob("*")
        if each.name.lower().endswith(_SUFFIXES) and each.is_file() and not each.name.startswith((".", "_"))
    )
    if not found:
        raise DataError(f"{path}: there is no Parquet or CSV file in this folder.")
    return found


def is_stream(path: Path) -> bool:
    """Whether a path is data that are streamed: a folder of tables, or a file too large to hold gladly."""
    if path.is_dir():
        return not (path / "datapackage.json").exists()
    if not path.is_file():
        return False
    name = path.name.lower()
    if name.endswith((".csv.gz", ".csv.zst")):
        return True
    if name.endswith(".csv"):
        return path.stat().st_size > LARGE_BYTES
    if not name.endswith(".parquet") or path.stat().st_size < LARGE_ROWS:
        return False
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return int(pq.read_metadata(path).num_rows) >= LARGE_ROWS
    except (pa.ArrowException, OSError):
        return False  # the reader that holds it in memory says what is wrong


def _refuse_copies(files: Sequence[Path]) -> None:
    """Refuse files of the same bytes: their impacts would count twice.

    Raises
    ------
    DataError
        With both names.
    """
    by_size: dict[int, list[Path]] = {}
    for path in files:
        with contextlib.suppress(OSError):  # said when it is read
            by_size.setdefault(path.stat().st_size, []).append(path)
    for alike in by_size.values():
        seen: dict[str, Path] = {}
        for path in alike if len(alike) > 1 else ():
            try:
                with path.open("rb") as file:
                    digest = hashlib.file_digest(file, "sha256").hexdigest()
            except OSError:
                continue
            if digest in seen:
                raise DataError(
                    f"{path}: the same data as {seen[digest].name}, and would be counted twice. Remove one."
                )
            seen[digest] = path


def _cells(batch: pa.RecordBatch, path: Path, first: int, *, texts: bool = False) -> Cells:
    """Columns of numbers as cells; texts are looked at elsewhere unless asked for."""
    import pyarrow as pa

    columns: list[Any] = []
    headers = [str(name).strip() for name in batch.schema.names]
    for name, column in zip(headers, batch.columns, strict=True):
        kind = column.type
        if pa.types.is_dictionary(kind):
            column, kind = column.cast(kind.value_type), kind.value_type
        if pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_null(kind):
            columns.append(column.cast(pa.float64()).to_numpy(zero_copy_only=False))
        elif texts and (pa.types.is_string(kind) or pa.types.is_large_string(kind)):
            columns.append([cell or "" for cell in column.to_pylist()])
        else:
            columns.append(DataError(f"{path}, column {name}: holds {kind}, not numbers. Convert it."))
    is_text = _is_text(path)
    lines = np.arange(first + 1 + is_text, first + 1 + is_text + batch.num_rows)
    return Cells(str(path), "", headers, 1, lines, columns, word="line" if is_text else "row")


def _is_text(path: Path) -> bool:
    return ".csv" in path.name.lower()


def _parquet_batches(path: Path) -> Iterator[pa.RecordBatch]:
    """A file, a column chunk at a time: what is read ahead would be held."""
    import pyarrow.parquet as pq

    with pq.ParquetFile(path, pre_buffer=False) as file:
        yield from file.iter_batches(_BATCH, use_threads=False)


def _csv_batches(path: Path) -> Iterator[pa.RecordBatch]:
    """Plain CSV: a header in the first line, commas between cells, points in numbers; labels stay text."""
    import pyarrow as pa
    import pyarrow.csv

    with pa.input_stream(str(path)) as stream:
        head = stream.read(1 << 16)
    text = head.decode("utf-8-sig", errors="replace")
    header = next(iter(text.splitlines()), "")
    if header.startswith("#") or ";" in header or "\t" in header or "," not in header:
        raise NotStreamableError(
            f"{path}: the first line is no plain header of names between commas, as a file needs that is not "
            "held in memory. Write such a header, or Parquet."
        )
    types = {
        name: pa.string() if role_of(name.strip()).dimension == "text" else pa.float64()
        for name in next(csv.reader([header]))
    }
    options = pa.csv.ConvertOptions(
        column_types=types, null_values=[*NOT_MEASURED, "NaN", "NA", "N/A", "#N/A"]
    )
    with pa.csv.open_csv(
        path, pa.csv.ReadOptions(use_threads=False, block_size=1 << 23), convert_options=options
    ) as reader:
        yield from reader


def _lots(number: int, first: int, n: int) -> NDArray[np.uint64]:
    """A random number of each row, the same whenever it is asked for (splitmix64, Steele et al. 2014)."""
    z = np.arange(first, first + n, dtype=np.uint64) + (np.uint64(number) << np.uint64(40))
    with np.errstate(over="ignore"):
        z = (z + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return np.asarray(z ^ (z >> np.uint64(31)), dtype=np.uint64)
