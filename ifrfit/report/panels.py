"""Curves, points and residuals as all figures draw them, and one observable of a fit in a panel.

First what is shown, as numbers, then its drawing. Points are open where they stick, outliers are ringed,
residuals have lines at 2 sigma.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.observations import word_of
from ifrfit.inference.distributions.protocol import BANDS
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.prediction import kinks_of
from ifrfit.physics import OBSERVABLES
from ifrfit.report.modes import other_modes
from ifrfit.report.provenance import STAND_IN
from ifrfit.report.regimes import has_angle, transitions
from ifrfit.report.style import GREY, RESIDUAL_DASHES, Dashes, SeriesStyle, series_styles, write_watermark

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SHADES = (0.18, 0.26)  # how dark the bands of 95 and of 68 % are
RESIDUAL_SIZE = 3.2 / 3.8  # of their markers, over that of the points
# the ends of the range are left out: some observables are undefined there
GRID = np.concatenate([[0.01], np.arange(0.5, 90.0, 0.5), [89.99]])
LONGEST_LABEL = 34
FEW = 8
CROWD = 200
ANGLE, SPEED = "incidence angle γ (deg)", "incoming speed (m/s)"
NUMBER = "measurement (number, in order)"
BEHIND, IN_FRONT = 2.0, 5.5  # drawing order: points are at 5
OTHER_MODE: dict[str, Any] = {"color": "0.25", "lw": 0.9, "ls": (0, (1, 1.2))}
FEW_POINTS, MANY = 60, 2000
PIXELS = 500  # from here on points are pixels in the svg too, or it would be huge


@dataclass(frozen=True)
class Pen:
    """How a line is drawn."""

    colour: str
    dashes: Dashes = "-"
    width: float = 1.2


@dataclass(frozen=True)
class Band:
    """Limits about a curve, each of the shape of its x."""

    lo68: Array
    hi68: Array
    lo95: Array
    hi95: Array

    @classmethod
    def of(cls, table: pd.DataFrame, prefix: str = "", sign: float = 1.0) -> Band:
        """From predictions, see `FitResult.predict`; "new_" for one more measurement, -1 for minus them."""
        low68, high68, low95, high95 = (
            sign * x for x in numbers(table, *(f"{prefix}{end}" for end in BANDS))
        )
        return cls(low68, high68, low95, high95) if sign > 0 else cls(high68, low68, high95, low95)


@dataclass(frozen=True)
class Curve:
    """A line. `credible` holds bands of the curve, `predictive` those of one more measurement.

    Attributes
    ----------
    kind : str
        Where its constants come from, as in the tables beside figures of the paper.
    label : str
        Curves with the same label have one entry in a legend.
    x, y : ndarray, (n,)
    pen : Pen
    credible, predictive : Band or None
    """

    kind: str
    label: str
    x: Array
    y: Array
    pen: Pen
    credible: Band | None = None
    predictive: Band | None = None


@dataclass(frozen=True)
class Points:
    """Observations of one series.

    Attributes
    ----------
    label, provenance : str
    x, y, sigma : ndarray, (n,)
        Without an error bar where sigma is 0.
    series_style : SeriesStyle
    sticking : ndarray of bool, (n,), or None
        Which are drawn open.
    residual : ndarray, (n,), or None
        Standardised; None where the points are not fitted.
    is_outlier : ndarray of bool, (n,), or None
    sigma_x : ndarray, (n,), or None
    """

    label: str
    x: Array
    y: Array
    sigma: Array
    series_style: SeriesStyle
    provenance: str = ""
    sticking: Mask | None = None
    residual: Array | None = None
    is_outlier: Mask | None = None
    sigma_x: Array | None = None


@dataclass(frozen=True)
class Look:
    """How heavily points are drawn: size, width of bars, darkness; as pixels where an svg would be huge."""

    size: float = 3.8
    alpha: float = 1.0
    bar: float = 0.7
    bar_alpha: float = 0.8
    pixels: bool = False


def numbers(rows: pd.DataFrame, *names: str) -> tuple[Array, ...]:
    """Columns of a table as numbers."""
    return tuple(rows[name].to_numpy(dtype=float) for name in names)


def sticks(rows: pd.DataFrame) -> Mask:
    """Which rows of the points of a result stick."""
    return rows["sticking"].map(bool).to_numpy(dtype=bool)


def draw_curve(
    axes: Axes,
    curve: Curve,
    *,
    shades: tuple[float, float] = SHADES,
    behind: float = 2.0,
    front: float = 3.0,
    has_edge: bool = False,
) -> None:
    """Draw a curve with its bands.

    Parameters
    ----------
    axes : Axes
    curve : Curve
    shades : (float, float)
        How dark the bands of 95 and of 68 % are.
    behind, front : float
        Drawing order of the bands and of the line.
    has_edge : bool
        Whether the line has a white edge, which lifts it off a crowd of points.
    """
    pen = curve.pen
    if curve.predictive is not None:
        for end in (curve.predictive.lo95, curve.predictive.hi95):
            axes.plot(curve.x, end, color=pen.colour, lw=0.6, ls=(0, (1, 1.5)), alpha=0.8, zorder=2.5)
    if curve.credible is not None:
        band = curve.credible
        for (low, high), alpha in zip(((band.lo95, band.hi95), (band.lo68, band.hi68)), shades, strict=True):
            axes.fill_between(curve.x, low, high, color=pen.colour, alpha=alpha, lw=0.0, zorder=behind)
    look: dict[str, Any] = {"color": pen.colour, "ls": pen.dashes, "lw": pen.width, "zorder": front}
    (line,) = axes.plot(curve.x, curve.y, label=curve.label, **look)
    if has_edge:
        from matplotlib.patheffects import Normal, Stroke

        line.set(path_effects=[Stroke(linewidth=3.2, foreground="white"), Normal()])


def draw_points(axes: Axes, points: Points, look: Look) -> None:
    """Draw observations with their error bars."""
    bars: dict[str, Any] = {
        "fmt": "none",
        "ecolor": points.series_style.colour,
        "elinewidth": look.bar,
        "alpha": look.bar_alpha,
        "zorder": 4,
        "rasterized": look.pixels,
    }
    axes.errorbar(points.x, points.y, yerr=points.sigma, **bars)
    if points.sigma_x is not None:
        axes.errorbar(points.x, points.y, xerr=points.sigma_x, **bars)
    draw_marked(axes, points, points.y, look)


def draw_residuals(axes: Axes, several: Sequence[Points], look: Look, *, front: float = 1.0) -> None:
    """Draw the standardised residuals of all points that were fitted, with lines at 0 and +-2 sigma.

    Parameters
    ----------
    axes : Axes
    several : sequence of Points
    look : Look
        Of the points themselves; residuals are a little smaller.
    front : float
        Drawing order of the lines at +-2: where points are many they would hide them.
    """
    small = replace(look, size=RESIDUAL_SIZE * look.size, alpha=1.0)
    fitted = [(points, points.residual) for points in several if points.residual is not None]
    for points, residual in fitted:
        draw_marked(axes, points, residual, small)
    axes.axhline(0.0, color=GREY, lw=0.7, zorder=1)
    for level in (-2.0, 2.0):
        axes.axhline(level, color=GREY, lw=0.7, ls=RESIDUAL_DASHES, zorder=front)
    low, top = residual_limits(np.concatenate([residual for _, residual in fitted]))
    axes.set_ylim(low, top)
    if top < 6.0:
        axes.set_yticks([-2.0, 0.0, 2.0])
    axes.set_ylabel("residual (σ)")


def residual_limits(z: Array) -> tuple[float, float]:
    """Limits of an axis of standardised residuals: room for the largest, 3.5 sigma at least."""
    top = max(3.5, 1.2 * float(np.abs(z[np.isfinite(z)]).max(initial=0.0)))
    return -top, top


def draw_marked(axes: Axes, points: Points, y: Array, look: Look) -> None:
    """Draw a mark for each point at a height of its own: open where it sticks, ringed where it lies out."""
    own, sticking = points.series_style, np.zeros(points.x.size, dtype=bool)
    sticking = sticking if points.sticking is None else points.sticking
    mark: dict[str, Any] = {
        "ls": "none",
        "marker": own.marker,
        "ms": look.size,
        "mec": own.colour,
        "mew": 0.8,
    }
    mark |= {"alpha": look.alpha, "rasterized": look.pixels, "zorder": 5}
    for chosen, face in ((sticking, "white"), (~sticking, own.colour)):
        if chosen.any():
            axes.plot(points.x[chosen], y[chosen], mfc=face, **mark)
    out = points.is_outlier
    if out is not None and out.any():
        ring: dict[str, Any] = {"ls": "none", "marker": "o", "ms": 8.5, "mfc": "none", "mec": "black"}
        axes.plot(points.x[out], y[out], mew=0.9, clip_on=False, zorder=6, **ring)


def is_outlier(result: FitResult, rows: pd.DataFrame) -> Mask:
    """Tell for each of some points whether it is an outlier, shape (n,).

    The rows that the fit names; they need not be the ones with the largest residuals, for an outlier drags
    the curve away from its neighbours. By the residuals where the fit does not judge them.
    """
    fact = result.facts.get("outliers")
    if fact is not None and "limit" in fact.figures:
        named = {str(name) for name in fact.figures.get("rows") or ()}
        found = np.zeros(len(rows), dtype=bool)
        # numbers first: to write the names of all of many rows takes long
        numbers_of = {int(n) for name in named for n in re.findall(r" (?:line|row) (\d+) ", name)}
        candidates = np.flatnonzero(rows["row"].isin(numbers_of).to_numpy())
        places = rows[["source", "row", "observable"]].iloc[candidates].itertuples(index=False)
        words = {str(name): word_of(result.inputs, str(name)) for name in rows["source"].unique()}
        found[candidates] = [
            f"{p.source} {words[str(p.source)]} {p.row} ({p.observable})" in named for p in places
        ]
        return found
    return np.asarray(np.abs(rows["standardised"].to_numpy(dtype=float)) > outlier_limit(result))


def outlier_limit(result: FitResult) -> float:
    """Largest standardised residual that chance allows in any of the points: Bonferroni at 1 %."""
    from scipy.special import ndtri

    return float(-ndtri(0.005 / max(len(result.points), 1)))


def handle(marker: str, size: float, face: str, edge: str = GREY) -> Line2D:
    """A marker for a legend."""
    from matplotlib.lines import Line2D

    return Line2D([], [], ls="none", marker=marker, ms=size, mfc=face, mec=edge)


def curves(result: FitResult, observable: str, names: list[str], *, bands: bool = True) -> list[Curve]:
    """Predict an observable for each series at its typical spin, along the incidence angle, (n,).

    Transition angles are among them, or, without bands, the kinks of the curve itself. A single place, 0,
    where no angle enters the observable.
    """
    styles, found = series_styles([str(name) for name in result.points["series"].unique()]), []
    for series in names:
        rows = result.points[result.points["series"] == series]
        rows = rows[rows["gamma_deg"].notna()]
        x, gamma, spin = np.zeros(1), np.full(1, 45.0), (0.0, 0.0)
        if has_angle(observable):
            spin = float(rows["spin_x"].median()), float(rows["spin_y"].median())
            known = transitions(result, series) if bands else ()
            kinks = (
                [e.value for e in known if e.value is not None] if bands else kinks_of(result, series, *spin)
            )
            x = gamma = np.unique(np.concatenate([GRID, kinks]))
        table = result.predict(gamma, *spin, observable=observable, series=series, bands=bands)
        pen = Pen(styles[series].colour, styles[series].line)
        value, band = table["value"].to_numpy(dtype=float), Band.of(table) if bands else None
        found.append(Curve("recovered", series, x, value, pen, band))
    return found


def draw_panel(
    data: Axes,
    residuals: Axes,
    result: FitResult,
    observable: str,
    styles: dict[str, SeriesStyle],
    speeds: Axes | None = None,
) -> None:
    """Draw data with error bars and curves with bands, and standardised residuals under them.

    With axes `speeds` residuals are drawn against the incoming speed, too.
    """
    draw_data(data, result, observable, styles)
    draw_residuals_of(residuals, result, observable, styles)
    if speeds is not None:
        rows = rows_of(result, observable)
        look = look_of(len(rows), angled=has_angle(observable))
        draw_residuals_by_speed(speeds, result, rows, styles, look)


def draw_data(axes: Axes, result: FitResult, observable: str, styles: dict[str, SeriesStyle]) -> None:
    """Draw data with error bars and curves with bands; other modes dotted."""
    rows = rows_of(result, observable)
    names = [str(name) for name in rows["series"].unique()]
    found, angled = curves(result, observable, names), has_angle(observable)
    x, label = abscissa(rows, observable)
    crowded, look = len(rows) > CROWD, look_of(len(rows), angled=angled)
    for curve, points in zip(found, _points_by_series(result, rows, observable, styles), strict=True):
        if angled:
            front = IN_FRONT if crowded else 3.0
            draw_curve(axes, curve, front=front, has_edge=crowded)
        else:  # above the values that it is the mean of: it is far narrower than they are
            level = _as_level(curve, _span(points.x, label))
            draw_curve(axes, level, shades=(0.35, 0.45), behind=IN_FRONT - 0.1, front=IN_FRONT)
        draw_points(axes, points, look)
    for _, mode in other_modes(result) if angled else ():
        for curve in curves(mode, observable, names, bands=False):
            axes.plot(curve.x, curve.y, zorder=2.8, **OTHER_MODE)
    axes.set_ylim(*value_limits(rows, found, x if angled else None))
    axes.set_ylabel(axis_label(observable))
    _set_angles(axes, result, x, label)
    mark_stand_in(axes, rows)


def draw_residuals_of(axes: Axes, result: FitResult, observable: str, styles: dict[str, SeriesStyle]) -> None:
    """Draw the standardised residuals of an observable."""
    rows = rows_of(result, observable)
    look = look_of(len(rows), angled=has_angle(observable))
    several = _points_by_series(result, rows, observable, styles)
    draw_residuals(axes, several, look, front=IN_FRONT if len(rows) > CROWD else 1.0)
    _set_angles(axes, result, *abscissa(rows, observable))


def rows_of(result: FitResult, observable: str) -> pd.DataFrame:
    """The points of a result that are of one observable."""
    return result.points[result.points["observable"] == observable]


def _set_angles(axes: Axes, result: FitResult, x: Array, label: str) -> None:
    set_x(axes, x, label)
    offset = result.noise.angle_offset is not None and label == ANGLE
    axes.set_xlabel(f"{label}, fitted offset added" if offset else label)


def _points_by_series(
    result: FitResult, rows: pd.DataFrame, observable: str, styles: dict[str, SeriesStyle]
) -> list[Points]:
    angled, (x, _) = has_angle(observable), abscissa(rows, observable)
    several = []
    for name in rows["series"].unique():
        own = (rows["series"] == name).to_numpy()
        several.append(_points(result, rows[own], x[own], styles[str(name)], angled))
    return several


def draw_residuals_by_speed(
    axes: Axes, result: FitResult, rows: pd.DataFrame, styles: dict[str, SeriesStyle], look: Look
) -> None:
    """Draw standardised residuals of an observable against the incoming speed of each row."""
    several, angled = [], has_angle(str(rows["observable"].iloc[0]))
    for name in rows["series"].unique():
        own = rows[rows["series"] == name]
        (speed,) = numbers(own, "speed_m_s")
        several.append(_points(result, own, speed, styles[str(name)], angled))
    draw_residuals(axes, several, look)
    axes.set_xlabel(SPEED)


def has_speeds(rows: pd.DataFrame, observable: str) -> bool:
    """Whether residuals of an observable are worth drawing against speed: known, and of several values.

    Not where the observable is drawn over the speed itself.
    """
    (speed,) = numbers(rows, "speed_m_s")
    return bool(len(rows)) and _differs(speed) and abscissa(rows, observable)[1] != SPEED


def abscissa(rows: pd.DataFrame, observable: str) -> tuple[Array, str]:
    """Where the rows of an observable are drawn, and the label of that axis.

    Over the angle of incidence; those that no angle enters over the angle at which they were measured if that
    differs, else over the speed, else by their number: a trend is a finding.
    """
    gamma, speed = (rows[name].to_numpy(dtype=float) for name in ("gamma_deg", "speed_m_s"))
    if has_angle(observable) or _differs(gamma):
        return gamma, ANGLE
    return (speed, SPEED) if _differs(speed) else (np.arange(1.0, len(rows) + 1.0), NUMBER)


def _differs(x: Array) -> bool:
    return bool(np.isfinite(x).all() and np.ptp(x) > 0.0)


def mark_stand_in(axes: Axes, rows: pd.DataFrame) -> None:
    """Write across a panel that its data are a stand-in, if they are."""
    if (rows["provenance"] == STAND_IN).any():
        write_watermark(axes, size=34)


def axis_label(observable: str) -> str:
    """Meaning, symbol and unit, wrapped to the height of a panel."""
    known = OBSERVABLES.get(observable)
    if known is None:
        return f"{observable} (–)"
    meaning = textwrap.fill(known.meaning, LONGEST_LABEL)
    # a symbol on a line of its own if it would not fit beside the words
    last = meaning.rpartition("\n")[2]
    gap = " " if len(last) + 12 <= LONGEST_LABEL else "\n"
    return f"{meaning}{gap}{known.symbol} ({known.unit_text})"


def value_limits(rows: pd.DataFrame, found: list[Curve], x: Array | None) -> tuple[float, float]:
    """Limits that hold all data, and curves as far as they stay near them, with room for labels on top."""
    value, error = numbers(rows, "value", "sigma_used")
    low, high = float(value.min()), float(value.max())
    error = np.where(np.isfinite(error), error, 0.0)
    span = max(high - low, 2.0 * float(np.median(error)), 0.02 * max(abs(low), abs(high)), 1e-9)
    # one huge error bar must not flatten everything else
    error = np.minimum(error, span)
    low, high = min(low, float((value - error).min())), max(high, float((value + error).max()))
    # a few points have no scale of their own: the curve sets it
    margin = 2.0 * span if len(value) >= FEW else np.inf
    values = [low, high]
    for curve in found:
        values += _within(curve.y[_sensible(curve.x)], value, margin)
        near = np.ones(len(curve.x), bool)
        if x is not None:
            near = (curve.x >= x.min() - 5.0) & (curve.x <= x.max() + 5.0)
        for end in () if curve.credible is None else (curve.credible.lo95, curve.credible.hi95):
            values += _within(end[near], value, 0.5 * span)
    low, high = min(values), max(values)
    room = high - low
    return low - 0.07 * room, high + (0.16 if x is not None else 0.07) * room


def _within(y: Array, value: Array, margin: float) -> list[float]:
    """Ends of a curve, as far as they are within reach of the data."""
    y = np.clip(y[np.isfinite(y)], value.min() - margin, value.max() + margin)
    return [float(y.min()), float(y.max())] if y.size else []


def _sensible(x: Array) -> NDArray[np.bool_]:
    """Where a curve may ask for room: some observables run away at the ends."""
    return np.asarray((x >= 5.0) & (x <= 85.0)) if x.size > 1 else np.ones(x.size, bool)


def set_x(axes: Axes, x: Array, label: str) -> None:
    """Limits and ticks of an axis as `abscissa` gives it."""
    if label == ANGLE:
        axes.set_xlim(0.0, 90.0)
        axes.set_xticks(np.arange(0.0, 91.0, 15.0))
    elif label == NUMBER:
        from matplotlib.ticker import MaxNLocator

        count = x.size
        axes.set_xlim(0.5 - 0.02 * count, count + 0.5 + 0.02 * count)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=6))


def _span(x: Array, label: str) -> Array:
    beyond = 0.02 * x.max() if label == SPEED else 0.5
    return np.array([x.min() - beyond, x.max() + beyond])


def _as_level(curve: Curve, span: Array) -> Curve:
    """A curve of a single place as a thin line across the panel."""
    assert curve.credible is not None
    band = curve.credible
    ends = (np.full(2, end[0]) for end in (band.lo68, band.hi68, band.lo95, band.hi95))
    pen = replace(curve.pen, width=1.0)
    return replace(curve, x=span, y=np.full(2, curve.y[0]), pen=pen, credible=Band(*ends))


def look_of(count: int, *, angled: bool = True) -> Look:
    """How so many points of an observable are drawn: paler where its curve is a level that hides in them."""
    size = 4.2 if count <= FEW_POINTS else 3.0 if count <= CROWD else 2.2 if count <= MANY else 1.4
    width, dark = (0.8, 0.9) if count <= FEW_POINTS else (0.5, 0.45)
    pixels = count > PIXELS
    return (
        Look(size, 1.0, width, dark, pixels) if angled else Look(0.75 * size, 0.4, width, 0.5 * dark, pixels)
    )


def _points(
    result: FitResult, rows: pd.DataFrame, x: Array, series_style: SeriesStyle, angled: bool
) -> Points:
    value, sigma, across, residual = numbers(rows, "value", "sigma_used", "sigma_gamma_deg", "standardised")
    sigma, across = (np.where(np.isfinite(error), error, 0.0) for error in (sigma, across))
    return Points(
        "",
        x,
        value,
        sigma,
        series_style,
        sticking=sticks(rows) & angled,
        residual=residual,
        is_outlier=is_outlier(result, rows),
        sigma_x=across if angled and across.any() else None,
    )
