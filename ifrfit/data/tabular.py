"""Files to cells: delimiter, encoding, comments, titles and decimal commas, with every cell's line kept."""

from __future__ import annotations

import csv
import hashlib
import io
import re
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ifrfit.data.cell_table import NUMBER, CellColumn, Cells, show
from ifrfit.errors import DataError

DELIMITERS = (",", ";", "\t")
LONGEST_CELL = (
    1000  # no label and no number needs more; the limit keeps a damaged file from being quoted at length
)
_BLANK = " \t;,"  # a line of these alone holds nothing
_LONGEST_HEADER = 50_000
_HEADER_WITHIN = 30  # lines in which the header is looked for, behind titles
_CONTROL = re.compile("[\x00-\x08\x0e-\x1f]")
_MAGIC = {
    b"PK\x03\x04": "a spreadsheet or an archive",
    b"\xd0\xcf\x11\xe0": "an old spreadsheet",
    b"\x1f\x8b": "compressed",
    b"%PDF": "a PDF",
}


def read_cells(path: Path, is_header: Callable[[str], bool]) -> Cells:
    """Read a CSV, TSV or Parquet file into cells.

    Parameters
    ----------
    path : Path
    is_header : callable
        Tells whether a cell reads like the name of a column; finds the header behind title lines.

    Raises
    ------
    DataError
        The file is missing, empty, not a table, or its rows do not fit its header.
    """
    file = str(path)
    raw = read_bytes(path)
    sha256 = hashlib.sha256(raw).hexdigest()
    if raw[:4] == b"PAR1":
        headers, columns, n = read_parquet(raw, file)
        cells = Cells(file, sha256, headers, 1, np.arange(1, n + 1), columns, word="row")
    else:
        cells = _parse(decode(raw, file), file, sha256, is_header)
    _check_headers(cells)
    if not len(cells):
        raise DataError(f"{file}: there is a header, but no row under it. Add one impact a line.")
    return cells


def read_bytes(path: Path) -> bytes:
    """Return the bytes of a file; a missing, unreadable or empty one, or a folder, is a DataError."""
    if path.is_dir():
        raise DataError(f"{path}: this is a folder. Name a CSV, TSV or Parquet file in it.")
    try:
        raw = path.read_bytes()
    except FileNotFoundError:
        raise DataError(f"{path}: there is no such file. Check the name.") from None
    except (OSError, ValueError) as error:  # ValueError: a name with a NUL in it
        reason = getattr(error, "strerror", None) or error
        raise DataError(f"{path}: cannot be read ({reason}). Check the file.") from None
    if not raw.strip():
        raise DataError(f"{path}: the file is empty. 'ifrfit template' prints a table to fill in.")
    return raw


def decode(raw: bytes, file: str) -> str:
    """Return the text of a file in UTF-8 (with or without BOM), UTF-16 with BOM or Latin-1."""
    for magic, what in _MAGIC.items():
        if raw.startswith(magic):
            raise DataError(f"{file}: the file is {what}, not a text table. Export it as CSV.")
    try:
        if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
            text = raw.decode("utf-16")
        else:
            text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")
    if _CONTROL.search(text):
        raise DataError(f"{file}: the file is binary, not a text table. Export it as CSV.")
    return text


def _parse(text: str, file: str, sha256: str, is_header: Callable[[str], bool]) -> Cells:
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if "#" in text:
        lines = ["" if line.lstrip().startswith("#") else line for line in lines]
    start, delimiter = _find_header(lines, is_header, file)
    _refuse_long_cells(lines, start, delimiter, file)
    commas = delimiter != "," and any("," in line for line in lines[start + 1 :])
    rows, at = _rows(lines, start, delimiter, file)
    headers = [cell.strip() for cell in rows.pop(0)]
    width = len(headers)
    while width and not headers[width - 1] and all(len(r) < width or not r[width - 1].strip() for r in rows):
        width -= 1  # spreadsheets export empty columns to the right
    headers = headers[:width]
    if any(len(row) != width for row in rows):
        body = zip(rows, at[1:], strict=True)
        rows = [_fit(row, headers, f"{file}, line {n}", delimiter) for row, n in body]
    columns = list(zip(*rows, strict=True)) if rows else [()] * width
    return Cells(file, sha256, headers, at[0], np.array(at[1:], dtype=np.int64), columns, commas)


def _rows(lines: list[str], start: int, delimiter: str, file: str) -> tuple[list[list[str]], list[int]]:
    """Return the rows that hold anything, and the line on which each begins."""
    reader = csv.reader(lines[start:], delimiter=delimiter, skipinitialspace=delimiter != "\t", strict=True)
    rows: list[list[str]] = []
    numbers: list[int] = []
    before = start
    try:
        for row in reader:
            if "".join(row).strip(_BLANK):
                rows.append(row)
                numbers.append(before + 1)
            before = start + reader.line_num
    except csv.Error as error:
        raise DataError(
            f"{file}, line {before + 1}: cannot be read ({error}). Check its quotation marks."
        ) from None
    if not rows:
        raise DataError(f"{file}: the file is empty. 'ifrfit template' prints a table to fill in.")
    return rows, numbers


