"""Estimates as people print them: two significant digits of the uncertainty decide how many are shown."""

from __future__ import annotations

import math
from collections.abc import Mapping

from ifrfit.inference.result.types import Estimate
from ifrfit.text import as_given, decimals, fixed, interval_text, sd_text


def places_of(estimate: Estimate) -> int | None:
    """Decimal places for the value and the interval of an estimate.

    The standard deviation decides; without one the half width of the 95 % interval, or its finite end.
    None where there is nothing to go by: the numbers are shown as they are.
    """
    if estimate.stderr is not None and math.isfinite(estimate.stderr) and estimate.stderr > 0.0:
        return decimals(estimate.stderr)
    low, high = estimate.interval95
    ends = [end for end in (low, high) if math.isfinite(end)]
    width = abs(high - low) / 2.0 if len(ends) == 2 else abs(ends[0]) if ends else 0.0
    return decimals(width) if width > 0.0 and math.isfinite(width) else None


def value_text(estimate: Estimate) -> str:
    """The value, rounded by its uncertainty; "-" where the data do not determine it."""
    if estimate.value is None:
        return "-"
    places = places_of(estimate)
    return as_given(estimate.value) if places is None else fixed(estimate.value, places)


def plus_minus(estimate: Estimate, sign: str = "±") -> str:
    """The value with its standard deviation, where there is one."""
    known = estimate.value is not None and estimate.stderr
    return value_text(estimate) + (f" {sign} {sd_text(known)}" if known else "")


def span_text(estimate: Estimate) -> str:
    """The 95 % interval, with the digits of the value."""
    return interval_text(estimate.interval95, places_of(estimate))


def by_series(entry: object) -> dict[str, Estimate]:
    """An estimate by the series whose it is: "" where all share it, nothing where there is none."""
    each = entry if isinstance(entry, Mapping) else {"": entry}
    return {series: found for series, found in each.items() if isinstance(found, Estimate)}


def labelled(name: str, series: str) -> str:
    """A constant's name, with the series in brackets where separate."""
    return f"{name} [{series}]" if series else name
