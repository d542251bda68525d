"""Project files of digitisers, written from pixels as the programs write them."""

from __future__ import annotations

import io
import json
import tarfile
from typing import Any

import numpy as np

# x: 0 at 100 and 90 at 700 pixels; y: -1 at 480 and 1 at 80 pixels
CLICKS = ((100.0, 500.0), (700.0, 500.0), (90.0, 480.0), (90.0, 80.0))
TEXTS = (("0", "-1"), ("90", "-1"), ("0", "-1"), ("90", "1"))


def pixel(gamma: float, value: float) -> tuple[float, float]:
    return 100.0 + 600.0 * gamma / 90.0, 280.0 - 200.0 * value


POINTS = tuple(pixel(gamma, value) for gamma, value in ((10.0, 0.5), (40.0, 0.1), (70.0, -0.7)))
VALUES = np.array([[10.0, 0.5], [40.0, 0.1], [70.0, -0.7]])


def calibration(clicks=CLICKS, texts=TEXTS) -> list[dict[str, Any]]:
    return [
        {"px": px, "py": py, "dx": dx, "dy": dy, "dz": None}
        for (px, py), (dx, dy) in zip(clicks, texts, strict=True)
    ]


def axes(name="XY", kind="XYAxes", **more) -> dict[str, Any]:
    flags = {"isLogX": False, "isLogY": False}
    return {"name": name, "type": kind, **flags, "calibrationPoints": calibration(), **more}


def dataset(name="glass", on="XY", points=POINTS, **more) -> dict[str, Any]:
    data = [{"x": x, "y": y, "value": [999.0, 999.0]} for x, y in points]  # stale, as after an edit
    return {"name": name, "axesName": on, "metadataKeys": [], "data": data, "autoDetectionData": None, **more}


def version_4(*, axes_coll=None, dataset_coll=None, version=(4, 2), **more) -> dict[str, Any]:
    return {
        "version": list(version),
        "axesColl": [axes()] if axes_coll is None else axes_coll,
        "datasetColl": [dataset()] if dataset_coll is None else dataset_coll,
        "measurementColl": [],
        **more,
    }


def version_3(points=POINTS, kind="XYAxes", version=(3, 8), **parameters) -> dict[str, Any]:
    return {
        "wpd": {
            "version": list(version),
            "axesType": kind,
            "axesParameters": {"isLogX": False, "isLogY": False, **parameters},
            "calibration": calibration(),
            "dataSeries": [
                {
                    "name": "Default Dataset",
                    "metadataKeys": [],
                    "data": [{"x": x, "y": y, "value": [999.0, 999.0]} for x, y in points],
                }
            ],
        }
    }


def as_json(project: object) -> bytes:
    return json.dumps(project).encode()


def as_tar(project: bytes, *, name="figure/wpd.json", extra: tuple[tarfile.TarInfo, ...] = ()) -> bytes:
    held = io.BytesIO()
    with tarfile.open(fileobj=held, mode="w:") as archive:
        info = b'{"version":[4,0],"json":"wpd.json","images":["image.png"]}'
        for title, content in (("figure/info.json", info), (name, project), ("figure/image.png", b"\x89PNG")):
            member = tarfile.TarInfo(title)
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
        for member in extra:
            archive.addfile(member)
    return held.getvalue()


def axis_point(identifier: int, at, graph, only="False") -> str:
    return (
        f'<Point Identifier="Axes&#9;point&#9;{identifier}" Ordinal="{identifier}" IsAxisPoint="True" '
        f'IsXOnly="{only}" Index="9"><PositionScreen X="{at[0]}" Y="{at[1]}"/>'
        f'<PositionGraph X="{graph[0]}" Y="{graph[1]}"/></Point>'
    )


THREE = "".join(
    axis_point(i, pixel(*value), value) for i, value in enumerate(((0.0, -1.0), (90.0, -1.0), (90.0, 1.0)))
)


def curve(name="Curve1", points=POINTS) -> str:
    clicked = "".join(
        f'<Point Identifier="{name}&#9;point&#9;{i}" Ordinal="{i}" IsAxisPoint="False" IsXOnly="False" '
        f'Index="9"><PositionScreen X="{x}" Y="{y}"/></Point>'
        for i, (x, y) in enumerate(points)
    )
    return f'<Curve CurveName="{name}"><ColorFilter/><CurvePoints>{clicked}</CurvePoints></Curve>'


