"""Which impacts stick and which slide, and at what angle: in words, and shaded in figures."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ifrfit.data.common_errors import loadings_of
from ifrfit.inference.model.entry_names import name_in
from ifrfit.inference.model.rows import OBLIQUE
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import CommonErrorSummary, Estimate
from ifrfit.physics import CLOSURES, OBSERVABLES, transition_angles, transition_tau
from ifrfit.report.modes import at_shown_mode, modes_of
from ifrfit.report.sentences import by_series, plus_minus, span_text
from ifrfit.report.style import GREY, STICKING_SHADE, SeriesStyle
from ifrfit.text import joined

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

REGIMES = ("sticking", "sliding")
_MOST_LINES = 8  # series that have one each
# share of the axis that a word takes: across, upright, in the small type of a strip
ACROSS, UPRIGHT, IN_STRIP = 0.17, 0.035, 0.13

# the transitions as (value, low, high) in degrees, ascending; or one word where there is none
Key = tuple[tuple[float, float, float], ...] | str


def regime_name(result: FitResult, regime: str) -> str:
    """What a regime, "sticking" or "sliding", is called under the result's closure."""
    closure = CLOSURES.get(result.closure)
    return regime if closure is None else closure.regimes[REGIMES.index(regime)]


def does(result: FitResult, regime: str, *, one: bool = False) -> str:
    """What impacts of a regime do, in words; what one does."""
    name = regime_name(result, regime)
    if name not in REGIMES:
        return f"in {name}"
    return {"sticking": "stick", "sliding": "slide"}[regime] + ("s" if one else "")


def count_impacts(rows: pd.DataFrame) -> int:
    """Physical impacts among rows: rows that share an impact_id are one, a row without one is its own."""
    named = rows[rows["impact_id"] != ""]
    distinct = len(named[["source", "impact_id"]].drop_duplicates())
    return distinct + len(rows) - len(named)


def has_angle(observable: str) -> bool:
    """Whether the incidence angle enters an observable at all."""
    return observable not in OBSERVABLES or OBSERVABLES[observable].has_angle


def _is_oblique(observable: str) -> bool:
    """Whether an observable knows whether an impact sticks; one that is not known here counts as such."""
    return observable not in OBSERVABLES or OBSERVABLES[observable].kind in OBLIQUE


def _of_observables(rows: pd.DataFrame, has: Callable[[str], bool]) -> pd.Series[bool]:
    """Which rows are of an observable of a kind; each name is asked for once."""
    return rows["observable"].isin([name for name in rows["observable"].unique() if has(str(name))])


def at_true_angles(result: FitResult) -> FitResult:
    """The result with its points at the angles of incidence, and without the common errors, that it found."""
    common = result.noise.common_errors
    if common is not None and common.are_counted and len(result.points):
        return _without_common_errors(result, common)
    offset = result.noise.angle_offset
    if offset is None or offset.value is None:
        return result
    return replace(result, points=result.points.assign(gamma_deg=result.points["gamma_deg"] + offset.value))


def _without_common_errors(result: FitResult, common: CommonErrorSummary) -> FitResult:
    """The points less what fitted errors that they have in common did to values and angles."""
    fitted = np.array(common.fitted)
    value, gamma_deg, _ = loadings_of(result.points, common.numbers)
    by_angle, by_value = gamma_deg @ fitted, value @ fitted
    points = result.points
    moved = {
        "gamma_deg": (points["gamma_deg"] - by_angle).clip(0.0, 90.0),
        "value": points["value"] - by_value,
        "fitted": points["fitted"] - by_value,
    }
    return replace(result, points=points.assign(**moved))


def transitions(result: FitResult, series: str) -> tuple[Estimate, ...]:
    """Transition angles of a series, ascending: none, one or two."""
    entry = result.transitions.get(series)
    if entry is None:
        return ()
    return (entry,) if isinstance(entry, Estimate) else tuple(entry)


def typical_spin(result: FitResult, series: str) -> tuple[float, float]:
    """R omega/u before impact, along x and y, of the median row of a series; none without points."""
    rows = result.points[result.points["series"] == series] if len(result.points) else result.points
    if not len(rows):
        return 0.0, 0.0
    return float(rows["spin_x"].median()), float(rows["spin_y"].median())


def spin_words(result: FitResult, series: str) -> str:
    """At which spin the transition of a series is given: its typical one."""
    if not len(result.points):
        return "at the typical spin"
    parts = [
        f"R omega_{axis}/u = {spin:.3g}"
        for axis, spin in zip("xy", typical_spin(result, series), strict=True)
        if spin
    ]
    return f"at {joined(parts)}" if parts else "without spin"


def transition_is_open(result: FitResult, series: str) -> bool:
    """Whether the data leave open where the transition is, which is not the same as there being none."""
    kappa = by_series(result.derived.get("kappa"))
    own = kappa.get("", kappa.get(series))
    angles = transitions(result, series)
    return any(angle.value is None for angle in angles) or (
        not angles and own is not None and own.value is None
    )


