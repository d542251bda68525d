"""Options about figures and sheets where several files are given: which of these each is about."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ifrfit.data.figures.question import KEYS
from ifrfit.data.sheets import is_spreadsheet
from ifrfit.errors import UsageError

_SHEET = "sheet"
_HEAD = 512  # bytes


def conventions_of(file: str | Path, files: Sequence[str | Path], convention: Sequence[str]) -> list[str]:
    """The conventions of one of several files.

    Those about figures or sheets may say of which file they are, ``axes=figure.json:XY``, by its path or its
    name. Without that they are about the file where there is one alone; of several about all projects of
    digitisers, or all spreadsheets, among them; where there are no projects, about all files.

    Parameters
    ----------
    file : str or Path
    files : sequence of str or Path
        All of the command.
    convention : sequence of ``NAME=CHOICE``

    Raises
    ------
    UsageError
        One is about a file that is not among them.
    """
    found = []
    for text in convention:
        key, _, choice = text.partition("=")
        if key.strip() not in (*KEYS, _SHEET):
            found.append(text)
            continue
        of, colon, rest = choice.partition(":")
        named = [each for each in files if of.strip() in (str(each), Path(each).name)] if colon else []
        if colon and not named and Path(of.strip()).suffix and Path(of.strip()).exists():
            raise UsageError(
                f"--{key.strip()} {choice}: {of.strip()} is not among the data. They are "
                f"{', '.join(str(each) for each in files)}."
            )
        if named:
            if any(Path(each) == Path(file) for each in named):
                found.append(f"{key.strip()}={rest.strip()}")
        elif len(files) == 1 or _is_about(key.strip(), file, files):
            found.append(text)
    return found


def _is_about(key: str, file: str | Path, files: Sequence[str | Path]) -> bool:
    """Whether an option that names no file is about one of several."""
    if key == _SHEET:
        sheets = [each for each in files if is_spreadsheet(_head(each))]
        return not sheets or file in sheets
    from ifrfit.data.figures.importers import importer_of

    projects = [each for each in files if importer_of(_head(each), as_points=False) is not None]
    return not projects or file in projects


def _head(file: str | Path) -> bytes:
    try:
        with Path(file).open("rb") as opened:
            return opened.read(_HEAD)
    except (OSError, ValueError):
        return b""
