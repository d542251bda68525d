"""Residuals against angle, against order, and against normal quantiles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.result.fit_result import FitResult
from ifrfit.report.page.drawings.canvas import panel
from ifrfit.report.panels import look_of
from ifrfit.report.plot_elements import (
    Points,
    draw_marked,
    draw_residuals,
    is_outlier,
    residual_limits,
    sticks,
)
from ifrfit.report.style import GREY, SeriesStyle, drawing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

LEVEL = 0.95


def draw_against(result: FitResult, styles: dict[str, SeriesStyle], x: Array, label: str) -> Figure:
    """Standardised residuals of every row against something, series by series.

    Parameters
    ----------
    result : FitResult
    styles : mapping of str to SeriesStyle
        Of each series.
    x : ndarray, (n,)
        Of each row of the points; rows where it is nan are left out.
    label : str
        Of the axis.
    """
    with drawing():
        figure, axes = panel()
        draw_residuals(axes, _series(result, styles, x), look_of(len(x)))
        axes.locator_params(axis="x", integer=True)
        axes.set_xlabel(label)
    return figure


def draw_quantiles(result: FitResult, styles: dict[str, SeriesStyle]) -> Figure:
    """Ordered standardised residuals against the quantiles of the normal law, with 95 % of each order."""
    from scipy.special import ndtri

    z = result.points["standardised"].to_numpy(dtype=float)
    n = z.size
    expected = np.empty(n)
    expected[np.argsort(z, kind="stable")] = ndtri((np.arange(1, n + 1) - 0.375) / (n + 0.25))
    with drawing():
        figure, axes = panel()
        order = np.sort(expected)
        low, high = quantile_band(n)
        axes.fill_between(order, low, high, color="0.5", alpha=0.2, lw=0.0)
        end = max(3.0, 1.1 * float(np.abs(order).max(initial=0.0)))
        axes.plot([-end, end], [-end, end], color=GREY, lw=0.8)
        for points in _series(result, styles, expected):
            draw_marked(axes, points, points.y, look_of(n))
        axes.set_xlim(-end, end)
        axes.set_ylim(*residual_limits(z))
        axes.set_xlabel("normal quantile (σ)")
        axes.set_ylabel("residual, in order (σ)")
    return figure


def quantile_band(n: int) -> tuple[Array, Array]:
    """Where 95 % of each order statistic of n normal numbers lie, lowest first, (n,) each.

    The i-th of n uniform numbers has the beta law with i and n + 1 - i.
    """
    from scipy.special import betaincinv, ndtri

    i = np.arange(1.0, n + 1.0)
    tail = 0.5 * (1.0 - LEVEL)
    low, high = (ndtri(betaincinv(i, n + 1.0 - i, p)) for p in (tail, 1.0 - tail))
    return np.asarray(low), np.asarray(high)


def _series(result: FitResult, styles: dict[str, SeriesStyle], x: Array) -> list[Points]:
    """Residuals of each series over x, where that is finite."""
    rows = result.points
    z, out = rows["standardised"].to_numpy(dtype=float), is_outlier(result, rows)
    sticking = sticks(rows) & rows["gamma_deg"].notna().to_numpy()
    found = []
    for name, own in styles.items():
        at = (rows["series"] == name).to_numpy() & np.isfinite(x)
        found.append(Points(name, x[at], z[at], np.zeros(at.sum()), own, "", sticking[at], z[at], out[at]))
    return found