def _fit(row: list[str], headers: list[str], at: str, delimiter: str) -> list[str]:
    width = len(headers)
    if len(row) == width or (len(row) > width and not any(cell.strip() for cell in row[width:])):
        return row[:width]
    number = f"{len(row)} cell{'s' if len(row) > 1 else ''} under a header of {width}"
    if len(row) < width:
        missing = headers[len(row)]
        raise DataError(
            f"{at}, column {missing}: the line ends before it, {number}. "
            'Complete the line; leave a cell empty for "not measured".'
        )
    hint = "Remove what is too many."
    if delimiter == ",":
        hint = (
            "Remove what is too many; if the numbers have decimal commas, separate the columns by semicolons."
        )
    raise DataError(f"{at}, column {width + 1}: the line goes on, {number}. {hint}")


def _find_header(lines: list[str], is_header: Callable[[str], bool], file: str) -> tuple[int, str]:
    """Return the index of the header and the delimiter: where most cells read like names of columns."""
    filled = [i for i, line in enumerate(lines) if line.strip(_BLANK)]
    if not filled:
        raise DataError(f"{file}: the file is empty. 'ifrfit template' prints a table to fill in.")
    best: tuple[int, int, int, str] | None = None
    for i in filled[:_HEADER_WITHIN]:
        if len(lines[i]) > _LONGEST_HEADER:
            continue
        for delimiter in DELIMITERS:
            cells = next(
                csv.reader(io.StringIO(lines[i]), delimiter=delimiter, skipinitialspace=delimiter != "\t")
            )
            if any(NUMBER.fullmatch(cell.strip()) for cell in cells):
                continue
            score = sum(map(is_header, cells))
            if score and (best is None or (score, len(cells)) > best[:2]):
                best = (score, len(cells), i, delimiter)
    if best is not None:
        # One column alone: any delimiter but the comma, which may then be a decimal one.
        return best[2], best[3] if best[1] > 1 else ";"
    first = lines[filled[0]]
    delimiter = max(DELIMITERS, key=first.count)
    if any(NUMBER.fullmatch(cell.strip()) for cell in first.split(delimiter)):
        raise DataError(
            f"{file}, line {filled[0] + 1}: there is no header, the file begins with numbers. Put the names "
            "of the columns into its first line, without '#': for example gamma_deg, beta."
        )
    return filled[0], delimiter


def _refuse_long_cells(lines: list[str], start: int, delimiter: str, file: str) -> None:
    headers = lines[start].split(delimiter)
    for i in range(start, len(lines)):
        if len(lines[i]) > LONGEST_CELL:
            for number, cell in enumerate(lines[i].split(delimiter)):
                if len(cell) > LONGEST_CELL:
                    name = headers[number].strip() if i > start and number < len(headers) else str(number + 1)
                    raise DataError(
                        f"{file}, line {i + 1}, column {name}: {show(cell)} is longer than any number or "
                        "label. Correct it."
                    )


def _check_headers(cells: Cells) -> None:
    seen: dict[str, int] = {}
    for number, header in enumerate(cells.headers, start=1):
        if not header:
            raise DataError(
                f"{cells.file}, {cells.word} {cells.header_line}, column {number}: the column has no name. "
                "Name it or remove it."
            )
        key = header.lower() if not header.startswith(("Omega", "Ω", "omega", "ω")) else header
        if key in seen:
            raise DataError(
                f"{cells.file}, {cells.word} {cells.header_line}: columns {seen[key]} and {number} are both "
                f"called '{header}'. Rename or remove one."
            )
        seen[key] = number


def read_parquet(raw: bytes, file: str) -> tuple[list[str], Sequence[CellColumn | DataError], int]:
    """Return the names, the columns and the number of rows of a Parquet file.

    A column is a float array, a sequence of text, or the error that its use raises.

    Raises
    ------
    DataError
        The file is damaged.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(io.BytesIO(raw))
    except (pa.ArrowException, OSError) as error:
        reason = str(error).splitlines()[0] if str(error) else "damaged"
        raise DataError(f"{file}: not a readable Parquet file ({reason:.100}). Write it again.") from None
    names = [str(name).strip() for name in table.column_names if not str(name).startswith("__index_level_")]
    return names, [_column(table.column(name), name, file, pa) for name in names], table.num_rows


def _column(column: Any, name: str, file: str, pa: Any) -> CellColumn | DataError:
    """Return numbers or texts; what is neither comes as the error to raise when somebody wants to use it."""
    kind = column.type
    if pa.types.is_dictionary(kind):
        column = column.cast(kind.value_type)
        kind = column.type
    if (
        pa.types.is_integer(kind)
        or pa.types.is_floating(kind)
        or pa.types.is_decimal(kind)
        or pa.types.is_null(kind)
    ):
        return np.asarray(column.cast(pa.float64()).to_numpy(zero_copy_only=False), dtype=np.float64)
    if pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_string_view(kind):
        return [cell if cell is not None else "" for cell in column.to_pylist()]
    return DataError(
        f"{file}, column {name}: holds {kind}, neither numbers nor text. Convert it, or leave it out: "
        f"--convention {shlex.quote(f'ignore={name}')}."
    )
