"""The tables of a folder, whoever reads them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path


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
