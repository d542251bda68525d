"""Tables of tracks: one frame a line, one impact a run."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.cell_table import Cells, show
from ifrfit.data.conventions import Conventions, suggest
from ifrfit.data.tabular import read_cells
from ifrfit.data.tracks.track import AXES, NORMAL, FloatArray, Track
from ifrfit.data.tracks.track_headers import header_key, header_unit
from ifrfit.errors import DataError, UsageError
from ifrfit.text import joined

_LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "\u00b5m": 1e-6, "\u03bcm": 1e-6}
_PIXELS = ("px", "pixel", "pixels", "pix")
_UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "\u00b5s": 1e-6, "\u03bcs": 1e-6},
    "angle": {"rad": 1.0, "deg": math.pi / 180.0, "\u00b0": math.pi / 180.0, "degrees": math.pi / 180.0},
    "length": _LENGTHS,
}
_FARTHEST = 1e6  # m
_LATEST = 1e12  # s; clocks count from 1970
_QUANTITY = re.compile(r"(?P<number>[0-9.]+(?:[eE][+-]?\d+)?)\s*(?P<unit>[a-z\u00b5\u03bc]*)")


def quantity(option: str, text: str | float | None, dimension: str) -> float | None:
    """A length or a time in SI units: a number, or text such as ``0.1mm``.

    Raises
    ------
    UsageError
        It is not positive, or has no known unit.
    """
    if text is None:
        return None
    units = _UNITS[dimension]
    match = _QUANTITY.fullmatch(str(text).strip()) if isinstance(text, str) else None
    try:
        found = float(match["number"]) * units[match["unit"]] if match else float(text)
    except (ValueError, KeyError, TypeError):
        found = math.nan
    if (isinstance(text, str) and match is None) or not (
        math.isfinite(found) and (found > 0.0 or (found == 0.0 and dimension == "time"))
    ):
        unit = "mm" if dimension == "length" else "ms"
        raise UsageError(
            f"{option} {text}: write a positive {dimension} with its unit, as {option} 0.1{unit}; known are "
            f"{', '.join(each for each in units if each.isascii())}."
        )
    return found


@dataclass(frozen=True)
class _Column:
    """A column: what it holds (``time``, ``x``, ``sigma:x``, ...), and its unit as written."""

    index: int
    header: str
    key: str
    unit: str


def read_track_table(
    path: Path, *, conventions: Conventions, fps: float | None = None, pixel: float | None = None
) -> tuple[list[Track], Cells]:
    """The runs of a table, in the order of the file.

    Parameters
    ----------
    path : Path
    conventions : Conventions
        ``ignore`` and ``sheet`` of them.
    fps : float or None
        Frames in a second, where the table numbers frames.
    pixel : float or None
        m, of positions in pixels.

    Raises
    ------
    DataError, UsageError
        A column is missing, unknown or without a unit, or time does not increase.
    """
    cells = read_track_cells(path, conventions)
    columns = _columns(cells, conventions)
    time = _time(cells, columns, fps)
    positions = {axis: _lengths(cells, columns, axis, pixel) for axis in AXES if axis in columns}
    sigmas = {
        axis: _lengths(cells, columns, f"sigma:{axis}", pixel) for axis in AXES if f"sigma:{axis}" in columns
    }
    angle = _numbers(cells, columns, "angle", "angle") if "angle" in columns else None
    if "sigma:angle" in columns:
        sigmas["angle"] = _numbers(cells, columns, "sigma:angle", "angle")
    _refuse_sigmas(cells, columns, sigmas)
    _refuse_beyond(cells, columns["time" if "time" in columns else "frame"], time, _LATEST)
    for axis, values in positions.items():
        _refuse_beyond(cells, columns[axis], values, _FARTHEST)
    names = cells.texts(columns["run"].index) if "run" in columns else [""] * len(cells)
    series = cells.texts(columns["series"].index) if "series" in columns else [""] * len(cells)
    seen = ~np.isnan(np.column_stack([time, *positions.values()])).any(axis=1)
    runs: dict[tuple[str, str], list[int]] = {}
    for row in np.flatnonzero(seen).tolist():
        runs.setdefault((series[row], names[row]), []).append(row)
    if not runs:
        raise DataError(f"{cells.file}: no line has a time and a position. Check the columns.")
    return [
        _track(cells, columns, time, positions, sigmas, angle, key, rows) for key, rows in runs.items()
    ], cells


def read_track_cells(path: Path, conventions: Conventions) -> Cells:
    """The cells of a table of tracks."""
    passed = conventions.mentioned
    return read_cells(path, lambda text: text.strip() in passed or header_key(text) != "", conventions.sheet)


def track_columns(cells: Cells, conventions: Conventions) -> list[str]:
    """How each column is understood, in words."""
    words = {
        "time": "the time of a frame",
        "frame": "the number of a frame",
        "run": "the run",
        "series": "the series",
    }
    words |= {
        "angle": "the angle of a mark, from x towards z",
        "x": "along the wall",
        "y": "across",
        NORMAL: "normal to the wall",
    }
    found = []
    for each in _columns(cells, conventions).values():
        of = each.key.removeprefix("sigma:")
        text = words[of] if of == each.key else f"the standard error of {of}"
        found.append(f"column '{each.header}' is {text}" + (f" ({each.unit})" if each.unit else ""))
    return found


def _columns(cells: Cells, conventions: Conventions) -> dict[str, _Column]:
    passed = conventions.ignores(cells.headers)
    found: dict[str, _Column] = {}
    unknown = []
    for index, header in enumerate(cells.headers):
        if header in passed:
            continue
        key = header_key(header)
        if not key or key in ("sigma:run", "sigma:frame", "sigma:series", "sigma:time"):
            unknown.append(header)
            continue
        if key in found:
            raise DataError(
                f"{cells.file}: the columns {found[key].header} and {header} both give {key}. Remove one."
            )
        unit = header_unit(header)
        found[key] = _Column(index, header, key, unit)
    if unknown:
        raise DataError(
            f"{cells.file}, line {cells.header_line}: a table of tracks has no use for "
            f"{joined(unknown[:4])}. Known are "
            f"t or frame, x, z, y, run, angle, their sigma_x, sigma_z, ..., and series. Rename it, or "
            f"leave it out, "
            f"{suggest('ignore=' + unknown[0])}."
        )
    for axis, about in (("x", "along the wall"), (NORMAL, "normal to the wall")):
        if axis not in found:
            hint = " Call the column y so, if that is it." if axis == NORMAL and "y" in found else ""
            raise DataError(
                f"{cells.file}: there is no column {axis}, the coordinate {about}.{hint or ' Add it.'}"
            )
    return found


def _time(cells: Cells, columns: Mapping[str, _Column], fps: float | None) -> FloatArray:
    """Seconds."""
    if "time" in columns and (fps is None or "frame" not in columns):
        if fps is not None:
            raise UsageError(
                f"--fps: {cells.file} gives times, in the column {columns['time'].header}. Leave it away."
            )
        return _numbers(cells, columns, "time", "time")
    if "frame" not in columns:
        raise DataError(f"{cells.file}: there is no time. Add a column t [s], or frame and --fps.")
    if fps is None:
        raise UsageError(
            f"--fps: {cells.file} numbers frames. Say how many there are in a second, as --fps 1000."
        )
    if not (math.isfinite(fps) and fps > 0.0):
        raise UsageError(f"--fps {fps:g}: the frames in a second must be a positive number, such as 1000.")
    if "time" in columns:
        raise DataError(
            f"{cells.file}: time is given twice, by t and by frame. Leave one out, {suggest('ignore=t')}."
        )
    return cells.numbers(columns["frame"].index) / fps


def _numbers(cells: Cells, columns: Mapping[str, _Column], key: str, dimension: str) -> FloatArray:
    column, units = columns[key], _UNITS[dimension]
    unit = column.unit or (columns[key.removeprefix("sigma:")].unit if key.startswith("sigma:") else "")
    factor = units.get(unit) or units.get(unit.lower())
    if factor is None:
        said = f"the unit {show(unit)} does not fit here" if unit else "no unit"
        first = next(iter(units))
        raise DataError(
            f"{cells.at(header=column.header)}: {said}. Put one into the header, as "
            f"{column.key[-5:].strip(':')} "
            f"[{first}]; known are {', '.join(each for each in units if each.isascii())}."
        )
    return cells.numbers(column.index) * factor


def _lengths(cells: Cells, columns: Mapping[str, _Column], key: str, pixel: float | None) -> FloatArray:
    column = columns[key]
    unit = column.unit or (
        columns[key.removeprefix("sigma:")].unit
        if key.startswith("sigma:") and key.removeprefix("sigma:") in columns
        else ""
    )
    if unit.lower() not in _PIXELS:
        return _numbers(cells, columns, key, "length")
    if pixel is None:
        raise UsageError(
            f"--pixel: {cells.file} has positions in pixels, in the column {column.header}. Say how large "
            f"one is in the "
            "plane of the motion, as --pixel 0.1mm."
        )
    return cells.numbers(column.index) * pixel


def _refuse_beyond(cells: Cells, column: _Column, values: FloatArray, most: float) -> None:
    """Refuse what no camera sees before it is squared."""
    cells.refuse_first(
        np.abs(values) > most,
        column.header,
        lambda row: f"{values[row]:g} in SI units is beyond what a camera sees. Correct it.",
    )


def _refuse_sigmas(cells: Cells, columns: Mapping[str, _Column], sigmas: Mapping[str, FloatArray]) -> None:
    lacking = [axis for axis in AXES if axis in columns and axis not in sigmas]
    if lacking and any(axis in sigmas for axis in AXES):
        raise DataError(
            f"{cells.file}: gives the error of {joined([a for a in AXES if a in sigmas])}, but not of "
            f"{joined(lacking)}. Give that of every coordinate, or of none."
        )
    for key, values in sigmas.items():
        header = columns[f"sigma:{key}"].header
        if key not in columns:
            raise DataError(
                f"{cells.at(header=header)}: the uncertainty of {key}, which the table does not have. "
                f"Remove it."
            )
        cells.refuse_first(
            ~(values > 0.0),
            header,
            lambda row: "a standard error of a position is a positive number. Give it.",
        )


def _track(
    cells: Cells,
    columns: Mapping[str, _Column],
    time: FloatArray,
    positions: Mapping[str, FloatArray],
    sigmas: Mapping[str, FloatArray],
    angle: FloatArray | None,
    key: tuple[str, str],
    rows: Sequence[int],
) -> Track:
    series, name = key
    at = np.array(rows)
    lines: NDArray[np.int64] = cells.lines[at]
    t = time[at]
    place = f"{cells.file}, run {name}" if name else cells.file
    late = np.flatnonzero(np.diff(t) <= 0.0)
    if len(late):
        row = int(late[0]) + 1
        raise DataError(
            f"{place}, {cells.word} {lines[row]}: {_when(t[row])} does not come after {_when(t[row - 1])} "
            f"of {cells.word} "
            f"{lines[row - 1]}. Frames go on in time, and each run has a number of its own in the column run."
        )
    return Track(
        name,
        place,
        lines,
        t,
        {axis: values[at] for axis, values in positions.items()},
        None if angle is None else angle[at],
        {of: values[at] for of, values in sigmas.items()},
        series,
    )


def _when(seconds: float) -> str:
    return f"t = {seconds:.6g} s"
