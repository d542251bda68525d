"""Residuals from all sides: against angle, speed and order, and against normal quantiles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.observations import word_of
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.report import style
from ifrfit.report.page.blocks import Block, Picture, Pictures
from ifrfit.report.page.charts.chart import Axis, Band, Chart, Line, Mark, Points, one_panel
from ifrfit.report.page.charts.scales import Ticks
from ifrfit.report.page.plugins import ReportSection
from ifrfit.report.page.report_input import ReportInput
from ifrfit.report.panels import ANGLE, RESIDUAL_SIZE, SPEED, is_outlier, look_of, residual_limits, sticks
from ifrfit.report.provenance import amount_words, stand_in_words
from ifrfit.report.regimes import REGIMES, regime_name
from ifrfit.report.style import GREY, RESIDUAL_DASHES, SeriesStyle

Array = NDArray[np.float64]

LEVEL = 0.95
SIGMAS = Ticks((-2.0, 0.0, 2.0), ("−2", "0", "2"))
FEW_SIGMAS = 6.0  # up to here an axis of residuals has ticks at 2 sigma only
MOST_DRAWN, BEYOND = 5000, 3.0  # points; and sigmas from which on every one is drawn
BAND_PLACES = 400
MARGIN = 0.05  # beside the data, by shares of their range


def build(given: ReportInput) -> Sequence[Block] | None:
    """Standardised residuals against angle, speed, order and normal quantiles; None without points."""
    result = given.result
    points = result.points
    if not len(points):
        return None
    styles = style.series_styles([str(name) for name in points["series"].unique()])
    z = points["standardised"].to_numpy(dtype=float)
    largest = int(np.nanargmax(np.abs(z))) if np.isfinite(z).any() else 0
    place = points.iloc[largest]
    line = (
        f" {word_of(result.inputs, place['source'])} {place['row']}" if place["row"] > 0 else ""
    )  # in rows that were streamed it is not known
    worst = f"The largest is {z[largest]:+.2f}, in {place['source']}{line}."
    count = int((np.abs(z) > 2.0).sum())
    beyond = f"{count} of {z.size} {'lies' if count == 1 else 'lie'} beyond ±2 σ."
    pictures = []
    gamma = points["gamma_deg"].to_numpy(dtype=float)
    if np.isfinite(gamma).any():
        pictures.append(
            Picture(
                "residuals-angle",
                "Residuals against the incidence angle",
                f"Residuals from {np.nanmin(gamma):.3g} to {np.nanmax(gamma):.3g} degrees. {beyond}",
                draw_against(result, styles, gamma, ANGLE),
            )
        )
    speed = points["speed_m_s"].to_numpy(dtype=float)
    known = speed[np.isfinite(speed)]
    if known.size and np.ptp(known) > 0.0:
        pictures.append(
            Picture(
                "residuals-speed",
                "Residuals against the incoming speed",
                f"Residuals from {known.min():.3g} to {known.max():.3g} m/s. {beyond}",
                draw_against(result, styles, speed, SPEED),
            )
        )
    if line:
        order = np.arange(1.0, z.size + 1.0)
        pictures.append(
            Picture(
                "residuals-order",
                "Residuals in the order of the rows",
                f"Standardised residuals row by row. {worst}",
                draw_against(result, styles, order, "row (number, in order)"),
            )
        )
    pictures.append(
        Picture(
            "residuals-quantiles",
            "Residuals against normal quantiles",
            f"Ordered residuals against the normal law. {beyond}",
            draw_quantiles(result, styles),
        )
    )
    stick, slide = (regime_name(result, regime) for regime in REGIMES)
    caption = (
        f"{stand_in_words(result)}Standardised residuals at the optimum: each over its own standard "
        "deviation, which where the noise comes from the misfit does not rest on the row itself. Open: "
        f"{stick}; filled: {slide}; ringed: outlier. Dashed: ±2 σ. Grey: where 95 % of each ordered residual "
        f"lies, one by one, if the noise is normal. {beyond} {worst}"
    )
    if result.is_sampled:
        caption = f"{caption} Of {amount_words(result)}."
    elif (left := int((~drawn_rows(z)).sum())) > 0:
        caption += f" {left:,} of {z.size:,} points within ±{BEYOND:g} σ are left out of the pictures."
    return (Pictures(tuple(pictures), caption),)


def draw_against(result: FitResult, styles: dict[str, SeriesStyle], x: Array, label: str) -> Chart:
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
    z = result.points["standardised"].to_numpy(dtype=float)
    known = x[np.isfinite(x)]
    room = MARGIN * float(np.ptp(known)) or 1.0
    ends = np.array([known.min() - room, known.max() + room])
    level = [Line(ends, np.zeros(2), GREY, 0.7)]
    level += [Line(ends, np.full(2, sigma), GREY, 0.7, RESIDUAL_DASHES) for sigma in (-2.0, 2.0)]
    low, high = residual_limits(z[np.isfinite(x)])
    y = Axis(low, high, "residual (σ)", ticks=SIGMAS if high < FEW_SIGMAS else None)
    marks: list[Mark] = [*level, *_marked(result, styles, x, RESIDUAL_SIZE * look_of(len(x)).size)]
    return one_panel(Axis(float(ends[0]), float(ends[1]), label, whole=label != SPEED), y, marks)


def draw_quantiles(result: FitResult, styles: dict[str, SeriesStyle]) -> Chart:
    """Ordered standardised residuals against the quantiles of the normal law, with 95 % of each order."""
    from scipy.special import ndtri

    z = result.points["standardised"].to_numpy(dtype=float)
    n = z.size
    expected = np.empty(n)
    expected[np.argsort(z, kind="stable")] = ndtri((np.arange(1, n + 1) - 0.375) / (n + 0.25))
    order = np.sort(expected)
    end = max(3.0, 1.1 * float(np.abs(order).max(initial=0.0)))
    ends = np.array([-end, end])
    places = band_places(n)
    marks: list[Mark] = [
        Band(order[places - 1], *quantile_band(n, places), "0.5", 0.2),
        Line(ends, ends, GREY, 0.8),
        *_marked(result, styles, expected, look_of(n).size),
    ]
    x = Axis(-end, end, "normal quantile (σ)", most=7)
    return one_panel(x, Axis(*residual_limits(z), "residual, in order (σ)", most=7), marks)


def band_places(n: int) -> NDArray[np.int64]:
    """Orders, from 1, at which the band of n residuals is drawn: all of few, of many denser in the tails."""
    if n <= BAND_PLACES:
        return np.arange(1, n + 1)
    tail = np.round(np.geomspace(1.0, 0.5 * n, BAND_PLACES // 2)).astype(np.int64)
    return np.unique(np.concatenate((tail, n + 1 - tail)))


def quantile_band(n: int, places: NDArray[np.int64] | None = None) -> tuple[Array, Array]:
    """Where 95 % of order statistics of n normal numbers lie, lowest first: of all, or at some places.

    The i-th of n uniform numbers has the beta law with i and n + 1 - i.
    """
    from scipy.special import betaincinv, ndtri

    i = np.arange(1.0, n + 1.0) if places is None else places.astype(float)
    tail = 0.5 * (1.0 - LEVEL)
    low, high = (ndtri(betaincinv(i, n + 1.0 - i, p)) for p in (tail, 1.0 - tail))
    return np.asarray(low), np.asarray(high)


def drawn_rows(z: Array) -> NDArray[np.bool_]:
    """Which of many residuals, (n,), are drawn: evenly some of those near zero, and all that lie far out."""
    step = -(-z.size // MOST_DRAWN)
    return np.asarray((np.arange(z.size) % step == 0) | ~(np.abs(z) <= BEYOND))


def _marked(result: FitResult, styles: dict[str, SeriesStyle], x: Array, size: float) -> list[Points]:
    """Residuals of each series over finite x: open where they stick, ringed where they lie out."""
    rows = result.points
    z, lies_out = rows["standardised"].to_numpy(dtype=float), is_outlier(result, rows)
    sticking = sticks(rows) & rows["gamma_deg"].notna().to_numpy()
    drawn = (drawn_rows(z) | lies_out) & np.isfinite(x)
    found = []
    for name, own in styles.items():
        at = (rows["series"] == name).to_numpy() & drawn
        for chosen, fill in ((at & sticking, "#fff"), (at & ~sticking, own.colour)):
            if chosen.any():
                found.append(Points(x[chosen], z[chosen], own.marker, size, fill, own.colour))
    at = lies_out & np.isfinite(x)
    if at.any():
        found.append(Points(x[at], z[at], "o", 8.5, "none", "#000", 0.9, is_clipped=False))
    return found


SECTION = ReportSection("residuals", "Residuals", build)