def angled_series(result: FitResult) -> list[str]:
    """Series that hold impacts, in order of appearance."""
    rows = result.points
    if not len(rows):
        return list(result.transitions)
    angled = _of_observables(rows, has_angle)
    return [str(name) for name in rows["series"][angled].unique()]


def regime_counts(result: FitResult, series: str) -> tuple[int, int]:
    """Impacts of a series that stick and that slide, as far as a row measured which they do."""
    rows = result.points
    oblique = _of_observables(rows, _is_oblique)
    rows = rows[(rows["series"] == series) & rows["gamma_deg"].notna() & oblique]
    sticking = rows["sticking"].map(bool).astype(bool)
    return count_impacts(rows[sticking]), count_impacts(rows[~sticking])


def regime_lines(result: FitResult, sign: str = "+-") -> list[str]:
    """One line a series: how many impacts stick and slide, and where the transition is.

    Of many series that have one transition, one line.
    """
    names = angled_series(result)
    # those of a sample are no counts of the data
    counted = len(result.points) and not result.is_sampled
    counts = {name: regime_counts(result, name) for name in names} if counted else {}
    words = {name: transition_words(result, name, counts.get(name), sign) for name in names}
    if len(counts) > _MOST_LINES and len(set(words.values())) == 1:
        stick, slide = (sum(each[regime] for each in counts.values()) for regime in (0, 1))
        return [f"all {len(names)} series: {_counted(result, stick, slide)}{words[names[0]]}"]
    lines = [(_counted(result, *counts[name]) if counts else "") + words[name] for name in names]
    return [f"{name}: {line}" for name, line in zip(names, lines, strict=True)] if len(names) > 1 else lines


def _counted(result: FitResult, stick: int, slide: int) -> str:
    sticks, slides = does(result, "sticking", one=stick == 1), does(result, "sliding", one=slide == 1)
    return f"{stick} impact{'' if stick == 1 else 's'} {sticks}, {slide} {slides}; "


def transition_words(result: FitResult, series: str, counts: tuple[int, int] | None, sign: str) -> str:
    """Say where the transition is, or why there is none; counts are (sticking, sliding) impacts."""
    angles = transitions(result, series)
    if transition_is_open(result, series):
        limits = [span_text(angle) for angle in angles if angle.value is None]
        return "transition not determined" + (f": {limits[0]} degrees (95 %)" if limits else "")
    if not angles:
        if counts is None:
            return "no transition"
        stick, slide = counts
        if stick and slide:
            return "no transition at its typical spin"
        return f"no transition: all {does(result, 'sliding' if slide else 'sticking')}"
    words = [plus_minus(angle, sign) for angle in angles]
    spin = f" {spin_words(result, series)}" if any(typical_spin(result, series)) else ""
    return f"transition{'s' if len(words) > 1 else ''} at {joined(words)} degrees{spin}"


def regime_key(result: FitResult, series: str) -> Key | None:
    """What is drawn as the regimes of a series: its transitions (value, low, high), or one word.

    A word where there is no transition: "sticking" or "sliding"; None where it is not known. Of several modes
    it is that of the one whose curve is drawn, without an interval, which would be that of all.
    """
    if modes_of(result):
        return _key_of_point(result, series)
    if transition_is_open(result, series):
        return None
    angles = transitions(result, series)
    if angles:
        return tuple(_angle(angle) for angle in angles)
    rows = result.points[(result.points["series"] == series) & result.points["gamma_deg"].notna()]
    sticking = rows["sticking"].map(bool)
    if not sticking.any():
        return "sliding"
    return "sticking" if sticking.all() else None


def _key_of_point(result: FitResult, series: str) -> Key | None:
    """Regimes of the mode whose curve is drawn."""
    closure = CLOSURES.get(result.closure)
    if closure is None:
        return None
    state = at_shown_mode(result).state
    point = dict(zip(state.names, state.point.tolist(), strict=True))
    c = 0.0 if closure.constant is None else point[name_in(point, closure.constant, series)]
    tau = transition_tau(closure, c, point[name_in(point, "kappa", series)], result.inertia_factor)
    spin = typical_spin(result, series)
    angles = transition_angles(tau, *spin)
    if angles:
        return tuple((angle, angle, angle) for angle in angles)
    return "sliding" if tau <= math.hypot(*spin) else "sticking"


def _angle(estimate: Estimate) -> tuple[float, float, float]:
    low, high = (
        end if math.isfinite(end) else default
        for end, default in zip(estimate.interval95, (0.0, 90.0), strict=True)
    )
    return float(estimate.value or 0.0), max(low, 0.0), min(high, 90.0)


def spans(key: Key) -> list[tuple[float, float, str]]:
    """Angle ranges with their regime, ascending: grazing impacts slide, below that regimes take turns."""
    if isinstance(key, str):
        return [(0.0, 90.0, key)]
    edges = [0.0, *(angle[0] for angle in key), 90.0]
    count = len(edges) - 1
    return [
        (edges[i], edges[i + 1], "sliding" if (count - 1 - i) % 2 == 0 else "sticking") for i in range(count)
    ]


