"""Error bars that were read off beside their points: ends of bars as standard errors, once it is said of what.

A digitiser keeps the ends of a bar as points of groups beside the first (WebPlotDigitizer), or somebody reads them as
curves of their own, called as the points are with ``upper`` or ``lower`` behind. A file does not say whether a bar is
one standard error, two, or an interval: that is asked for.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ifrfit.data.cell_table import show
from ifrfit.data.figures.calibration import Calibration, FloatArray
from ifrfit.data.figures.digitised_figure import Bar, PointSet
from ifrfit.errors import DataError, UsageError

_ENDS = re.compile(
    r"^(?P<of>.+?)[\s_\-:,(\[]*\b(?P<end>upper|lower|up|down|high|low|plus|minus|left|right|top|bottom)\b[\s)\]]*$",
    re.IGNORECASE,
)
_SHARE = re.compile(r"(?P<percent>\d{1,2}(\.\d+)?)\s*%")
_SIGMAS = re.compile(r"(?P<number>\d+(\.\d+)?)?\s*(sigma|sd|se)?")
_NEAR = 4.0  # standard errors of two clicks, within which the end of a bar stands over its point
_LOPSIDED = 1.5  # of one side to the other: no standard error

KNOWN = "sigma, 2sigma, 95%"


def standard_errors(text: str | float | None) -> float | None:
    """How many standard errors half a bar is: of ``sigma`` 1, of ``2sigma`` 2, of ``95%`` 1.96.

    Raises
    ------
    UsageError
    """
    if text is None:
        return None
    said = str(text).strip().lower()
    share = _SHARE.fullmatch(said)
    number = math.nan
    if share is not None:
        from statistics import NormalDist

        percent = float(share["percent"])
        number = NormalDist().inv_cdf(0.5 + percent / 200.0) if 0.0 < percent < 100.0 else math.nan
    else:
        match = _SIGMAS.fullmatch(said) if said else None
        number = float(match["number"] or 1.0) if match else math.nan
    if not (math.isfinite(number) and number > 0.0):
        raise UsageError(
            f"--bars {text}: say what half a bar is, in standard errors or as an interval: {KNOWN}."
        )
    return number


@dataclass(frozen=True)
class BarErrors:
    """Standard errors of values by their bars.

    Attributes
    ----------
    sizes : (m, 2) float array
        Of x and y; nan where there is no bar.
    notes : tuple of str
    """

    sizes: FloatArray
    notes: tuple[str, ...]


def curves_of_ends(sets: Sequence[PointSet]) -> dict[str, str]:
    """Point sets that are called as another with the end of a bar behind, and that other."""
    names = [each.name for each in sets if each.name]
    matches = {name: _ENDS.match(name) for name in names}
    return {name: match["of"] for name, match in matches.items() if match and match["of"] in names}


def with_curves_of_ends(sets: Sequence[PointSet], pixels: float, file: str) -> list[PointSet]:
    """The point sets, those that are ends of bars of another made a part of it.

    Raises
    ------
    DataError
        An end stands over no point, or two over one.
    """
    ends, found = curves_of_ends(sets), {each.name: each for each in sets}
    for each in sets:
        match = _ENDS.match(each.name)
        if each.name not in ends or match is None:
            continue
        of = found[ends[each.name]]
        bar = Bar(match["end"].lower(), _over_points(each, of, match["end"].lower(), pixels, file))
        found[of.name] = replace(of, bars=(*of.bars, bar))
        del found[each.name]
    return list(found.values())


def _over_points(ends: PointSet, of: PointSet, end: str, pixels: float, file: str) -> FloatArray:
    """The end over each point, nan where there is none: the points are those with the same x, of left and right y."""
    along = 1 if end in ("left", "right") else 0
    placed = np.full(of.points.shape, math.nan)
    for point in ends.points:
        distance = np.abs(of.points[:, along] - point[along])
        near = np.flatnonzero(distance <= _NEAR * math.sqrt(2.0) * pixels)
        if len(near) != 1:
            which = "no point" if not len(near) else f"{len(near)} points"
            raise DataError(
                f"{file}, curve {show(ends.name)}: the end at pixel ({point[0]:.6g}, {point[1]:.6g}) stands over {which} of "
                f"{show(of.name)}. Read each bar where its point is, or leave --bars away."
            )
        if not np.isnan(placed[near[0]]).all():
            raise DataError(
                f"{file}, curve {show(ends.name)}: two ends stand over one point of {show(of.name)}, near pixel "
                f"({point[0]:.6g}, {point[1]:.6g}). Remove one."
            )
        placed[near[0]] = point
    return placed


def bar_errors(sets: Sequence[PointSet], calibration: Calibration, bars: float, name: str) -> BarErrors:
    """Standard errors of all points by their bars.

    A bar is along the coordinate that its ends differ more in, in pixels across the picture; its half length is that
    between two ends, or from the point to the one that was read.

    Raises
    ------
    DataError
        A bar has three ends.
    """
    parts, lopsided = [], 0
    for each in sets:
        sizes = np.full(each.points.shape, math.nan)
        values = calibration.values(each.points)
        for coordinate in (0, 1):
            ends = [
                calibration.values(bar.points)[:, coordinate]
                for bar in each.bars
                if _along(bar, each, calibration) == coordinate
            ]
            if len(ends) > 2:
                raise DataError(
                    f"{name}, dataset {show(each.name)}: {len(ends)} groups of points are ends of the same bars, "
                    f"which have two. Remove those that are none."
                )
            if ends:
                away = np.abs(np.column_stack(ends) - values[:, [coordinate]])
                seen = ~np.isnan(away).all(axis=1)
                sizes[seen, coordinate] = np.nanmean(away[seen], axis=1) / bars
                if len(ends) == 2:
                    low, high = away.min(axis=1), away.max(axis=1)
                    lopsided += int(np.sum(high > _LOPSIDED * low))
        parts.append(sizes)
    notes = []
    if lopsided:
        count = "1 bar is" if lopsided == 1 else f"{lopsided} bars are"
        notes.append(f"{name}: {count} more than {_LOPSIDED:g} times as long on one side; sigma is the mean of both")
    return BarErrors(np.concatenate(parts), tuple(notes))


def _along(bar: Bar, of: PointSet, calibration: Calibration) -> int:
    """0 for bars along x, 1 along y."""
    moved = np.nanmedian(np.abs(bar.points - of.points), axis=0)
    ways = [np.abs(each.theta[:2]) / np.linalg.norm(each.theta[:2]) @ moved for each in (calibration.x, calibration.y)]
    return int(ways[1] >= ways[0])
