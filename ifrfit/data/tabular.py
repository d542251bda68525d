"""Files to cells: delimiter, encoding, comments, titles and decimal commas, with every cell's line kept."""

from __future__ import annotations

import csv
import hashlib
import io
import itertools
import re
import shlex
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ifrfit.data.cell_table import NUMBER, CellColumn, Cells, TextColumn, UnreadableKindError, show
from ifrfit.data.column_names import UNITS, parse_header, unit_name
from ifrfit.data.merged_headers import Spans, merge_headers
from ifrfit.data.notes_in_text import calibration_in, notes_in
from ifrfit.data.sheets import DELIMITER, is_spreadsheet, lines_of_sheet
from ifrfit.errors import DataError, UsageError

DELIMITERS = (",", ";", "\t")
BLANKS = " "  # however many stand between two cells
LONGEST_CELL = (
    1000  # no label and no number needs more; the limit keeps a damaged file from being quoted at length
)
_BLANK = " \t;,"  # a line of these alone holds nothing
_LONGEST_HEADER = 50_000
_ROWS_AT_ONCE = 10_000  # held as single cells
_HEADER_WITHIN = 30  # lines in which the header is looked for, behind titles
_CONTROL = re.compile("[\x00-\x08\x0e-\x1f]")
_MAGIC = {
    b"PK\x03\x04": "a spreadsheet or an archive",
    b"\xd0\xcf\x11\xe0": "an old spreadsheet",
    b"\x1f\x8b": "compressed",
    b"%PDF": "a PDF",
}


_JSON = re.compile(r"\s*(\{\s*[\"}]|\[\s*[\[{])")  # how an object begins, or a list of objects or lists


def read_cells(path: Path, is_header: Callable[[str], bool], sheet: str | None = None) -> Cells:
    """Read a text table, a spreadsheet or a Parquet file into cells.

    Parameters
    ----------
    path : Path
    is_header : callable
        Tells whether a cell reads like the name of a column; finds the header behind title lines.
    sheet : str, optional
        Of a spreadsheet.

    Raises
    ------
    UsageError
        A sheet is named that is not there, or of a file that has none.
    DataError
        The file is missing, empty, not a table, or its rows do not fit its header.
    """
    file = str(path)
    raw = read_bytes(path)
    sha256 = hashlib.sha256(raw).hexdigest()
    if sheet is not None and not is_spreadsheet(raw):
        raise UsageError(f"--convention sheet={sheet}: {file} is no spreadsheet. Leave it away.")
    if is_spreadsheet(raw):
        lines, spans = lines_of_sheet(raw, file, sheet)
        lines = _without_comments(lines)
        cells = replace(_parse(lines, file, sha256, is_header, (DELIMITER,), spans), word="row")
    elif raw[:4] == b"PAR1":
        headers, columns, n = read_parquet(raw, file)
        cells = Cells(
            file, sha256, headers, 1, np.arange(1, n + 1), columns, word="row", counted="counted from 1"
        )
    else:
        text = decode(raw, file)
        if _JSON.match(text):
            raise DataError(
                f"{file}: this is JSON, not a text table. Write the impacts as CSV, or read the file in "
                "Python and give its columns."
            )
        del raw  # of a long file only one form is kept at a time
        notes, calibration, lines = notes_in(text), calibration_in(text), _lines(text)
        del text
        cells = replace(_parse(lines, file, sha256, is_header), notes=notes, calibration=calibration)
    check_headers(cells)
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


def _lines(text: str) -> list[str]:
    """Lines of a text, comments emptied."""
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return _without_comments(lines) if "#" in text else lines


def _without_comments(lines: list[str]) -> list[str]:
    return ["" if line.lstrip().startswith("#") else line for line in lines]


def _parse(
    lines: list[str],
    file: str,
    sha256: str,
    is_header: Callable[[str], bool],
    delimiters: Sequence[str] = (*DELIMITERS, BLANKS),
    spans: Spans | None = None,
) -> Cells:
    start, delimiter = _find_header(lines, is_header, file, delimiters)
    if delimiter == BLANKS:
        lines = [*lines[:start], *(BLANKS.join(line.split()) for line in lines[start:])]
    _refuse_long_cells(lines, start, delimiter, file)
    start, merged = _merged(lines, start, delimiter, is_header, spans or {}, file)
    commas = delimiter != "," and any("," in line for line in lines[start + 1 :])
    rows = _rows(lines, start, delimiter, file)
    header_line, names = next(rows, (0, []))
    if not names:
        raise DataError(f"{file}: the file is empty. 'ifrfit template' prints a table to fill in.")
    headers = merged or [cell.strip() for cell in names]
    rows, units = _units_row(rows)
    width = len(headers)
    while width and not headers[width - 1] and _is_blank(_rows(lines, start, delimiter, file), width - 1):
        width -= 1  # spreadsheets export empty columns to the right
    headers = _with_units(headers[:width], units)
    columns = [TextColumn() for _ in headers]
    numbers = [np.empty(0, dtype=np.int64)]
    while block := list(itertools.islice(rows, _ROWS_AT_ONCE)):
        fitted = (
            row if len(row) == width else _fit(row, headers, f"{file}, line {n}", delimiter)
            for n, row in block
        )
        for column, cells in zip(columns, zip(*fitted, strict=True), strict=True):
            column.append(cells)
        numbers.append(np.array([n for n, _ in block], dtype=np.int64))
    return Cells(file, sha256, headers, header_line, np.concatenate(numbers), columns, commas)


