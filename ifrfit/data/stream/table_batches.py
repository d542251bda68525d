"""Rows of a Parquet or CSV file, some at a time, as columns of numbers."""

from __future__ import annotations

import contextlib
import csv
import io
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.cell_table import NOT_MEASURED, Cells
from ifrfit.data.column_layout import Layout
from ifrfit.data.column_names import role_of
from ifrfit.data.stream.files import NotStreamableError, is_text, opened_text
from ifrfit.data.stream.portions import Piece
from ifrfit.errors import DataError

if TYPE_CHECKING:
    import pyarrow as pa

_BATCH = 1 << 17
_FEW = 1 << 12  # rows, by which columns are looked at
_BUFFER = 1 << 18  # bytes of a column that are read at once: a row group may be longer than memory
_INDEX = "__index_level_"
_ROW = re.compile(r"Row #(\d+)")


def table_batches(piece: Piece, *, few: bool = False) -> Iterator[pa.RecordBatch]:
    """The rows of a piece; a few at a time, if only the first ones are looked at."""
    return _csv_batches(piece) if is_text(piece.path) else _parquet_batches(piece, _FEW if few else _BATCH)


def cells_of(batch: pa.RecordBatch, path: Path, first: int, *, texts: bool = False) -> Cells:
    """Columns of numbers as cells; texts are looked at elsewhere unless asked for."""
    import pyarrow as pa

    columns: list[Any] = []
    headers = [str(name).strip() for name in batch.schema.names]
    for name, column in zip(headers, batch.columns, strict=True):
        kind = column.type
        if pa.types.is_dictionary(kind):
            column, kind = column.cast(kind.value_type), kind.value_type
        if is_number(kind):
            columns.append(column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False))
        elif texts and (pa.types.is_string(kind) or pa.types.is_large_string(kind)):
            columns.append([cell or "" for cell in column.to_pylist()])
        else:
            columns.append(DataError(f"{path}, column {name}: holds {kind}, not numbers. Convert it."))
    has_header = is_text(path)
    lines = np.arange(first + 1 + has_header, first + 1 + has_header + batch.num_rows)
    return Cells(
        str(path),
        "",
        headers,
        1,
        lines,
        columns,
        word="line" if has_header else "row",
        counted="" if has_header else "counted from 1",
    )


def is_number(kind: pa.DataType) -> bool:
    """Whether a column holds numbers, or nothing."""
    import pyarrow as pa

    of = pa.types
    return any(test(kind) for test in (of.is_integer, of.is_floating, of.is_decimal, of.is_null))


def texts_of(column: pa.Array, path: Path, name: str) -> pa.Array:
    """A column of labels as strings, which are those of `Cells.texts` but for blanks around them.

    Raises
    ------
    DataError
        It holds what has no text.
    """
    import pyarrow as pa

    kind = column.type
    try:
        if pa.types.is_dictionary(kind):
            column, kind = column.cast(kind.value_type), kind.value_type
        if is_number(kind) and not pa.types.is_integer(kind):
            encoded = column.cast(pa.float64(), safe=False).dictionary_encode()
            values = np.array(encoded.dictionary)
            each = Cells(str(path), "", [name], 1, np.arange(values.size), [values])
            column = pa.array(each.texts(0), pa.string()).take(encoded.indices)
        return column.cast(pa.string()).fill_null("")
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError):
        raise DataError(f"{path}, column {name}: holds {kind}, not text. Convert it.") from None


def labels_of(batch: pa.RecordBatch, layout: Layout, key: str) -> pa.Array:
    """A column of labels as strings, by its key."""
    column = layout.columns[key]
    return texts_of(batch.column(column.index), Path(layout.cells.file), column.header)


def rows_like_others(batch: pa.RecordBatch, layout: Layout, at: NDArray[np.intp]) -> pa.RecordBatch:
    """Some rows, whose columns have the types of those of all files: numbers, text, or nothing if unused."""
    import pyarrow as pa

    used = {column.index: column for column in layout.columns.values()}
    found, rows = [], pa.array(at)
    for index, column in enumerate(batch.columns):
        if index not in used:
            found.append(pa.nulls(at.size))
        elif used[index].dimension == "text":
            text = column.cast(pa.string()) if pa.types.is_string_view(column.type) else column
            found.append(texts_of(text.take(rows), Path(layout.cells.file), used[index].header))
        else:
            found.append(column.take(rows).cast(pa.float64(), safe=False))
    return pa.RecordBatch.from_arrays(found, names=batch.schema.names)


