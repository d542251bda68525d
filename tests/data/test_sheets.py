"""Spreadsheets and blank-separated text say what the same table as CSV says."""

from __future__ import annotations

import io
import struct
import zipfile

import numpy as np
import pytest
from refusals import refused
from sheet_files import ods, xls, xlsb, xlsx

from ifrfit.errors import DataError, UsageError

ROWS = [["gamma_deg", "beta", "sigma_beta"], [10, 0.5, 0.01], [40, 0.1, 0.01], [70.25, -0.7, ""]]
VALUES = [[10.0, 0.5], [40.0, 0.1], [70.25, -0.7]]
WRITERS = {"xlsx": xlsx, "ods": ods, "xlsb": xlsb, "xls": xls}


def values(found):
    return found.table[["gamma_deg", "value"]].to_numpy()


@pytest.mark.parametrize("kind", WRITERS)
def test_a_sheet_is_a_table(read, kind):
    found = read(WRITERS[kind]({"impacts": ROWS}), name=f"x.{kind}")
    np.testing.assert_allclose(values(found), VALUES, rtol=0, atol=0)
    assert list(found.table["row"]) == [2, 3, 4]
    assert set(found.table["series"]) == {"x"}


@pytest.mark.parametrize("kind", WRITERS)
def test_titles_stand_above_and_units_below_the_header(read, kind):
    rows = [
        ["Glass on glass, June"],
        [""],
        ["gamma", "beta", "u"],
        ["rad", "", "[mm/s]"],
        *([np.radians(gamma).item(), beta, 2000.0] for gamma, beta in VALUES),
    ]
    found = read(WRITERS[kind]({"impacts": rows}), name=f"x.{kind}")
    np.testing.assert_allclose(values(found), VALUES, rtol=1e-14)
    np.testing.assert_allclose(found.table["speed_m_s"], 2.0)


def test_units_below_the_header_in_text(read):
    found = read("gamma;beta;sigma_beta\n°;-;-\n10;0,5;0,01\n40;0,1;0,01\n")
    np.testing.assert_allclose(values(found), VALUES[:2])
    # a row that is no row of units stays a row
    with refused(DataError, "line 2, column gamma_deg: 'ten' is not a number"):
        read("gamma_deg,beta\nten,0.4\n")


@pytest.mark.parametrize("kind", WRITERS)
def test_sheets_by_name(read, kind):
    book = WRITERS[kind]({"impacts": ROWS, "notes": [["made in June"]], "more": ROWS[:2], "empty": []})
    np.testing.assert_allclose(values(read(book, "sheet=more", name="x.xlsx")), VALUES[:1])
    with refused(DataError, "x.xlsx: has the sheets 'impacts', 'notes', 'more'. Say which, as --convention"):
        read(book, name="x.xlsx")
    with refused(UsageError, "sheet=June: .* has the sheets 'impacts', 'notes', 'more', 'empty'"):
        read(book, "sheet=June", name="x.xlsx")
    with refused(UsageError, "sheet=more: .* is no spreadsheet"):
        read("gamma_deg,beta\n10,0.4\n", "sheet=more")
    with refused(DataError, "the file is empty"):
        read(book, "sheet=empty", name="x.xlsx")


@pytest.mark.parametrize("kind", WRITERS)
def test_refusals_name_the_row(read, kind):
    with refused(DataError, "x.ods, row 3, column beta: 'high' is not a number"):
        read(WRITERS[kind]({"impacts": [ROWS[0], ROWS[1], [40, "high", 0.01]]}), name="x.ods")


def test_damaged_and_hostile_spreadsheets(read):
    book = xlsx({"impacts": ROWS})
    for raw in (book[: len(book) // 2], book[:200], b"PK\x03\x04abc", b"\xd0\xcf\x11\xe0abc" * 99):
        with refused(DataError, "x.csv: the file is a spreadsheet or an archive, not a text table"):
            read(raw)
    with refused(DataError, "reaches over 1,048,576 rows and 16,384 columns"):
        read(_with_far_cell(book))


def test_a_binary_sheet_with_a_far_cell_is_refused(read):
    far = [*ROWS, *([] for _ in range(30_000)), [*[""] * 400, 1.0]]
    with refused(DataError, "sheet1.bin: reaches over 30,005 rows and 401 columns. Delete what lies far off"):
        read(xlsb({"impacts": far}), name="x.xlsb")


def test_an_old_sheet_with_a_far_cell_is_refused(read):
    book = xls({"impacts": ROWS})
    far = book.replace(struct.pack("<HHH", 3, 1, 0), struct.pack("<HHH", 65_000, 250, 0))
    assert far != book
    with refused(DataError, "x.xls: reaches over 65,001 rows and 251 columns. Delete what lies far off"):
        read(far, name="x.xls")


@pytest.mark.parametrize("write", [xls, xlsb])
def test_damaged_binary_sheets_are_read_or_refused(read, write):
    """Cut anywhere, or with bytes turned over: a table, or one sentence."""
    book = write({"impacts": ROWS})
    rng = np.random.default_rng(1)
    for cut in range(8, len(book), max(len(book) // 60, 1)):
        _read_or_refused(read, book[:cut])
    for _ in range(100):
        wrong = bytearray(book)
        for place in rng.integers(4, len(book), 3):
            wrong[place] ^= int(rng.integers(1, 256))
        _read_or_refused(read, bytes(wrong))


def _read_or_refused(read, raw):
    said = ""
    try:
        read(raw)
    except DataError as error:
        said = str(error)
    assert "\n" not in said


def test_rows_that_repeat_a_million_times_are_refused(read):
    repeated = (
        b'<table:table-row table:number-rows-repeated="400000"><table:table-cell '
        b'table:number-columns-repeated="16" office:value-type="float" office:value="1"/></table:table-row>'
    )
    with refused(DataError, "sheet 'impacts': reaches over 400,00. rows and 1. columns"):
        read(_with(ods({"impacts": ROWS}), b"</table:table>", repeated))


_FAR = b'<row r="1048576"><c r="XFD1048576"><v>1</v></c></row>'


def _with_far_cell(book):
    return _with(book, b"</sheetData>", _FAR)


def _with(book, before, more):
    held = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(book)) as old, zipfile.ZipFile(held, "w") as new:
        for each in old.namelist():
            new.writestr(each, old.read(each).replace(before, more + before))
    return held.getvalue()


@pytest.mark.parametrize("gap", [" ", "   ", " \t "])
def test_blanks_between_columns(read, gap):
    rows = [["gamma_deg", "beta"], *([str(gamma), str(beta)] for gamma, beta in VALUES)]
    text = "# blanks\n" + "".join(f"  {gap.join(row)} \n" for row in rows)
    if "\t" in gap:
        text = text.replace(f"gamma_deg{gap}beta", "gamma_deg beta")
    np.testing.assert_allclose(values(read(text)), VALUES)


def test_blanks_inside_a_header_part_nothing(read):
    found = read("impact angle;beta\n10;0,4\n", "angle=impact angle:from-normal")
    np.testing.assert_allclose(values(found), [[10.0, 0.4]])
    with refused(DataError, "columns are separated by commas, semicolons or tabs"):
        read("gamma_deg Ort\n10 0.4\n")
    with refused(DataError, "line 3, column beta: the line ends before it"):
        read("gamma_deg beta\n10 0.4\n20\n")
