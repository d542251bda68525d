"""A digitised figure as a table of impacts: values, errors of reading, and what all rows have in common."""

from __future__ import annotations

import hashlib
import logging
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.cell_table import CellColumn, Cells, show
from ifrfit.data.column_names import UNITS, WALL_ANGLE, Role, named_role, role_of
from ifrfit.data.common_errors import of_angle, of_value
from ifrfit.data.conventions import Conventions
from ifrfit.data.figures.calibration import Calibration
from ifrfit.data.figures.digitised_figure import DigitisedFigure, FigureAxes, PointSet
from ifrfit.data.figures.error_bars import BarErrors, bar_errors, curves_of_ends, with_curves_of_ends
from ifrfit.data.figures.importers import importer_of
from ifrfit.data.figures.question import ONE_PIXEL, FigureQuestion
from ifrfit.data.tabular import read_bytes
from ifrfit.errors import DataError, UsageError

LARGEST_FILE = 128 * 2**20  # bytes: an archive holds the scanned page, too
_HEAD = 512  # bytes
_DIGITISED = "digitised"
_LARGEST = 1e100  # of a value, and of what a click does to it: the square of a larger one is infinite
_BEYOND = 4.0  # standard errors of a click by which an angle may lie outside 0 to 90 degrees

FloatArray = NDArray[np.float64]
_LOG = logging.getLogger(__name__)


def cells_of_figure(path: Path, conventions: Conventions) -> Cells | None:
    """The table of a figure, or None where the file is a table of impacts.

    Parameters
    ----------
    path : Path
    conventions : Conventions
        Its ``figure`` says what the axes are.

    Raises
    ------
    DataError
        The file is refused, or holds a figure of which nothing is said.
    UsageError
        It does not have what is asked for.
    """
    question = conventions.figure
    if question is not None:
        question.require_axes()
    head = _head(path)
    if head is None and question is not None:
        read_bytes(path)  # which says why it cannot be read
    importer = importer_of(head, as_points=question is not None) if head is not None else None
    if importer is None:
        return None
    if question is None:
        raise DataError(
            f"{path}: is a project of {importer.title}. Say what its axes are, as in 'ifrfit import {path} --x "
            "gamma_deg --y beta --out data.csv'."
        )
    size = path.stat().st_size
    if size > LARGEST_FILE:
        raise DataError(
            f"{path}: {size / 2**20:,.0f} MB are more than any project, the most is {LARGEST_FILE // 2**20} MB. "
            "Export the points as CSV."
        )
    raw = read_bytes(path)
    figure = importer.read(raw, str(path))
    return _table(figure, question, conventions, str(path), hashlib.sha256(raw).hexdigest())


def _head(path: Path) -> bytes | None:
    """How a file begins; None where it cannot be read, which is said where tables are read."""
    try:
        with path.open("rb") as file:
            return file.read(_HEAD)
    except (OSError, ValueError):
        return None


