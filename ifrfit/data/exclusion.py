"""Rows and impacts that the user wants left out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ifrfit.errors import UsageError

if TYPE_CHECKING:
    import pandas as pd

Mask = NDArray[np.bool_]


def excluded(table: pd.DataFrame, entries: Sequence[str | int]) -> Mask:
    """Return which rows the entries name: ``7`` or ``FILE:7`` is a line, ``id:7`` or other text an impact_id.

    Raises
    ------
    UsageError
        An entry names nothing, or could mean more than one thing.
    """
    out = np.zeros(len(table), dtype=bool)
    for entry in entries:
        out |= _named(table, str(entry).strip())
    return out


def _named(table: pd.DataFrame, entry: str) -> Mask:
    impacts = (table["impact_id"] == entry).to_numpy() & (entry != "")
    if entry.startswith("id:") and not impacts.any():
        impacts = (table["impact_id"] == entry[3:]).to_numpy()
        rows = np.zeros(len(table), dtype=bool)
    else:
        rows = _rows(table, entry)
    both = bool(rows.any() and impacts.any())
    if both and not np.array_equal(rows, impacts):
        name = table["source"].to_numpy()[rows][0]
        raise UsageError(
            f"--exclude {entry}: could be line {entry} or the impact called {entry}. Write {name}:{entry} "
            f"for the line, id:{entry} for the impact."
        )
    found = rows | impacts
    if not found.any():
        raise UsageError(
            f"--exclude {entry}: names no row and no impact of the data. Give the number of a line of the "
            "file, FILE:LINE, or an impact_id."
        )
    return found


def _rows(table: pd.DataFrame, entry: str) -> Mask:
    source, colon, number = entry.rpartition(":")
    if not number.isdecimal():
        return np.zeros(len(table), dtype=bool)
    here = (table["row"] == int(number)).to_numpy()
    if colon:
        # a path works as well as the name of the file, which is what the table keeps
        name = source.replace("\\", "/").rsplit("/", 1)[-1]
        return here & table["source"].isin([source, name]).to_numpy()
    sources = list(dict.fromkeys(table["source"].to_numpy()[here]))
    if len(sources) > 1:
        raise UsageError(
            f"--exclude {entry}: there is a line {entry} in {' and in '.join(sources)}. Write "
            f"{sources[0]}:{entry}."
        )
    return here
