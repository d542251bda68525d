"""Sheets of spreadsheets as lines of cells: .xlsx, .ods, .xls and .xlsb, read in memory."""

from __future__ import annotations

import csv
import datetime
import io
import re
import zipfile
import zlib
from typing import Any

from ifrfit.data.cell_table import show
from ifrfit.data.compound_file import extent_of_xls
from ifrfit.data.merged_headers import Spans
from ifrfit.errors import DataError, UsageError

MAGIC = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")
DELIMITER = "\t"
_LARGEST = 256 * 2**20  # bytes that a file may unpack to
_MOST_FILES = 10_000
_MOST_CELLS = 5_000_000
_LAST_CELL = 11  # of the numbers of records of .xlsb: 0 begins a row, 1 to 11 are cells
_CELL = re.compile(rb'<c r="([A-Z]{1,3})(\d{1,7})"')
_REMEDY = "Export the sheet as CSV."


def is_spreadsheet(head: bytes) -> bool:
    """Whether a file that begins so is a spreadsheet, or an archive."""
    return head.startswith(MAGIC)


def lines_of_sheet(raw: bytes, file: str, sheet: str | None) -> tuple[list[str], Spans]:
    """The rows of a sheet as lines with tabs between cells, from its first row; and which cells are merged.

    Parameters
    ----------
    raw : bytes
    file : str
    sheet : str or None
        Its name; may be left out where one sheet alone holds anything.

    Raises
    ------
    DataError
        It is no spreadsheet, damaged, unpacks to more than any table takes, or has several filled sheets.
    UsageError
        There is no sheet of that name.
    """
    _refuse_bomb(raw, file)
    from python_calamine import CalamineError, CalamineWorkbook

    try:
        book = CalamineWorkbook.from_filelike(io.BytesIO(raw))
        names = list(book.sheet_names)
        if sheet is not None and sheet not in names:
            raise UsageError(
                f"--convention sheet={sheet}: {file} has the sheets {', '.join(map(show, names))}."
            )
        chosen = {name: book.get_sheet_by_name(name) for name in ([sheet] if sheet else names)}
        filled = {name: each for name, each in chosen.items() if each.height}
        for name, each in filled.items():
            if (each.total_height + 1) * (each.total_width + 1) > _MOST_CELLS:
                raise DataError(
                    f"{file}, sheet {show(name)}: reaches over {each.total_height:,} rows and "
                    f"{each.total_width:,} columns. Delete what lies far off."
                )
        if len(filled) > 1:
            raise DataError(
                f"{file}: has the sheets {', '.join(map(show, filled))}. Say which, as --convention "
                f"'sheet={next(iter(filled))}'."
            )
        only = next(iter(filled.values()), None)
        rows = only.to_python(skip_empty_area=False) if only is not None else []
    except (CalamineError, ValueError, OSError) as error:
        if isinstance(error, DataError | UsageError):
            raise
        raise DataError(
            f"{file}: the file is a spreadsheet or an archive, not a text table. It cannot be opened as a "
            f"spreadsheet ({' '.join(str(error).split())[:80]}): {_REMEDY[0].lower()}{_REMEDY[1:]}"
        ) from None
    except BaseException as error:
        if type(error).__name__ != "PanicException":  # of the reader, which is no Exception
            raise
        raise DataError(_damaged(file, "its records contradict each other")) from None
    if not rows:
        raise DataError(f"{file}: the file is empty. 'ifrfit template' prints a table to fill in.")
    return _lines(rows), _spans(only)


def _spans(sheet: Any) -> Spans:
    """Cells that are merged over several columns, as far as the format's reader tells: of .xlsx and .xls."""
    found: Spans = {}
    for (row, first), (_, last) in sheet.merged_cell_ranges or ():
        found.setdefault(row, {})[first] = last
    return found


