"""Which impacts stick and which slide, and at what angle the one turns into the other."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ifrfit.inference.model.rows import OBLIQUE
from ifrfit.inference.result.fit_result import FitResult
from ifrfit.inference.result.types import Estimate
from ifrfit.physics import CLOSURES, OBSERVABLES
from ifrfit.report.rounding import by_series, plus_minus, span_text
from ifrfit.text import joined

if TYPE_CHECKING:
    import pandas as pd


_REGIMES = ("sticking", "sliding")


def regime_name(result: FitResult, regime: str) -> str:
    """What a regime, "sticking" or "sliding", is called under the result's closure."""
    closure = CLOSURES.get(result.closure)
    return regime if closure is None else closure.regimes[_REGIMES.index(regime)]


def does(result: FitResult, regime: str, *, one: bool = False) -> str:
    """What impacts of a regime do, in words; what one does."""
    name = regime_name(result, regime)
    if name not in _REGIMES:
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


def at_true_angles(result: FitResult) -> FitResult:
    """The result with its points at the angles of incidence that it found; the set ones without an offset."""
    offset = result.noise.angle_offset
    if offset is None or offset.value is None:
        return result
    return replace(result, points=result.points.assign(gamma_deg=result.points["gamma_deg"] + offset.value))


def transitions(result: FitResult, series: str) -> tuple[Estimate, ...]:
    """Transition angles of a series, ascending: none, one or two."""
    entry = result.transitions.get(series)
    if entry is None:
        return ()
    return (entry,) if isinstance(entry, Estimate) else tuple(entry)


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
    angled = rows["observable"].map(lambda name: has_angle(str(name))).astype(bool)
    return [str(name) for name in rows["series"][angled].unique()]


def regime_counts(result: FitResult, series: str) -> tuple[int, int]:
    """Impacts of a series that stick and that slide, as far as a row measured which they do."""
    rows = result.points
    oblique = rows["observable"].map(lambda name: _is_oblique(str(name))).astype(bool)
    rows = rows[(rows["series"] == series) & rows["gamma_deg"].notna() & oblique]
    sticking = rows["sticking"].map(bool).astype(bool)
    return count_impacts(rows[sticking]), count_impacts(rows[~sticking])


def regime_lines(result: FitResult, sign: str = "+-") -> list[str]:
    """One line a series: how many impacts stick and slide, and where the transition is."""
    names = angled_series(result)
    lines = []
    for series in names:
        prefix = f"{series}: " if len(names) > 1 else ""
        if not len(result.points):
            lines.append(prefix + transition_words(result, series, None, sign))
            continue
        stick, slide = regime_counts(result, series)
        sticks, slides = does(result, "sticking", one=stick == 1), does(result, "sliding", one=slide == 1)
        counts = f"{stick} impact{'' if stick == 1 else 's'} {sticks}, {slide} {slides}"
        words = transition_words(result, series, (stick, slide), sign)
        lines.append(f"{prefix}{counts}; {words}")
    return lines


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
    return f"transition{'s' if len(words) > 1 else ''} at {joined(words)} degrees"
