"""Where a row of a stream stands: a number that files and rows share, and the words that a user needs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from ifrfit.data.stream.files import is_text
from ifrfit.data.stream.portions import Piece, Portion

_ROWS = 40  # bits of a row within its file


class Place(NamedTuple):
    """A row.

    Attributes
    ----------
    file : str
        Its name, with the folders in which it lies below that of the data.
    row : int
        Line of a text, row of a Parquet file from 1 on.
    word : {"line", "row"}
    """

    file: str
    row: int
    word: str

    def __str__(self) -> str:
        return f"{self.file}:{self.row}"


def place_of(number: int, row: int) -> int:
    """The number of a row of file `number`; `row` as `Piece.first` counts."""
    return (number << _ROWS) + row


def name_of(path: Path, data: Path) -> str:
    """Name of a file of the data, below the folder that was given."""
    return path.relative_to(data).as_posix() if path != data and path.is_relative_to(data) else path.name


def places_of(numbers: Sequence[int], portions: Sequence[Portion], data: Path) -> list[Place]:
    """Where rows stand, by their numbers."""
    pieces: dict[int, list[Piece]] = {}
    for piece in (piece for portion in portions for piece in portion):
        pieces.setdefault(piece.number, []).append(piece)
    found: list[Place] = []
    for number in numbers:
        file, row = number >> _ROWS, number & ((1 << _ROWS) - 1)
        # a line has two bytes or more: bytes and rows do not overlap
        piece = max((one for one in pieces[file] if one.first <= row), key=lambda one: one.first)
        is_line = is_text(piece.path)
        row_in_file = piece.rows_before() + row - piece.first + 1 + is_line
        found.append(Place(name_of(piece.path, data), row_in_file, "line" if is_line else "row"))
    return found
