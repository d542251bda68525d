"""A table as cells that know their file, line and column."""

from __future__ import annotations

import bisect
import math
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import DataError

NOT_MEASURED = frozenset({"", "nan", "na", "n/a", "#n/a"})
_OR_EMPTY = 'Correct it, or leave the cell empty for "not measured".'
_MINUS = "\u2212"  # the sign of mathematics, which spreadsheets and word processors write for a hyphen
NUMBER = re.compile(rf"[+\-{_MINUS}]?(\d+([.,]\d*)?|[.,]\d+)([eE][+\-{_MINUS}]?\d+)?", re.ASCII)

_THOUSANDS = re.compile(r"[+-]?\d{1,3}([,.' \u2009\u202f\xa0]\d{3})+([.,]\d*)?", re.ASCII)

_END = "\x1f"  # of a cell; no file of text that is read holds one


class TextColumn(Sequence[str]):
    """Cells of text, kept joined: a string for each would take several times the room."""

    def __init__(self) -> None:
        self._blocks: list[str] = []
        self._firsts = [0]

    def append(self, cells: Sequence[str]) -> None:
        """Put further cells under those that are there."""
        self._blocks.append(_END.join(cells))
        self._firsts.append(len(self) + len(cells))

    def blocks(self) -> Iterator[tuple[int, list[str]]]:
        """Some cells at a time, with the row of the first."""
        for first, block in zip(self._firsts, self._blocks, strict=False):
            yield first, block.split(_END)

    def __len__(self) -> int:
        return self._firsts[-1]

    def __iter__(self) -> Iterator[str]:
        return (cell for _, block in self.blocks() for cell in block)

    @overload
    def __getitem__(self, row: int) -> str: ...
    @overload
    def __getitem__(self, row: slice) -> Sequence[str]: ...
    def __getitem__(self, row: int | slice) -> str | Sequence[str]:
        if isinstance(row, slice):
            return list(self)[row]
        number = bisect.bisect_right(self._firsts, row) - 1
        return self._blocks[number].split(_END)[row - self._firsts[number]]


class UnreadableKindError(DataError):
    """A column of a file or table is of a kind that is neither numbers nor text.

    Parameters
    ----------
    said : str
    kind : str
        As Arrow calls it.
    """

    def __init__(self, said: str, kind: str) -> None:
        super().__init__(said, kind)

    @property
    def kind(self) -> str:
        """What it holds, as Arrow calls it."""
        return str(self.args[1])


CellColumn = Sequence[str] | NDArray[np.float64]
_path = lru_cache(Path)  # thousands of groups are rows of one file


