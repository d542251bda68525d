"""What to believe where covariance, profile and exact intervals disagree."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

FACTOR = 1.25  # between widths, from which on two methods disagree
SHARE = 0.25  # of the exact width, by which an end may be off
_PLATEAU = 3.0  # times the profile's width, beyond which an exact interval holds more than a tail
_FEW = 30.0  # degrees of freedom of the noise under which points are few
_METHODS = ("covariance", "profile")


def disagreements(table: pd.DataFrame) -> tuple[str, ...]:
    """Sentences on intervals that differ from the exact ones, which to believe, and why.

    Parameters
    ----------
    table : DataFrame
        What `ifrfit.inference.diagnostics.interval_comparison.intervals` returned.

    Returns
    -------
    tuple of str
        One sentence a quantity and at most; none where all agree, or without exact intervals. Widths
        disagree beyond a factor of 1.25 (`FACTOR`), ends where one is off by more than a quarter (`SHARE`)
        of the width of the exact interval.
    """
    said = []
    for name, row in table.to_dict("index").items():
        exact = float(row["exact_low"]), float(row["exact_high"])
        if not exact[1] > exact[0]:
            continue
        differing = {}
        for method in _METHODS:
            interval = float(row[f"{method}_low"]), float(row[f"{method}_high"])
            how = _difference(interval, exact)
            if how:
                differing[method] = f"the {method} interval {_text(interval)} {how}"
        if differing:
            said.append(
                f"{name}: {' and '.join(differing.values())}; believe the exact one, {_text(exact)}: "
                f"{_why(row, differing)}."
            )
    return tuple(said)


def _difference(interval: tuple[float, float], exact: tuple[float, float]) -> str:
    """How an interval differs from the exact one, or nothing."""
    width, right = interval[1] - interval[0], exact[1] - exact[0]
    if math.isinf(width):
        return "is open"
    if width > FACTOR * right:
        return f"is {width / right:.2g} times as wide as the exact one"
    if width * FACTOR < right:
        return f"has {100.0 * width / right:.0f} % of the width of the exact one"
    off = max(abs(a - b) for a, b in zip(interval, exact, strict=True)) / right
    if off > SHARE:
        return f"has an end off by {100.0 * off:.0f} % of the width"
    return ""


def _why(row: Mapping[Hashable, Any], differing: Mapping[str, str]) -> str:
    """What the other methods do not know."""
    low, high = float(row["covariance_low"]), float(row["covariance_high"])
    reasons = []
    if row["shape"] == "flat" or math.isinf(high - low):
        return "the data alone leave it open, so its ends come from the domain and the prior"
    if row["shape"] == "multimodal":
        reasons.append("several optima describe the data, and it weighs them")
    bounds = [
        b for b, out in ((row["lower"], low < row["lower"]), (row["upper"], high > row["upper"])) if out
    ]
    near = row["profile_low"] <= row["lower"] or row["profile_high"] >= row["upper"]
    if "covariance" in differing and bounds:
        reasons.append(f"the covariance goes on beyond the bound {bounds[0]:g}")
    elif near and row["shape"] == "one_sided":
        reasons.append("the data do not tell it from the bound of its domain")
    exact, profiled = row["exact_high"] - row["exact_low"], row["profile_high"] - row["profile_low"]
    if exact > _PLATEAU * profiled and not reasons:
        return "far from its least the misfit rises no further, and the width of the prior counts there"
    if float(row["noise_dof"]) < _FEW:
        reasons.append(f"the noise rests on few points ({float(row['noise_dof']):.0f} degrees of freedom)")
    if not reasons:
        reasons.append("the misfit is no parabola: it bends where impacts begin to slide")
    return ", and ".join(reasons)


def _text(interval: tuple[float, float]) -> str:
    """An interval to as many digits as its width gives sense to."""
    width = interval[1] - interval[0]
    digits = max(0, 2 - math.floor(math.log10(width))) if 0.0 < width < math.inf else 3
    return f"[{interval[0]:.{digits}f}, {interval[1]:.{digits}f}]"
