"""Refuse what cannot be: every message names the file, the line, the column and what to do."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.cell_table import show
from ifrfit.data.column_layout import Layout
from ifrfit.data.common_errors import LARGEST_ANGLE, common_columns_in
from ifrfit.data.readings_below_zero import (
    has_sign,
    made_by_noise,
    no_noise,
    series_of,
    within_errors,
)
from ifrfit.data.schema import BY_NOISE, SIGMA_RANGE, SPEED_RANGE, TINY
from ifrfit.data.table_forms import Piece
from ifrfit.errors import DataError
from ifrfit.physics.angles import Array, sincos
from ifrfit.physics.observable import Observable
from ifrfit.physics.observables import FREE, OBSERVABLES

Mask = NDArray[np.bool_]

# Below this a velocity per incoming speed is rounding, not motion.
NO_MOTION = 1e-12

# A sigma so far below the median of its observable is a slip: its row would outweigh 1e8 others.
TINY_SHARE = 1e-4
_FEWEST_SIGMAS = 6  # below, a median says little

_UNDEFINED = {
    "contact": "the contact point does not move before the impact (U_t = 0), so beta = -V_t/U_t has no value",
    "normal": "at gamma = 0 there is no tangential velocity before, so it has no value",
    "rest": "at gamma = 0 without spin nothing moves along the wall, so it has no value",
    "grazing": "at gamma = 90 degrees there is no normal velocity before, so it has no value",
}


def drop_missing(piece: Piece) -> tuple[Piece, dict[str, int]]:
    """Leave out rows whose value, angle or spin was not measured.

    Returns
    -------
    piece : Piece
    skipped : dict of str to int
        Count by reason.
    """
    columns = piece.columns
    without_angle = np.isin(columns["observable"], [o.name for o in OBSERVABLES.values() if not o.has_angle])
    missing = np.zeros(len(piece.rows), dtype=bool)
    skipped: dict[str, int] = {}
    for reason, here in (
        ("not measured", np.isnan(columns["value"])),
        ("angle not measured", np.isnan(columns["gamma_deg"]) & ~without_angle),
        ("spin not measured", np.isnan(columns["spin_x"] + columns["spin_y"]) & ~without_angle),
    ):
        count = int(np.count_nonzero(here & ~missing))
        if count:
            skipped[reason] = count
        missing |= here
    kept = piece.take(~missing)
    for name in ("spin_x", "spin_y"):
        if np.isnan(kept.columns[name]).any():
            kept.columns[name] = np.nan_to_num(kept.columns[name], nan=0.0)
    return kept, skipped


def validate(piece: Piece, layout: Layout) -> None:
    """Check ranges and where observables are undefined.

    Parameters
    ----------
    piece : Piece
    layout : Layout
        Of the table that it is from.

    Raises
    ------
    DataError
        Names the first offending row.
    """
    cells = layout.cells
    for name, bad, text in _broken_rules(piece, layout):
        for place in np.flatnonzero(bad)[:1].tolist():
            said = text.format(f"{piece.columns[name][place]:.6g}")
            raise DataError(f"{cells.at(piece.rows[place], piece.header(name))}: {said}")


def _broken_rules(piece: Piece, layout: Layout) -> Iterator[tuple[str, Mask, str]]:
    """Rules one after the other: the column, which rows break it, and what to say of the value."""
    columns = piece.columns
    yield from _ranges(columns)
    undefined = without_value(columns["gamma_deg"], columns["spin_x"], columns["spin_y"])
    for name in dict.fromkeys(columns["observable"]):
        observable, here = OBSERVABLES[name], columns["observable"] == name
        value = columns["value"]
        outside = (value < observable.low) | (value > observable.high)
        if (here & (value < 0.0)).any():
            outside &= ~_by_noise(observable, here, piece, layout)
        tiny = (np.abs(value) < TINY) & (value != 0)
        unit = " degrees" if observable.unit == "deg" else ""
        if has_sign(observable):
            yield (
                "value",
                here & outside & (value < 0.0) & (value > -BY_NOISE),
                no_noise(observable),
            )
        yield (
            "value",
            here & outside,
            f"{{}}{unit} is impossible for {name} ({observable.low:g} to {observable.high:g}{unit}). "
            "Correct it.",
        )
        yield (
            "value",
            here & tiny,
            f"{{}}{unit} is impossible for {name} (0, or {TINY:g} and more in size). Write 0 or correct it.",
        )
        named = "" if piece.header("value") == name else f"{name}: "
        for kind in observable.undefined:
            said = f"{named}{_UNDEFINED[kind]}. Empty the cell or remove the row."
            yield "value", here & undefined[kind], said
        yield from _tiny_sigmas(columns["sigma"], name, here)


def _by_noise(observable: Observable, here: Mask, piece: Piece, layout: Layout) -> Mask:
    """Rows of an observable that noise explains below zero."""
    at = np.flatnonzero(here)
    columns = {name: piece.columns[name][at] for name in ("value", "gamma_deg", "sigma")}
    series = series_of(layout)
    found = np.zeros(here.shape, dtype=bool)
    found[at] = made_by_noise(
        observable, **columns, series=None if series is None else series[piece.rows[at]]
    )
    return found


def _ranges(columns: Mapping[str, Any]) -> Iterator[tuple[str, Mask, str]]:
    gamma = columns["gamma_deg"]
    yield (
        "gamma_deg",
        (gamma < 0) | (gamma > 90),
        "the incidence angle comes to {} degrees from the normal, outside 0 to 90. Correct it.",
    )
    for name in ("spin_x", "spin_y"):
        spin = np.abs(columns[name])
        yield (
            name,
            (spin > FREE) | ((spin < TINY) & (spin > 0)),
            f"{{}} is impossible for a spin R omega/u (0, or {TINY:g} to {FREE:g}). Correct it.",
        )
    speed = columns["speed_m_s"]
    low, high = SPEED_RANGE
    yield (
        "speed_m_s",
        (speed < low) | (speed > high),
        f"{{}} m/s is impossible for an incoming speed ({low:g} to {high:g}). Correct it.",
    )
    sigma = columns["sigma"]
    yield (
        "sigma",
        sigma <= 0,
        "{} cannot be a standard uncertainty. Give a positive one, or leave the cell empty if it is not "
        "known.",
    )
    low, high = SIGMA_RANGE
    yield (
        "sigma",
        (sigma < low) | (sigma > high),
        f"{{}} is impossible for a standard uncertainty ({low:g} to {high:g}). Correct it.",
    )
    # 0 is allowed here: it says that the angle or the spin is exact.
    for name, most in (("sigma_gamma_deg", 90.0), ("sigma_spin_x", FREE), ("sigma_spin_y", FREE)):
        spread = columns[name]
        yield (
            name,
            (spread < 0) | ((spread > 0) & (spread < low)) | (spread > most),
            f"{{}} cannot be a standard uncertainty (0, or {low:g} to {most:g}). Correct it.",
        )
    for name in common_columns_in(columns):
        most = LARGEST_ANGLE if name.endswith("_deg") else high
        yield (
            name,
            np.abs(columns[name]) > most,
            f"{{}} is more than one standard error can do here ({-most:g} to {most:g}). Correct it, or leave "
            "the cell empty for a row that has no part in this error.",
        )


def _tiny_sigmas(sigma: Array, observable: str, here: Mask) -> Iterator[tuple[str, Mask, str]]:
    """A sigma that one row can have by a slip only: the fit would pass through its value."""
    found = lone_sigmas(sigma[here])
    if found is not None:
        yield "sigma", here & (sigma <= found[0]), tiny_sigma(observable, found[1])


def impossible(observable: Observable, value: Array, sigma: Array | None = None) -> Mask:
    """Values that an observable cannot have: beyond its ends, or tiny as by a slipped exponent.

    Those that noise of a stated uncertainty carries below zero are none of them.
    """
    beyond = (value < observable.low) | (value > observable.high)
    if sigma is not None:
        beyond &= ~within_errors(observable, value, sigma)
    return np.asarray(beyond | ((np.abs(value) < TINY) & (value != 0.0)))


def lone_sigmas(sigma: Array) -> tuple[float, float] | None:
    """The largest of the uncertainties that stand alone far below the others, and the median; or None."""
    ordered = np.sort(sigma[sigma > 0.0])
    if ordered.size < _FEWEST_SIGMAS:
        return None
    median = float(np.median(ordered))
    # sigmas that spread over many decades have none that stands alone
    below = ordered[ordered < TINY_SHARE * median]
    if not below.size or ordered[below.size] * TINY_SHARE <= below[-1]:
        return None
    return float(below[-1]), median


def tiny_sigma(observable: str, median: float) -> str:
    """What is said of such an uncertainty, which is to be put in."""
    return (
        f"{{}} is more than {1.0 / TINY_SHARE:,.0f} times smaller than the median sigma of {observable}, "
        f"{median:.3g}: the fit would pass through this value whatever the others say. Correct it."
    )


def without_value(gamma_deg: Array, s_x: Array, s_y: Array) -> dict[str, Mask]:
    """Return which impacts leave observables without a value, by the reasons of `Observable.undefined`."""
    return undefined_at(*sincos(gamma_deg, degrees=True), s_x, s_y)


def undefined_at(sine: Array, cosine: Array, s_x: Array, s_y: Array) -> dict[str, Mask]:
    """The same as `without_value`, from sine and cosine of the angle."""
    spin = np.hypot(s_x, s_y)
    return {
        "contact": np.hypot(sine + s_y, s_x) <= NO_MOTION * (1.0 + spin),
        "normal": sine <= NO_MOTION,
        "rest": (sine <= NO_MOTION) & (spin <= NO_MOTION),
        "grazing": cosine <= NO_MOTION,
    }


SUMMARIES = ("mean", "average", "std", "sd", "total")


def refuse_summary_rows(layout: Layout) -> None:
    """Refuse the first row whose impact or series is called a mean, a standard deviation or a total.

    A series of that name that every row belongs to is a label like any other: a table of means.

    Parameters
    ----------
    layout : Layout

    Raises
    ------
    DataError
        With file, line, column and remedy.
    """
    for key in ("impact_id", "series"):
        if not layout.has(key):
            continue
        texts = layout.texts(key)
        found = [row for row, text in enumerate(texts) if text.lower() in SUMMARIES]
        if 0 < len(found) < len(texts):
            raise DataError(
                f"{layout.cells.at(found[0], layout.header(key))}: {show(texts[found[0]])} names a summary "
                "of other rows, not an impact. Remove the row."
            )


SAME_ANGLE = 0.5  # degrees that readings of one impact may differ by
# by how much they may, and what to call them; of a speed relative to itself
_SETTINGS = {
    "gamma_deg": (SAME_ANGLE, "angle", " degrees"),
    "spin_x": (0.05, "spin", ""),
    "spin_y": (0.05, "spin", ""),
    "speed_m_s": (0.1, "speed", " m/s"),
}


def refuse_restarted_impacts(layout: Layout, columns: Mapping[str, Any], rows: NDArray[np.int64]) -> None:
    """Refuse an impact_id that stands at two angles, spins or speeds of one table.

    Parameters
    ----------
    layout : Layout
    columns : mapping of str to array_like
        Rows of the common schema.
    rows : ndarray of int
        In which row of the table each of them stands.

    Raises
    ------
    DataError
        Names both lines and the remedy.
    """
    if not layout.has("impact_id"):
        return
    ids = np.asarray(columns["impact_id"], dtype=object)
    given = np.flatnonzero(ids != "")
    _, first, impact = np.unique(ids[given].astype(str), return_index=True, return_inverse=True)
    start = given[first[impact]]
    cells = layout.cells
    free = " or remove the column" if not layout.has("observable") else ""
    for name, (tolerance, noun, unit) in _SETTINGS.items():
        value = np.asarray(columns[name], dtype=float)
        most = tolerance * (np.abs(value[start]) if name == "speed_m_s" else 1.0)
        differs = np.abs(value[given] - value[start]) > most  # what is not given differs from nothing
        for place, other in zip(given[differs], start[differs], strict=True):
            raise DataError(
                f"{cells.at(rows[place], layout.header('impact_id'))}: "
                f"impact {show(str(ids[place]))} has the {noun} {value[place]:g}{unit} here and "
                f"{value[other]:g}{unit} in {cells.word} {cells.lines[rows[other]]}. "
                f"Number the impacts through the whole table{free}.",
            )