@dataclass
class Cells:
    """A table as it stands in the file, column by column.

    Attributes
    ----------
    file : str
        As the user named it, for messages.
    sha256 : str
    headers : list of str
    header_line : int
    lines : (n,) int array
        Line of each row in a text file, number of the row in a Parquet file; from 1.
    columns : sequence
        Per header a sequence of n strings, a float array (Parquet), or the error to raise if it is used.
    decimal_commas : bool
        Whether numbers may have decimal commas.
    word : str
        ``line``, ``row`` or ``point``.
    counted : str
        How rows are numbered, in messages, where people might count in another way; empty for lines.
    labels : tuple of str
        What the index of a data frame calls each row, where that is no number; else empty.
    notes : tuple of str
        Sentences about the file that go with every result.
    calibration : str
        Which calibration of a figure its common errors are of; empty where it is not said.
    in_memory : bool
        Whether it is no file: its name is then not cut at slashes and dots.
    places : sequence of str
        Where each row stands, of rows of several files; else empty.
    """

    file: str
    sha256: str
    headers: list[str]
    header_line: int
    lines: NDArray[np.int64]
    columns: Sequence[CellColumn | DataError]
    decimal_commas: bool = False
    word: str = "line"
    counted: str = ""
    labels: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    calibration: str = ""
    in_memory: bool = False
    places: Sequence[str] = ()
    _points: dict[str, tuple[int, int]] = field(default_factory=dict)

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.lines)

    def __getstate__(self) -> dict[str, Any]:
        """What goes to another process: columns of numbers as one array, which takes a third of the time."""
        places = [k for k, column in enumerate(self.columns) if isinstance(column, np.ndarray)]
        numbers = np.array([self.columns[k] for k in places])
        others = [None if k in places else column for k, column in enumerate(self.columns)]
        return self.__dict__ | {"columns": others, "numbers": (places, numbers)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Put the columns back."""
        places, numbers = state.pop("numbers")
        for place, column in zip(places, numbers, strict=True):
            state["columns"][place] = column
        self.__dict__.update(state)

    @property
    def name(self) -> str:
        """The file without its folder, for notes that go into results."""
        return self.file if self.in_memory else _path(self.file).name

    @property
    def label(self) -> str:
        """What a series is called that the table does not name: the file without folder and ending."""
        return self.file if self.in_memory else _path(self.file).stem

    def at(self, row: int | None = None, header: str | None = None) -> str:
        """Return where a message is about: file, line of a row (0-based; else of the header), column."""
        parts = [self.places[row]] if row is not None and self.places else [self.file]
        if row is not None and not self.places:
            called = f"index {show(self.labels[row])}" if self.labels else ""
            how = ", ".join(filter(None, (self.counted, called)))
            parts.append(f"{self.word} {self.lines[row]}{how and f' ({how})'}")
        elif row is None and header is not None and self.word == "line":
            parts.append(f"line {self.header_line}")
        if header is not None:
            parts.append(f"column {header}")
        return ", ".join(parts)

    def refuse_first(self, bad: NDArray[np.bool_], header: str, why: Callable[[int], str]) -> None:
        """Refuse the first row that is bad; `why` says why.

        Raises
        ------
        DataError
            If there is one.
        """
        for row in np.flatnonzero(bad)[:1].tolist():
            raise DataError(f"{self.at(row, header)}: {why(row)}")

    def texts(self, column: int) -> list[str]:
        """Return the cells of a column as stripped text."""
        cells = self._cells(column)
        if isinstance(cells, np.ndarray):
            return [
                "" if math.isnan(x) else str(int(x)) if math.isfinite(x) and x == int(x) else repr(float(x))
                for x in cells
            ]
        return [cell.strip() for cell in cells]

    def _cells(self, column: int) -> CellColumn:
        cells = self.columns[column]
        if isinstance(cells, DataError):
            raise cells
        return cells

    def numbers(self, column: int) -> NDArray[np.float64]:
        """Return the cells of a column as numbers, NaN where nothing was measured.

        Raises
        ------
        DataError
            Text, infinity, or decimal commas and points in one file.
        """
        cells = self._cells(column)
        if isinstance(cells, np.ndarray):
            values = cells.astype(np.float64)
        else:
            values = self._convert(cells, column)
        self.refuse_first(
            np.isinf(values),
            self.headers[column],
            lambda row: f"{show(str(cells[row]))} is infinite. {_OR_EMPTY}",
        )
        return values

    def _convert(self, cells: Sequence[str], column: int) -> NDArray[np.float64]:
        blocks = cells.blocks() if isinstance(cells, TextColumn) else [(0, cells)]
        parts = [self._converted(block, first, column) for first, block in blocks]
        return np.concatenate([np.empty(0), *parts])

    def _converted(self, cells: Sequence[str], first: int, column: int) -> NDArray[np.float64]:
        """Convert all cells at once if they are plain numbers, else one by one, which finds the culprit."""
        text = "\n".join(cells)
        # Python reads 1_000 as a number, people do not write it; decimal signs are to be compared one by one
        if not any(sign in text for sign in ("_", ",", *("." if self.decimal_commas else ""))):
            with suppress(ValueError):
                return np.fromiter(map(float, cells), dtype=np.float64, count=len(cells))
        return np.array([self._number(cell.strip(), row, column) for row, cell in enumerate(cells, first)])

    def _number(self, cell: str, row: int, column: int) -> float:
        if cell.lower() in NOT_MEASURED:
            return math.nan
        number = cell.replace(_MINUS, "-")
        if self.decimal_commas:
            self._one_decimal_sign(cell, row, column)
            number = number.replace(",", ".")
        if "," not in number and (NUMBER.fullmatch(number) or number.lower().lstrip("+-") in _INFINITE):
            return float(number)
        remedy = "Write thousands without a sign between." if _THOUSANDS.fullmatch(number) else _OR_EMPTY
        raise DataError(f"{self.at(row, self.headers[column])}: {show(cell)} is not a number. {remedy}")

    def _one_decimal_sign(self, cell: str, row: int, column: int) -> None:
        """Refuse a file with decimal commas and points: one of them could part thousands."""
        if not NUMBER.fullmatch(cell):
            return
        for sign, other in ((",", "."), (".", ",")):
            if sign not in cell:
                continue
            self._points.setdefault(sign, (row, column))
            if other in self._points:
                there, of = self._points[other]
                raise DataError(
                    f"{self.at(row, self.headers[column])}: {show(cell)} has a decimal {_SIGN[sign]}, "
                    f"{self.word} {self.lines[there]} in column {self.headers[of]} a decimal {_SIGN[other]}. "
                    "Write all numbers the same way."
                )


_INFINITE = ("inf", "infinity")
_SIGN = {",": "comma", ".": "point"}


def show(cell: str) -> str:
    """Return a cell in quotes, shortened."""
    return f"'{cell}'" if len(cell) <= 40 else f"'{cell[:20]}...' ({len(cell)} characters)"
