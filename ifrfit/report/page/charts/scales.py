"""Scales of axes, and ticks on them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEPS = (1.0, 2.0, 2.5, 5.0)  # times a power of ten
LONGEST = 7  # characters of a tick's label, its sign not counted; more make an offset
SMALL, LARGE = 1e-4, 1e5  # beyond these numbers a power of ten is taken out of the labels
PLAIN_DECADES = (-3, 4)  # powers of ten written out
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Ticks:
    """Places of ticks with their labels, and a note to be read with all of them.

    Attributes
    ----------
    places : tuple of float
    labels : tuple of str
    note : str
        A factor or an offset that the labels lack, such as "×10⁻⁶" or "+0.94"; mostly empty.
    """

    places: tuple[float, ...]
    labels: tuple[str, ...]
    note: str = ""


class Scale(Protocol):
    """How values lie along an axis."""

    def position(self, values: Array) -> Array:
        """Monotonic in the values; an axis is linear in it."""

    def ticks(self, low: float, high: float, most: int, *, whole: bool = False) -> Ticks:
        """At most so many ticks between two values, low < high; integers alone if `whole`."""


@dataclass(frozen=True)
class Linear:
    """Positions are the values."""

    def position(self, values: Array) -> Array:
        """The values."""
        return values

    def ticks(self, low: float, high: float, most: int, *, whole: bool = False) -> Ticks:
        """Multiples of the least step of `STEPS` times a power of ten that makes at most `most` ticks."""
        step = _step(low, high, most, whole)
        return _labelled([i * step for i in _multiples(low, high, step)], step)


@dataclass(frozen=True)
class Logarithmic:
    """Positions are decimal logarithms; values are positive."""

    def position(self, values: Array) -> Array:
        """log10, of zero and less far below everything."""
        return np.asarray(np.log10(np.maximum(values, 1e-300)))

    def ticks(self, low: float, high: float, most: int, *, whole: bool = False) -> Ticks:
        """Powers of ten, every second or third where they would be more than `most`."""
        first, last = math.ceil(math.log10(low) - 1e-9), math.floor(math.log10(high) + 1e-9)
        every = max(1, math.ceil((last - first + 1) / most))
        powers = range(last, first - 1, -every)[::-1]
        return Ticks(tuple(10.0**power for power in powers), tuple(map(power_of_ten, powers)))


@dataclass(frozen=True)
class SymmetricLogarithmic:
    """Linear from -threshold to threshold, logarithmic beyond, of the same slope in decades on either side.

    Attributes
    ----------
    threshold : float
    """

    threshold: float

    def position(self, values: Array) -> Array:
        """x/t within the threshold t, else sign(x) (1 + log10(|x|/t))."""
        share = np.abs(values) / self.threshold
        return np.asarray(
            np.where(share <= 1.0, share, 1.0 + np.log10(np.maximum(share, 1.0))) * np.sign(values)
        )

    def ticks(self, low: float, high: float, most: int, *, whole: bool = False) -> Ticks:
        """Up to twice the threshold those of a linear axis; beyond, 0 and powers of ten.

        The threshold itself, too, where there is only one power of ten.
        """
        if max(-low, high) <= 2.0 * self.threshold:
            return Linear().ticks(low, high, most, whole=whole)
        last = math.floor(math.log10(max(-low, high)) + 1e-9)
        first = math.floor(math.log10(self.threshold)) + 1
        every = max(1, math.ceil((last - first + 1) / max(1, most - 1)))
        found = [10.0**power for power in range(last, first - 1, -every)[::-1]]
        if len(found) == 1:
            found = [self.threshold, *found]
        places = [-x for x in reversed(found) if -x >= low] + [0.0] + [x for x in found if x <= high]
        return Ticks(tuple(places), tuple(number_text(x, 0) for x in places))

    def value(self, position: float) -> float:
        """What lies at a position."""
        size = abs(position)
        value = size if size <= 1.0 else 10.0 ** (size - 1.0)
        return math.copysign(self.threshold * value, position)

    def widened(self, low: float, high: float, share: float) -> float:
        """A lower end that leaves a share of the axis, 0 to 1, below `low`."""
        start, end = self.position(np.array([low, high])).tolist()
        return self.value(end - (end - start) / (1.0 - share))

    def shifted(self, x: float, share: float, low: float, high: float) -> float:
        """The value that lies a share of an axis, from `low` to `high`, above another one."""
        at, start, end = self.position(np.array([x, low, high])).tolist()
        return self.value(at + share * (end - start))


def _step(low: float, high: float, most: int, whole: bool) -> float:
    """The least nice step that makes at most `most` ticks."""
    power = math.floor(math.log10((high - low) / max(most, 1))) - 1
    steps = (step * 10.0**exponent for exponent in range(power, power + 4) for step in STEPS)
    for step in steps:
        if whole and step != round(step):
            continue
        if len(_multiples(low, high, step)) <= max(most, 1):
            return step
    return 1.0 if whole else high - low


def _multiples(low: float, high: float, step: float) -> range:
    """Which multiples of a step lie between two values, with those that rounding takes out."""
    rounding = 1e-9 + 1e-15 * max(abs(low), abs(high)) / step
    return range(math.ceil(low / step - rounding), math.floor(high / step + rounding) + 1)


def _labelled(places: Sequence[float], step: float) -> Ticks:
    """Labels with as many decimals as the step has; what is common to long ones goes into the note."""
    if not places:
        return Ticks((), ())
    largest = max(abs(places[0]), abs(places[-1]))
    shown, note = [float(place) for place in places], ""
    if len(number_text(largest, _decimals(step))) > LONGEST and largest > 100.0 * step and largest < LARGE:
        # as many digits of the middle as all labels share
        unit = 10.0 ** math.ceil(math.log10(places[-1] - places[0] or step))
        offset = round(places[len(places) // 2] / unit) * unit
        shown = [place - offset for place in shown]
        note = ("+" if offset > 0 else "") + number_text(offset, _decimals(unit))
    largest = max(abs(shown[0]), abs(shown[-1]))
    if largest and not SMALL <= largest < LARGE:
        power = math.floor(math.log10(largest) + 1e-9)
        shown, step = [x * 10.0**-power for x in shown], step * 10.0**-power
        note = f"×{power_of_ten(power, plain=False)} {note}".strip()
    return Ticks(tuple(places), tuple(number_text(x, _decimals(step)) for x in shown), note)


def _decimals(step: float) -> int:
    """Decimals that multiples of a step need."""
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    return decimals if math.isclose(round(step * 10.0**decimals), step * 10.0**decimals) else decimals + 1


def number_text(x: float, decimals: int) -> str:
    """A number with a true minus, and no sign before zero; thousands set off from five digits on."""
    text = f"{x:.{decimals}f}"
    text = text.removeprefix("-") if not text.strip("-0.") else text
    if abs(x) >= 1e4 and decimals == 0:
        text = f"{round(x):,}".replace(",", "\u2009")
    return text.replace("-", "−")


def power_of_ten(power: int, *, plain: bool = True) -> str:
    """10 to a power: written out where it is near 1 and `plain`, else with a raised exponent."""
    if plain and PLAIN_DECADES[0] <= power <= PLAIN_DECADES[1]:
        return number_text(10.0**power, max(0, -power))
    return f"10{str(power).translate(_RAISED)}"