def _table(
    figure: DigitisedFigure, question: FigureQuestion, conventions: Conventions, file: str, sha256: str
) -> Cells:
    axes = _axes(figure, question, file)
    if axes.calibrate is not None:
        figure = replace(figure, sets=_with_ends(figure.sets, question, file))
    sets = _sets(figure, axes, question, file)
    names = _series(sets, question, Path(file).stem)
    angle, measured = _angle(question.x, conventions), _measured(question.y, conventions)
    for each, series in zip(sets, names, strict=True):
        _LOG.info("%s: %s, %d points of %s", file, figure.program, len(each.points), series)
    calibration = axes.calibrate() if axes.calibrate is not None else None
    points = np.concatenate([each.points for each in sets])
    columns: dict[str, CellColumn] = {
        "series": [name for name, each in zip(names, sets, strict=True) for _ in each.points]
    }
    notes = [note for each in sets for note in (*each.notes, *_left_out(each, question))]
    name = Path(file).name
    if calibration is None:
        if question.pixels is not None:
            raise UsageError(
                f"--pixels: {file} holds values without the pixels of the clicks, so that nothing follows from it. "
                "Leave it away, or give the project of the digitiser."
            )
        columns |= {question.x: points[:, 0], question.y: points[:, 1]}
        notes.append(f"{name}: the points have no pixels, so that the errors of reading are not known")
    else:
        pixels = ONE_PIXEL if question.pixels is None else question.pixels
        values = calibration.values(points)
        _refuse_infinite(values, names, sets, file)
        errors = calibration.reading_errors(points, pixels)
        _refuse_boundless(calibration.common_errors(points, pixels), errors, file)
        by_bars = _bars(sets, calibration, question, file)
        values[:, 0], moved = _within_quadrant(values[:, 0], errors[:, 0], angle)
        columns |= {question.x: values[:, 0], question.y: values[:, 1]}
        both = errors if by_bars is None else np.hypot(errors, np.nan_to_num(by_bars.sizes))
        columns |= _errors(question, angle, measured, values, both)
        columns |= _common_errors(calibration, points, pixels, values, angle, conventions)
        notes += _notes(calibration, points, pixels, question, name, by_bars)
        if moved:
            angles = "1 angle lay" if moved == 1 else f"{moved} angles lay"
            notes.append(
                f"{name}: {angles} outside 0 to 90 degrees by less than {_BEYOND:g} standard errors of a click, and "
                f"{'was' if moved == 1 else 'were'} set to the end"
            )
    said = conventions.provenance or _DIGITISED
    columns["provenance"] = [said] * len(points)
    return Cells(
        file,
        sha256,
        list(columns),
        0,
        np.arange(1, len(points) + 1),
        list(columns.values()),
        word="point",
        notes=tuple(notes),
        calibration="" if calibration is None else calibration.digest,
    )


def _with_ends(sets: Sequence[PointSet], question: FigureQuestion, file: str) -> tuple[PointSet, ...]:
    """The point sets, with curves that are ends of bars of others as a part of these where bars are asked for."""
    if question.bars is not None:
        pixels = ONE_PIXEL if question.pixels is None else question.pixels
        return tuple(with_curves_of_ends(sets, pixels, file))
    for end, of in curves_of_ends(sets).items():
        if end in question.datasets or not question.datasets:
            raise DataError(
                f"{file}: {show(end)} is by its name the end of error bars of {show(of)}, not measured beside it. "
                f"Say what half a bar is, as --bars sigma, or leave it out, --dataset {_quoted(of)}."
            )
    return tuple(sets)


def _bars(
    sets: Sequence[PointSet], calibration: Calibration, question: FigureQuestion, file: str
) -> BarErrors | None:
    """What bars make of the errors, where it was said what they are."""
    if question.bars is None:
        return None
    if not any(each.bars for each in sets):
        of = sets[0].name or "NAME"
        raise UsageError(
            f"--bars: {file} has no ends of bars, as points of groups beside the first, or as curves called "
            f"'{of} upper' and '{of} lower'. Read them off, or leave it away."
        )
    return bar_errors(sets, calibration, question.bars, Path(file).name)


def _axes(figure: DigitisedFigure, question: FigureQuestion, file: str) -> FigureAxes:
    """The axes that are asked for, or the only ones that could be meant."""
    there = {each.name: each for each in figure.axes}
    if question.axes is not None:
        if question.axes not in there:
            raise UsageError(f"--axes {show(question.axes)}: {file} has {_names(list(there), 'axes')}.")
        return there[question.axes]
    used = {each.axes for each in figure.sets if each.name in question.datasets or not question.datasets}
    if not question.datasets and len(used) > 1:
        used = {name for name in used if _calibrates(there[name])}
    possible = [there[name] for name in there if name in used]
    if not there:
        raise DataError(f"{file}: has no axes. Calibrate the figure.")
    if len(possible) > 1:
        raise UsageError(
            f"--axes: {file} has points on {_names([each.name for each in possible], 'axes')}. Say which, as "
            f"--axes {_quoted(possible[0].name)}."
        )
    return possible[0] if possible else next(iter(there.values()))


def _calibrates(axes: FigureAxes) -> bool:
    try:
        if axes.calibrate is not None:
            axes.calibrate()
    except DataError:
        return False
    return True


def _quoted(name: str) -> str:
    return name if name.replace("_", "").replace("-", "").isalnum() else f"'{name}'"


