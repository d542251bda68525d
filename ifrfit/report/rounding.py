"""Numbers as people print them: two significant digits of the uncertainty decide how many are shown."""

from __future__ import annotations

import math

from ifrfit.inference.result.types import Estimate, Interval

MOST_PLACES = 10  # beyond this a column of zeros says less than an exponent
FEWEST_PLACES = -5


def decimals(uncertainty: float, digits: int = 2) -> int:
    """Decimal places that show `digits` significant digits of `uncertainty`.

    Parameters
    ----------
    uncertainty : float
        Finite and not 0; the sign does not matter.
    digits : int

    Returns
    -------
    int
        0.0134 gives 3, 0.0996 gives 2 (it rounds to 0.10), 120 gives -1.
    """
    exponent = int(f"{abs(uncertainty):.{digits - 1}e}".partition("e")[2])
    return digits - 1 - exponent


def fixed(value: float, places: int) -> str:
    """`value` rounded to `places` decimals; negative `places` round to tens, hundreds, ...

    Beyond 10 places the rest is dropped, above a million the number is written with an exponent.
    """
    if places < FEWEST_PLACES:
        digits = max(0, places + math.floor(math.log10(abs(value)))) if value else 0
        text = f"{value:.{digits}e}"
    else:
        places = min(places, MOST_PLACES)
        text = f"{round(value, places):.0f}" if places < 0 else f"{value:.{places}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text


def spread(uncertainty: float) -> str:
    """A standard deviation with two significant digits, with an exponent where it is tiny or huge."""
    if not math.isfinite(uncertainty) or uncertainty == 0.0:
        return "0" if uncertainty == 0.0 else "-"
    places = decimals(uncertainty)
    if not FEWEST_PLACES <= places <= MOST_PLACES:
        return f"{uncertainty:.1e}"
    return fixed(uncertainty, places)


def alone(value: float) -> str:
    """A number that has no uncertainty, as the user gave it."""
    return f"{value:.10g}"


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
    return alone(estimate.value) if places is None else fixed(estimate.value, places)


def ends_text(interval: Interval, places: int | None) -> tuple[str, str]:
    """Both ends of an interval as text, an infinite one as the empty string."""
    low, high = (
        "" if not math.isfinite(end) else alone(end) if places is None else fixed(end, places)
        for end in interval
    )
    return low, high


def interval_text(interval: Interval, places: int | None, width: int = 0) -> str:
    """An interval in words: "[0.113, 0.129]", "> 0.21", "< 0.3" or "any value".

    Parameters
    ----------
    interval : tuple of float
    places : int or None
        Decimal places.
    width : int
        Both ends are padded to this many characters, so that columns line up.
    """
    low, high = ends_text(interval, places)
    if low and high:
        return f"[{low:>{width}}, {high:>{width}}]"
    if low:
        return f"> {low}"
    return f"< {high}" if high else "any value"
