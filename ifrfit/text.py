"""Numbers and lists as people write them."""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from numbers import Real

MOST_PLACES = 10  # beyond this a column of zeros says less than an exponent
FEWEST_PLACES = -5
_LONG = 120.0  # seconds from which on minutes are said
_UNITS_OF_TIME = ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"), (1e-9, "ns"))


def joined(words: Sequence[str], last: str = "and") -> str:
    """Words with commas and a last "and": "a, b and c"."""
    return ", ".join(words[:-1]) + f" {last} {words[-1]}" if len(words) > 1 else "".join(words)


def meant(name: object, candidates: Sequence[str]) -> str:
    """Sentence that offers the candidates close to a name; empty if there are none."""
    close = difflib.get_close_matches(str(name), candidates, n=3, cutoff=0.6)
    return f" Did you mean {' or '.join(close)}?" if close else ""


def number_of(value: object) -> float | None:
    """A number, also where a text says it as the quotient of two; None for what is none."""
    if isinstance(value, bool) or not isinstance(value, Real | str):
        return None
    if isinstance(value, Real):
        return float(value)
    above, slash, below = value.partition("/")
    try:
        return float(above) / float(below) if slash else float(above)
    except (ValueError, ZeroDivisionError):
        return None


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


def as_given(value: float) -> str:
    """A number that has no uncertainty, as the user gave it."""
    return f"{value:.10g}"


def sd_text(sd: float) -> str:
    """A standard deviation with two significant digits, with an exponent where it is tiny or huge."""
    if not math.isfinite(sd) or sd == 0.0:
        return "0" if sd == 0.0 else "-"
    places = decimals(sd)
    if not FEWEST_PLACES <= places <= MOST_PLACES:
        return f"{sd:.1e}"
    return fixed(sd, places)


def plus_minus(value: float, sd: float) -> str:
    """A value with its standard uncertainty, both to two digits of that: "0.904 +- 0.012"."""
    if not (math.isfinite(sd) and sd > 0.0):
        return as_given(value)
    return f"{fixed(value, decimals(sd))} +- {sd_text(sd)}"


def p_text(p: float) -> str:
    """A p value or probability: two digits, one digit and an exponent below 1e-3."""
    if p < 1e-300:
        return "0, below 1e-300"
    return f"{p:.2g}" if p >= 1e-3 else f"{p:.0e}"


def times_text(factor: float) -> str:
    """How many times more, of a factor above one: two digits of it, or of what it is beyond one."""
    beyond = factor - 1.0
    if not 0.0 < beyond < 0.095:
        return f"{factor:.2g}" if factor < 99.5 else f"{factor:.3g}"
    return f"{factor:.{1 - math.floor(math.log10(beyond))}f}"


def power_of_ten(number: float) -> str:
    """A number with one digit and its power of ten, as 1e-3; 0 as it is."""
    if number == 0.0:
        return "0"
    digit, _, exponent = f"{number:.0e}".partition("e")
    return f"{digit}e{int(exponent)}"


def duration(seconds: float) -> str:
    """A time with two digits and the unit that people would use; "-" where it is not known."""
    if not math.isfinite(seconds):
        return "-"
    if seconds == 0.0:
        return "0 s"
    if seconds >= _LONG:
        return f"{seconds / 60.0:.2g} min" if seconds < 6000.0 else f"{seconds / 60.0:,.0f} min"
    size, unit = next(
        ((size, unit) for size, unit in _UNITS_OF_TIME if seconds >= 0.9995 * size), _UNITS_OF_TIME[-1]
    )
    amount = seconds / size
    text = f"{amount:.0f}" if amount >= 9.95 else f"{amount:.1f}" if amount >= 0.95 else f"{amount:.2g}"
    return f"{text} {unit}"


def interval_ends(interval: tuple[float, float], places: int | None) -> tuple[str, str]:
    """Both ends of an interval as text, an infinite one as the empty string."""
    low, high = (
        "" if not math.isfinite(end) else as_given(end) if places is None else fixed(end, places)
        for end in interval
    )
    return low, high


def interval_text(interval: tuple[float, float], places: int | None, width: int = 0) -> str:
    """An interval in words: "[0.113, 0.129]", "> 0.21", "< 0.3" or "any value".

    Parameters
    ----------
    interval : tuple of float
    places : int or None
        Decimal places.
    width : int
        Both ends are padded to this many characters, so that columns line up.
    """
    low, high = interval_ends(interval, places)
    if low and high:
        return f"[{low:>{width}}, {high:>{width}}]"
    if low:
        return f"> {low}"
    return f"< {high}" if high else "any value"


def progress_words(done: int, most: int, of: str, lately: int, seconds: float) -> str:
    """How far, how fast, and how long it will take: "200 of 10,000 steps, 40 a second, 4 min left".

    Parameters
    ----------
    done, most : int
    of : str
        What is counted.
    lately : int
        Of those done as many as took `seconds`: what an earlier run kept, and getting ready, is no rate.
    seconds : float
    """
    words = f"{done:,} of {most:,} {of}"
    if lately <= 0 or seconds <= 0.0:
        return words
    rate = lately / seconds
    speed = f"{rate:,.0f} a second" if rate >= 10.0 else f"{rate:.2g} a second"
    left = (most - done) / rate
    remaining = (
        f"{left:.0f} s left"
        if left < 100.0
        else f"{left / 60.0:.0f} min left"
        if left < 6000.0
        else f"{left / 3600.0:.0f} h left"
    )
    return f"{words}, {speed}, {remaining}" if most > done else f"{words}, {speed}"