def coordinate_system(
    axis_points=THREE, curves=None, scales=("Linear", "Linear"), kind="Cartesian", units="Number"
):
    return (
        f'<CoordSystem><General/><Coords TypeString="{kind}" ScaleXThetaString="{scales[0]}" '
        f'ScaleYRadiusString="{scales[1]}" UnitsXString="{units}" UnitsYString="Number"/>'
        f'<Curve CurveName="Axes"><CurvePoints>{axis_points}</CurvePoints></Curve>'
        f"<CurvesGraphs>{curve() if curves is None else curves}</CurvesGraphs></CoordSystem>"
    )


def engauge(*systems: str, root="Document", doctype="<!DOCTYPE engauge>") -> bytes:
    inside = "".join(systems or (coordinate_system(),))
    image = '<Image Width="9" Height="9"><![CDATA[!!! no base64 at all !!!]]></Image>'
    document = f'<Document VersionNumber="12.1" AxesPointsRequired="0">{image}{inside}</Document>'
    body = document if root == "Document" else f"<{root}>{document}</{root}>"
    return f'<?xml version="1.0" encoding="UTF-8"?>{doctype}{body}'.encode()


def _style(name: str, connect: str) -> str:
    """What Engauge keeps of how a curve is found and drawn."""
    return f"""
            <ColorFilter CurveName="{name}" Mode="2" ModeString="Intensity" IntensityLow="0"
                IntensityHigh="50" ForegroundLow="0" ForegroundHigh="10" HueLow="180" HueHigh="360"
                SaturationLow="50" SaturationHigh="100" ValueLow="0" ValueHigh="50"/>
            <CurveStyle CurveName="{name}">
                <LineStyle Width="1" Color="1" ColorString="Blue" ConnectAs="0" ConnectAsString="{connect}"/>
                <PointStyle Radius="10" LineWidth="1" Color="1" ColorString="Blue" Shape="1"
                    ShapeString="Cross"/>
            </CurveStyle>"""


def engauge_whole(curves=None) -> bytes:
    """A document with all that version 12 writes: settings of export, grid, segments, colours and styles."""
    curves = {"glass": POINTS} if curves is None else curves
    drawn = "".join(
        curve(name, points).replace("<ColorFilter/>", _style(name, "FunctionSmooth"))
        for name, points in curves.items()
    )
    image = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<!DOCTYPE engauge>
<Document VersionNumber="12.1" AxesPointsRequired="0">
    <Image Width="800" Height="600"><![CDATA[{image}]]></Image>
    <CoordSystem>
        <General CursorSize="3" ExtraPrecision="1"/>
        <Coords Type="0" TypeString="Cartesian" Coords="0" ScaleXTheta="0" ScaleXThetaString="Linear"
            ScaleYRadius="0" ScaleYRadiusString="Linear" UnitsX="0" UnitsXString="Number" UnitsY="0"
            UnitsYString="Number" UnitsTheta="0" UnitsThetaString="Degrees (DDD.DDDDD)" UnitsRadius="0"
            UnitsRadiusString="Number" UnitsDate="3" UnitsDateString="YYYY/MM/DD" UnitsTime="2"
            UnitsTimeString="HH:MM:SS"/>
        <DigitizeCurve CursorInnerRadius="5" CursorLineWidth="2" CursorSize="1" CursorStandardCross="True"/>
        <Export PointsSelectionFunctions="0" PointsSelectionFunctionsString="InterpolateAllCurves"
            PointsIntervalFunctions="10" PointsIntervalUnitsFunctions="1" PointsSelectionRelations="0"
            PointsSelectionRelationsString="Interpolate" LayoutFunctions="0" Delimiter="0" Header="1"
            HeaderString="Simple" XLabel="x">
            <CurveNamesNotExported>
                <CurveNameNotExported CurveName="Axes"/>
            </CurveNamesNotExported>
        </Export>
        <AxesChecker Mode="1" Seconds="3" LineColor="6"/>
        <GridDisplay Stable="True" DisableX="0" CountX="5" StartX="0" StepX="10" StopX="40" DisableY="0"
            CountY="4" StartY="0" StepY="0.5" StopY="1" Color="0" ColorString="Black"/>
        <GridRemoval Stable="False" DefinedGridLines="False" CloseDistance="10" CountX="2" StartX="0"
            StopX="90"/>
        <PointMatch PointSize="48" ColorAccepted="4" ColorAcceptedString="Green"/>
        <Segments PointSeparation="25" MinLength="2" FillCorners="False" LineWidth="4" LineColor="4"/>
        <Curve CurveName="Axes">{_style("Axes", "ConnectSkipForAxisCurve")}
            <CurvePoints>{THREE}</CurvePoints>
        </Curve>
        <CurvesGraphs>{drawn}</CurvesGraphs>
    </CoordSystem>
</Document>
""".encode()
