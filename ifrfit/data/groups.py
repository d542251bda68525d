"""Tables of many files as groups: the rows that share the text of some columns."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ifrfit.data.cell_table import CellColumn, Cells, UnreadableKindError
from ifrfit.data.column_names import role_of
from ifrfit.data.conventions import Conventions
from ifrfit.data.readers import read_table
from ifrfit.data.table_folders import possible_duplicates, same_rows
from ifrfit.errors import DataError, UsageError
from ifrfit.text import joined

FILE = "file"  # stands for the name of the file among the columns that groups are formed by
_NO_CHANCE = 3  # rows that stand alike in two files of other groups for no other reason than a copy


@dataclass(frozen=True)
class Group:
    """The rows that share a key.

    Attributes
    ----------
    key : tuple of str
        Text of each column that groups are formed by.
    tables : tuple of Cells
        Its rows of each file that holds some.
    trouble : str
        Why it is not whole; empty where it is.
    """

    key: tuple[str, ...]
    tables: tuple[Cells, ...]
    trouble: str = ""

    @property
    def rows(self) -> int:
        """How many rows of the files it has."""
        return sum(map(len, self.tables))

    @property
    def files(self) -> tuple[str, ...]:
        """Names of the files, without their folders."""
        return tuple(table.name for table in self.tables)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of what its cells say, and where they stand."""
        found = hashlib.sha256()
        for table in self.tables:
            found.update(repr((table.name, table.headers, table.decimal_commas)).encode())
            found.update(table.lines.tobytes())
            for column in table.columns:
                if isinstance(column, np.ndarray):
                    found.update(column.tobytes())
                else:
                    found.update(repr(column if isinstance(column, DataError) else list(column)).encode())
        return found.hexdigest()


@dataclass(frozen=True)
class RefusedFile:
    """A file without groups, and why."""

    name: str
    reason: str


@dataclass(frozen=True)
class GroupedFiles:
    """Files whose rows are put into groups.

    Attributes
    ----------
    files : tuple of Path
    by : tuple of str
        Columns as they are called in the files; a folder ``NAME=VALUE`` is a column, too, and `FILE` stands
        for the name of the file, see `file_names`.
    conventions : Conventions
    roots : tuple of Path
        The files and folders that were named, which names of files are relative to.
    """

    files: tuple[Path, ...]
    by: tuple[str, ...]
    conventions: Conventions
    roots: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        twice = [name for name, count in Counter(self.by).items() if count > 1]
        if not self.by or twice:
            said = f"{twice[0]} is given twice" if twice else "name a column"
            raise UsageError(f"--by: {said}, as --by material,wall.")

    @property
    def is_by_file(self) -> bool:
        """Whether no group can have rows of two files, unless they have a column of that name."""
        return len(self.files) == 1 or FILE in self.by

    @cached_property
    def file_names(self) -> dict[Path, str]:
        """What each file is called as a key."""
        parts = {path: tuple(_folders(path).get(name) for name in self.by) for path in self.files}
        return _file_names(self.files, self.roots, parts)

    def groups(self) -> Iterator[Group | RefusedFile]:
        """Each group when the last of its files was read, and each file that is refused.

        A group of several files waits for them: files are read twice then, once for the keys alone.

        Raises
        ------
        UsageError
            No file has the columns.
        """
        last: dict[tuple[str, ...], int] = {}
        before: dict[Path, tuple[str, set[tuple[str, ...]]]] = {}
        if not self.is_by_file:
            for number, path in enumerate(self.files):
                try:
                    cells = read_table(path, self.conventions)
                    keys = self._rows_by_key(cells, path)
                    before[path] = cells.sha256, set(keys)
                    last |= dict.fromkeys(keys, number)
                except DataError:
                    continue  # it is refused when its turn comes
        yield from self._read(last, before)

    def _read(
        self, last: dict[tuple[str, ...], int], before: dict[Path, tuple[str, set[tuple[str, ...]]]]
    ) -> Iterator[Group | RefusedFile]:
        waiting: dict[tuple[str, ...], Group] = {}
        refused: list[RefusedFile] = []
        without: list[str] = []
        formed: set[tuple[str, ...]] = set()
        twins = possible_duplicates(self.files)
        seen: dict[Path, Cells] = {}
        by_bytes: dict[str, tuple[Path, set[tuple[str, ...]]]] = {}
        for number, path in enumerate(self.files):
            try:
                cells = read_table(path, self.conventions)
                keyed = self._rows_by_key(cells, path)
                first = by_bytes.setdefault(cells.sha256, (path, set(keyed)))
                if first[0] != path and keyed and (len(cells) >= _NO_CHANCE or first[1] & set(keyed)):
                    raise _CopyError(
                        f"{path}: the same data as {first[0]}, and would be counted twice. Remove one of "
                        "them."
                    )
                if any(path in pair for pair in twins):
                    _refuse_seen(
                        cells, path, [seen[one] for one, two in twins if two == path and one in seen]
                    )
                    seen[path] = cells
                if self.is_by_file and (common := sorted(formed & set(keyed))):
                    raise DataError(
                        f"{path}: its column {FILE} names a group of an earlier file, "
                        f"{', '.join(common[0])}, and --by {FILE} takes each file by itself. Rename the "
                        "column, and name it in --by."
                    )
            except DataError as error:
                if isinstance(error, _ColumnMissingError):
                    without.append(error.in_shell)
                if isinstance(error, _CopyError):  # no group waits for its rows
                    before.pop(path, None)
                refused.append(RefusedFile(path.name, error.in_shell))
                keyed, cells = {}, None
            if len(without) == len(self.files):
                raise UsageError(without[0])
            if keyed:
                yield from refused
                refused = []
            sha256, expected = before.get(path, ("", set()))
            if expected and (cells is None or cells.sha256 != sha256):
                # what was read of its groups is not what was counted on
                for key in expected | set(keyed):
                    group = waiting.get(key, Group(key, ()))
                    waiting[key] = replace(group, trouble=f"{path}: {_CHANGED}")
            if cells is not None:
                for key, table in zip(keyed, _parted(cells, list(keyed.values())), strict=True):
                    group = waiting.get(key, Group(key, ()))
                    waiting[key] = Group(key, (*group.tables, table), group.trouble)
            over = [key for key in waiting if last.get(key, number) <= number]
            for key in over:
                formed.add(key)
                yield waiting.pop(key)
        yield from refused

    def _rows_by_key(self, cells: Cells, path: Path) -> dict[tuple[str, ...], NDArray[np.intp]]:
        """Rows of each key, in the order in which the keys first occur."""
        folders = _folders(path)
        columns: list[list[str]] = []
        for name in self.by:
            if name in cells.headers:
                columns.append(_key_texts(cells, name))
            elif name == FILE:
                columns.append([self.file_names[path]] * len(cells))
            elif name in folders:
                columns.append([folders[name]] * len(cells))
            else:
                raise _ColumnMissingError(
                    f"--by {name}: {path} has no such column. It has {joined(cells.headers)}; {FILE} stands "
                    "for the name of the file."
                )
        if not len(cells):
            return {}
        texts = pd.DataFrame(dict(enumerate(columns)), dtype=object)
        group = texts.groupby(list(texts), sort=False).ngroup().to_numpy()
        order = np.argsort(group, kind="stable")
        rows_of = np.split(order, np.cumsum(np.bincount(group))[:-1])
        return {tuple(column[rows[0]] for column in columns): rows for rows in rows_of}

    def conventions_of(self, cells: Cells) -> Conventions:
        """The conventions, under which columns that form groups and measure nothing are passed over."""
        named = self.conventions.headers
        labels = tuple(
            name
            for name in self.by
            if name in cells.headers and name not in named and role_of(name).kind == "unknown"
        )
        return replace(self.conventions, ignored=(*self.conventions.ignored, *labels))


