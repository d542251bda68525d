"""What a figure shows, as numbers: the drawing and the table beside it are made of the same arrays."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Literal, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from ifrfit.physics import OBSERVABLES
from ifrfit.report.panels import Band, Curve, Points
from ifrfit.report.regimes import Mark, Regimes

Array = NDArray[np.float64]
Kind = Literal["data", "printed_constants", "recovered", "as_printed", "other"]
T = TypeVar("T")

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
class Abscissa:
    """The horizontal axis.

    Attributes
    ----------
    label : str
        With its unit.
    low, high : float
    ticks : tuple of float
    grid : ndarray
        Where curves are computed, in x.
    gamma : callable
        x to the incidence angle in degrees.
    of_gamma : callable
        The incidence angle in degrees to x.
    logarithmic : bool
    spin : bool
        x is the lateral spin R omega_x/u at one angle, not a function of the angle.
    """

    label: str
    low: float
    high: float
    ticks: tuple[float, ...]
    grid: Array
    gamma: Callable[[Array], Array]
    of_gamma: Callable[[Array], Array]
    logarithmic: bool = False
    spin: bool = False

    def inside(self, gamma: float) -> float:
        """An angle in degrees as x, not beyond the ends of the axis."""
        return float(np.clip(self.of_gamma(np.asarray(gamma, dtype=float)), self.low, self.high))

    def with_points(self, x: Array) -> Abscissa:
        """The same axis, wide enough for points that lie beyond its ends."""
        if not x.size or (x.min() >= self.low and x.max() <= self.high):
            return self
        low, high = min(self.low, float(x.min())), max(self.high, 1.03 * float(x.max()))
        space = np.geomspace if self.logarithmic else np.linspace
        return replace(self, low=low, high=high, grid=np.asarray(space(max(low, 1e-3), high, self.grid.size)))


@dataclass(frozen=True)
class Ordinate:
    """The vertical axis: an observable, or minus it.

    Attributes
    ----------
    observable : str
    low, high : float
        At least this range is shown.
    sign : float
        -1 where the source plots the negative.
    label : str
        With its unit; from the observable where empty.
    """

    observable: str
    low: float
    high: float
    sign: float = 1.0
    name: str = ""

    @property
    def in_degrees(self) -> bool:
        """Whether it is an angle."""
        return OBSERVABLES[self.observable].unit == "deg"

    @property
    def label(self) -> str:
        """Words, symbol and unit."""
        known = OBSERVABLES[self.observable]
        symbol = known.symbol if self.sign > 0 else f"$-${known.symbol}"
        return f"{self.name or known.meaning}\n{symbol} ({known.unit_text})"


def _tangent(gamma: Array) -> Array:
    return np.tan(np.radians(np.minimum(gamma, 89.999)))


def _angle(tangent: Array) -> Array:
    return np.degrees(np.arctan(tangent))


def _same(x: Array) -> Array:
    return x


_DEGREES = np.concatenate([[0.01], np.arange(1.0, 90.0), [89.99]])
_EVERY_15 = tuple(float(x) for x in range(0, 91, 15))

INCIDENCE = Abscissa("incidence angle γ (deg)", 0.0, 90.0, _EVERY_15, _DEGREES, _same, _same)
# lambda is defined at both ends
FROM_NORMAL = replace(INCIDENCE, grid=np.arange(0.0, 91.0))
CONTACT = replace(INCIDENCE, label="contact angle before ψ$_{\\mathrm{before}}$ = γ (deg)")
RATIO = Abscissa(
    "velocity ratio $U_t/U_n$ = tan γ (–)",
    0.0,
    2.6,
    (0.0, 0.5, 1.0, 1.5, 2.0, 2.5),
    np.linspace(0.01, 2.6, 131),
    _angle,
    _tangent,
)
TANGENT = Abscissa(
    "tan γ (–), logarithmic",
    0.06,
    15.0,
    (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0),
    np.geomspace(0.06, 15.0, 121),
    _angle,
    _tangent,
    logarithmic=True,
)
LATERAL_SPIN = Abscissa(
    "lateral spin before $R\\omega_x/u$ (–)",
    0.0,
    1.0,
    (0.0, 0.2, 0.4, 0.6, 0.8, 1.0),
    np.linspace(0.0, 1.0, 101),
    lambda x: np.full_like(x, 45.0),
    _same,
    spin=True,
)


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
    curves, points, regimes = _rounded((scene.curves, scene.points, scene.regimes))
    return replace(scene, curves=curves, points=points, regimes=regimes)


def _rounded(value: T) -> T:
    """A number, an array, or a part of a scene with all its numbers rounded."""
    found: object = value
    if isinstance(value, np.ndarray):
        found = np.array([_rounded(x) for x in value.tolist()], dtype=value.dtype)
    elif isinstance(value, float):
        found = float(f"{value:.{DIGITS}g}")
    elif isinstance(value, tuple):
        found = tuple(_rounded(part) for part in value)
    elif isinstance(value, Curve | Band | Points | Regimes | Mark):
        found = replace(value, **{each.name: _rounded(getattr(value, each.name)) for each in fields(value)})
        if isinstance(found, Points) and found.residual is not None:
            found = replace(found, residual=np.round(found.residual, RESIDUAL_PLACES))
    return cast("T", found)


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
