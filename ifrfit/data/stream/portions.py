"""Files parted into portions, each read on its own: some files, or some row groups of one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ifrfit.data.stream.files import BYTES_A_LINE, is_text, unreadable
from ifrfit.errors import DataError

FIRST_ROWS = 400_000  # of the first portion, which tells where to look closely in all others
ROWS = 2_000_000  # of each other portion: seconds of work, unless a row group or a text file is longer


@dataclass(frozen=True)
class Piece:
    """A file, or some row groups of it.

    Attributes
    ----------
    path : Path
    number : int
        Of the file, in the order of the names.
    first : int
        Row of the file with which it begins.
    rows : int
        How many there are; of text a guess from the size.
    row_groups : tuple of int
        Of a Parquet file; empty for text, which is read whole.
    size, changed : int
        Bytes of the file, and when it was written (ns): what is read is what was parted.
    """

    path: Path
    number: int
    first: int
    rows: int
    row_groups: tuple[int, ...]
    size: int
    changed: int

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
    """A text file, or each row group of a Parquet file."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        stat = path.stat()
        stamp = (stat.st_size, stat.st_mtime_ns)
        if is_text(path):
            return [Piece(path, number, 0, stat.st_size // BYTES_A_LINE, (), *stamp)]
        about = pq.read_metadata(path)
    except (pa.ArrowException, OSError) as error:
        raise unreadable(path, error) from None
    found, first = [], 0
    for group in range(about.num_row_groups):
        rows = int(about.row_group(group).num_rows)
        found.append(Piece(path, number, first, rows, (group,), *stamp))
        first += rows
    return found


def _together(one: Piece, following: Piece) -> Piece:
    groups = one.row_groups + following.row_groups
    return Piece(one.path, one.number, one.first, one.rows + following.rows, groups, one.size, one.changed)