def _parquet_batches(piece: Piece, rows: int) -> Iterator[pa.RecordBatch]:
    """Row groups, some bytes of each column at a time: what is read ahead would be held."""
    import pyarrow.parquet as pq

    reading = {"pre_buffer": False, "buffer_size": _BUFFER, "page_checksum_verification": True}
    with pq.ParquetFile(piece.path, **reading) as file:
        # pandas leaves the numbers of the rows there where some of them were dropped
        columns = [name for name in file.schema_arrow.names if not name.startswith(_INDEX)]
        groups = list(piece.row_groups)
        yield from file.iter_batches(rows, row_groups=groups, columns=columns, use_threads=False)


def _csv_batches(piece: Piece) -> Iterator[pa.RecordBatch]:
    """Plain CSV: a header in the first line, commas between cells, points in numbers; labels stay text."""
    import pyarrow as pa
    import pyarrow.csv

    names = _header_of(piece.path)
    types = {
        name: pa.string() if role_of(name.strip()).dimension == "text" else pa.float64() for name in names
    }
    options = pa.csv.ConvertOptions(
        column_types=types, null_values=[*NOT_MEASURED, "NaN", "NA", "N/A", "#N/A"]
    )
    reading = pa.csv.ReadOptions(
        use_threads=False, block_size=1 << 23, column_names=names if piece.first else None
    )
    with contextlib.ExitStack() as opened:
        file: Any = opened_text(piece.path) if piece.is_whole else piece.path.open("rb", buffering=0)
        source = opened.enter_context(_Lines(file, piece))
        try:
            for batch in opened.enter_context(pa.csv.open_csv(source, reading, convert_options=options)):
                if source.quotes:
                    _refuse_line_breaks(batch, piece.path)
                yield batch
        except pa.ArrowInvalid as error:
            # the row that it names is one of the part
            said = _ROW.sub(lambda row: f"Row #{int(row[1]) + piece.rows_before() + 1}", str(error))
            raise (error if piece.first == 0 else pa.ArrowInvalid(said)) from None
        if source.quotes % 2:
            # what follows an open quotation mark is dropped in silence
            raise NotStreamableError(
                f"{piece.path}: a quotation mark is not closed in its line. Close it, or write Parquet."
            )


def _refuse_line_breaks(batch: pa.RecordBatch, path: Path) -> None:
    """Refuse cells with line breaks: the file is parted at ends of lines, and might be within such a cell."""
    import pyarrow as pa
    import pyarrow.compute as pc

    for name, column in zip(batch.schema.names, batch.columns, strict=True):
        if pa.types.is_string(column.type) and any(
            pc.any(pc.match_substring(column, end)).as_py() for end in ("\n", "\r")
        ):
            raise NotStreamableError(
                f"{path}, column {name}: a cell holds a line break, or its quotation mark is not closed. "
                "Write it in one line, or the table as Parquet."
            )


def _header_of(path: Path) -> list[str]:
    """Names of the columns.

    Raises
    ------
    DataError
        The file is empty.
    NotStreamableError
        The first line is no plain header.
    """
    with opened_text(path) as stream:
        head = stream.read(1 << 16)
    text = head.decode("utf-8-sig", errors="replace")
    header = next(iter(text.splitlines()), "")
    if not text.strip():
        raise DataError(f"{path}: the file is empty. Remove it.")
    if header.startswith("#") or ";" in header or "\t" in header or "," not in header:
        raise NotStreamableError(
            f"{path}: the first line is no plain header of names between commas, as a file needs that is not "
            "held in memory. Write such a header, or Parquet."
        )
    return next(csv.reader([header]))


class _Lines(io.RawIOBase):
    """The lines of a piece of a text file, and how many quotation marks were met in them."""

    def __init__(self, file: Any, piece: Piece) -> None:
        super().__init__()
        self._file = file
        self.quotes = 0
        self._left = sys.maxsize if piece.is_whole else piece.end - piece.first
        if piece.first:
            file.seek(piece.first)

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        part = self._file.read(min(len(buffer), self._left)) if self._left else b""
        buffer[: len(part)] = part
        self.quotes += part.count(b'"')
        self._left -= len(part)
        return len(part)

    def close(self) -> None:
        self._file.close()
        super().close()
