"""Several readings of one figure: the same points clicked anew are one measurement, in whatever files."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

_DIGITISED = "digitised"
_FEWEST = 5  # points of a reading: fewer agree by chance
_CLOSE = 0.008  # of the range of angles and of values: some pixels of any figure
_SHARE = 0.8  # of the points of the smaller reading that the other has, too


@dataclass(frozen=True)
class RepeatReading:
    """A reading that has the points of an earlier one.

    Attributes
    ----------
    rows : (n,) int array
        Of the table, of the later one.
    said : str
        In words.
    """

    rows: NDArray[np.intp]
    said: str


def repeat_readings(table: pd.DataFrame) -> Iterator[RepeatReading]:
    """The readings whose points are those of an earlier one.

    Points are the same where angle and value agree within 0.8 % of their ranges, one for one. Series of one
    file and of several are compared, as far as their provenance is digitised and they are of one observable.

    Parameters
    ----------
    table : DataFrame
        In the common schema.
    """
    read_off = table["provenance"].to_numpy(dtype=object) == _DIGITISED
    if not read_off.any():
        return
    columns = [table[name].to_numpy(dtype=object) for name in ("observable", "source", "series")]
    readings: dict[tuple[str, str, str], list[int]] = {}
    for row in np.flatnonzero(read_off).tolist():
        readings.setdefault((columns[0][row], columns[1][row], columns[2][row]), []).append(row)
    places = np.column_stack([table[name].to_numpy(dtype=float) for name in ("gamma_deg", "value")])
    kept: list[tuple[tuple[str, str, str], NDArray[np.intp]]] = []
    for name, found in readings.items():
        rows = np.array(found)
        same = None
        for earlier, others in kept:
            if earlier[0] == name[0]:
                count = _same_points(places[others], places[rows])
                if count:
                    same = earlier, others, count
                    break
        if same is None:
            kept.append((name, rows))
            continue
        earlier, others, count = same
        yield RepeatReading(
            rows,
            f"{_called(name)} reads the points of {_called(earlier)} again ({count} of "
            f"{min(len(rows), len(others))} "
            f"agree in angle and value): it is one measurement and counts once, {_called(earlier)} is used. "
            "--independent counts both",
        )


def _called(name: tuple[str, str, str]) -> str:
    observable, source, series = name
    return f"{observable} of {series} in {source}"


def _same_points(one: NDArray[np.float64], other: NDArray[np.float64]) -> int:
    """How many points of two readings are the same; 0 where these are no readings of the same points."""
    from scipy.spatial import cKDTree

    one, other = (each[np.isfinite(each).all(axis=1)] for each in (one, other))
    fewer = min(len(one), len(other))
    if fewer < _FEWEST:
        return 0
    size = np.ptp(np.concatenate([one, other]), axis=0)
    scale = _CLOSE * np.where(size > 0.0, size, 1.0)
    few, many = (one, other) if len(one) == fewer else (other, one)
    distance, which = cKDTree(many / scale).query(few / scale, p=np.inf)
    near = distance <= 1.0
    count = len(np.unique(np.asarray(which)[near]))
    return count if count >= _SHARE * fewer else 0
