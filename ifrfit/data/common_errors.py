"""Columns of errors that rows have in common: `common1`, `common1_gamma_deg`, `common2`, and so on.

One number of them is one standard normal error z, the same for all rows: it moves each value by z times
`common1`, in the unit of the value, and each angle of incidence by z times `common1_gamma_deg`. So the clicks
that calibrate a figure move all its points, and so any covariance of values can be written.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

# without its unit, as headers are taken apart
_NAME = re.compile(r"common(?P<number>[1-9]\d{0,4})(?P<angle>_gamma)?")
_COLUMN = re.compile(r"common(?P<number>[1-9]\d{0,4})(?P<angle>_gamma_deg)?")
LARGEST_ANGLE = 45.0  # degrees by which one standard error may turn an angle

Array = NDArray[np.float64]


def of_value(number: int) -> str:
    """The column of what an error does to the values."""
    return f"common{number}"


def of_angle(number: int) -> str:
    """The column of what an error does to the angles of incidence, degrees."""
    return f"common{number}_gamma_deg"


def dimension_of(name: str) -> str | None:
    """number or angle, for the name of such a column without its unit; None for other names."""
    found = _NAME.fullmatch(name)
    if found is None:
        return None
    return "angle" if found["angle"] else "number"


def common_columns_in(names: Iterable[str]) -> list[str]:
    """Those names that are columns of common errors, by number."""
    likely = (name for name in names if str(name).startswith("common"))
    found = {name: match for name in likely if (match := _COLUMN.fullmatch(str(name))) is not None}
    return sorted(found, key=lambda name: (int(found[name]["number"]), found[name]["angle"] or ""))


def field_of(name: str) -> dict[str, str]:
    """A column of a common error, as a field of a Frictionless table schema."""
    moves = "the angle of incidence" if name.endswith("_gamma_deg") else "the value, in its unit"
    what = f"What one standard deviation of an error that rows have in common adds to {moves}."
    return {"name": name, "type": "number", "description": what}


def numbers_in(names: Iterable[str]) -> list[int]:
    """Numbers of the common errors that have a column among these, ascending."""
    matches = (_COLUMN.fullmatch(name) for name in common_columns_in(names))
    return sorted({int(match["number"]) for match in matches if match is not None})


def loadings_of(
    table: pd.DataFrame, numbers: Sequence[int] | None = None
) -> tuple[Array, Array, tuple[int, ...]]:
    """What each common error does to values and angles, (n, r) each, and its number.

    Without numbers they are those of all errors that move any row. Cells that are empty say that a row has no
    part in one.
    """
    every, numbers = numbers is None, numbers_in(table.columns.tolist()) if numbers is None else numbers
    value, angle = np.zeros((2, len(table), len(numbers)))
    if not numbers:
        return value, angle, ()
    for place, number in enumerate(numbers):
        for column, into in ((of_value(number), value), (of_angle(number), angle)):
            if column in table:
                into[:, place] = np.nan_to_num(table[column].to_numpy(dtype=float))
    acts = (value != 0.0).any(axis=0) | (angle != 0.0).any(axis=0) | (not every)
    kept = tuple(number for number, does in zip(numbers, acts, strict=True) if does)
    return value[:, acts], angle[:, acts], kept


def renumbered(table: pd.DataFrame, numbers: Mapping[int, int]) -> pd.DataFrame:
    """The table with other numbers for its common errors."""
    names: dict[str, str] = {}
    for old, new in numbers.items():
        names |= {of_value(old): of_value(new), of_angle(old): of_angle(new)}
    return table.rename(columns=names)
