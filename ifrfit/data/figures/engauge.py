"""Projects of Engauge Digitizer: XML since version 6, with the picture inside, which is never decoded."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ifrfit.data.cell_table import show
from ifrfit.data.figures.bounded_xml import read_xml
from ifrfit.data.figures.calibration import (
    Calibration,
    CalibrationError,
    from_axis_clicks,
    from_point_clicks,
)
from ifrfit.data.figures.digitised_figure import DigitisedFigure, FigureAxes, FileImporter, PointSet, points_of
from ifrfit.errors import DataError

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

_TITLE = "Engauge Digitizer"
_BEFORE_XML = b"\x00\x00\xca\xfe"  # of versions before 6
_REMEDY = f"Save the document anew in {_TITLE}."
_ROOTS = ("Document", "ErrorReport")
_AXES = "Axes"  # the curve that holds the clicks on the axes


def read_document(raw: bytes, file: str) -> DigitisedFigure:
    """What a document holds; see `FigureImporter.read`.

    Raises
    ------
    DataError
        With the place in the file.
    """
    if raw.startswith(_BEFORE_XML):
        raise DataError(
            f"{file}: is of {_TITLE} before version 6, whose binary files are not read. Open it in a newer version "
            "and save it as XML, or export the points as CSV."
        )
    root = read_xml(raw, file, _REMEDY)
    if root.tag not in _ROOTS:
        raise DataError(
            f"{file}: its root is {show(root.tag)}, that of {_TITLE} is {' or '.join(_ROOTS)}. Check the file."
        )
    document = root if root.tag == "Document" else root.find(".//Document")
    document = root if document is None else document
    version = document.get("VersionNumber", "").strip()[:20]
    systems = document.findall(".//CoordSystem") or [document]
    axes, sets = [], []
    for number, system in enumerate(systems, start=1):
        name = "" if len(systems) == 1 else str(number)
        at = f"{file}, coordinate system {name}" if name else file
        axes.append(FigureAxes(name, _calibrator(system, at)))
        sets += [_curve(each, name, at) for each in system.findall(".//CurvesGraphs/Curve")]
    _refuse_same_names(sets, file)
    return DigitisedFigure(f"{_TITLE} {version}".strip(), tuple(axes), tuple(sets))


def _calibrator(system: Element, at: str) -> Callable[[], Calibration]:
    def calibrate() -> Calibration:
        is_log = _scales(system, at)
        clicks = [
            point
            for curve in system.findall("./Curve")
            if curve.get("CurveName") == _AXES
            for point in curve.iter("Point")
        ]
        place = f"{at}, curve {_AXES}"
        try:
            if len(clicks) == 3:
                pixels = np.array([_position(each, "PositionScreen", place) for each in clicks])
                values = np.array([_position(each, "PositionGraph", place) for each in clicks])
                return from_point_clicks(pixels, values, is_log=is_log)
            if len(clicks) == 4:
                return _of_separate_axes(clicks, is_log, place)
        except CalibrationError as error:
            raise DataError(f"{place}: {error}.") from None
        raise DataError(
            f"{place}: three clicks, or two on each axis, fix the axes; here are {len(clicks)}. Complete them."
        )

    return calibrate


def _of_separate_axes(clicks: list[Element], is_log: tuple[bool, bool], place: str) -> Calibration:
    """Axes from two clicks on x, where y is not known, and two on y."""
    on_x = [each for each in clicks if each.get("IsXOnly", "").lower() == "true"]
    on_y = [each for each in clicks if each not in on_x]
    if len(on_x) != 2:
        raise DataError(f"{place}: {len(on_x)} of four clicks are on x, which takes two. {_REMEDY}")
    pixels = np.array([_position(each, "PositionScreen", place) for each in (*on_x, *on_y)])
    x1, x2 = (_number(each, "PositionGraph", "X", place) for each in on_x)
    y1, y2 = (_number(each, "PositionGraph", "Y", place) for each in on_y)
    return from_axis_clicks(pixels, (x1, x2), (y1, y2), is_log=is_log)


def _scales(system: Element, at: str) -> tuple[bool, bool]:
    """Whether x and y are logarithmic."""
    found = system.find(".//Coords")
    if found is None:
        raise DataError(f"{at}: has no Coords, which say the scales of the axes. {_REMEDY}")
    place = f"{at}, Coords"
    if found.get("TypeString", "Cartesian") != "Cartesian":
        raise DataError(f"{place}: the axes are {show(found.get('TypeString', ''))}; points are read from Cartesian ones.")
    for units in ("UnitsXString", "UnitsYString"):
        said = found.get(units, "")
        if "date" in said.lower() or "time" in said.lower():
            raise DataError(f"{place}, {units}: {show(said)}. Impacts are read from axes of numbers alone.")
    is_log = []
    for key in ("ScaleXThetaString", "ScaleYRadiusString"):
        said = found.get(key, "")
        if said not in ("Linear", "Log"):
            raise DataError(f"{place}, {key}: is {show(said)}, known are Linear and Log. {_REMEDY}")
        is_log.append(said == "Log")
    return is_log[0], is_log[1]


def _curve(curve: Element, axes: str, at: str) -> PointSet:
    name = curve.get("CurveName", "").strip()
    label = f"{axes}/{name}" if axes else name
    place = f"{at}, curve {show(name)}"
    pairs = [_position(each, "PositionScreen", place) for each in curve.iter("Point")]
    return PointSet(label, axes, points_of(pairs, place))


def _position(point: Element, of: str, place: str) -> tuple[float, float]:
    return _number(point, of, "X", place), _number(point, of, "Y", place)


def _number(point: Element, of: str, key: str, place: str) -> float:
    found = point.find(of)
    where = f"{place}, point {show(point.get('Identifier', '').replace(chr(9), ' '))}, {of}"
    if found is None or found.get(key) is None:
        raise DataError(f"{where}: has no {key}. {_REMEDY}")
    text = str(found.get(key))
    try:
        number = float(text) if "_" not in text else math.nan
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise DataError(f"{where}, {key}: {show(text)} is not a number. {_REMEDY}")
    return number


def _refuse_same_names(sets: list[PointSet], file: str) -> None:
    for name, count in Counter(each.name for each in sets).items():
        if count > 1:
            raise DataError(f"{file}: {count} curves are called {show(name)}. Rename them.")


def _is_document(head: bytes) -> bool:
    begins = head.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"<")
    named = any(f"<{root}".encode() in head for root in _ROOTS) or b"<!DOCTYPE engauge" in head
    return head.startswith(_BEFORE_XML) or (begins and named)


ENGAUGE = FileImporter("engauge", _TITLE, True, _is_document, read_document)
