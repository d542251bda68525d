"""Columns that were computed from others of the same impacts, held against these."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.double_counting import impact_numbers
from ifrfit.physics.angles import Array, Incidence
from ifrfit.physics.inertia import BODIES
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.physics.rebound import Reading, ratio
from ifrfit.text import joined

if TYPE_CHECKING:
    import pandas as pd

_FEWEST = 5  # impacts
_CLOSES = 0.05  # share of the median size by which readings may miss what others of their impact make
_FAR = 0.1  # share of it, from which a difference that is no scatter is one of definition
_NO_SCATTER = 6.0  # standard errors of its mean
_BETTER = 0.25  # share of the difference that is left by another definition
_MEASURED = ("v_x", "v_y", "v_n", "spin_x_after", "spin_y_after")
_OTHERS: dict[str, Callable[[Array], Array]] = {
    "of the opposite sign": lambda x: -x,
    "its square, a ratio of energies": lambda x: x * x,
    "in percent": lambda x: 100.0 * x,
}
_OTHER_ANGLES: dict[str, Callable[[Array], Array]] = {
    "of the opposite sign": lambda x: -x,
    "measured from the wall": lambda x: 90.0 - x,
    "in radians": np.radians,
}


def contradictions(table: pd.DataFrame, double: NDArray[np.bool_]) -> list[str]:
    """Say which columns that are left out contradict the velocities of the same impacts.

    Parameters
    ----------
    table : DataFrame
    double : (n,) bool array
        Rows that are left out because others hold the same measurement.
    """
    if not double.any():
        return []
    names, impacts = table["observable"].to_numpy(dtype=object), impact_numbers(table)
    said = []
    for name in dict.fromkeys(names[double]):
        rows = np.flatnonzero(double & (names == name) & (impacts >= 0))
        if name in _MEASURED or rows.size < _FEWEST:
            continue
        used = {
            each: _beside(table, impacts, rows, np.flatnonzero(~double & (names == each)))
            for each in (*_MEASURED, "beta_cm", "e_n")
            if each != name
        }
        made = OBSERVABLES[name].value(_reading(table.iloc[rows], used), np.full(rows.size, np.nan))
        given = table["value"].to_numpy(dtype=float)[rows]
        words = _difference(given, np.asarray(made), OBSERVABLES[name].unit == "deg")
        if words:
            by = joined([each for each, value in used.items() if np.isfinite(value).any()])
            said.append(f"{name} contradicts {by} of the same impacts, which are used: {words}. Check both.")
    return said


def _beside(
    table: pd.DataFrame, impacts: NDArray[np.int64], rows: NDArray[np.intp], others: NDArray[np.intp]
) -> Array:
    """Value of other rows that are of the impacts of some rows; nan without one."""
    value = dict(zip(impacts[others].tolist(), table["value"].to_numpy(dtype=float)[others], strict=True))
    return np.array([value.get(one, np.nan) for one in impacts[rows].tolist()])


def _reading(table: pd.DataFrame, used: dict[str, Array]) -> Reading:
    """What velocities and spins of an impact make of it."""
    none = np.full(len(table), np.nan)
    gamma, spin_x, spin_y = (table[c].to_numpy(dtype=float) for c in ("gamma_deg", "spin_x", "spin_y"))
    i = Incidence.of(np.nan_to_num(gamma), spin_x, spin_y, degrees=True)
    v_x, v_y, v_n, after_x, after_y = (used.get(name, none) for name in _MEASURED)
    v_x = np.where(np.isnan(v_x), -used.get("beta_cm", none) * i.sine, v_x)
    v_n = np.where(np.isnan(v_n), used.get("e_n", none) * i.cosine, v_n)
    v_y, after_x = (np.where(np.isnan(x) & (spin_x == 0.0), 0.0, x) for x in (v_y, after_x))
    sticks = np.zeros(len(table), dtype=bool)
    k, e_n = ratio(i.sine - v_x, i.slip_x), ratio(v_n, i.cosine)
    return Reading(v_x, v_y, v_n, after_x, after_y, sticks, k, i, e_n, next(iter(BODIES)))


def _difference(given: Array, made: Array, is_angle: bool) -> str:
    """How readings differ from what was made of others; empty where they do not, or scatter about it."""
    there = np.isfinite(given) & np.isfinite(made)
    if there.sum() < _FEWEST:
        return ""
    given, made = given[there], made[there]
    off = given - made
    typical, size = float(np.median(np.abs(off))), float(np.median(np.abs(made)))
    if typical <= _CLOSES * size:
        return ""
    others = (_OTHER_ANGLES if is_angle else _OTHERS).items()
    left = {words: float(np.median(np.abs(given - other(made)))) for words, other in others}
    best = min(left, key=lambda words: left[words])
    says = f"it differs by {typical:.2g} (median)"
    if left[best] < _BETTER * typical:
        return f"{says}, and looks as if it were {best}"
    error = float(off.std()) / np.sqrt(off.size)
    is_far = typical > _FAR * size and abs(float(off.mean())) > _NO_SCATTER * error
    return f"{says}, and not by scatter" if is_far else ""