def _left_out(points: PointSet, question: FigureQuestion) -> list[str]:
    """What is said of ends of bars that nobody asked for."""
    if question.bars is not None or not points.bars:
        return []
    count = sum(int((~np.isnan(bar.points).all(axis=1)).sum()) for bar in points.bars)
    return [
        f"{count} points of the groups {', '.join(bar.name for bar in points.bars)} of dataset {show(points.name)} were "
        "left out: they mark bars, and the file does not say whether these are one standard error. If they are, say "
        "--bars sigma; --bars 2sigma and --bars 95% are others"
    ]


def _names(names: Sequence[str], what: str) -> str:
    return f"the {what} {', '.join(map(show, names))}" if names else f"no {what}"


def _sets(
    figure: DigitisedFigure, axes: FigureAxes, question: FigureQuestion, file: str
) -> list[PointSet]:
    """The datasets that are asked for, in that order; else all on the axes."""
    there = {each.name: each for each in figure.sets if each.axes == axes.name}
    for name in question.datasets:
        if name not in there:
            on = f" on the axes {show(axes.name)}" if len(figure.axes) > 1 else ""
            raise UsageError(
                f"--dataset {show(name)}: {file} has {_names(list(there), 'datasets')}{on}."
            )
    duplicates = [name for name in question.datasets if question.datasets.count(name) > 1]
    if duplicates:
        raise UsageError(f"--dataset {show(duplicates[0])} is given several times, and would count as often.")
    chosen = [there[name] for name in question.datasets] or list(there.values())
    filled = [each for each in chosen if len(each.points)]
    if not filled:
        on = f" on the axes {show(axes.name)}" if axes.name else ""
        raise DataError(f"{file}: there is no point{on}. Read some off.")
    return filled


def _series(sets: Sequence[PointSet], question: FigureQuestion, stem: str) -> list[str]:
    if not question.series:
        return [each.name or stem for each in sets]
    if len(question.series) not in (1, len(sets)):
        raise UsageError(
            f"--series: {len(question.series)} names for {len(sets)} datasets. Give one for each, or one for all."
        )
    return list(question.series) * (len(sets) if len(question.series) == 1 else 1)


def _angle(header: str, conventions: Conventions) -> Role:
    """What x is: an angle of incidence, or its tangent."""
    if conventions.angle_column == header and conventions.angle_unit == "tan":
        return Role("common", "tan_gamma", "number")
    found = role_of(header)
    if header in conventions.columns:
        found = named_role(conventions.columns[header], header, conventions.units.get(header))
    if found.kind == "angle" or found.name in ("gamma", "tan_gamma"):
        return found
    if conventions.angle_column == header:
        return Role("angle", "angle", "angle", conventions.angle_unit or conventions.units.get(header))
    raise UsageError(
        f"--x {_quoted(header)}: is no incidence angle. Say which angle the axis is, as --x gamma_deg (from the "
        "normal), --x tan_gamma, or --x alpha_deg with --convention angle=from-wall."
    )


def _measured(header: str, conventions: Conventions) -> Role:
    """What y is: an observable, perhaps under a name that leaves a choice open."""
    found = role_of(header)
    if header in conventions.columns:
        found = named_role(conventions.columns[header], header, conventions.units.get(header))
    if found.kind not in ("observable", "open", "magnitude"):
        raise UsageError(
            f"--y {_quoted(header)}: is no observable. Say what was measured, as --y beta, --y e_n or --y delta_deg."
        )
    return found


def _errors(
    question: FigureQuestion, angle: Role, measured: Role, values: FloatArray, errors: FloatArray
) -> dict[str, CellColumn]:
    """Columns of the errors of reading, in the units of the axes."""
    known = role_of(f"sigma_{question.y}")
    of_y = f"sigma_{question.y}" if known.kind == "sigma" else f"sigma_{measured.name}"
    if angle.name == "tan_gamma":
        in_degrees = np.degrees(errors[:, 0] / (1.0 + values[:, 0] ** 2))
        return {"sigma_gamma_deg": in_degrees, of_y: errors[:, 1]}
    of_x = f"sigma_{question.x}"
    if role_of(of_x).name != "sigma_gamma":
        of_x = "sigma_gamma"  # in the unit of the angle
    return {of_x: errors[:, 0], of_y: errors[:, 1]}


