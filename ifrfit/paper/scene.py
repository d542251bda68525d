"""What a figure shows, as numbers: the drawing and the table beside it are made of the same arrays."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ifrfit.paper.axes import Abscissa, Ordinate
from ifrfit.report.style import SeriesStyle

Array = NDArray[np.float64]
Kind = Literal["data", "printed_constants", "recovered", "as_printed", "other"]
Dashes = str | tuple[int, tuple[float, ...]]

HEADER = (
    "panel",
    "kind",
    "label",
    "x",
    "y",
    "y_lo68",
    "y_hi68",
    "y_lo95",
    "y_hi95",
    "sigma",
    "provenance",
)
DATA, RESIDUALS = "data", "residuals"
DIGITS = 6  # a posterior is known to 1e-4 of its standard deviation; the last bits are the processor's own
RESIDUAL_PLACES = 3


@dataclass(frozen=True)
class Pen:
    """How a line is drawn."""

    colour: str
    dashes: Dashes = "-"
    width: float = 1.1


@dataclass(frozen=True)
class Band:
    """Limits about a curve, each of the shape of its x."""

    lo68: Array
    hi68: Array
    lo95: Array
    hi95: Array


@dataclass(frozen=True)
class Curve:
    """A line. `credible` holds bands of the curve, `predictive` those of one more measurement.

    Curves with the same label have one entry in the legend.
    """

    kind: Kind
    label: str
    x: Array
    y: Array
    pen: Pen
    credible: Band | None = None
    predictive: Band | None = None


@dataclass(frozen=True)
class Points:
    """Observations of one series. Residuals are standardised; None where the points are not fitted.

    `is_outlier` tells the outliers.
    """

    label: str
    x: Array
    y: Array
    sigma: Array
    series_style: SeriesStyle
    provenance: str
    sticking: NDArray[np.bool_] | None = None
    residual: Array | None = None
    is_outlier: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class Mark:
    """A transition between the regimes, with the ends of its 95 % interval where it has one."""

    kind: Kind
    label: str
    x: float
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Regimes:
    """Ranges of x with their regime; the style of their series where several differ."""

    spans: tuple[tuple[float, float, str], ...]
    marks: tuple[Mark, ...]
    series_style: SeriesStyle | None = None


@dataclass(frozen=True)
class Scene:
    """A figure before it is drawn.

    Attributes
    ----------
    stem : str
        Of its files.
    title : str
    warnings : tuple of str
        What nobody may overlook, under the title.
    x, y : Abscissa, Ordinate
    curves, points, regimes : tuple
    notes : tuple of str
        Legend lines without a handle.
    """

    stem: str
    title: str
    x: Abscissa
    y: Ordinate
    curves: tuple[Curve, ...] = ()
    points: tuple[Points, ...] = ()
    regimes: tuple[Regimes, ...] = ()
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    stand_in: bool = False


@dataclass(frozen=True)
class Row:
    """A line of figN.csv."""

    panel: str
    kind: str
    label: str
    x: float | None
    y: float | None = None
    limits: tuple[float | None, ...] = field(default=(None,) * 4)
    sigma: float | None = None
    provenance: str = ""

    def cells(self) -> list[str]:
        """Text of each column; a missing number is empty."""
        numbers = [_number(value) for value in (self.x, self.y, *self.limits, self.sigma)]
        return [self.panel, self.kind, self.label, *numbers, self.provenance]


def _number(value: float | None) -> str:
    return "" if value is None or not np.isfinite(value) else f"{float(value) + 0.0:.{DIGITS}g}"


def rounded(scene: Scene) -> Scene:
    """The scene with its numbers as the csv has them, so that every machine draws the same picture.

    Six significant digits; standardised residuals to 0.001.
    """
    return replace(
        scene,
        curves=tuple(_round_curve(curve) for curve in scene.curves),
        points=tuple(_round_points(points) for points in scene.points),
        regimes=tuple(_round_regimes(regimes) for regimes in scene.regimes),
    )


def _round(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _round_end(value: float | None) -> float | None:
    return None if value is None else _round(value)


def _round_all(values: Array) -> Array:
    return np.array([_round(value) for value in values.tolist()], dtype=float)


def _round_band(band: Band | None) -> Band | None:
    if band is None:
        return None
    return Band(*(_round_all(limit) for limit in (band.lo68, band.hi68, band.lo95, band.hi95)))


def _round_curve(curve: Curve) -> Curve:
    return replace(
        curve,
        x=_round_all(curve.x),
        y=_round_all(curve.y),
        credible=_round_band(curve.credible),
        predictive=_round_band(curve.predictive),
    )


def _round_points(points: Points) -> Points:
    residual = None if points.residual is None else np.round(points.residual, RESIDUAL_PLACES)
    x, y, sigma = (_round_all(values) for values in (points.x, points.y, points.sigma))
    return replace(points, x=x, y=y, sigma=sigma, residual=residual)


def _round_regimes(regimes: Regimes) -> Regimes:
    spans = tuple((_round(low), _round(high), regime) for low, high, regime in regimes.spans)
    marks = tuple(
        replace(mark, x=_round(mark.x), low=_round_end(mark.low), high=_round_end(mark.high))
        for mark in regimes.marks
    )
    return replace(regimes, spans=spans, marks=marks)


def rows_of(scene: Scene) -> Iterator[Row]:
    """Every curve, point and transition of a figure."""
    for points in scene.points:
        yield from _of_points(points)
    for curve in scene.curves:
        yield from _of_curve(curve, "", curve.credible)
        if curve.predictive is not None:
            yield from _of_curve(curve, ", one more measurement", curve.predictive)
    for regimes in scene.regimes:
        for mark in regimes.marks:
            yield Row(DATA, mark.kind, mark.label, mark.x)
            if mark.low is not None and mark.high is not None:
                yield Row(DATA, mark.kind, f"{mark.label}, 95 % from", mark.low)
                yield Row(DATA, mark.kind, f"{mark.label}, 95 % to", mark.high)


def _of_points(points: Points) -> Iterator[Row]:
    for x, y, sigma in zip(points.x, points.y, points.sigma, strict=True):
        yield Row(DATA, "data", points.label, x, y, sigma=sigma, provenance=points.provenance)
    if points.residual is not None:
        for x, z in zip(points.x, points.residual, strict=True):
            yield Row(RESIDUALS, "data", points.label, x, z, provenance=points.provenance)


def _of_curve(curve: Curve, suffix: str, band: Band | None) -> Iterator[Row]:
    for i, (x, y) in enumerate(zip(curve.x, curve.y, strict=True)):
        limits = (None,) * 4 if band is None else (band.lo68[i], band.hi68[i], band.lo95[i], band.hi95[i])
        yield Row(DATA, curve.kind, curve.label + suffix, x, y, limits)


def write_rows(rows: Sequence[Row], path: Path) -> None:
    """Write figN.csv: six significant digits, empty where there is no number."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(HEADER)
        writer.writerows(row.cells() for row in rows)
