"""The tables of a folder, whoever reads them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ifrfit.data.cell_table import Cells
from ifrfit.errors import DataError, UsageError

_SUFFIXES = (".csv", ".tsv", ".parquet")
_PACKED = (".gz", ".zst")
_ROUNDING = 1e-6  # relative, to which a number is the one that another file has: text may have been rounded


def path_of(name: str | Path) -> Path:
    """The path of a name that somebody gave.

    Raises
    ------
    UsageError
        For an empty one, of which a path would be the folder one is in.
    """
    if not str(name).strip():
        raise UsageError("An empty name stands for no data. Name a file or a dataset, or . for this folder.")
    return Path(name)


def table_files(paths: Sequence[Path]) -> list[Path]:
    """The files named, and those of the folders named, with their folders, in the order of their names.

    Raises
    ------
    DataError
        A path does not exist, or there is no CSV, TSV or Parquet file in a folder.
    """
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            inside = tables_in(path, _SUFFIXES)
            if not inside:
                raise DataError(f"{path}: there is no CSV, TSV or Parquet file in this folder.")
            found += inside
        elif path.exists():
            found.append(path)
        else:
            raise DataError(f"{path}: there is no such file or folder. Check the name.")
    return list(dict.fromkeys(found))


def tables_in(folder: Path, suffixes: Sequence[str]) -> list[Path]:
    """Files of the folder and of those in it, by name, but for those that begin with . or _ or lie in such.

    Parameters
    ----------
    folder : Path
    suffixes : sequence of str
        Ends of the names that count, in small letters.
    """
    return sorted(
        path
        for path in folder.rglob("*")
        if path.name.lower().endswith(tuple(suffixes))
        and path.is_file()
        and not any(part.startswith((".", "_")) for part in path.relative_to(folder).parts)
    )


def possible_duplicates(files: Sequence[Path]) -> list[tuple[Path, Path]]:
    """Pairs of files that differ by folder and kind alone, as a.csv and a.parquet: perhaps the same rows."""
    by_stem: dict[str, list[Path]] = {}
    for path in files:
        by_stem.setdefault(_stem_and_kind(path)[0], []).append(path)
    return [
        (one, other)
        for alike in by_stem.values()
        for number, other in enumerate(alike)
        for one in alike[:number]
        if _stem_and_kind(one)[1] != _stem_and_kind(other)[1]
    ]


def same_rows(one: Cells, other: Cells) -> bool:
    """Whether two tables have the same numbers in the columns that both have, as far as both go."""
    n = min(len(one), len(other))
    common = [name for name in one.headers if name in other.headers]
    compared = False
    for name in common:
        try:
            ours, theirs = (cells.numbers(cells.headers.index(name))[:n] for cells in (one, other))
        except DataError:
            continue  # of text
        if not np.allclose(ours, theirs, rtol=_ROUNDING, atol=0.0, equal_nan=True):
            return False
        compared = True
    return compared and n > 0


def _stem_and_kind(path: Path) -> tuple[str, str]:
    name, kind = path, ""
    if path.suffix.lower() in _PACKED:
        name, kind = path.with_suffix(""), path.suffix.lower()
    return name.stem, name.suffix.lower() + kind