def _common_errors(
    calibration: Calibration,
    points: FloatArray,
    pixels: float,
    values: FloatArray,
    angle: Role,
    conventions: Conventions,
) -> dict[str, CellColumn]:
    """Columns of what the clicks on the axes do to all points: y as its axis, angles from the normal."""
    errors = calibration.independent_common_errors(points, pixels)
    if angle.name == "tan_gamma":
        by_x = np.degrees(1.0 / (1.0 + values[:, 0] ** 2))
    else:
        by_x = np.full(len(points), UNITS[angle.unit][1] if angle.unit in UNITS else 1.0)
    if conventions.angle_from == "from-wall" or (conventions.angle_from is None and angle.name == WALL_ANGLE):
        by_x = -by_x
    columns: dict[str, CellColumn] = {}
    for place in range(errors.shape[2]):
        columns[of_value(place + 1)] = errors[:, 1, place]
        columns[of_angle(place + 1)] = by_x * errors[:, 0, place]
    return columns


def _within_quadrant(values: FloatArray, errors: FloatArray, angle: Role) -> tuple[FloatArray, int]:
    """Angles that clicks put a little outside 0 to 90 degrees at the end; how many there are."""
    low, high = 0.0, math.inf
    if angle.dimension == "angle":
        factor = UNITS[angle.unit][1] if angle.unit in UNITS else 1.0
        high = 90.0 / factor
    outside = np.maximum(low - values, values - high)
    slight = (outside > 0.0) & (outside < _BEYOND * errors)
    return np.where(slight, np.clip(values, low, high), values), int(slight.sum())


def _notes(
    calibration: Calibration,
    points: FloatArray,
    pixels: float,
    question: FigureQuestion,
    name: str,
    by_bars: BarErrors | None,
) -> list[str]:
    common = np.linalg.norm(calibration.common_errors(points, pixels), axis=2).max(axis=0)
    clicks = "1 pixel" if pixels == 1.0 else f"{pixels:g} pixels"
    alone = (
        f"{name}: sigma is the error of reading alone, a click of {clicks}; how the experiment scattered is not "
        "part of it (--noise scaled, --noise unknown)"
    )
    return [
        *([alone] if by_bars is None else _notes_of_bars(by_bars, question, clicks, name)),
        f"{name}: readings of one figure share the error of its calibration: at most {common[0]:.2g} in "
        f"{question.x} and {common[1]:.2g} in {question.y}, in columns of their own (common1 and so on)",
    ]


def _notes_of_bars(by_bars: BarErrors, question: FigureQuestion, clicks: str, name: str) -> list[str]:
    is_there = ~np.isnan(by_bars.sizes)
    along = [f"{count} along {of}" for count, of in zip(is_there.sum(axis=0), (question.x, question.y), strict=True) if count]
    errors = "1 standard error" if question.bars == 1.0 else f"{question.bars:.4g} standard errors"
    lacking = int((~is_there.any(axis=1)).sum())
    notes = [
        f"{name}: sigma is of bars ({' and '.join(along)}; half a bar is {errors}) together with the error of reading, a "
        f"click of {clicks}"
    ]
    if lacking:
        points = "1 point has" if lacking == 1 else f"{lacking} points have"
        notes.append(f"{name}: {points} no bar; sigma there is the error of reading alone")
    return [*notes, *by_bars.notes]


def _refuse_boundless(common: FloatArray, errors: FloatArray, file: str) -> None:
    if not ((np.abs(common) < _LARGEST).all() and (errors < _LARGEST).all() and (errors > 0.0).all()):
        raise DataError(
            f"{file}: a click on the axes moves the values beyond all bounds, or not at all. Calibrate anew, with "
            "ticks that are far from each other."
        )


def _refuse_infinite(
    values: FloatArray, names: Sequence[str], sets: Sequence[PointSet], file: str
) -> None:
    bad = np.flatnonzero(~(np.abs(values) < _LARGEST).all(axis=1))
    if len(bad):
        ends = np.cumsum([len(each.points) for each in sets])
        which = int(np.searchsorted(ends, bad[0], side="right"))
        raise DataError(
            f"{file}, dataset {show(names[which])}: a point lies so far outside the axes that it has no value. "
            "Remove it."
        )