def _lines(rows: list[list[Any]]) -> list[str]:
    held = io.StringIO()
    writer = csv.writer(held, delimiter=DELIMITER, lineterminator="\n")
    writer.writerows([_text(cell) for cell in row] for row in rows)
    return held.getvalue().split("\n")[:-1]


def _text(cell: Any) -> str:
    """A cell as a text table would have it; a date stays one, which no column of numbers takes."""
    if isinstance(cell, float) and cell.is_integer() and abs(cell) < 1e15:
        return str(int(cell))
    if isinstance(cell, datetime.date | datetime.time):
        return cell.isoformat()
    return " ".join(str(cell).split())


def _refuse_bomb(raw: bytes, file: str) -> None:
    """Refuse archives that unpack to far more than tables take, or whose last cell is far away."""
    if raw.startswith(MAGIC[1]):
        extent = extent_of_xls(raw)
        if extent is None:
            raise DataError(_damaged(file, "no workbook"))
        _refuse_far_cell(extent, file)
    if not raw.startswith(MAGIC[0]):
        return
    try:
        with zipfile.ZipFile(io.BytesIO(raw)) as archive:
            members = archive.infolist()
            total = sum(each.file_size for each in members)
            if total > _LARGEST or len(members) > _MOST_FILES:
                raise DataError(
                    f"{file}: unpacks to {len(members):,} files of {total / 2**20:,.0f} MB, more than any "
                    f"table takes. {_REMEDY}"
                )
            for each in members:
                if each.filename.startswith("xl/worksheets/") and each.filename.endswith(".xml"):
                    _refuse_far_cell(_extent(archive.read(each)), f"{file}, {each.filename}")
                if each.filename.startswith("xl/worksheets/") and each.filename.endswith(".bin"):
                    _refuse_far_cell(_binary_extent(archive.read(each)), f"{file}, {each.filename}")
    except (
        zipfile.BadZipFile,
        zlib.error,
        NotImplementedError,
        RuntimeError,
        EOFError,
        OSError,
        ValueError,
    ) as error:
        if isinstance(error, DataError):
            raise
        raise DataError(_damaged(file, str(error))) from None


def _damaged(file: str, why: str) -> str:
    return (
        f"{file}: the file is a spreadsheet or an archive, not a text table. It is damaged "
        f"({' '.join(why.split())[:80]}): {_REMEDY[0].lower()}{_REMEDY[1:]}"
    )


def _extent(xml: bytes) -> tuple[int, int]:
    """Rows and columns that the cells of a sheet of .xlsx reach over."""
    right = down = 0
    for column, row in _CELL.findall(xml):
        number = 0
        for letter in column:
            number = 26 * number + letter - ord("A") + 1
        right, down = max(right, number), max(down, int(row))
    return down, right


def _binary_extent(records: bytes) -> tuple[int, int]:
    """The same of a sheet of .xlsb: records of a number, a length, seven bits to a byte, and content."""
    right = down = at = 0
    while at < len(records):
        kind, at = _seven_bits(records, at, 2)
        size, at = _seven_bits(records, at, 4)
        if kind <= _LAST_CELL and size >= 4:
            number = int.from_bytes(records[at : at + 4], "little") + 1
            down, right = (max(down, number), right) if kind == 0 else (down, max(right, number))
        at += size
    return down, right


def _seven_bits(records: bytes, at: int, most: int) -> tuple[int, int]:
    """A number of at most so many bytes, and where the next begins."""
    number = 0
    for place, byte in enumerate(records[at : at + most]):
        number |= (byte & 0x7F) << 7 * place
        at += 1
        if byte < 0x80:
            break
    return number, at


def _refuse_far_cell(extent: tuple[int, int], at: str) -> None:
    """Refuse a sheet whose rectangle of cells would not fit into memory."""
    down, right = extent
    if right * down > _MOST_CELLS:
        raise DataError(f"{at}: reaches over {down:,} rows and {right:,} columns. Delete what lies far off.")
