"""Where a row of a stream stands: a number that files and rows share, and the words that a user needs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ifrfit.data.stream.files import NotStreamableError, is_text
from ifrfit.data.stream.portions import Portion
from ifrfit.errors import UsageError
from ifrfit.text import joined

_ROWS = 40  # bits of a row within its file


class Place(NamedTuple):
    """A row.

    Attributes
    ----------
    path : Path
    file : str
        Its name, with the folders in which it lies below that of the data.
    row : int
        Line of a text, row of a Parquet file from 1 on.
    word : {"line", "row"}
    """

    path: Path
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


def first_row(path: Path) -> int:
    """Number by which a user calls the first row of a file: a header is the first line of a text."""
    return 2 if is_text(path) else 1


def places_of(
    numbers: Iterable[int], portions: Sequence[Portion], data: Path, read: Mapping[int, int]
) -> list[Place]:
    """Where rows stand, by their numbers.

    Parameters
    ----------
    numbers : iterable of int
    portions : sequence of Portion
    data : Path
        The file or folder that was given.
    read : mapping of int to int
        Rows that were read of each piece, by the number of its first.
    """
    firsts: dict[
        int, list[int]
    ] = {}  # of the pieces of each file, and the row of the file that each begins with
    begins: dict[int, list[int]] = {}
    files: dict[int, tuple[Path, str, str]] = {}
    after = 0
    for piece in (piece for portion in portions for piece in portion):
        if piece.number not in files:
            word = "line" if is_text(piece.path) else "row"
            files[piece.number] = piece.path, name_of(piece.path, data), word
            after = first_row(piece.path)
        firsts.setdefault(piece.number, []).append(piece.first)
        begins.setdefault(piece.number, []).append(after)
        after += read[place_of(piece.number, piece.first)]
    every = np.fromiter(numbers, dtype=np.int64)
    file, row = every >> _ROWS, every & ((1 << _ROWS) - 1)
    for number in np.unique(file).tolist():
        own = file == number
        first = np.asarray(firsts[number])
        # a line has two bytes or more: bytes and rows do not overlap
        at = np.searchsorted(first, row[own], side="right") - 1
        row[own] += np.asarray(begins[number])[at] - first[at]
    return [
        Place(path, name, each, word)
        for (path, name, word), each in zip(map(files.__getitem__, file.tolist()), row.tolist(), strict=True)
    ]


def excluded_rows(entries: Sequence[str], files: Sequence[Path], data: Path) -> tuple[tuple[int, int], ...]:
    """File and row, from 0 on, of each entry of --exclude.

    Raises
    ------
    NotStreamableError
        An entry names no file and row.
    UsageError
        It could be of several files.
    """
    found = []
    for entry in entries:
        source, colon, number = entry.rpartition(":")
        name = source.replace("\\", "/")
        own = [
            place
            for place, path in enumerate(files)
            if not colon or name in (str(path), name_of(path, data), path.name)
        ]
        exact = [place for place in own if name_of(files[place], data) == name]
        own = exact or own
        if not number.isdecimal() or not own:
            raise NotStreamableError(
                f"--exclude {entry}: of data that are not held in memory rows are named by file and row, as "
                f"{name_of(files[0], data)}:{first_row(files[0])}."
            )
        if len(own) > 1:
            names = [name_of(files[place], data) for place in own]
            raise UsageError(
                f"--exclude {entry}: could be of {joined(names[:2])}{' and others' if len(own) > 2 else ''}. "
                f"Write {names[0]}:{number}."
            )
        row = int(number) - first_row(files[own[0]])
        if row < 0:
            raise UsageError(f"--exclude {entry}: the first row is {first_row(files[own[0]])}.")
        found.append((own[0], row))
    return tuple(found)
