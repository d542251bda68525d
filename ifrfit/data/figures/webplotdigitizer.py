"""Projects of WebPlotDigitizer: JSON of version 3 and 4, alone or in the tar that the program writes.

Values that the file keeps beside the pixels are those of the calibration of their time: they are passed over,
and made anew from the pixels.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator

import numpy as np

from ifrfit.data.cell_table import show
from ifrfit.data.figures.calibration import Calibration, CalibrationError, from_axis_clicks
from ifrfit.data.figures.digitised_figure import Bar, DigitisedFigure, FigureAxes, FileImporter, PointSet, points_of
from ifrfit.data.figures.located_json import Located, read_json
from ifrfit.data.figures.project_archive import is_tar, project_of_tar
from ifrfit.errors import DataError

_TITLE = "WebPlotDigitizer"
_OTHER_AXES = {
    "BarAxes": "bars",
    "PolarAxes": "polar",
    "TernaryAxes": "ternary",
    "MapAxes": "those of a map",
    "ImageAxes": "pixels without a calibration",
    "CircularChartRecorderAxes": "those of a circular recorder",
}
_DATE = re.compile(r"\d+[/:]\d+|\d{4}-\d{1,2}(-\d{1,2})?\b")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


def read_project(raw: bytes, file: str) -> DigitisedFigure:
    """What a project holds; see `FigureImporter.read`.

    Raises
    ------
    DataError
        With the place in the file.
    """
    if is_tar(raw[:512]):
        raw, file = project_of_tar(raw, file)
    whole = read_json(raw, file)
    if whole.has("wpd"):
        return _version_3(whole["wpd"])
    if not whole.has("version"):
        raise DataError(f"{whole.at}: is no project of {_TITLE}: it has neither wpd nor version. Check the file.")
    return _version_4(whole)


def _version(project: Located, known: int) -> str:
    """The version as text; any but the known one is refused."""
    numbers = [int(each.number()) for each in project["version"].items()]
    if not numbers or numbers[0] != known:
        said = ".".join(map(str, numbers[:3])) or "none"
        raise DataError(
            f"{project['version'].at}: is {said}; known are 3 and 4. Open the project in {_TITLE} 4 and save it "
            "anew, or export the points as CSV."
        )
    return ".".join(map(str, numbers[:2]))


def _version_3(project: Located) -> DigitisedFigure:
    version = _version(project, 3)
    kind = project["axesType"].text()
    if kind == "XYAxes":
        parameters = project["axesParameters"] if project.has("axesParameters") else Located({}, project.file)
        calibrate = _calibrator(project["calibration"], parameters, _at_axes(project, "calibration"))
    else:
        calibrate = _refusal(project["axesType"].at, kind)
    sets = [_point_set(each, "") for each in _entries(project, "dataSeries")]
    return DigitisedFigure(f"{_TITLE} {version}", (FigureAxes("", calibrate),), _distinct(sets, project))


def _version_4(project: Located) -> DigitisedFigure:
    version = _version(project, 4)
    axes = []
    for each in _entries(project, "axesColl"):
        kind, name = each["type"].text(), each["name"].text() if each.has("name") else ""
        if kind == "XYAxes":
            calibrate = _calibrator(
                each["calibrationPoints"], each, f"{_at_axes(each, 'calibrationPoints')} of axes {show(name)}"
            )
        else:
            calibrate = _refusal(f"{each.at}, axes {show(name)}", kind)
        axes.append(FigureAxes(name, calibrate))
    names = Counter(each.name for each in axes)
    for name, count in names.items():
        if count > 1:
            raise DataError(f"{project['axesColl'].at}: {count} axes are called {show(name)}. Rename them.")
    sets = []
    for each in _entries(project, "datasetColl"):
        on = each["axesName"].text()
        if on not in names:
            raise DataError(f"{each['axesName'].at}: there are no axes called {show(on)}. Attach the dataset to axes.")
        sets.append(_point_set(each, on))
    return DigitisedFigure(f"{_TITLE} {version}", tuple(axes), _distinct(sets, project))


def _entries(project: Located, key: str) -> Iterator[Located]:
    return project[key].items() if project.has(key) else iter(())


def _at_axes(axes: Located, key: str) -> str:
    return axes[key].at


def _refusal(at: str, kind: str) -> Callable[[], Calibration]:
    """What refuses axes that are not of x and y, once somebody asks for them."""

    def refuse() -> Calibration:
        raise DataError(
            f"{at}: the axes are {_OTHER_AXES.get(kind, show(kind))}; points are read from axes of x and y "
            "alone. Calibrate the figure as XY axes."
        )

    return refuse


def _calibrator(points: Located, flags: Located, at: str) -> Callable[[], Calibration]:
    """What makes the calibration of XY axes of their four points, once somebody asks for it."""

    def calibrate() -> Calibration:
        given = list(points.items())
        if len(given) != 4:
            raise DataError(f"{at}: XY axes take four calibration points, here are {len(given)}. Calibrate anew.")
        clicks = np.array([[each["px"].number(), each["py"].number()] for each in given])
        x_values = _axis_value(given[0]["dx"]), _axis_value(given[1]["dx"])
        y_values = _axis_value(given[2]["dy"]), _axis_value(given[3]["dy"])
        is_log = (_flag(flags, "isLogX"), _flag(flags, "isLogY"))
        rotates = not _flag(flags, "noRotation")
        try:
            return from_axis_clicks(clicks, x_values, y_values, is_log=is_log, rotates=rotates)
        except CalibrationError as error:
            raise DataError(f"{at}: {error}.") from None

    return calibrate


def _flag(of: Located, key: str) -> bool:
    return of.has(key) and of[key].flag()


def _axis_value(given: Located) -> float:
    """The value of an axis at a click, which the program keeps as it was typed."""
    if not isinstance(given.value, str):
        return given.number()
    text = given.text().replace("\u2212", "-")
    if _DATE.search(text):
        raise DataError(f"{given.at}: {show(text)} is a date or a time. Impacts are read from axes of numbers alone.")
    if not _NUMBER.fullmatch(text):
        raise DataError(f"{given.at}: {show(text)} is not a number. Calibrate anew, with plain numbers.")
    return Located(float(text), given.file, given.place).number()


def _point_set(given: Located, axes: str) -> PointSet:
    """The points of a dataset; of one with groups those of the first, the others are ends of their bars.

    Points of one bar have one number ``tuple``.
    """
    name = given["name"].text() if given.has("name") else ""
    groups = [each.text() for each in given["groupNames"].items()] if given.has("groupNames") else []
    pairs: list[tuple[float, float]] = []
    rows: dict[int, int] = {}
    ends: dict[int, list[tuple[int | None, tuple[float, float], str]]] = {}
    for each in _entries(given, "data"):
        point = each["x"].number(), each["y"].number()
        group = int(each["group"].number()) if groups and each.has("group") else 0
        together = int(each["tuple"].number()) if groups and each.has("tuple") else None
        if group:
            ends.setdefault(group, []).append((together, point, each.at))
            continue
        if together is not None:
            rows[together] = len(pairs)
        pairs.append(point)
    bars, lost = [], 0
    for group, points in sorted(ends.items()):
        placed = np.full((len(pairs), 2), np.nan)
        for together, point, at in points:
            if together is None or together not in rows:
                lost += 1
                continue
            if not np.isnan(placed[rows[together]]).all():
                raise DataError(f"{at}: group {group} has two points of tuple {together}. Remove one.")
            placed[rows[together]] = point
        bars.append(Bar(groups[group] if group < len(groups) else str(group), placed))
    notes = []
    if lost:
        notes.append(f"{lost} points of dataset {show(name)} mark ends of bars that have no point, and were left out")
    return PointSet(name, axes, points_of(pairs, given.at), tuple(notes), tuple(bars))


def _distinct(sets: list[PointSet], project: Located) -> tuple[PointSet, ...]:
    for name, count in Counter(each.name for each in sets).items():
        if count > 1:
            raise DataError(f"{project.at}: {count} datasets are called {show(name)}. Rename them.")
    return tuple(sets)


_FIRST_KEYS = (b'"wpd"', b'"version"', b'"axesColl"', b'"datasetColl"')


def _is_project(head: bytes) -> bool:
    begins = head.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"{")
    return is_tar(head) or (begins and any(key in head for key in _FIRST_KEYS))


WEBPLOTDIGITIZER = FileImporter("webplotdigitizer", _TITLE, True, _is_project, read_project)
