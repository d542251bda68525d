"""Curves, points and residuals as all figures draw them: first what is shown, as numbers, then its drawing.

Points are open where they stick, outliers are ringed, residuals have lines at 2 sigma.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.distributions.protocol import BANDS
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.report.style import GREY, RESIDUAL_DASHES, Dashes, SeriesStyle

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SHADES = (0.18, 0.26)  # how dark the bands of 95 and of 68 % are
RESIDUAL_SIZE = 3.2 / 3.8  # of their markers, over that of the points


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
        places = rows[["source", "row", "observable"]].itertuples(index=False)
        return np.array([f"{p.source} line {p.row} ({p.observable})" in named for p in places], dtype=bool)
    return np.asarray(np.abs(rows["standardised"].to_numpy(dtype=float)) > outlier_limit(result))


def outlier_limit(result: FitResult) -> float:
    """Largest standardised residual that chance allows in any of the points: Bonferroni at 1 %."""
    from scipy.special import ndtri

    return float(-ndtri(0.005 / max(len(result.points), 1)))


def handle(marker: str, size: float, face: str, edge: str = GREY) -> Line2D:
    """A marker for a legend."""
    from matplotlib.lines import Line2D

    return Line2D([], [], ls="none", marker=marker, ms=size, mfc=face, mec=edge)
