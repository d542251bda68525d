"""One observable in a figure: data, curve with bands, regimes and standardised residuals."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.result.fit_result import FitResult
from ifrfit.physics import OBSERVABLES
from ifrfit.report.markers import draw_markers, draw_residual_axis, is_outlier, ring_outliers, sticks
from ifrfit.report.provenance import STAND_IN
from ifrfit.report.regimes import has_angle, transitions
from ifrfit.report.style import SeriesStyle, write_watermark

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

# the ends of the range are left out: some observables are undefined there
GRID = np.concatenate([[0.01], np.arange(0.5, 90.0, 0.5), [89.99]])
LONGEST_LABEL = 34
FEW = 8
CROWD = 200
ANGLE, SPEED = "incidence angle γ (deg)", "incoming speed (m/s)"
NUMBER = "measurement (number, in order)"
BEHIND, IN_FRONT = 2.0, 5.5  # drawing order: points are at 5
MANY = 2000
PIXELS = 500  # from here on points are pixels in the svg too, or it would be huge


@dataclass(frozen=True)
class Curve:
    """Prediction for one series along the incidence angle (or along the strip, for e_n and mu)."""

    series: str
    x: Array
    table: pd.DataFrame


def curves(result: FitResult, observable: str, names: list[str], *, bands: bool = True) -> list[Curve]:
    """Predict an observable for each series at its typical spin, transition angles included."""
    found = []
    for series in names:
        rows = result.points[result.points["series"] == series]
        if not has_angle(observable):
            table = result.predict([45.0], observable=observable, series=series, bands=bands)
            found.append(Curve(series, np.zeros(1), table))
            continue
        rows = rows[rows["gamma_deg"].notna()]
        angles = [e.value for e in transitions(result, series) if e.value is not None]
        grid = np.unique(np.concatenate([GRID, angles]))
        table = result.predict(
            grid,
            float(rows["spin_x"].median()),
            float(rows["spin_y"].median()),
            observable=observable,
            series=series,
            bands=bands,
        )
        found.append(Curve(series, grid, table))
    return found


def draw_data(
    axes: Axes, result: FitResult, observable: str, names: list[str], styles: dict[str, SeriesStyle]
) -> None:
    """Draw data with error bars, and curves with bands, into `axes`."""
    rows = result.points[result.points["observable"] == observable]
    found = curves(result, observable, names)
    angled = has_angle(observable)
    x, label = abscissa(rows, observable)
    size = marker_size(len(rows)) * (1.0 if angled else 0.75)
    for curve in found:
        own = (rows["series"] == curve.series).to_numpy()
        if angled:
            _draw_curve(axes, curve, styles[curve.series], crowded=len(rows) > CROWD)
        else:
            _draw_level(axes, curve, styles[curve.series], _span(x[own], label))
        _draw_points(axes, x[own], rows[own], styles[curve.series], size, angled)
    ring_outliers(axes, x, rows["value"].to_numpy(dtype=float), is_outlier(result, rows))
    axes.set_ylim(*value_limits(rows, found, x if angled else None))
    set_x(axes, x, label)
    axes.set_ylabel(axis_label(observable))
    mark_stand_in(axes, rows)


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
        write_watermark(axes, "STAND-IN", size=34)


def draw_residuals(
    axes: Axes, result: FitResult, observable: str, names: list[str], styles: dict[str, SeriesStyle]
) -> None:
    """Draw standardised residuals with lines at +-2."""
    rows = result.points[result.points["observable"] == observable]
    angled = has_angle(observable)
    x, label = abscissa(rows, observable)
    z = rows["standardised"].to_numpy(dtype=float)
    for series in names:
        own = (rows["series"] == series).to_numpy()
        _markers(axes, x[own], z[own], rows[own], styles[series], marker_size(len(rows)) * 0.85, angled)
    ring_outliers(axes, x, z, is_outlier(result, rows))
    draw_residual_axis(axes, z, room=1.35, front=IN_FRONT if len(rows) > CROWD else 1.0)
    set_x(axes, x, label)
    offset = result.noise.angle_offset is not None and label == ANGLE
    axes.set_xlabel(f"{label}, fitted offset added" if offset else label)


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


def marker_size(count: int) -> float:
    """Points: smaller where there are many."""
    return 4.2 if count <= 60 else 3.0 if count <= CROWD else 2.2 if count <= MANY else 1.4


def value_limits(rows: pd.DataFrame, found: list[Curve], x: Array | None) -> tuple[float, float]:
    """Limits that hold all data, and curves as far as they stay near them, with room for labels on top."""
    value, error = rows["value"].to_numpy(dtype=float), rows["sigma_used"].to_numpy(dtype=float)
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
        values += _within(curve.table["value"].to_numpy(dtype=float)[_sensible(curve.x)], value, margin)
        near = np.ones(len(curve.x), bool)
        if x is not None:
            near = (curve.x >= x.min() - 5.0) & (curve.x <= x.max() + 5.0)
        for column in {"lo95", "hi95"} & set(curve.table):
            values += _within(curve.table[column].to_numpy(dtype=float)[near], value, 0.5 * span)
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


def _draw_curve(axes: Axes, curve: Curve, series_style: SeriesStyle, *, crowded: bool) -> None:
    """Draw a curve with its bands; where points crowd it lies above them, with a white edge."""
    for level, alpha in (("95", 0.16), ("68", 0.22)):
        axes.fill_between(
            curve.x, *_band(curve, level), color=series_style.colour, alpha=alpha, lw=0.0, zorder=BEHIND
        )
    (line,) = axes.plot(
        curve.x,
        curve.table["value"].to_numpy(dtype=float),
        color=series_style.colour,
        ls=series_style.line,
        zorder=3,
    )
    if crowded:
        from matplotlib.patheffects import Normal, Stroke

        line.set(zorder=IN_FRONT, path_effects=[Stroke(linewidth=3.2, foreground="white"), Normal()])


def _draw_level(axes: Axes, curve: Curve, series_style: SeriesStyle, span: Array) -> None:
    """Draw a constant with its bands above the values it is the mean of: it is far narrower than they are."""
    for level, alpha in (("95", 0.35), ("68", 0.45)):
        low, high = _band(curve, level)
        axes.fill_between(
            span, low[0], high[0], color=series_style.colour, alpha=alpha, lw=0.0, zorder=IN_FRONT - 0.1
        )
    value = float(curve.table["value"].iloc[0])
    axes.plot(span, [value, value], color=series_style.colour, lw=1.0, ls=series_style.line, zorder=IN_FRONT)


def _band(curve: Curve, level: str) -> tuple[Array, Array]:
    low, high = (curve.table[f"{end}{level}"].to_numpy(dtype=float) for end in ("lo", "hi"))
    return low, high


def _draw_points(
    axes: Axes, x: Array, rows: pd.DataFrame, series_style: SeriesStyle, size: float, angled: bool
) -> None:
    y, error = rows["value"].to_numpy(dtype=float), rows["sigma_used"].to_numpy(dtype=float)
    across = rows["sigma_gamma_deg"].to_numpy(dtype=float) if angled else np.full(len(rows), np.nan)
    few = len(rows) <= 60
    bars: dict[str, Any] = {
        "fmt": "none",
        "ecolor": series_style.colour,
        "elinewidth": 0.8 if few else 0.5,
        "alpha": (0.9 if few else 0.45) * (1.0 if angled else 0.5),
        "zorder": 4,
        "rasterized": len(rows) > PIXELS,
    }
    axes.errorbar(x, y, yerr=np.where(np.isfinite(error), error, 0.0), **bars)
    if np.isfinite(across).any():
        axes.errorbar(x, y, xerr=np.where(np.isfinite(across), across, 0.0), **bars)
    _markers(axes, x, y, rows, series_style, size, angled, alpha=1.0 if angled else 0.4)


def _markers(
    axes: Axes,
    x: Array,
    y: Array,
    rows: pd.DataFrame,
    series_style: SeriesStyle,
    size: float,
    angled: bool,
    alpha: float = 1.0,
) -> None:
    edge, pixels = 0.9 if size > 2.5 else 0.6, len(rows) > PIXELS
    draw_markers(
        axes, x, y, sticks(rows) & angled, series_style, size, mew=edge, alpha=alpha, rasterized=pixels
    )