def _folders(path: Path) -> dict[str, str]:
    """The columns that its folders are: their values by their names."""
    return dict(part.split("=", 1) for part in path.parts[:-1] if part.count("=") == 1)


def _file_names(
    files: Sequence[Path], roots: Sequence[Path], others: Mapping[Path, object]
) -> dict[Path, str]:
    """Names that tell files apart, beside the `others` of their keys, made the same way for all of them.

    Without folder and suffix where these are unique; else with the folders below what was named, without the
    suffix where that tells them; else with it; else, of several folders named, the whole path.
    """
    below = {path: _below(path, roots) for path in files}
    ways: tuple[Callable[[Path], str], ...] = (
        lambda path: path.stem,
        lambda path: below[path].with_suffix("").as_posix(),
        lambda path: below[path].as_posix(),
    )
    for way in ways:
        names = {path: way(path) for path in files}
        if len({(others[path], name) for path, name in names.items()}) == len(names):
            return names
    return {path: path.as_posix() for path in files}


def _below(path: Path, roots: Sequence[Path]) -> Path:
    """The path below the folder that was named, the longest of several."""
    inside = [root for root in roots if root != path and path.is_relative_to(root)]
    return path.relative_to(max(inside, key=lambda root: len(root.parts))) if inside else Path(path.name)


def _key_texts(cells: Cells, name: str) -> list[str]:
    """The cells of a column that forms groups, without blanks around.

    Raises
    ------
    DataError
        It holds neither numbers nor text.
    """
    column = cells.columns[cells.headers.index(name)]
    if isinstance(column, UnreadableKindError):
        raise DataError(
            f"{cells.file}, column {name}: holds {column.kind}, and groups are formed by text or numbers. "
            f"Write it as text, or leave {name} out of --by."
        )
    return cells.texts(cells.headers.index(name))


def _refuse_seen(cells: Cells, path: Path, others: Sequence[Cells]) -> None:
    """Refuse a file of the rows of another one."""
    for other in others:
        if len(other) == len(cells) and same_rows(other, cells):
            raise _CopyError(
                f"{path}: has the rows of {other.name}, which would be counted twice. Remove one of them."
            )


class _CopyError(DataError):
    """A file has the rows of another one."""


class _ColumnMissingError(DataError):
    """A file lacks a column that groups are formed by."""


_CHANGED = "the file was changed while it was read. Run the command again."


def _parted(cells: Cells, parts: Sequence[NDArray[np.intp]]) -> Iterator[Cells]:
    """Tables of some rows each, whose arrays are views of one that has them in order."""
    if len(parts) == 1 and parts[0].size == len(cells):
        yield cells
        return
    order = np.concatenate([*parts, np.zeros(0, dtype=np.intp)])

    def ordered(column: CellColumn | DataError) -> CellColumn | DataError:
        if isinstance(column, DataError):
            return column
        if isinstance(column, np.ndarray):
            return np.asarray(column[order])
        unpacked = list(column)  # `TextColumn` would unpack them for each
        return [unpacked[row] for row in order.tolist()]

    lines, columns = cells.lines[order], [ordered(column) for column in cells.columns]
    first = 0
    for part in parts:
        rows = slice(first, first + part.size)
        own = [column if isinstance(column, DataError) else column[rows] for column in columns]
        yield replace(cells, lines=lines[rows], columns=own)
        first = rows.stop