def _merged(
    lines: list[str], start: int, delimiter: str, is_header: Callable[[str], bool], spans: Spans, file: str
) -> tuple[int, list[str] | None]:
    """Where the header ends, and what it says together with a row of titles above or of names below."""
    if delimiter == BLANKS:
        return start, None
    there = [i for i in range(max(start - 2, 0), min(start + 3, len(lines))) if lines[i].strip(_BLANK)]
    above, below = [i for i in there if i < start], [i for i in there if i > start]
    for titles, names in ((above[-1:], [start]), ([start], below[:1])):
        if titles and names:
            upper, lower = (_cells(lines[i], delimiter) for i in (titles[0], names[0]))
            at = f"{file}, line {titles[0] + 1}"
            found = merge_headers(upper, lower, is_header, spans.get(titles[0]), at)
            if found is not None:
                return names[0], found
    return start, None


def _cells(line: str, delimiter: str) -> list[str]:
    return next(csv.reader([line], delimiter=delimiter, skipinitialspace=delimiter != "\t"), [])


def _rows(lines: list[str], start: int, delimiter: str, file: str) -> Iterator[tuple[int, list[str]]]:
    """Rows that hold anything, each with the line on which it begins; the first is the header."""
    reader = csv.reader(
        itertools.islice(lines, start, None),
        delimiter=delimiter,
        skipinitialspace=delimiter != "\t",
        strict=True,
    )
    before = start
    try:
        for row in reader:
            if "".join(row).strip(_BLANK):
                yield before + 1, row
            before = start + reader.line_num
    except csv.Error as error:
        raise DataError(
            f"{file}, line {before + 1}: cannot be read ({error}). Check its quotation marks."
        ) from None


def _units_row(
    rows: Iterator[tuple[int, list[str]]],
) -> tuple[Iterator[tuple[int, list[str]]], list[str]]:
    """Take off a row of units under the header, as spreadsheets have it: known units, and nothing else."""
    first = next(rows, None)
    if first is None:
        return rows, []
    cells = [cell.strip().strip("[]()").strip() for cell in first[1]]
    units = [unit_name(cell) if cell else "" for cell in cells]
    if all(unit in UNITS for unit in units if unit) and any(unit not in ("", "1") for unit in units):
        return rows, [unit if cell else "" for unit, cell in zip(units, cells, strict=True)]
    return itertools.chain([first], rows), []


def _with_units(headers: list[str], units: list[str]) -> list[str]:
    """Headers with the units that stand below them, where they state none of their own."""
    padded = [*units, *("" for _ in headers)]
    return [
        f"{header} [{unit}]" if unit and unit != "1" and parse_header(header).unit is None else header
        for header, unit in zip(headers, padded, strict=False)
    ]


def _is_blank(rows: Iterator[tuple[int, list[str]]], column: int) -> bool:
    """Whether a column holds nothing."""
    return all(len(row) <= column or not row[column].strip() for _, row in rows)


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


def _find_header(
    lines: list[str], is_header: Callable[[str], bool], file: str, delimiters: Sequence[str]
) -> tuple[int, str]:
    """Return the index of the header and the delimiter: where most cells read like names of columns."""
    filled = [i for i, line in enumerate(lines) if line.strip(_BLANK)]
    if not filled:
        raise DataError(f"{file}: the file is empty. 'ifrfit template' prints a table to fill in.")
    best: tuple[int, int, int, str] | None = None
    for i in filled[:_HEADER_WITHIN]:
        if len(lines[i]) > _LONGEST_HEADER:
            continue
        for delimiter in delimiters:
            if delimiter == BLANKS:
                cells = lines[i].split()
                if any(sign in lines[i] for sign in DELIMITERS) or not all(map(is_header, cells)):
                    continue
            cells = _cells(lines[i], delimiter)
            if any(NUMBER.fullmatch(cell.strip()) for cell in cells):
                continue
            score = sum(map(is_header, cells))
            if score and (best is None or (score, len(cells)) > best[:2]):
                best = (score, len(cells), i, delimiter)
    if best is None:
        best = _names_below_titles(lines, filled[:_HEADER_WITHIN], is_header, file, delimiters)
    if best is not None:
        # One column alone: any delimiter but the comma, which may then be a decimal one.
        return best[2], best[3] if best[1] > 1 else ";"
    first = lines[filled[0]]
    delimiter = max((each for each in delimiters if each != BLANKS), key=first.count)
    if any(NUMBER.fullmatch(cell.strip()) for cell in first.split(delimiter)):
        raise DataError(
            f"{file}, line {filled[0] + 1}: there is no header, the file begins with numbers. Put the names "
            "of the columns into its first line, without '#': for example gamma_deg, beta."
        )
    return filled[0], delimiter


