"""A figure as a digitiser keeps it: axes, and the points that were read off, by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.figures.calibration import Calibration
from ifrfit.errors import DataError


@dataclass(frozen=True)
class FigureAxes:
    """One pair of axes.

    Attributes
    ----------
    name : str
    calibrate : callable or None
        Gives the `Calibration`, or raises the DataError that says why there is none: axes that nobody asks
        for may be what they like. None where points are kept as values, without pixels.
    """

    name: str
    calibrate: Callable[[], Calibration] | None = None


@dataclass(frozen=True)
class Bar:
    """Ends of error bars, one for each point.

    Attributes
    ----------
    name : str
    points : (n, 2) float array
        Pixels; nan where a point has none.
    """

    name: str
    points: NDArray[np.float64]


@dataclass(frozen=True)
class PointSet:
    """Points that were read off one pair of axes.

    Attributes
    ----------
    name : str
        Of the dataset or curve in the digitiser; empty where it has none.
    axes : str
        Name of its axes.
    points : (n, 2) float array
        Pixels; values where the axes have no calibration.
    notes : tuple of str
        What of the dataset was left out, and why.
    bars : tuple of Bar
        Ends of error bars, as far as the file ties them to the points.
    """

    name: str
    axes: str
    points: NDArray[np.float64]
    notes: tuple[str, ...] = ()
    bars: tuple[Bar, ...] = ()


@dataclass(frozen=True)
class DigitisedFigure:
    """What a file of a digitiser holds.

    Attributes
    ----------
    program : str
        That wrote it, with the version of its format.
    axes : tuple of FigureAxes
    sets : tuple of PointSet
    """

    program: str
    axes: tuple[FigureAxes, ...]
    sets: tuple[PointSet, ...]


@runtime_checkable
class FigureImporter(Protocol):
    """What reads the files of one digitiser."""

    @property
    def name(self) -> str:
        """Its name in the registry."""

    @property
    def title(self) -> str:
        """As it is called in messages."""

    @property
    def has_pixels(self) -> bool:
        """Whether its files say where the clicks were.

        The others are tables of values, and taken for a figure only where that is said.
        """

    def recognises(self, head: bytes) -> bool:
        """Whether the first 512 bytes of a file look like one of its files."""

    def read(self, raw: bytes, file: str) -> DigitisedFigure:
        """What the file holds.

        Raises
        ------
        DataError
            With the file, the place in it, and what to do.
        """


@dataclass(frozen=True)
class FileImporter:
    """An importer made of functions; see `FigureImporter`."""

    name: str
    title: str
    has_pixels: bool
    recognised_by: Callable[[bytes], bool] = field(repr=False)
    read_by: Callable[[bytes, str], DigitisedFigure] = field(repr=False)

    def recognises(self, head: bytes) -> bool:
        """Whether a file that begins so looks like one of its files."""
        return self.recognised_by(head)

    def read(self, raw: bytes, file: str) -> DigitisedFigure:
        """What the file holds."""
        return self.read_by(raw, file)


MOST_POINTS = 100_000  # of a dataset: nobody clicks more, and files that claim more are damaged


def points_of(pairs: Sequence[tuple[float, float]], place: str) -> NDArray[np.float64]:
    """Positions as an array.

    Raises
    ------
    DataError
        For more of them than anybody clicks.
    """
    if len(pairs) > MOST_POINTS:
        raise DataError(f"{place}: holds {len(pairs):,} points, the most that are read are {MOST_POINTS:,}.")
    return np.array(pairs, dtype=np.float64).reshape(-1, 2)
