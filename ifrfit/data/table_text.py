"""Observations as a CSV file in the common schema, which `ifrfit.read` reads again."""

from __future__ import annotations

import contextlib
import uuid
from collections.abc import Sequence
from pathlib import Path

from ifrfit.data.common_errors import common_columns_in
from ifrfit.data.notes_in_text import calibration_line, note_lines
from ifrfit.data.observations import Observations
from ifrfit.data.schema import SCHEMA
from ifrfit.errors import DataError, UsageError

_DIGITS = "%.10g"


def table_text(observations: Observations, comments: Sequence[str] = ()) -> str:
    """A table as CSV: comments, notes, and the columns that hold anything.

    Parameters
    ----------
    observations : Observations
    comments : sequence of str
        Lines, without the ``#``.
    """
    table = observations.table
    filled = [
        name
        for name in (*SCHEMA, *common_columns_in(table.columns))
        if name in table
        and not (table[name].isna() | (table[name].astype(str) == "")).all()
        and not (name in ("spin_x", "spin_y") and (table[name] == 0.0).all())
    ]
    head = [f"# {' '.join(line.split())}" for line in comments] + note_lines(observations.notes)
    if observations.calibration:
        head.append(calibration_line(observations.calibration))
    body = table[filled].to_csv(index=False, float_format=_DIGITS, lineterminator="\n")
    return "\n".join([*head, str(body)])


def write_text(text: str, path: Path, *, force: bool = False) -> None:
    """Write a file that appears whole or not at all.

    Raises
    ------
    UsageError
        There is one already, and it is not to be replaced.
    DataError
        It cannot be written.
    """
    if path.is_dir():
        raise UsageError(f"--out {path}: this is a folder. Name a file in it.")
    if path.exists() and not force:
        raise UsageError(f"--out {path}: there is such a file already. Name another one, or add --force.")
    beside = path.with_name(f".{path.name}.{uuid.uuid4().hex[:8]}")
    try:
        beside.write_text(text, encoding="utf-8", newline="\n")
        beside.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            beside.unlink()
        raise DataError(f"{path}: cannot be written ({error.strerror}). Name another place.") from None