@dataclass(frozen=True)
class Mark:
    """A transition between the regimes, with the ends of its 95 % interval where it has one."""

    kind: str
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


def regimes_of(
    result: FitResult, styles: Mapping[str, SeriesStyle], place: Callable[[float], float] = float
) -> tuple[Regimes, ...]:
    """Regimes of each series; one for all where they do not differ.

    Parameters
    ----------
    result : FitResult
    styles : mapping of str to SeriesStyle
        Of the series that are drawn.
    place : callable
        Incidence angle in degrees to the horizontal axis, not beyond its ends.
    """
    keys = {series: regime_key(result, series) for series in styles}
    shared = len(set(keys.values())) == 1
    found = []
    for series, key in list(keys.items())[: 1 if shared else None]:
        ranges = ((place(low), place(high), regime) for low, high, regime in spans(key)) if key else ()
        label = "transition" + ("" if shared else f", {series}")
        marks = () if key is None or isinstance(key, str) else key
        found.append(
            Regimes(
                tuple(span for span in ranges if span[1] > span[0]),
                tuple(Mark("recovered", label, *map(place, mark)) for mark in marks),
                None if shared else styles[series],
            )
        )
    return tuple(found)


def shade(axes: Axes, regimes: Regimes, *, words: bool, name: Callable[[str], str] = str) -> None:
    """Shade sticking, name both regimes if `words`, and draw the transitions with their intervals.

    Parameters
    ----------
    axes : Axes
        With its limits.
    regimes : Regimes
    words : bool
    name : callable
        "sticking" or "sliding" to what it is called.
    """
    to_axes = axes.transData + axes.transAxes.inverted()
    for low, high, regime in regimes.spans:
        if regime == "sticking":
            axes.axvspan(low, high, color=STICKING_SHADE, lw=0.0, zorder=0)
        left, right = (float(to_axes.transform((x, axes.get_ylim()[0]))[0]) for x in (low, high))
        if words and right - left > UPRIGHT:
            axes.text(
                0.5 * (left + right),
                0.98,
                name(regime),
                transform=axes.transAxes,
                ha="center",
                va="top",
                rotation=0.0 if right - left > ACROSS else 90.0,
                color=GREY,
                style="italic",
                zorder=1,
            )
    for mark in regimes.marks:
        if mark.kind == "printed_constants":
            axes.axvline(mark.x, color="black", lw=0.7, ls=(0, (5, 1.6)), zorder=1.6)
            continue
        if mark.low is not None and mark.high is not None and mark.high > mark.low:
            axes.axvspan(mark.low, mark.high, color="0.5", alpha=0.3, lw=0.0, zorder=1)
        axes.axvline(mark.x, color=GREY, lw=0.9, zorder=1.5)


def draw_strip(axes: Axes, several: Sequence[Regimes], name: Callable[[str], str] = str) -> None:
    """Draw the regimes of several series that differ, one bar a series, above the data.

    Parameters
    ----------
    axes : Axes
        Shares the horizontal axis, with its limits, of the data.
    several : sequence of Regimes
        With the styles of their series.
    name : callable
        As in `shade`.
    """
    axes.set_ylim(len(several), 0)
    left, right = axes.get_xlim()
    for row, regimes in enumerate(several):
        own = regimes.series_style
        assert own is not None
        axes.plot(
            [-0.02],
            [row + 0.5],
            marker=own.marker,
            ms=3.8,
            color=own.colour,
            transform=axes.get_yaxis_transform(),
            clip_on=False,
        )
        if not regimes.spans:
            words = "transition not determined"
            axes.text(0.5 * (left + right), row + 0.5, words, ha="center", va="center", fontsize=6)
        for low, high, regime in regimes.spans:
            shadow = "0.86" if regime == "sticking" else "white"
            axes.barh(row + 0.5, high - low, left=low, height=0.84, color=shadow, ec=own.colour, lw=0.6)
            if high - low > IN_STRIP * (right - left):
                middle, text = (low + high) / 2.0, name(regime)
                axes.text(middle, row + 0.5, text, ha="center", va="center_baseline", fontsize=6)
        for mark in regimes.marks:
            ends = [row + 0.08, row + 0.92]
            if mark.kind == "printed_constants":
                axes.plot([mark.x, mark.x], ends, color="black", lw=0.8, ls=(0, (2, 1)))
                continue
            if mark.low is not None and mark.high is not None:
                wide = mark.high - mark.low
                axes.barh(row + 0.5, wide, left=mark.low, height=0.84, color=own.colour, alpha=0.45, lw=0.0)
            axes.plot([mark.x, mark.x], ends, color=own.colour, lw=1.2)
    axes.set_axis_off()


def note_open_transition(axes: Axes, result: FitResult, series: str) -> None:
    """Say in the picture what is known of a transition that the data do not determine."""
    if not transition_is_open(result, series):
        return
    axes.text(
        0.5,
        0.975,
        transition_words(result, series, None, "±"),
        transform=axes.transAxes,
        ha="center",
        va="top",
        color=GREY,
        style="italic",
        fontsize=6.5,
    )
