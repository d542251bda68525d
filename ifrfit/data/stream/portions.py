"""Files parted into portions, each read on its own: some files, or some row groups or lines of one."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from ifrfit.data.stream.files import BYTES_A_LINE, is_text, unreadable
from ifrfit.errors import DataError

FIRST_ROWS = 400_000  # of the first portion, which tells where to look closely in all others
ROWS = 2_000_000  # of each other portion: seconds of work, unless a row group is longer
_TEXT_BYTES = FIRST_ROWS * BYTES_A_LINE  # of a piece of text
_STEP = 1 << 16  # bytes that are looked through for the end of a line


@dataclass(frozen=True)
class Piece:
    """A file, or some row groups or lines of it.

    Attributes
    ----------
    path : Path
    number : int
        Of the file, in the order of the names.
    first : int
        Row of the file with which it begins; of text the byte, which tells its rows from all others as well.
    rows : int
        How many there are; of text a guess from the size.
    row_groups : tuple of int
        Of a Parquet file; empty for text.
    size, changed : int
        Bytes of the file, and when it was written (ns): what is read is what was parted.
    end : int
        Byte of a text file before which it ends.
    """

    path: Path
    number: int
    first: int
    rows: int
    row_groups: tuple[int, ...]
    size: int
    changed: int
    end: int = 0

    @property
    def is_whole(self) -> bool:
        """Whether it is all of a file of text."""
        return not self.row_groups and self.first == 0 and self.end == self.size

    def rows_before(self) -> int:
        """Rows of the file before it; lines of text are counted for that, so ask only to name one."""
        if self.row_groups or self.first == 0:
            return self.first
        return _lines_before(self.path, self.first, self.changed) - 1  # the header is none

    def check_unchanged(self) -> None:
        """See that the file is the one that was parted.

        Raises
        ------
        DataError
            It was written to since, or is gone.
        """
        try:
            found = self.path.stat()
        except OSError as error:
            raise unreadable(self.path, error) from None
        if (found.st_size, found.st_mtime_ns) != (self.size, self.changed):
            raise DataError(
                f"{self.path}: it changed while it was read. Run again when nothing writes to it."
            )


Portion = tuple[Piece, ...]


def portions_of(files: Sequence[Path]) -> list[Portion]:
    """All rows of the files, in their order; the parting depends on the files alone.

    Raises
    ------
    DataError
        A file cannot be read.
    """
    found: list[list[Piece]] = [[]]
    rows = 0
    for piece in (piece for number, path in enumerate(files) for piece in _pieces(path, number)):
        most = FIRST_ROWS if len(found) == 1 else ROWS
        if found[-1] and rows + piece.rows > most:
            found.append([])
            rows = 0
        rows += piece.rows
        last = found[-1][-1] if found[-1] else None
        if last is not None and last.path == piece.path:
            found[-1][-1] = _together(last, piece)
        else:
            found[-1].append(piece)
    return [tuple(pieces) for pieces in found]


def _pieces(path: Path, number: int) -> list[Piece]:
    """Lines of a text file, or each row group of a Parquet file."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        stat = path.stat()
        stamp = (stat.st_size, stat.st_mtime_ns)
        if is_text(path):
            cuts = [0, *_cuts(path, stat.st_size), stat.st_size]
            return [
                Piece(path, number, first, (end - first) // BYTES_A_LINE, (), *stamp, end)
                for first, end in itertools.pairwise(cuts)
            ]
        about = pq.read_metadata(path)
    except (pa.ArrowException, OSError) as error:
        raise unreadable(path, error) from None
    found, first = [], 0
    for group in range(about.num_row_groups):
        rows = int(about.row_group(group).num_rows)
        found.append(Piece(path, number, first, rows, (group,), *stamp))
        first += rows
    return found


def _cuts(path: Path, size: int) -> list[int]:
    """Bytes at which lines of a text file begin, some way apart; none of a compressed one."""
    if path.suffix.lower() != ".csv":
        return []
    found: list[int] = []
    with path.open("rb") as file:
        for wanted in range(_TEXT_BYTES, size, _TEXT_BYTES):
            if found and found[-1] > wanted:
                continue
            file.seek(wanted)
            while step := file.read(_STEP):
                line_end = step.find(b"\n")
                if line_end >= 0:
                    found.append(file.tell() - len(step) + line_end + 1)
                    break
    return [cut for cut in found if cut < size]


@lru_cache(maxsize=1)
def _counted(path: Path, changed: int) -> list[tuple[int, int]]:
    """Bytes and lines before them as far as they were counted: parts are mostly read in their order."""
    return [(0, 0)]


def _lines_before(path: Path, byte: int, changed: int) -> int:
    known = _counted(path, changed)
    at, lines = max(pair for pair in known if pair[0] <= byte)
    with path.open("rb") as file:
        file.seek(at)
        while at < byte:
            step = file.read(min(_STEP, byte - at))
            if not step:
                break
            at, lines = at + len(step), lines + step.count(b"\n")
    known.append((at, lines))
    return lines


def _together(one: Piece, following: Piece) -> Piece:
    groups, rows = one.row_groups + following.row_groups, one.rows + following.rows
    return replace(one, rows=rows, row_groups=groups, end=following.end)