def _names_below_titles(
    lines: list[str],
    filled: list[int],
    is_header: Callable[[str], bool],
    file: str,
    delimiters: Sequence[str],
) -> tuple[int, int, int, str] | None:
    """The header of names that mean something together with the titles above them alone."""
    for above, below in itertools.pairwise(filled):
        for delimiter in delimiters:
            if (
                delimiter == BLANKS
                or len(lines[above]) > _LONGEST_HEADER
                or len(lines[below]) > _LONGEST_HEADER
            ):
                continue
            cells = _cells(lines[below], delimiter)
            at = f"{file}, line {above + 1}"
            if merge_headers(_cells(lines[above], delimiter), cells, is_header, None, at) is not None:
                return 1, len(cells), below, delimiter
    return None


def _refuse_long_cells(lines: list[str], start: int, delimiter: str, file: str) -> None:
    headers = lines[start].split(delimiter)
    for i in range(max(start - 2, 0), len(lines)):  # titles stand above the names
        if len(lines[i]) > LONGEST_CELL:
            for number, cell in enumerate(lines[i].split(delimiter)):
                if len(cell) > LONGEST_CELL:
                    name = headers[number].strip() if i > start and number < len(headers) else str(number + 1)
                    raise DataError(
                        f"{file}, line {i + 1}, column {name}: {show(cell)} is longer than any number or "
                        "label. Correct it."
                    )


def check_headers(cells: Cells) -> None:
    """Refuse columns without a name and two of one name.

    Raises
    ------
    DataError
        With the place.
    """
    seen: dict[str, int] = {}
    where = cells.file if cells.in_memory else f"{cells.file}, {cells.word} {cells.header_line}"
    for number, header in enumerate(cells.headers, start=1):
        if not header:
            raise DataError(f"{where}, column {number}: the column has no name. Name it or remove it.")
        key = header.lower() if not header.startswith(("Omega", "Ω", "omega", "ω")) else header
        if key in seen:
            raise DataError(
                f"{where}: columns {seen[key]} and {number} are both called '{header}'. Rename or remove one."
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
        table = pq.read_table(io.BytesIO(raw), page_checksum_verification=True)
    except (pa.ArrowException, OSError) as error:
        reason = str(error).splitlines()[0] if str(error) else "damaged"
        raise DataError(f"{file}: not a readable Parquet file ({reason:.100}). Write it again.") from None
    names = [str(name).strip() for name in table.column_names if not str(name).startswith("__index_level_")]
    return names, [arrow_column(table.column(name), name, file, pa) for name in names], table.num_rows


def arrow_column(column: Any, name: str, file: str, pa: Any) -> CellColumn | DataError:
    """Return a column of Arrow as numbers or texts.

    What is neither comes as the error to raise when somebody wants to use it.
    """
    kind = column.type
    if pa.types.is_dictionary(kind):
        kind = kind.value_type
        if pa.types.is_string_view(kind):  # of polars: Arrow has no cast for it
            column = pa.chunked_array([column.to_pylist()], pa.string())
        column = column.cast(kind)
    if (
        pa.types.is_integer(kind)
        or pa.types.is_floating(kind)
        or pa.types.is_decimal(kind)
        or pa.types.is_null(kind)
    ):
        try:
            return np.asarray(column.cast(pa.float64()).to_numpy(zero_copy_only=False), dtype=np.float64)
        except pa.ArrowInvalid:
            return DataError(
                f"{file}, column {name}: holds whole numbers beyond 2^53, which doubles do not tell "
                "from the next. Write them as text."
            )
    if pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_string_view(kind):
        return [cell if cell is not None else "" for cell in column.to_pylist()]
    return UnreadableKindError(
        f"{file}, column {name}: holds {kind}, neither numbers nor text. Convert it, or leave it out: "
        f"--convention {shlex.quote(f'ignore={name}')}.",
        str(kind),
    )
