"""Points that a digitiser exported as text: two columns, or a pair of columns for each series."""

from __future__ import annotations

import csv
import math
from collections import Counter

from ifrfit.data.cell_table import NUMBER, show
from ifrfit.data.figures.digitised_figure import DigitisedFigure, FigureAxes, FileImporter, PointSet, points_of
from ifrfit.data.tabular import DELIMITERS, decode
from ifrfit.errors import DataError

_TITLE = "a table of points"
_MOST_TITLES = 10  # lines above the numbers
_AXIS_NAMES = frozenset({"x", "y"})


def read_pairs(raw: bytes, file: str) -> DigitisedFigure:
    """Points in pairs of columns; see `FigureImporter.read`.

    Lines above the numbers may name the series, over the first column of each pair or over both, and the
    columns themselves, x and y.

    Raises
    ------
    DataError
        With the line and the column.
    """
    lines = [line for line in decode(raw, file).splitlines()]
    rows = _rows(lines, file)
    first = next((i for i, (_, row) in enumerate(rows) if _has_number(row)), None)
    if first is None:
        raise DataError(f"{file}: holds no line of numbers. Export the points as two columns, x and y.")
    if first > _MOST_TITLES:
        raise DataError(
            f"{file}, line {rows[0][0]}: {first} lines stand above the numbers, at most {_MOST_TITLES} are titles."
        )
    width = max(len(row) for _, row in rows[first:])
    if width % 2:
        columns = "1 column" if width == 1 else f"{width} columns"
        raise DataError(
            f"{file}, line {rows[first][0]}: {columns} of numbers, points are pairs of columns, x and y of each "
            "series. Export every series with its own x."
        )
    names = _names([row for _, row in rows[:first]], width // 2)
    sets = [
        PointSet(names[i], "", points_of(_pairs(rows[first:], i, file), file)) for i in range(width // 2)
    ]
    return DigitisedFigure(_TITLE, (FigureAxes(""),), tuple(sets))


def _rows(lines: list[str], file: str) -> list[tuple[int, list[str]]]:
    """Cells of each line that holds any, with its number."""
    kept = [(i, line) for i, line in enumerate(lines, start=1) if line.strip(" \t,;") and line.lstrip()[0] != "#"]
    counted = Counter({sign: sum(line.count(sign) for _, line in kept) for sign in DELIMITERS})
    # decimal commas stand beside semicolons or tabs
    delimiter = ";" if counted[";"] else "\t" if counted["\t"] else ","
    found = []
    for number, line in kept:
        try:
            cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True, strict=True))
        except csv.Error as error:
            raise DataError(f"{file}, line {number}: cannot be read ({error}). Check its quotation marks.") from None
        while cells and not cells[-1].strip():
            cells.pop()
        found.append((number, [cell.strip() for cell in cells]))
    return found


def _has_number(row: list[str]) -> bool:
    return bool(row) and all(not cell or NUMBER.fullmatch(cell) for cell in row)


def _names(titles: list[list[str]], count: int) -> list[str]:
    """Of each series, from the last line of titles that is not x and y."""
    for row in reversed(titles):
        if {cell.lower() for cell in row if cell} <= _AXIS_NAMES:
            continue
        names = [next((cell for cell in row[2 * i : 2 * i + 2] if cell), "") for i in range(count)]
        if count > 1 and len(set(names)) == count and all(names):
            return names
        break
    return [""] if count == 1 else [f"series {i}" for i in range(1, count + 1)]


def _pairs(rows: list[tuple[int, list[str]]], series: int, file: str) -> list[tuple[float, float]]:
    found = []
    for line, row in rows:
        cells = (row + [""] * (2 * series + 2))[2 * series : 2 * series + 2]
        if any(cells):
            x, y = (_number(cell, f"{file}, line {line}, column {2 * series + i}") for i, cell in enumerate(cells, 1))
            found.append((x, y))
    return found


def _number(cell: str, at: str) -> float:
    text = cell.replace("\u2212", "-")
    if not NUMBER.fullmatch(text) or ("," in text and "." in text):
        said = show(cell) if cell else "an empty cell"
        raise DataError(f"{at}: {said} is not a number. A point is two numbers.")
    number = float(text.replace(",", "."))
    if not math.isfinite(number):
        raise DataError(f"{at}: {show(cell)} is not a finite number.")
    return number


POINT_PAIRS = FileImporter("points", _TITLE, False, lambda head: True, read_pairs)
