"""Published constants of pairs of materials, with their printed errors, and those that a user adds.

The package's own stand in published_constants.csv beside this file, as they were printed. A file of the
same columns, ``materials.csv`` in the folder of the user's data, adds pairs, or replaces those of the same
names and geometry.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path

from ifrfit.data.catalogue import user_root
from ifrfit.errors import DataError, UsageError
from ifrfit.text import joined, meant

CONSTANTS = ("e_n", "beta0", "mu")
COLUMNS = (
    "body", "other", "geometry", "diameter_mm",
    *(name for constant in CONSTANTS for name in (constant, f"u_{constant}")),
    "provenance", "source",
)  # fmt: skip
_LARGEST = 1 << 20  # bytes of a file of pairs


@dataclass(frozen=True)
class Pair:
    """One row: two bodies, and what was printed of them.

    Attributes
    ----------
    body, other : str
        The sphere, and what it hit.
    geometry : str
        sphere-sphere or sphere-plate.
    diameter_mm : float
        Of the sphere; nan where it is not stated.
    values : mapping of str to (float, float)
        Constant to value and printed error.
    provenance, source : str
    """

    body: str
    other: str
    geometry: str
    diameter_mm: float
    values: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    provenance: str = "published"
    source: str = ""

    @property
    def name(self) -> str:
        """As ``--prior-from`` takes it."""
        return f"{self.body}/{self.other}"

    @property
    def words(self) -> str:
        """Constants with their errors."""
        return ", ".join(f"{name} {value:g} +- {error:g}" for name, (value, error) in self.values.items())


def user_file() -> Path:
    """Where a user's own pairs stand."""
    return user_root().parent / "materials.csv"


def all_pairs() -> tuple[Pair, ...]:
    """Pairs of the package, then those of the user, who replaces what has the same names and geometry.

    Raises
    ------
    DataError
        For a user's file that is broken: file and line are named.
    """
    own = str(files("ifrfit.data").joinpath("published_constants.csv").read_text(encoding="utf-8"))
    found = {(each.name, each.geometry): each for each in _read(own, "published_constants.csv")}
    place = user_file()
    if place.is_file():
        if place.stat().st_size > _LARGEST:
            raise DataError(f"{place}: it is larger than {_LARGEST} bytes, and no table of pairs.")
        try:
            text = place.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError):
            raise DataError(f"{place}: it cannot be read as text. Save it as CSV in UTF-8.") from None
        found |= {(each.name, each.geometry): each for each in _read(text, str(place))}
    return tuple(found.values())


def find_pair(name: str) -> Pair:
    """The pair of a name, ``BODY/OTHER`` in either order, with ``/GEOMETRY`` where there are several.

    Raises
    ------
    UsageError
        Where there is none, or more than one.
    """
    pairs = all_pairs()
    parts = [part.strip().lower() for part in name.split("/")]
    bodies, geometry = parts[:2], parts[2] if len(parts) > 2 else None
    found = [
        each
        for each in pairs
        if bodies in ([each.body.lower(), each.other.lower()], [each.other.lower(), each.body.lower()])
        and geometry in (None, each.geometry)
    ]
    if len(found) == 1:
        return found[0]
    if not found:
        names = list(dict.fromkeys(each.name for each in pairs))
        raise UsageError(
            f"There are no published constants of '{name}'. 'ifrfit materials list' shows the pairs; "
            f"your own go into {user_file()}.{meant(name, names)}"
        )
    choices = joined([f"{each.name}/{each.geometry}" for each in found], "or")
    raise UsageError(f"'{name}' was published more than once: name one of {choices}.")


def prior_values(pair: Pair, leave: tuple[str, ...] = ()) -> dict[str, tuple[float, float]]:
    """Constants of a pair as normal priors, but for those to leave out.

    Raises
    ------
    UsageError
        For a printed error of zero.
    """
    found = {name: both for name, both in pair.values.items() if name not in leave}
    for name, (value, error) in found.items():
        if error == 0.0:
            raise UsageError(
                f"--prior-from {pair.name}: {name} was printed as {value:g} with an error of 0, which is "
                "rounding and no certainty, so it is no prior. Say what you know of it: "
                f"--prior {name}={value:g},SD, or --fix {name}={value:g}."
            )
    return found


def _read(text: str, name: str) -> list[Pair]:
    reader = csv.reader(text.splitlines())
    header = next(reader, [])
    if tuple(header) != COLUMNS:
        raise DataError(f"{name}, line 1: the columns of a table of pairs are {','.join(COLUMNS)}.")
    found = []
    for cells in reader:
        if not cells:
            continue
        where = f"{name}, line {reader.line_num}"
        if len(cells) != len(COLUMNS):
            raise DataError(f"{where}: it has {len(cells)} cells instead of {len(COLUMNS)}.")
        row = {column: cell.strip() for column, cell in zip(COLUMNS, cells, strict=True)}
        for column in ("body", "other", "geometry", "source"):
            if not row[column] or ("/" in row[column] and column != "source"):
                raise DataError(
                    f"{where}, column {column}: '{row[column]}' is empty or holds a '/'. Name it."
                )
        values = {}
        for constant in CONSTANTS:
            if row[constant]:
                error = _number(row[f"u_{constant}"], where, f"u_{constant}")
                values[constant] = (_number(row[constant], where, constant), error)
        size = _number(row["diameter_mm"], where, "diameter_mm") if row["diameter_mm"] else math.nan
        found.append(
            Pair(row["body"], row["other"], row["geometry"], size, values, row["provenance"], row["source"])
        )
    return found


def _number(cell: str, where: str, column: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not (value >= 0.0 and math.isfinite(value)):
        raise DataError(f"{where}, column {column}: '{cell}' is not a number of 0 or more.")
    return value
