"""Files of tables that are read some rows at a time: which they are, and how much they hold."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ifrfit.data.table_folders import tables_in
from ifrfit.errors import DataError, UsageError

if TYPE_CHECKING:
    import pyarrow as pa

LARGE_ROWS, LARGE_BYTES = 500_000, 50_000_000  # of a file that is streamed unasked
BYTES_A_LINE = 50  # of text, roughly
_SUFFIXES = (".parquet", ".csv", ".csv.gz", ".csv.zst")
_PACKED = {".gz": "gzip", ".zst": "zstd"}


class NotStreamableError(UsageError):
    """The table is one for the reader that holds it in memory."""


def stream_files(path: Path) -> list[Path]:
    """The file, or the tables of a folder and of those in it, in the order of their names.

    Raises
    ------
    DataError
        There is none.
    """
    if not path.is_dir():
        return [path]
    found = tables_in(path, _SUFFIXES)
    if not found:
        raise DataError(f"{path}: there is no Parquet or CSV file in this folder.")
    return found


def is_stream(path: Path) -> bool:
    """Whether a path is data that are streamed: a folder of tables, or a file too large to hold gladly."""
    if path.is_dir():
        return not (path / "datapackage.json").exists()
    if not path.is_file():
        return False
    name = path.name.lower()
    if name.endswith((".csv.gz", ".csv.zst")):
        return True
    if name.endswith(".csv"):
        return path.stat().st_size > LARGE_BYTES
    if not name.endswith(".parquet") or path.stat().st_size < LARGE_ROWS:
        return False
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return int(pq.read_metadata(path).num_rows) >= LARGE_ROWS
    except (pa.ArrowException, OSError):
        return False  # the reader that holds it in memory says what is wrong


def is_text(path: Path) -> bool:
    """Whether a table is CSV, compressed or not."""
    return path.name.lower().endswith((".csv", ".csv.gz", ".csv.zst"))


def opened_text(path: Path) -> pa.NativeFile:
    """A file of text, unpacked by its suffix, which may be in capitals."""
    import pyarrow as pa

    return pa.input_stream(str(path), compression=_PACKED.get(path.suffix.lower()))


def unreadable(path: Path, error: Exception) -> DataError:
    """What is said of a file that cannot be read."""
    reason = str(error).splitlines()[0] if str(error) else "damaged"
    return DataError(f"{path}: cannot be read ({reason:.150}). Write it again.")


def has_rows(path: Path) -> bool:
    """Whether a table has more than a header, or cannot be read, which is said when it is read."""
    import pyarrow as pa

    if not is_text(path):
        return True
    try:
        with opened_text(path) as file:
            lines = file.read(1 << 16).splitlines()
    except (pa.ArrowException, OSError):
        return True
    return any(line.strip() for line in lines[1:])


def refuse_copies(files: Sequence[Path]) -> None:
    """Refuse files of the same bytes: their impacts would count twice.

    Raises
    ------
    DataError
        With both names.
    """
    by_size: dict[int, list[Path]] = {}
    for path in files:
        with contextlib.suppress(OSError):  # said when it is read
            by_size.setdefault(path.stat().st_size, []).append(path)
    for alike in by_size.values():
        seen: dict[str, Path] = {}
        for path in alike if len(alike) > 1 else ():
            try:
                with path.open("rb") as file:
                    digest = hashlib.file_digest(file, "sha256").hexdigest()
            except OSError:
                continue
            if digest in seen and has_rows(path):
                raise DataError(
                    f"{path}: the same data as {seen[digest].name}, and would be counted twice. Remove one."
                )
            seen[digest] = path
