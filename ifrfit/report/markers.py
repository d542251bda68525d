"""Points and residuals as all figures draw them: open where they stick, outliers ringed, lines at 2 sigma."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.result.fit_result import FitResult
from ifrfit.report.style import GREY, RESIDUAL_DASHES, SeriesStyle

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def numbers(rows: pd.DataFrame, *names: str) -> tuple[Array, ...]:
    """Columns of a table as numbers."""
    return tuple(rows[name].to_numpy(dtype=float) for name in names)


def sticks(rows: pd.DataFrame) -> Mask:
    """Which rows of the points of a result stick."""
    return rows["sticking"].map(bool).to_numpy(dtype=bool)


def draw_markers(
    axes: Axes, x: Array, y: Array, sticking: Mask, own: SeriesStyle, size: float, **more: Any
) -> None:
    """Draw the points of one series: open where they stick, filled where they slide.

    Parameters
    ----------
    axes : Axes
    x, y : ndarray, (n,)
    sticking : ndarray of bool, (n,)
    own : SeriesStyle
    size : float
        In points.
    **more
        Further properties of the markers, as ``alpha``.
    """
    for chosen, face in ((sticking, "white"), (~sticking, own.colour)):
        if chosen.any():
            look: dict[str, Any] = {"mfc": face, "mec": own.colour, "mew": 0.8, "zorder": 5} | more
            axes.plot(x[chosen], y[chosen], ls="none", marker=own.marker, ms=size, **look)


def ring_outliers(
    axes: Axes, x: Array, y: Array, out: Mask, *, size: float = 10.0, edge: float = 1.1
) -> None:
    """Draw a ring around each outlier."""
    if out.any():
        look: dict[str, Any] = {"mfc": "none", "mec": "black", "mew": edge, "zorder": 6}
        axes.plot(x[out], y[out], ls="none", marker="o", ms=size, clip_on=False, **look)


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


def draw_residual_axis(axes: Axes, z: Array, *, room: float = 1.2, front: float = 1.0) -> None:
    """Draw lines at 0 and +-2 sigma, and give standardised residuals their limits.

    Parameters
    ----------
    axes : Axes
    z : ndarray, (n,)
        All residuals of these axes.
    room : float
        Times the largest of them.
    front : float
        Drawing order of the lines at +-2: where points are many they would hide them.
    """
    axes.axhline(0.0, color=GREY, lw=0.7, zorder=1)
    for level in (-2.0, 2.0):
        axes.axhline(level, color=GREY, lw=0.7, ls=RESIDUAL_DASHES, zorder=front)
    low, top = residual_limits(z, room)
    axes.set_ylim(low, top)
    if top < 6.0:
        axes.set_yticks([-2.0, 0.0, 2.0])
    axes.set_ylabel("residual (σ)")


def residual_limits(z: Array, room: float = 1.2) -> tuple[float, float]:
    """Limits of an axis of standardised residuals: room for the largest, 3.5 sigma at least."""
    top = max(3.5, room * float(np.abs(z[np.isfinite(z)]).max(initial=0.0)))
    return -top, top


def handle(marker: str, size: float, face: str, edge: str = GREY) -> Line2D:
    """A marker for a legend."""
    from matplotlib.lines import Line2D

    return Line2D([], [], ls="none", marker=marker, ms=size, mfc=face, mec=edge)
